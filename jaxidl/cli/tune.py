"""The command ``jaxidl tune``."""

import math
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from jaxidl.cli.arguments import optional
from jaxidl.errors import ConfigurationError


def tune(
    *,
    out: Annotated[Path, arg(metavar="DIR")] = Path("out/tune"),
    plant: Annotated[str, arg(metavar="point_mass|arm")] = "point_mass",
    controller: Annotated[
        str | None, optional("pid|doomed", "pid on the point mass, doomed on the arm")
    ] = None,
    bound: Annotated[float | None, optional("FEEDBACK", "that of the present gains")] = None,
    steps: int = 30,
    runs: int = 4,
    test_runs: int = 20,
    root: int = 1,
    executions: Annotated[int | None, optional("N", "4 on the point mass, 3 on the arm")] = None,
    epochs: Annotated[int | None, optional("N", "10 on the point mass, 8 on the arm")] = None,
    overwrite: bool = False,
) -> None:
    """Tune controller and learner gains by gradient through learning; compare with random search.

    Feedback effort stays within a bound.

    Args:
        out: folder for tune.json, tune.md and the figure; finished points are kept there, and the
            same command continues.
        plant: the paper's point mass with its low gains, or the seven-joint arm (under DOOMED).
        controller: feedback law: pid or doomed on the point mass; the arm has doomed.
        bound: largest mean applied feedback [N or Nm].
        steps: number of steps of gradient descent; random search may take as long.
        runs: number of learning runs that a point is judged by.
        test_runs: number of fresh learning runs that compare the tuned gains with others.
        root: number from which all seeds follow.
        executions: number of executions of each learning run.
        epochs: number of epochs of each training.
        overwrite: start again; existing results at --out are kept as DIR.old.
    """
    from jaxidl.backend import choose_devices
    from jaxidl.files import write_bytes
    from jaxidl.jobs.pieces import set_aside
    from jaxidl.plot.tune import draw_tune  # matplotlib, and with the arm mujoco: slow to import
    from jaxidl.tune.problem import problem
    from jaxidl.tune.run import as_text
    from jaxidl.tune.run import tune as run
    from jaxidl.tune.search import Search

    if bound is not None and not (math.isfinite(bound) and bound > 0.0):
        raise ConfigurationError(
            "--bound > 0", str(bound), "give the largest mean feedback, or leave it out"
        )
    choose_devices(None)
    sizes = {
        name: value
        for name, value in (("executions", executions), ("epochs", epochs))
        if value is not None
    }
    for name, least in (("executions", 2), ("epochs", 1)):
        if sizes.get(name, least) < least:
            raise ConfigurationError(f"--{name} >= {least}", str(sizes[name]), "correct it")
    tuned = problem(plant, controller, **sizes)
    if overwrite:
        set_aside(out, ("tune.json", "points"))
    search = Search(steps=steps, runs=runs, test_runs=test_runs, root=root)
    result = run(tuned, search, out, bound=bound)
    text = as_text(result)
    write_bytes(out / "tune.md", f"{text}\n".encode())
    for path in (out / "tune.json", out / "tune.md", *draw_tune(result, out)):
        print(f"wrote {path}")
    print(text)
