"""The logs, and the same preparation and measure for every peer; needs NumPy, SciPy and MuJoCo
only.

A case is one question: these runs, this nominal rigid body, perhaps an older log as reference.
Everybody fits on the first 70 % of each run. The error is that of the torque on the last 30 %: root
mean square of (measured − predicted) over the standard deviation of the measured torque there, both
after the same zero-phase low-pass (Butterworth, fourth order, forwards and backwards). Velocities
and accelerations are central differences of the positions behind the same filter.
"""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false, reportCallIssue=false

import json
import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np
from scipy.signal import butter, filtfilt

DATA = Path(os.environ.get("JAXIDL_DATA", Path(__file__).resolve().parents[3] / "shared" / "data"))
FITTED = 0.7  # share of each run, from its start
EDGE = 0.25  # left out at both ends of a run, where the filter has no neighbours [s]
SLIDER = """<mujoco><worldbody><body name="slider"><joint name="slide" type="slide" axis="1 0 0"/>
<inertial pos="0 0 0" mass="95.1089" diaginertia="1 1 1"/></body></worldbody></mujoco>"""


@dataclass(frozen=True)
class Case:
    """One question to every peer."""

    name: str
    runs: tuple[str, ...]  # CSV files, relative to DATA
    model: str | None  # MJCF file, relative to DATA; None: the slider above
    cut: float  # of the low-pass [Hz]
    reference: str | None = None  # an older log: what is new since then?

    def missing(self) -> str:
        """Return why the case cannot run, or nothing."""
        files = [*self.runs, *(f for f in (self.model, self.reference) if f)]
        gone = [f for f in files if not (DATA / f).is_file()]
        return f"no {', '.join(gone)} in {DATA}; set JAXIDL_DATA" if gone else ""

    @property
    def xml(self) -> str:
        """The nominal rigid body as MJCF."""
        return (DATA / self.model).read_text() if self.model else SLIDER

    @cached_property
    def body(self) -> mujoco.MjModel:
        """The nominal rigid body; limits are switched off, they add no torque to an inverse
        dynamics.
        """
        model = mujoco.MjModel.from_xml_string(self.xml)
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        return model

    @property
    def joints(self) -> list[str]:
        return [self.body.joint(j).name for j in range(self.body.nv)]


CASES = {
    case.name: case
    for case in (
        Case("emps", ("emps/emps.csv",), None, 100.0),
        Case("ur10e", ("ur10e/without_load.csv",), "ur10e/ur10e.xml", 8.0),
        Case("ur10e_load", ("ur10e/with_load.csv",), "ur10e/ur10e.xml", 8.0),
        Case(
            "ur10e_change",
            ("ur10e/with_load.csv",),
            "ur10e/ur10e.xml",
            8.0,
            "ur10e/without_load.csv",
        ),
        Case(
            "xl330",
            tuple(f"xl330/{n}.csv" for n in ("sin_sin", "up_and_down", "sin_time_square")),
            "xl330/pendulum.xml",
            8.0,
        ),
    )
}


@dataclass(frozen=True)
class Run:
    """One run on a uniform clock: smoothed motion and torque (T, J), and which rows are fitted and
    which are held out.
    """

    time: np.ndarray  # (T,) [s]
    q: np.ndarray  # (T, J) [m or rad]
    qd: np.ndarray
    qdd: np.ndarray
    tau: np.ndarray  # (T, J) [N or Nm]
    cut: float  # [Hz]
    fitted: np.ndarray  # (T,) bool
    held_out: np.ndarray  # (T,) bool

    def smooth(self, x: np.ndarray) -> np.ndarray:
        """Low-pass ``x`` (T, ...) as the torque was."""
        return filtfilt(*butter(4, 2.0 * self.cut * (self.time[1] - self.time[0])), x, axis=0)


def read(file: str) -> dict[str, np.ndarray]:
    """Read a log: column name -> (T,)."""
    table = np.genfromtxt(DATA / file, delimiter=",", names=True)
    return {name: table[name] for name in table.dtype.names or ()}


def prepare(case: Case, file: str) -> Run:
    """Read one run of a case, put it on a uniform clock, smooth and differentiate it."""
    log, joints = read(file), case.body.nv
    dt = float(np.median(np.diff(log["time"])))
    time = np.arange(log["time"][0], log["time"][-1], dt)
    smooth = lambda x: filtfilt(*butter(4, 2.0 * case.cut * dt), x, axis=0)
    even = lambda key: np.stack(
        [np.interp(time, log["time"], log[f"{key}{j}"]) for j in range(joints)], axis=1
    )
    q = smooth(even("q"))
    qd = np.gradient(q, dt, axis=0)
    since, split = time - time[0], FITTED * (time[-1] - time[0])
    fitted = (since > EDGE) & (since < split - EDGE / 2)
    held_out = (since >= split) & (since < since[-1] - EDGE)
    return Run(
        time, q, qd, np.gradient(qd, dt, axis=0), smooth(even("tau")), case.cut, fitted, held_out
    )


def inverse_dynamics(model: mujoco.MjModel, run: Run) -> np.ndarray:
    """Torque (T, J) that the motion takes, with whatever passive forces the model has."""
    data, out = mujoco.MjData(model), np.empty_like(run.q)
    for t in range(len(run.q)):
        data.qpos[:], data.qvel[:], data.qacc[:] = run.q[t], run.qd[t], run.qdd[t]
        mujoco.mj_inverse(model, data)
        out[t] = data.qfrc_inverse
    return out


def held_out_error(runs: list[Run], predicted: list[np.ndarray]) -> list[float]:
    """Error (J,) of predicted torques (T, J), one for each run, smoothed here: the number of the
    table.
    """
    left = np.concatenate(
        [(r.tau - r.smooth(p))[r.held_out] for r, p in zip(runs, predicted, strict=True)]
    )
    spread = np.concatenate([r.tau[r.held_out] for r in runs]).std(axis=0)
    return (np.sqrt((left**2).mean(axis=0)) / spread).tolist()


def cut_log(file: str, path: Path, first: bool) -> Path:
    """Write the fitted (first) or the held-out part of a log as logged to ``path`` (CSV), for peers
    that read files.
    """
    log = read(file)
    since = log["time"] - log["time"][0]
    rows = since < FITTED * since[-1] if first else since >= FITTED * since[-1]
    np.savetxt(
        path,
        np.column_stack([x[rows] for x in log.values()]),
        "%.9g",
        ",",
        header=",".join(log),
        comments="",
    )
    return path


def save(path: Path | str, **result: object) -> None:
    """Write a peer's answer to one case as JSON."""
    Path(path).write_text(json.dumps(result, indent=1, allow_nan=False) + "\n")
