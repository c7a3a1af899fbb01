"""The command ``jaxidl tune``."""

import math
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from jaxidl.errors import ConfigurationError


def tune(
    *,
    out: Annotated[Path, arg(metavar="DIR")],
    plant: Annotated[str, arg(metavar="point_mass|arm")] = "point_mass",
    controller: Annotated[str | None, arg(metavar="pid|doomed")] = None,
    bound: float | None = None,
    steps: int = 30,
    seeds: int = 4,
    test_seeds: int = 20,
    seed: int = 1,
    executions: int | None = None,
    epochs: int | None = None,
) -> None:
    """Controller and learner gains by gradient through learning, under a bound on feedback effort,
    against random search.

    Args:
        out: folder for tune.json, tune.md and the figure; finished points are kept there, and the
            same command continues.
        plant: the paper's point mass with its low gains, or the seven-joint arm (under DOOMED).
        controller: feedback law: pid (the default) or doomed on the point mass; the arm has doomed.
        bound: of the mean applied feedback [N or Nm] (default: that of the present gains).
        steps: of gradient descent; random search may cost as much.
        seeds: learning runs that judge a point.
        test_seeds: fresh learning runs that compare what was found.
        seed: root of all of them.
        executions: of each learning run (default: 4 on the point mass, 3 on the arm).
        epochs: of each training (default: 10 on the point mass, 8 on the arm).
    """
    from jaxidl.backend import choose_devices
    from jaxidl.files import write_bytes
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
    search = Search(steps=steps, seeds=seeds, test_seeds=test_seeds, seed=seed)
    result = run(tuned, search, out, bound=bound)
    text = as_text(result)
    write_bytes(out / "tune.md", f"{text}\n".encode())
    for path in (out / "tune.json", out / "tune.md", *draw_tune(result, out)):
        print(f"wrote {path}")
    print(text)
