"""The command ``jaxidl ablate``."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import OmitArgPrefixes, UseAppendAction, arg

from jaxidl.cli.arguments import Names
from jaxidl.cli.options import Options
from jaxidl.errors import ConfigurationError
from jaxidl.paper.grid import COUNTS, LEVELS, Axes, Grid, Value

if TYPE_CHECKING:
    from jaxidl.paper.study import PaperStudy

# one's name for the grid's
AXIS = {"controller": "controllers", "gain": "gains", "seed": "seeds", "source": "sources"}
BASE = Axes(("pid",), ("low",), (5e-4,), (5.0,), (5.0,), (20,), (1, 2, 3, 4, 5))


def ablate(
    axes: Annotated[Axes, OmitArgPrefixes] = BASE,
    running: Annotated[Options, OmitArgPrefixes] = Options(),  # noqa: B008
    *,
    vary: Annotated[tuple[Names, ...], UseAppendAction, arg(metavar="NAME VALUE ...")],
    out: Annotated[Path, arg(metavar="FILE.nc")] = Path("out/ablation.nc"),
) -> None:
    """Vary any number of the study: each --vary is one more axis of a sweep, and the figure shows
    its influence.

    Numbers that do not set an array's size (gains, masses, filter constants, rates) share one
    compiled program; sizes and whole numbers (layers, batch, kept, steps) need a program for each
    value. The study's own axes, such as noise, can also be varied.

    Args:
        axes: values of the grid.
        running: how the sweep is run.
        vary: a number's name and its values; repeat it for another number. Any name of the study's
            settings, for instance learner_gain, applied_gain (kp [N/m], their other gains in
            proportion), alpha (filter of the learning feedback), prior_mass [kg], learning_rate,
            layers (as 200,100,50,20,1), batch, kept (number of earlier executions to learn
            from as well), train_on, policy_gains.0, pid_gains.0.1. A wrong name lists them all.
        out: file of the results; figure and table (FILE.png, FILE.pdf, FILE.md) are written beside
            it.
    """
    from jaxidl.backend import choose_devices  # JAX and matplotlib: not for a help text
    from jaxidl.files import write_bytes
    from jaxidl.paper.ablation import as_markdown
    from jaxidl.paper.runs import run_sweep
    from jaxidl.paper.study import PaperStudy
    from jaxidl.plot.ablation import draw_ablation

    if out.suffix != ".nc":  # table and figure lie beside it under its name
        raise ConfigurationError("--out FILE.nc", str(out), "give it the ending .nc")
    grid = varying(Grid(**vars(axes)), PaperStudy(), vary)
    choose_devices(running.devices)
    data = run_sweep(grid, out, **running.keywords())
    table = as_markdown(data)
    write_bytes(out.with_suffix(".md"), f"{table}\n".encode())
    for path in (out, out.with_suffix(".md"), *draw_ablation(data, out.parent, out.stem)):
        print(f"wrote {path}")
    print(table)


def varying(grid: Grid, study: "PaperStudy", vary: tuple[Names, ...]) -> Grid:
    """Return the grid with the axes that ``--vary`` asks for.

    Each is (name, value, …): one of the grid's own axes or a number of the study.

    Raises:
        ConfigurationError: for an unknown name, no values, or a value of another kind or out of
            bounds.
    """
    from jaxidl.paper.vary import parsed

    added: list[tuple[str, tuple[Value, ...]]] = []
    named = [AXIS.get(words[0], words[0]) for words in vary if words]
    if len(set(named)) < len(named):
        raise ConfigurationError(
            "each name to vary once", ", ".join(named), "give all its values in one --vary"
        )
    for name, *given in ((words or ("",)) for words in vary):
        if not given:
            raise ConfigurationError(
                "a name and values for --vary", name or "nothing", "write --vary NAME VALUE VALUE …"
            )
        axis = AXIS.get(name, name)
        if axis not in grid.axes():
            added.append((name, tuple(parsed(study, name, value) for value in given)))
            continue
        values: tuple[Value, ...] = tuple(given)
        if axis in COUNTS or axis in LEVELS:
            values = tuple(_number(name, text, int if axis in COUNTS else float) for text in given)
        grid = replace(grid, **{axis: values})
    grid = replace(grid, vary=tuple(added))
    if not any(
        len(values) > 1 for dim, values in grid.dims().items() if dim not in ("seed", "source")
    ):
        raise ConfigurationError(
            "something that varies, apart from seed and source",
            "one setting only",
            "--vary NAME VALUE VALUE …",
        )
    return grid


def _number(name: str, text: str, kind: type) -> float | int:
    try:
        return kind(text)
    except ValueError:
        what = "a whole number" if kind is int else "a number"
        raise ConfigurationError(f"{what} for {name}", repr(text), "correct the value") from None
