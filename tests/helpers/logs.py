"""Sound logs, files of them, and checks of what was read."""

from pathlib import Path

import numpy as np
import pytest

from jaxidl.errors import LogError
from jaxidl.logs.log import Log, from_arrays

SAMPLES, DT = 300, 0.005


def good(samples=SAMPLES, joints=2, dt=DT, **more):
    """The columns of a sound log."""
    time = np.arange(samples) * dt
    columns = {"time": time}
    columns |= {f"q{j}": np.sin((2 + j) * time) for j in range(joints)}
    columns |= {f"tau{j}": 3 * np.cos((2 + j) * time + 0.1) for j in range(joints)}
    return columns | more


def each_joint(columns, kind, joints) -> np.ndarray:
    """The columns of one kind, such as q, of these joints side by side (T, J)."""
    return np.stack([columns[f"{kind}{j}"] for j in joints], axis=1)


def text(columns, delimiter=","):
    """The columns as CSV."""
    lines = [delimiter.join(columns)]
    cells = [
        [c if isinstance(c, str) else repr(float(c)) for c in column] for column in columns.values()
    ]
    return "\n".join(lines + [delimiter.join(row) for row in zip(*cells, strict=True)]) + "\n"


def write(path: Path, columns) -> Path:
    """A log in the format that its name says."""
    if path.suffix == ".npz":
        np.savez(path, **columns)
    elif path.suffix == ".parquet":
        import pyarrow as pa
        import pyarrow.parquet as pq

        pq.write_table(pa.table({key: pa.array(column) for key, column in columns.items()}), path)
    else:
        path.write_text(text(columns))
    return path


def arrays(columns) -> Log:
    """The log of these columns, without a file."""
    time, run = columns["time"], columns.get("run")
    joints = range(sum(key.startswith("tau") for key in columns))
    q, tau = (each_joint(columns, kind, joints) for kind in ("q", "tau"))
    return from_arrays(time, q, tau, run=run)


def check(log: Log):
    """Check what holds for every log."""
    T, J = log.q.shape
    assert log.samples == T >= 200 - 5
    assert log.joints == J >= 1
    for array, shape in (
        (log.time, (T,)),
        (log.q, (T, J)),
        (log.tau, (T, J)),
        (log.qd, (T, J)),
        (log.qdd, (T, J)),
    ):
        assert array is None or (
            array.shape == shape and array.dtype == np.float64 and np.isfinite(array).all()
        )
    segments = log.segments()
    assert len(segments) == log.runs
    assert [s.start for s in segments] + [T] == [0] + [s.stop for s in segments]
    for i, s in enumerate(segments):
        assert (log.run[s] == i).all()
        # uniform up to digits that time was written with
        np.testing.assert_allclose(np.diff(log.time[s]), log.dt, rtol=0.3)
    assert all(isinstance(note, str) and "\n" not in note for note in log.notes)


def refuse(call, *words):
    """Check that the call is refused in one printable line with these words."""
    with pytest.raises(LogError) as caught:
        call()
    line = str(caught.value)
    assert line.isprintable(), line  # no line break either
    assert len(line) < 600
    for word in words:
        assert word in line, line


ARM = ("shoulder_pan_joint", "elbow_joint", "wrist_1_joint")
THREE = good(joints=3)


def titled(rename, columns=THREE):
    """The columns of a log under other titles."""
    return {rename(key): column for key, column in columns.items()}


def as_robots_do(time="time", **titles):
    """The three joints under other titles, given as formats of the joint's number or name."""

    def rename(key):
        kind, number = key.rstrip("0123456789"), key.lstrip("timeqaud")
        if key == "time":
            return time
        pattern = titles[kind]
        return pattern.format(
            int(number),
            n=int(number) + 1,
            name=ARM[int(number)],
            short=ARM[int(number)].removesuffix("_joint"),
        )

    return titled(rename)


def same(log, columns=THREE, joints=(0, 1, 2)):
    """Check that these joints' columns were read, in this order."""
    check(log)
    for kind in ("q", "tau"):
        np.testing.assert_allclose(
            getattr(log, kind), each_joint(columns, kind, joints), rtol=1e-12
        )


LINK = (
    '<body name="{0}" pos="0 0 -0.3"><joint name="{0}_joint" axis="{1}"/><geom size="0.05" pos="0.1'
    ' 0 -0.2"/>{2}</body>'
)


def robot(folder):
    """A model file of the three joints."""
    inside = ""
    for name, axis in (("wrist_1", "1 0 0"), ("elbow", "0 1 0"), ("shoulder_pan", "0 0 1")):
        inside = LINK.format(name, axis, inside)
    path = folder / "robot.xml"
    path.write_text(f"<mujoco><worldbody>{inside}</worldbody></mujoco>")
    return path


CURRENTS = {key.replace("tau", "motor_current_"): column for key, column in THREE.items()}
