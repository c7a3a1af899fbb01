"""mujoco.sysid (``mujoco[sysid]`` on the package index) as its documentation has it: rollouts of a
model with free parameters.

``python mujoco_sysid.py CASE ANSWER.json``. Damping, friction loss, armature and an offset of every
joint, and the ten inertial parameters of every link (pseudo-inertia), fitted to the positions and
speeds of rollouts of half a second under the logged torques, each from the measured state: a whole
log run open-loop leaves the measured motion within seconds. With a reference both logs are fitted
together, and a payload is welded to the last body of the new log's model only. The answer is the
identified model; its torque error is that of its inverse dynamics with friction loss times the sign
of the speed.
"""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

import sys
from functools import lru_cache

import mujoco
import numpy as np
from cases import CASES, Case, Run, held_out_error, inverse_dynamics, prepare, read, save
from mujoco import sysid

WINDOW = 0.5  # [s]
ITERATIONS = 25  # of each of two rounds
PER_JOINT = ("damping", "frictionloss", "armature", "offset")


# >>> what a user writes
def spec_of(case: Case, dt: float, loaded: bool) -> mujoco.MjSpec:
    """The nominal body with a motor, two sensors and, where there may be one, a payload."""
    spec = mujoco.MjSpec.from_string(case.xml)
    spec.option.timestep, spec.option.integrator = dt, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.compiler.balanceinertia = True  # rounding leaves a point mass short of A + B >= C
    for name in case.joints:
        motor = spec.add_actuator(
            name=f"{name}_motor", target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT
        )
        motor.gainprm[0], motor.biastype = 1.0, mujoco.mjtBias.mjBIAS_AFFINE
        spec.joint(name).actfrclimited = spec.joint(name).limited = 0
        for kind in (mujoco.mjtSensor.mjSENS_JOINTPOS, mujoco.mjtSensor.mjSENS_JOINTVEL):
            spec.add_sensor(
                name=f"{name}_{int(kind)}",
                type=kind,
                objtype=mujoco.mjtObj.mjOBJ_JOINT,
                objname=name,
            )
    if loaded:
        last = spec.body(case.body.body(case.body.nbody - 1).name)
        last.add_body(name="payload", mass=0.1, inertia=[1e-3] * 3, explicitinertial=True)
    return spec


def modifier(name: str, kind: str):
    """Write one joint's parameter into a spec."""

    def write(spec: mujoco.MjSpec, p: sysid.Parameter) -> None:
        if kind == "offset":
            spec.actuator(f"{name}_motor").biasprm[0] = -p.value[0]
        else:
            setattr(
                spec.joint(name),
                kind,
                float(p.value[0]) if kind != "damping" else [float(p.value[0]), 0.0, 0.0],
            )

    return write


def inertia(name: str):
    """Write one link's inertial parameters into a spec.

    The package's own writer leaves the frame undefined, which MuJoCo 3.17 and 4.0 refuse to
    compile.
    """

    def write(spec: mujoco.MjSpec, p: sysid.Parameter) -> None:
        sysid.apply_body_inertia(spec, name, p)
        spec.body(name).iquat = [1.0, 0.0, 0.0, 0.0]

    return write


def load(spec: mujoco.MjSpec, p: sysid.Parameter) -> None:
    """Write the payload's mass and centre."""
    if body := spec.body("payload"):
        body.mass, body.ipos = p.value[0], p.value[1:4]


def parameters(case: Case, spec: mujoco.MjSpec, runs: list[Run]) -> sysid.ParameterDict:
    """Bounds and starting values from the size of torques, speeds and accelerations."""
    found, model = sysid.ParameterDict(), spec.compile()
    tau, qd, qdd = (
        np.abs(np.concatenate([getattr(r, key) for r in runs])).max(axis=0)
        for key in ("tau", "qd", "qdd")
    )
    for j, name in enumerate(case.joints):
        most = {
            "damping": tau[j] / qd[j],
            "frictionloss": tau[j],
            "armature": tau[j] / qdd[j],
            "offset": tau[j],
        }
        for kind in PER_JOINT:
            low, start = (-most[kind], 0.0) if kind == "offset" else (0.0, 0.1 * most[kind])
            found.add(
                sysid.Parameter(
                    f"{name}_{kind}", start, low, most[kind], modifier=modifier(name, kind)
                )
            )
    for j in range(case.body.njnt):
        body = case.body.body(case.body.jnt_bodyid[j]).name
        found.add(
            sysid.body_inertia_param(
                spec, model, body, inertia_type=sysid.InertiaType.Pseudo, modifier=inertia(body)
            )
        )
    if case.reference:
        # not at zero: MuJoCo takes a centre that near for the frame's origin, and the derivative
        # there is nothing
        found.add(
            sysid.Parameter(
                "payload",
                [0.1, 0.01, 0.01, 0.01],
                [0, -0.5, -0.5, -0.5],
                [10, 0.5, 0.5, 0.5],
                modifier=load,
            )
        )
    return found


