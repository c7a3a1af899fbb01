"""Each of the paper's statements as numbers with intervals and a verdict.

Every statistic is a positive ratio, computed for each seed over all settings the statement speaks
of; seeds then give a geometric mean and a 95 % Student interval of its logarithm. It is computed
twice, because a few runs diverge (the mass is thrown metres, in an unstable region kilometres) and
a single one of them can decide an average: *on average*, with means over settings as in the paper's
figures, and *typically*, with medians. Each interval is compared with the range in which the
statement is true: inside it holds, outside it does not, across the border it is undecided. The
verdict is *holds* or *does not hold* where both agree, *only partly* otherwise, with what each
says. Iterations that diverged are left out and counted in ``left_out``.
"""

import json
import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np
import xarray as xr
from rich import box
from rich.console import Console
from rich.table import Table

from jaxidl.errors import StoreError
from jaxidl.files import markdown
from jaxidl.jobs.statistics import Mean, geometric
from jaxidl.paper.claims import CLAIMS, Claim
from jaxidl.paper.runs import added
from jaxidl.paper.view import View


def within(number: Mean, low: float, high: float) -> str:
    """Say whether a ratio is in the range in which its statement is true."""
    bottom, top = number.interval or (number.value, number.value)
    if low < bottom and top < high:
        return "holds"
    return "does not hold" if top <= low or bottom >= high else "undecided"


@dataclass(frozen=True)
class Verdict:
    """A claim, computed."""

    name: str
    statement: str
    measure: str
    true_if: str
    average: Mean | None
    typical: Mean | None
    verdict: str  # holds, does not hold, only partly, not in these results
    why: str  # of "only partly": what each of the two numbers says
    left_out: int  # diverged iterations in the whole file
    # the same statistic on average for each other source, and whether the statement is true of it,
    # too
    beside: dict[str, str]


def check_claims(data: xr.Dataset) -> list[Verdict]:
    """Check every claim against the results in ``data``.

    Claims about values that the file lacks are "not in these results".

    Raises:
        StoreError: if the file is an ablation's, which has other settings than the paper's.
    """
    if varied := added(data):
        raise StoreError(
            "results of `jaxidl sweep`",
            f"an ablation over {', '.join(varied)}",
            "check another file",
        )
    views = View(data, typical=False), View(data, typical=True)
    left_out = int((~data["finite"]).sum())
    with warnings.catch_warnings():
        # settings of which nothing is left average to NaN, and are dropped
        warnings.simplefilter("ignore", RuntimeWarning)
        return [_check(claim, *views, left_out) for claim in CLAIMS]


def _check(claim: Claim, mean: View, median: View, left_out: int) -> Verdict:
    numbers = average, typical = _number(claim.statistic, mean), _number(claim.statistic, median)
    if not (average and typical):
        verdict, why = "not in these results", _lacking(claim.statistic, mean)
    else:
        found = [within(number, claim.low, claim.high) for number in (average, typical)]
        verdict = found[0] if found[0] == found[1] != "undecided" else "only partly"
        why = f"on average {found[0]}, typically {found[1]}" if verdict == "only partly" else ""
    beside = {source: _same(_number(statistic, mean), claim) for source, statistic in claim.beside}
    return Verdict(
        claim.name,
        claim.statement,
        claim.measure,
        _range(claim),
        *numbers,
        verdict,
        why,
        left_out,
        beside,
    )


def _same(number: Mean | None, claim: Claim) -> str:
    return (
        "-"
        if number is None
        else f"{number.value:.2g}" + " (true)" * (within(number, claim.low, claim.high) == "holds")
    )


LACKING = {
    "noise": "one noise only",
    "iteration": "too few executions",
    "source": "not all three sources",
}


def _lacking(statistic: Callable[[View], xr.DataArray], view: View) -> str:
    """Return what a file lacks for a statistic, in words."""
    try:
        statistic(view)
    except KeyError as error:
        what = str(error.args[0]) if error.args else ""
        return LACKING.get(what, "values that these results do not have")
    return ""


def _number(statistic: Callable[[View], xr.DataArray], view: View) -> Mean | None:
    try:
        return geometric(np.atleast_1d(statistic(view).values).astype(float))
    except KeyError:
        return None


def _range(claim: Claim) -> str:
    if claim.low == 0.0:
        return f"< {claim.high:g}"
    return f"> {claim.low:g}" if claim.high == np.inf else f"{claim.low:g} to {claim.high:g}"


def as_json(rows: list[Verdict], data: xr.Dataset) -> str:
    """Return the verdicts as JSON, with the revision that computed the results ``data``."""
    claims = [asdict(row) for row in rows]
    return json.dumps({"git_revision": data.attrs.get("git_revision"), "claims": claims}, indent=1)


HEADINGS = (
    "statement",
    "measured as",
    "true if",
    "on average",
    "typically",
    "verdict",
    "the same for others",
)


def _cells(row: Verdict) -> tuple[str, ...]:
    verdict = row.verdict + (f": {row.why}" if row.why else "")
    if row.average and row.average.interval is None:
        verdict += " (one seed)"
    numbers = ("-" if number is None else str(number) for number in (row.average, row.typical))
    return (
        row.statement,
        row.measure,
        row.true_if,
        *numbers,
        verdict,
        ", ".join(f"{k} {v}" for k, v in row.beside.items()),
    )


def as_table(rows: list[Verdict]) -> str:
    """Return the verdicts as a table for a terminal, with the number of iterations left out."""
    table = Table(box=box.SIMPLE)
    for heading in HEADINGS:
        table.add_column(heading, no_wrap=heading in HEADINGS[2:5])
    for row in rows:
        table.add_row(*_cells(row))
    console = Console(width=170)
    with console.capture() as text:
        console.print(table)
    return "\n".join(line.rstrip() for line in text.get().splitlines()) + "\n" + _footnote(rows)


def as_markdown(rows: list[Verdict]) -> str:
    """Return the verdicts as a Markdown table."""
    return markdown(HEADINGS, map(_cells, rows)) + "\n\n" + _footnote(rows)


def _footnote(rows: list[Verdict]) -> str:
    seeds = max((row.average.seeds for row in rows if row.average), default=0)
    text = (
        "geometric mean over seeds [95 % interval]; on average: means over settings, typically:"
        " medians; "
    )
    text += f"{seeds} seed{'s' * (seeds != 1)}; {rows[0].left_out} diverged iterations left out"
    return text + (
        " (one seed gives no interval: verdicts go by the value alone)" if seeds == 1 else ""
    )
