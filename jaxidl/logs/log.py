"""Measured logs: read from CSV, NPZ or Parquet, checked, and resampled to one interval.

A log records what a mechanism did: time, positions and torques of its joints, perhaps velocities
and accelerations, in SI units, in one run or several. What cannot be used is refused with one line
that names column and row; what was changed is a note.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64, Int

from jaxidl.errors import LogError
from jaxidl.logs import checks, numeric
from jaxidl.logs.array_tables import expanded
from jaxidl.logs.families import Wanted
from jaxidl.logs.formats import load
from jaxidl.logs.fresh import fresh
from jaxidl.logs.mending import Samples
from jaxidl.logs.motor_side import MotorSide
from jaxidl.logs.ros_bag import is_bag, load_bag
from jaxidl.logs.sampling import LEAST_RUN, interval, pieces, resample
from jaxidl.logs.speeds import check_speeds
from jaxidl.logs.stamps import counted
from jaxidl.logs.table import Table, listed, name_of, reason
from jaxidl.logs.words import KINDS


@dataclass(frozen=True)
class Log:
    """A record of a mechanism's motion, sampled at one rate.

    Within a run the samples are ``dt`` apart.
    """

    time: Float64[np.ndarray, " T"]  # [s], increasing within a run
    q: Float64[np.ndarray, "T J"]  # [m or rad]
    tau: Float64[np.ndarray, "T J"]  # [N or N m]
    qd: Float64[np.ndarray, "T J"] | None  # [m/s or rad/s], if it was measured
    qdd: Float64[np.ndarray, "T J"] | None  # [m/s^2 or rad/s^2], if it was measured
    run: Int[np.ndarray, " T"]  # 0, 1, 2, ... in order of appearance
    dt: float  # [s] nominal sampling interval
    notes: tuple[str, ...]  # remarks that are not errors
    # mean positions [m or rad] of the robot's joints that were not used, by name
    still: tuple[tuple[str, float], ...] = ()
    stray: tuple[str, ...] = ()  # those of them that moved
    files: tuple[str, ...] = ()  # that it was read from
    # options other than the default ones with which the files were read, by name
    reading: Mapping[str, Any] = field(default_factory=dict)

    @property
    def joints(self) -> int:
        """J, the number of joints."""
        return self.q.shape[1]

    @property
    def samples(self) -> int:
        """T, the number of samples in all runs."""
        return len(self.time)

    @property
    def runs(self) -> int:
        """The number of runs."""
        return int(self.run[-1]) + 1

    def segments(self) -> list[slice]:
        """Return the rows of each run."""
        edges = np.searchsorted(self.run, np.arange(self.runs + 1)).tolist()
        return [slice(a, b) for a, b in pairwise(edges)]


def read(
    paths: Path | str | Sequence[Path | str],
    joints: int | Sequence[str] | None = None,
    *,
    robot: Sequence[str] = (),
    columns: Sequence[str] = (),
    motor: MotorSide | None = None,
    topic: str | None = None,
) -> Log:
    """Return the log in files; each file after the first adds its runs.

    Args:
        paths: CSV (comma, semicolon or tab; ``#`` comments), NPZ or Parquet, with columns ``time``,
            ``q0...``, ``tau0...`` and, if present, ``qd0...``, ``qdd0...`` and ``run`` (any
            labels). NPZ may hold ``q`` and ``tau`` as (T, J). Other titles are recognised where
            they can have one meaning only (``actual_q_0``, ``elbow/effort``); a note says how. ROS
            bags with ``sensor_msgs/JointState`` are read if ``rosbags`` is installed.
        joints: number of the model's joints, or their names in its order. Default: as in the log.
        robot: names of all joints of the robot, in order; columns of those not in ``joints`` are
            left out. Default: ``joints``.
        columns: which column is which, as ``"q0=actual_q_0"`` or, for all joints,
            ``"q=actual_q_*"``.
        motor: how joints follow from motors, if the log has motors' data.
        topic: topic of a ROS bag, if it has several with joint states.

    Raises:
        LogError: if a file cannot be read, or its contents cannot be used.
    """
    files = [Path(path) for path in ([paths] if isinstance(paths, Path | str) else paths)]
    if not files:
        raise LogError("at least one log", "none", "name a CSV, NPZ or Parquet file, or a ROS bag")
    count = joints if isinstance(joints, int) or joints is None else len(joints)
    names = () if isinstance(joints, int) or joints is None else tuple(joints)
    whole = tuple(robot) or names
    taken = tuple(whole.index(name) for name in names) if names else tuple(range(len(whole)))
    wanted = Wanted(
        count, whole, taken, tuple(columns), motor is not None and motor.torque_constant is not None
    )
    tables = [
        load_bag(path, wanted, topic) if is_bag(path) else load(path, wanted) for path in files
    ]
    for i, path in enumerate(files):
        if any(os.path.samefile(path, other) for other in files[:i]):
            raise LogError(
                "each log once",
                f"{name_of(path)} twice",
                "leave one of them out, otherwise held-out data would also be fitted",
            )
    return replace(_assemble(tables, count, motor), files=tuple(map(str, files)))


def from_arrays(
    time: object,
    q: object,
    tau: object,
    qd: object | None = None,
    qdd: object | None = None,
    run: object | None = None,
    joints: int | None = None,
) -> Log:
    """Return a log from arrays, checked as a file is.

    Args:
        time: (T,) [s].
        q: (T, J) or (T,) [m or rad]; so are tau [N or N m], and qd and qdd if given.
        run: (T,) labels of any kind; None is one run.
        joints: number of the model's joints. Default: as in the arrays.

    Raises:
        LogError: if they cannot be used.
    """
    given = {"time": time, "q": q, "tau": tau, "qd": qd, "qdd": qdd, "run": run}
    arrays = {}
    for key, value in given.items():
        if np.ma.is_masked(value):  # a plain array would bring back masked values
            raise LogError(
                f"every value of {key}",
                "masked values",
                "interpolate them, or cut them out and start a new run",
            )
        try:
            if value is not None:
                arrays[key] = np.asarray(value)
        except Exception as error:  # foreign array types may raise anything
            raise LogError(
                f"an array for {key}", reason(error), "give lists of numbers of equal length"
            ) from None
    return _assemble([expanded("the arrays", arrays, Wanted(joints))], joints)


def _assemble(tables: list[Table], joints: int | None, motor: MotorSide | None = None) -> Log:
    """Return one log of all files' runs."""
    found: list[Samples] = []
    notes: list[str] = []
    for table in tables:
        found.append(numeric.samples(table, joints, motor))
        counts = [samples.signals["q"].shape[1] for samples in found]
        if counts[-1] != counts[0]:
            got = f"{counts[0]} in {tables[0].name} and {counts[-1]} in {table.name}"
            raise LogError(
                "the same number of joints in every log", got, "use logs of one mechanism"
            )
        notes += found[-1].notes
        if table.ignored:
            notes.append(
                f"column{'s' * (len(table.ignored) > 1)} {listed(table.ignored)} of {table.name}"
                " ignored"
            )
    kinds = [kind for kind in KINDS if all(kind in samples.signals for samples in found)]
    for kind in KINDS:
        if kind not in kinds and any(kind in samples.signals for samples in found):
            notes.append(f"{kind} ignored: not every log has it")
    if motor is not None:
        notes.append(motor.note())
    found = [fresh(counted(samples, notes), notes) for samples in found]
    cut = [piece for samples in found for piece in pieces(samples, notes)]
    if not cut:
        raise LogError(
            f"a run of at least {LEAST_RUN} samples", "only shorter ones", "record longer"
        )
    dt = interval(cut)
    even = [resample(piece, dt) for piece in cut]
    if missing := sum(part.missing for part in even):
        notes.append(f"{missing} missing sample{'s were' if missing > 1 else ' was'} interpolated")
    if uneven := max(part.uneven for part in even):
        notes.append(
            f"time is uneven, by up to {uneven:.1%} of an interval: resampled every {dt:.6g} s"
        )
    if slowed := sum(part.slowed for part in even):
        rates = sorted({f"{1 / piece.step:.4g}" for piece in cut}, key=float)
        notes.append(
            f"rates of {', '.join(rates[:6])} Hz: {slowed} run{'s' * (slowed > 1)} resampled to"
            f" {1 / dt:.4g} Hz"
        )
    time = np.concatenate([part.time for part in even])
    run = np.repeat(np.arange(len(even)), [len(part.time) for part in even])
    signals = {kind: np.concatenate([part.signals[kind] for part in even]) for kind in kinds}
    still = {
        name: float(np.mean([s.still[name][0] for s in found if name in s.still]))
        for s in found
        for name in s.still
    }
    log = Log(
        time,
        signals["q"],
        signals["tau"],
        signals.get("qd"),
        signals.get("qdd"),
        run,
        dt,
        (),
        tuple(still.items()),
        tuple(name for name in still if any(s.still.get(name, (0.0, False))[1] for s in found)),
    )
    if log.qd is not None:
        check_speeds(log.q, log.qd, dt, log.segments())
    checks.long_enough(log.time, dt)
    odd = checks.motion(log.q, log.tau, log.time, log.segments(), tables[0].called)
    return replace(log, notes=(*notes, *odd))