def sequences(case: Case, file: str, run: Run, spec: mujoco.MjSpec) -> sysid.ModelSequences:
    """The fitted part of a run in windows."""
    model, log = spec.compile(), read(file)
    tau = np.stack(
        [np.interp(run.time, log["time"], log[f"tau{j}"]) for j in range(model.nv)], axis=1
    )
    length = max(5, round(WINDOW / (run.time[1] - run.time[0])))
    inside = np.flatnonzero(run.fitted)
    starts = range(inside[0], inside[-1] - length, length)
    sensed = np.stack([run.q, run.qd], axis=2).reshape(len(run.q), -1)
    states, controls, sensors = [], [], []
    for s in starts:
        time = run.time[s : s + length] - run.time[s]
        states.append(sysid.create_initial_state(model, run.q[s], run.qd[s], np.zeros(0)))
        controls.append(sysid.TimeSeries.from_control_names(time, tau[s : s + length], model))
        sensors.append(sysid.TimeSeries.from_names(time, sensed[s : s + length], model))
    return sysid.ModelSequences(file, spec, [str(s) for s in starts], states, controls, sensors)


def identify(
    case: Case, files: list[str], runs: list[Run]
) -> tuple[sysid.ParameterDict, mujoco.MjSpec]:
    """Fit all of it; the model of the new log comes back with it."""
    dt = float(runs[0].time[1] - runs[0].time[0])
    dt = dt if dt < 0.003 else dt / 2
    specs = [spec_of(case, dt, bool(case.reference) and file != case.reference) for file in files]
    start = parameters(case, specs[0], runs)
    groups = [
        sequences(case, file, run, spec) for file, run, spec in zip(files, runs, specs, strict=True)
    ]
    scale = np.stack(
        [np.concatenate([getattr(r, key) for r in runs]).std(axis=0) for key in ("q", "qd")], axis=1
    ).ravel()

    def compare(params, predicted, measured, model, return_pred_all, **_):
        """By default each window is divided by its own spread, which is next to nothing where the
        robot rests.
        """
        measured = sysid.apply_delayed_ts_window(measured, predicted, 0.0, 0.0)
        predicted = predicted.resample(measured.times)
        return (measured.data - predicted.data) / scale, predicted, measured

    def fit(start: sysid.ParameterDict) -> sysid.ParameterDict:
        scratch = start.copy()

        # a model is the same for all windows: compiling it for each would take most of the time
        @lru_cache(1000)
        def compiled(key: bytes, loaded: bool) -> mujoco.MjModel:
            scratch.update_from_vector(np.frombuffer(key))
            return sysid.apply_param_modifiers(scratch, specs[0] if loaded else specs[-1])

        residual = sysid.build_residual_fn(
            models_sequences=groups,
            build_model=lambda p, spec: compiled(p.as_vector().tobytes(), spec is specs[0]),
            modify_residual=compare,
            n_threads=1,
        )
        return sysid.optimize(
            start, residual, optimizer="mujoco", max_iters=ITERATIONS, x_scale="jac", verbose=True
        )[0]

    for key in list(start.keys()):  # joints first, links with them in a second round
        start[key].frozen = key.endswith("_inertia")
    start = fit(start)
    for key in list(start.keys()):
        start[key].frozen = False
    return fit(start), specs[0]


# <<<


def main(name: str, answer: str) -> None:
    case = CASES[name]
    files = [*case.runs, *([case.reference] if case.reference else [])]
    runs = [prepare(case, file) for file in files]
    found, spec = identify(case, files, runs)
    model = sysid.apply_param_modifiers(found, spec)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    value = {
        kind: np.array([found[f"{j}_{kind}"].value[0] for j in case.joints]) for kind in PER_JOINT
    }
    new = runs[: len(case.runs)]
    predicted = [
        inverse_dynamics(model, r) + value["frictionloss"] * np.sign(r.qd) + value["offset"]
        for r in new
    ]
    words = dict(
        zip(
            ("viscous", "dry", "rotor", "offset"),
            (value[k].tolist() for k in PER_JOINT),
            strict=True,
        )
    )
    if case.reference:
        words |= {
            "payload": float(found["payload"].value[0]),
            "payload_centre": found["payload"].value[1:].tolist(),
        }
    save(answer, held_out=held_out_error(new, predicted), estimated=words)


if __name__ == "__main__":
    main(*sys.argv[1:])
