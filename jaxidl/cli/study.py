"""The commands ``jaxidl figures``, ``claims`` and ``reproduce``: what a sweep of the paper's grid
says.
"""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import tyro
from tyro.conf import arg

from jaxidl.cli.arguments import optional
from jaxidl.paper.grid import Grid


def figures(
    results: Annotated[Path, tyro.conf.Positional, arg(metavar="RESULTS.nc")],
    /,
    *,
    out: Annotated[Path, arg(metavar="DIR")] = Path("out/figures"),
) -> None:
    """Draw the study's figures, or an ablation's, from stored results.

    Args:
        results: a results file of `jaxidl sweep` or `jaxidl ablate`.
        out: folder for the PNG and PDF files.
    """
    from jaxidl.paper.runs import added, read_results

    # matplotlib: slow to import, and only needed here
    from jaxidl.plot.ablation import draw_ablation
    from jaxidl.plot.figures import draw_all

    data = read_results(results)
    for path in draw_ablation(data, out, results.stem) if added(data) else draw_all(data, out):
        print(f"wrote {path}")


def claims(
    results: Annotated[Path, tyro.conf.Positional, arg(metavar="RESULTS.nc")],
    /,
    *,
    json: bool = False,
    markdown: bool = False,
) -> None:
    """Check the paper's statements against stored results.

    Args:
        results: a results file of `jaxidl sweep`.
        json: print JSON instead of a table.
        markdown: print a Markdown table.
    """
    from jaxidl.paper.runs import read_results
    from jaxidl.paper.verdicts import as_json, as_markdown, as_table, check_claims

    data = read_results(results)
    rows = check_claims(data)
    print(as_json(rows, data) if json else as_markdown(rows) if markdown else as_table(rows))


def reproduce(
    *,
    quick: bool = False,
    out: Annotated[Path, arg(metavar="DIR")] = Path("out"),
    devices: Annotated[int | None, optional("N", "all")] = None,
    overwrite: bool = False,
) -> None:
    """Reproduce the paper's simulation study: sweep, then figures and claims.

    Args:
        quick: one seed of the lowest and the highest noise: takes minutes instead of hours.
        out: folder; results, figures and claims go into its subfolder "study", or "quick".
        devices: number of CPU cores or accelerators to use.
        overwrite: start again; existing results at --out are kept as FILE.nc.old.
    """
    from jaxidl.backend import choose_devices  # JAX: not for a help text
    from jaxidl.paper.runs import run_sweep

    choose_devices(devices)
    folder = out / ("quick" if quick else "study")
    grid, results = Grid.quick() if quick else Grid(), folder / "study.nc"
    if overwrite or not results.exists():
        first_figure(grid, results, devices=devices, overwrite=overwrite)
    run_sweep(grid, results, devices=devices)
    report(results, folder)


def first_figure(grid: Grid, results: Path, **running: Any) -> None:
    """Run those few of the grid's runs that the paper's Fig. 1 shows, and draw it beside them."""
    from jaxidl.paper.runs import run_sweep
    from jaxidl.plot.figures import draw_all

    few = replace(
        grid,
        gains=("low",),
        noise=tuple(dict.fromkeys((min(grid.noise), max(grid.noise)))),
        friction=grid.friction[:1],
        stiction=grid.stiction[:1],
        epochs=grid.epochs[:1],
        seeds=grid.seeds[:1],
    )
    data = run_sweep(few, results, **running)
    for path in draw_all(data, results.parent, ("fig1_illustration",)):
        print(f"wrote {path}, of the first {len(few)} of {len(grid)} learning runs", flush=True)


def report(results: Path, out: Path) -> None:
    """Write figures and claims.json from a results file into ``out``; print the claims."""
    from jaxidl.files import write_bytes
    from jaxidl.paper.runs import read_results
    from jaxidl.paper.verdicts import as_json, as_table, check_claims
    from jaxidl.plot.figures import draw_all

    data = read_results(results)
    paths = draw_all(data, out)
    rows = check_claims(data)
    write_bytes(out / "claims.json", (as_json(rows, data) + "\n").encode())
    print(as_table(rows))
    for path in (results, out / "claims.json", *paths):
        print(f"wrote {path}")
