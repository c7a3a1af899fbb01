"""FIGAROH (``figaroh`` with ``pin`` on the package index) as its documentation has it: a subclass
for the data, a configuration.

``python figaroh_fit.py CASE ANSWER.json``. Free links, viscous and dry friction, actuator inertia
and offset of every joint; weighted least squares, then the physically consistent fit
(``select_stage: physical_fit``). Its own filter has the common band; its decimation low-passes
torque and regressor alike, as the common measure does. It has no older log as a reference: there
both logs are fitted, and the load is the difference of the last links' masses.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
import pinocchio as pin
from cases import CASES, FITTED, Case, Run, held_out_error, prepare, read, save
from figaroh.backends.pinocchio import PinocchioBackend
from figaroh.data.trajectory import TrajectoryData
from figaroh.identification.base_identification import BaseIdentification
from figaroh.tools.regressor import build_regressor_basic

# >>> what a user writes
CONFIG = """
robot:
  name: {name}
  properties:
    joints: {{active_joints: {joints}}}
    mechanics:
      friction_coefficients: {{viscous: {zeros}, static: {zeros}}}
      actuator_inertias: {zeros}
      joint_offsets: {zeros}
    coupling: {{has_coupled_wrist: false}}
tasks:
  identification:
    enabled: true
    select_stage: physical_fit
    problem:
      use_joint_torques: true
      wls: true
      model_components: {{friction: true, joint_offset: true, actuator_inertia: true}}
    signal_processing: {{sampling_frequency: {rate}, cutoff_frequency: {cut}, filter_order: 4}}
"""


class Identification(BaseIdentification):
    """The fitted part of the runs, one after the other; seams and ends are masked."""

    files: tuple[str, ...]

    def load_trajectory_data(self, data_source: str | None = None) -> TrajectoryData:
        joints, parts, start = self.model.nv, [], 0.0
        for file in self.files:
            log = read(file)
            since = log["time"] - log["time"][0]
            dt = float(np.median(np.diff(since)))
            time = np.arange(0.0, FITTED * since[-1], dt)
            q, tau = (
                np.stack([np.interp(time, since, log[f"{k}{j}"]) for j in range(joints)], 1)
                for k in ("q", "tau")
            )
            parts.append((start + time, q, tau, (time > 0.25) & (time < time[-1] - 0.25)))
            start += time[-1] + dt
        t, q, tau, mask = (np.concatenate(x) for x in zip(*parts, strict=True))
        slides = [
            self.model.joints[j + 1].shortname().startswith("JointModelP") for j in range(joints)
        ]
        kind, unit = zip(
            *[("joint_force", "N") if s else ("joint_torque", "N·m") for s in slides], strict=True
        )
        return TrajectoryData(t, tuple(self.model.names[1:]), q, tau, kind, unit, mask=mask)


def identify(model: Path, case: Case, files: tuple[str, ...], rate: float) -> Identification:
    """Fit the files' first part."""
    robot = pin.RobotWrapper(pin.buildModelFromMJCF(str(model)))
    # its own loader reads URDF only
    robot.backend = PinocchioBackend.from_model(robot.model, robot.data)
    zeros = [0.0] * robot.model.nv
    config = model.with_suffix(".yaml")
    joints = list(robot.model.names[1:])
    config.write_text(
        CONFIG.format(name=case.name, joints=joints, zeros=zeros, rate=rate, cut=case.cut)
    )
    found = Identification(robot, str(config))
    found.files = files
    found.identif_config |= {
        "act_idxq": list(range(robot.model.nq)),
        "act_idxv": list(range(robot.model.nv)),
    }
    found.initialize()
    found.solve(
        decimate=True,
        decimation_factor=max(2, round(rate / (2.5 * case.cut))),
        plotting=False,
        wls=True,
    )
    return found


# <<<


def predict(found: Identification, run: Run) -> np.ndarray:
    """Torque (T, J) of the estimate that FIGAROH selects, on the common motion."""
    regressor = build_regressor_basic(found.robot, run.q, run.qd, run.qdd, found.identif_config)
    return (regressor @ found.selected.values).reshape(run.q.shape[1], -1).T


def main(name: str, answer: str) -> None:
    case = CASES[name]
    rates = [1.0 / float(np.median(np.diff(read(file)["time"]))) for file in case.runs]
    with tempfile.TemporaryDirectory() as folder:
        model = Path(folder) / "model.xml"
        model.write_text(case.xml)
        found = identify(model, case, case.runs, float(np.mean(rates)))
        old = (
            identify(model, case, (case.reference,), float(np.mean(rates)))
            if case.reference
            else None
        )
    if not found.selected.accepted:
        return save(answer, reason=f"its physical fit is rejected: {found.selected.reason}"[:300])
    values, joints = found.selected.parameter_dict(), case.joints
    words = {"viscous": "fv", "dry": "fs", "rotor": "Ia", "offset": "off"}
    estimated: dict[str, object] = {
        kind: [values[f"{key}_{j}"] for j in joints] for kind, key in words.items()
    }
    if old is not None and old.selected.accepted:
        keys = [f"{k}_{joints[-1]}" for k in ("m", "mx", "my", "mz")]
        mass, *moment = (values[k] - old.selected.parameter_dict()[k] for k in keys)
        estimated |= {"payload": mass, "payload_centre": [m / mass for m in moment]}
    runs = [prepare(case, file) for file in case.runs]
    save(
        answer,
        held_out=held_out_error(runs, [predict(found, r) for r in runs]),
        estimated=estimated,
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
