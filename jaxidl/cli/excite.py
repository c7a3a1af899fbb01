"""The command ``jaxidl excite``."""

import math
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from jaxidl.cli.arguments import Names, optional
from jaxidl.cli.plugins import load
from jaxidl.errors import ConfigurationError


def excite(
    *,
    model: Annotated[Path, arg(metavar="ROBOT.xml")],
    out: Annotated[Path, arg(metavar="FILE.csv")] = Path("motion.csv"),
    for_: Annotated[
        Path | None, arg(name="for", metavar="DIR", help_behavior_hint="(optional)")
    ] = None,
    plugin: Annotated[Names, optional("FILE.py ...")] = (),
    joints: Annotated[Names, optional("NAME ...", "all, with --for those of the diagnosis")] = (),
    limits: Annotated[Path | None, optional("FILE.yaml")] = None,
    start: Annotated[tuple[float, ...], optional("Q ...", "the middle of the range")] = (),
    seconds: float = 20.0,
    criterion: Annotated[str, arg(metavar="d|a")] = "d",
    kind: Annotated[str, arg(metavar="fourier|spline")] = "fourier",
    top: float = 1.5,
    rate: float = 100.0,
    starts: int = 4,
    steps: int = 150,
    seed: int = 0,
) -> None:
    """Design the most informative motion: one that gives small standard errors of all effects, or,
    with --for, one that settles an ambiguous diagnosis.

    Args:
        model: MJCF or URDF file.
        out: file of the motion: time, q0..., qd0..., qdd0..., tau0.... A picture (.png) and the
            predicted standard errors or separations (.json) are written beside it.
        for_: folder of a diagnosis (--out of jaxidl gap) whose explanations the motion should tell
            apart. The noise is that of its log; without limits the motion stays in the log's range.
        plugin: Python files or modules with effects of your own that the diagnosis names.
        joints: joints that move; the others are locked.
        limits: YAML file with position, speed, acceleration, torque, margins, clearance and start.
        start: posture at the beginning and the end [m or rad].
        seconds: length of the motion.
        criterion: D-optimal (product of the standard errors) or A-optimal (sum of their relative
            squares). With --for it is always T-optimal.
        kind: Fourier series or B-spline.
        top: highest frequency of the motion [Hz].
        rate: samples of the file per second.
        starts: number of random motions that are improved side by side.
        steps: number of steps of gradient descent.
        seed: seed of the random motions.
    """
    from jaxidl.backend import choose_devices
    from jaxidl.excite.run import Request
    from jaxidl.excite.run import excite as run
    from jaxidl.files import as_json, write_bytes
    from jaxidl.jobs.progress import Bar
    from jaxidl.plot.excite import draw_excite
    from jaxidl.stop import STOP

    if out.suffix != ".csv":
        raise ConfigurationError("--out FILE.csv", str(out), "give the motion a name with .csv")
    if not all(map(math.isfinite, (seconds, top, rate, *start))):
        raise ConfigurationError("finite numbers", "inf or nan", "correct the options")
    for name in plugin:
        load(name)
    request = Request(criterion, kind, seconds, top, rate, starts, steps, seed)
    choose_devices(None)
    with Bar("reading", transient=True) as bar:
        result = run(
            model,
            request,
            joints=joints,
            limits=limits,
            start=start,
            diagnosis=for_,
            watch=lambda what, share: bar.at(share, what),
        )
    files = {out: result.csv(), out.with_suffix(".json"): as_json(result.record()) + "\n"}
    for path, content in files.items():
        write_bytes(path, content.encode())
    draw_excite(result, out.with_suffix(".png"))
    print(result.table)
    for note in result.notes():
        print(note)
    for path in (*files, out.with_suffix(".png")):
        print(f"wrote {path}")
    if STOP.is_set():  # interrupted: these files hold the best so far
        raise KeyboardInterrupt
