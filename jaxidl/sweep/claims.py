"""The paper's statements about its simulation study, each as a number with an interval and a verdict.

Every statistic is a positive ratio, computed for each seed from averages over all settings the statement speaks of; seeds
then give a geometric mean and a 95 % Student interval of its logarithm. The verdict compares that interval with the range in
which the statement is true: inside it *holds*, outside it *does not hold*, across its border it holds *only partly*.
Iterations whose run diverged are left out of the averages and counted in ``left_out``.
"""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import xarray as xr
from rich import box
from rich.console import Console
from rich.table import Table
from scipy import stats

LAST = 5  # iterations at the end that count as "converged"


class View:
    """Averages of a results file, diverged iterations left out."""

    def __init__(self, data: xr.Dataset):
        self.data = data
        self.noises = (float(data.noise.min()), float(data.noise.max()))

    def runs(self, variable: str = "q_error", **where: Any) -> xr.DataArray:
        """The runs at the given values, NaN where diverged. Raises KeyError if the file lacks a value."""
        chosen = self.data[[variable, "finite"]].sel(**where)
        return chosen[variable].where(chosen["finite"])

    def curve(self, variable: str = "q_error", **where: Any) -> xr.DataArray:
        """(seed, iteration) mean over all settings that ``where`` leaves open."""
        runs = self.runs(variable, **where)
        return runs.mean([dim for dim in runs.dims if dim not in ("seed", "iteration")])

    def start(self, **where: Any) -> xr.DataArray:
        """(seed,) mean in execution 0."""
        return self.curve(**where).isel(iteration=0)

    def end(self, variable: str = "q_error", **where: Any) -> xr.DataArray:
        """(seed,) mean over the last executions."""
        return self.curve(variable, **where).isel(iteration=slice(-LAST, None)).mean("iteration")

    def area(self, **where: Any) -> xr.DataArray:
        """(seed,) mean over all executions after the first: small when learning is fast."""
        return self.curve(**where).isel(iteration=slice(1, None)).mean("iteration")

    def jumps(self, **where: Any) -> xr.DataArray:
        """(seed,) how erratic: mean |log ratio| of a run's errors in successive executions of the second half."""
        late = self.runs(**where).isel(iteration=slice(self.data.sizes["iteration"] // 2, None))
        steps = abs(xr.ufuncs.log(late).diff("iteration"))
        return steps.mean([dim for dim in steps.dims if dim != "seed"])

    def spread(self, **where: Any) -> xr.DataArray:
        """(seed,) standard deviation over settings and the last executions."""
        runs = self.runs(**where).isel(iteration=slice(-LAST, None))
        return runs.std([dim for dim in runs.dims if dim != "seed"])


@dataclass(frozen=True)
class Claim:
    """One statement, the ratio that tests it, and the range of the ratio in which it is true."""

    name: str
    statement: str
    measure: str
    statistic: Callable[[View], xr.DataArray]
    low: float = 0.0
    high: float = np.inf


@dataclass(frozen=True)
class Verdict:
    """A claim, computed."""

    name: str
    statement: str
    measure: str
    true_if: str
    value: float | None
    interval: tuple[float, float] | None  # 95 % over seeds; None with fewer than two
    seeds: int
    verdict: str
    left_out: int  # diverged iterations in the whole file


def _both(name: str, statement: str, measure: str, statistic: Callable, low: float = 0.0, high: float = np.inf) -> list[Claim]:
    """The same claim for either controller, low gain unless the statistic says otherwise."""
    return [
        Claim(f"{name}/{who}", f"{who.upper()}: {statement}", measure, lambda v, who=who: statistic(v, who), low, high)
        for who in ("pid", "doomed")
    ]


def _low(who: str, source: str, **where: Any) -> dict[str, Any]:
    return {"controller": who, "gain": "low", "source": source, **where}


def _best_other(statistic: Callable[..., xr.DataArray], who: str) -> xr.DataArray:
    """The smaller of the indirect and direct values, seed by seed."""
    indirect, direct = (statistic(**_low(who, source)) for source in ("indirect", "direct"))
    return indirect.where(indirect < direct, direct)


CLAIMS: list[Claim] = [
    Claim(
        "indirect-low-pid",
        "PID: with indirect data and low gain, tracking does not improve",
        "final / first error, all settings",
        lambda v: v.end(**_low("pid", "indirect")) / v.start(**_low("pid", "indirect")),
        low=1.0,
    ),
    *_both(
        "direct-low-noise",
        "with direct data, low gain and low noise, tracking improves",
        "final / first error at the lowest noise",
        lambda v, who: v.end(**_low(who, "direct", noise=v.noises[0])) / v.start(**_low(who, "direct", noise=v.noises[0])),
        high=1.0,
    ),
    Claim(
        "indirect-slower",
        "DOOMED: indirect data improves tracking, but more slowly than direct (low noise)",
        "mean error over iterations, indirect / direct",
        lambda v: v.area(**_low("doomed", "indirect", noise=v.noises[0])) / v.area(**_low("doomed", "direct", noise=v.noises[0])),
        low=1.0,
    ),
    *_both(
        "direct-erratic",
        "with direct data alone, convergence is erratic in very high noise",
        "mean |log step| between late iterations, direct / joint at the highest noise",
        lambda v, who: v.jumps(**_low(who, "direct", noise=v.noises[1])) / v.jumps(**_low(who, "joint", noise=v.noises[1])),
        low=1.0,
    ),
    *_both(
        "indirect-noise",
        "noise does not affect learning from indirect data much",
        "mean error over iterations, highest / lowest noise",
        lambda v, who: v.area(**_low(who, "indirect", noise=v.noises[1])) / v.area(**_low(who, "indirect", noise=v.noises[0])),
        low=0.8,
        high=1.25,
    ),
    *_both(
        "direct-noise",
        "direct data is affected more by noise than indirect data",
        "(final error, highest / lowest noise) direct / indirect",
        lambda v, who: (
            v.end(**_low(who, "direct", noise=v.noises[1]))
            / v.end(**_low(who, "direct", noise=v.noises[0]))
            / (v.end(**_low(who, "indirect", noise=v.noises[1])) / v.end(**_low(who, "indirect", noise=v.noises[0])))
        ),
        low=1.0,
    ),
    *_both(
        "joint-consistent",
        "joint data converges most consistently (low gain)",
        "spread of the final error over settings, joint / better of the others",
        lambda v, who: v.spread(**_low(who, "joint")) / _best_other(v.spread, who),
        high=1.0,
    ),
    *_both(
        "joint-ordering",
        "on average joint data ends with the lowest error (low gain)",
        "final error, joint / better of the others",
        lambda v, who: v.end(**_low(who, "joint")) / _best_other(v.end, who),
        high=1.0,
    ),
    *_both(
        "joint-faster",
        "joint data converges faster than indirect data (low gain)",
        "mean error over iterations, joint / indirect",
        lambda v, who: v.area(**_low(who, "joint")) / v.area(**_low(who, "indirect")),
        high=1.0,
    ),
    Claim(
        "direct-degrades",
        "PID: with direct data and low gain, mean tracking degrades again after a few iterations",
        "final / lowest mean error over iterations",
        lambda v: v.end(**_low("pid", "direct")) / v.curve(**_low("pid", "direct")).min("iteration"),
        low=2.0,
    ),
    *_both(
        "indirect-feedback",
        "with low gain, indirect data needs more feedback torque than joint data",
        "final applied feedback, indirect / joint",
        lambda v, who: v.end("feedback_applied", **_low(who, "indirect")) / v.end("feedback_applied", **_low(who, "joint")),
        low=1.0,
    ),
    Claim(
        "joint-torque",
        "joint data leads to lower exerted torques than indirect data (low gain, both controllers)",
        "final commanded torque, joint / indirect",
        lambda v: v.end("torque", gain="low", source="joint") / v.end("torque", gain="low", source="indirect"),
        high=1.0,
    ),
    *_both(
        "joint-high-gain",
        "with high gain, joint data is no worse than indirect data",
        "final error, joint / indirect (10 % allowed)",
        lambda v, who: v.end(controller=who, gain="high", source="joint") / v.end(controller=who, gain="high", source="indirect"),
        high=1.1,
    ),
    Claim(
        "high-gain-less",
        "with high gain, the advantage of joint over indirect data is less pronounced",
        "(final error, indirect / joint) low gain / high gain",
        lambda v: (
            v.end(gain="low", source="indirect")
            / v.end(gain="low", source="joint")
            / (v.end(gain="high", source="indirect") / v.end(gain="high", source="joint"))
        ),
        low=1.0,
    ),
    *_both(
        "high-gain-first",
        "high gain tracks well in the very first execution",
        "first error, high / low gain",
        lambda v, who: v.start(controller=who, gain="high") / v.start(controller=who, gain="low"),
        high=0.5,
    ),
]


def check_claims(data: xr.Dataset) -> list[Verdict]:
    """Every claim against the results in ``data``; those about values that the file lacks say so."""
    view = View(data)
    left_out = int((~data["finite"]).sum())
    return [_check(claim, view, left_out) for claim in CLAIMS]


def _check(claim: Claim, view: View, left_out: int) -> Verdict:
    about = (claim.name, claim.statement, claim.measure, _range(claim))
    try:
        ratios = np.atleast_1d(claim.statistic(view).values).astype(float)
    except KeyError:
        return Verdict(*about, None, None, 0, "not in these results", left_out)
    logs = np.log(ratios[np.isfinite(ratios) & (ratios > 0)])
    if len(logs) == 0:
        return Verdict(*about, None, None, 0, "not in these results", left_out)
    value, interval = float(np.exp(logs.mean())), None
    if len(logs) > 1:
        half = stats.t.ppf(0.975, len(logs) - 1) * logs.std(ddof=1) / np.sqrt(len(logs))
        interval = (float(np.exp(logs.mean() - half)), float(np.exp(logs.mean() + half)))
    low, high = interval or (value, value)
    if claim.low <= low and high <= claim.high:
        verdict = "holds"
    elif high < claim.low or low > claim.high:
        verdict = "does not hold"
    else:
        verdict = "only partly"
    return Verdict(*about, value, interval, len(logs), verdict, left_out)


def _range(claim: Claim) -> str:
    if claim.low == 0.0:
        return f"<= {claim.high:g}"
    return f">= {claim.low:g}" if claim.high == np.inf else f"{claim.low:g} to {claim.high:g}"


def as_json(rows: list[Verdict]) -> str:
    """The verdicts as a JSON list."""
    return json.dumps([asdict(row) for row in rows], indent=1)


def _cells(row: Verdict) -> tuple[str, ...]:
    value = "-" if row.value is None else f"{row.value:.3g}"
    interval = "-" if row.interval is None else f"{row.interval[0]:.3g} to {row.interval[1]:.3g}"
    return row.statement, row.measure, row.true_if, value, interval, row.verdict


HEADINGS = ("statement", "measured as", "true if", "value", "95 % interval", "verdict")


def as_table(rows: list[Verdict]) -> str:
    """The verdicts as a table for a terminal, and what was left out."""
    table = Table(box=box.SIMPLE, show_lines=False)
    for heading in HEADINGS:
        table.add_column(heading, no_wrap=heading in ("value", "verdict", "95 % interval", "true if"))
    for row in rows:
        table.add_row(*_cells(row))
    console = Console(width=160, file=None, record=True, quiet=False)
    with console.capture() as text:
        console.print(table)
    return text.get() + _footnote(rows)


def as_markdown(rows: list[Verdict]) -> str:
    """The verdicts as a Markdown table."""
    lines = ["| " + " | ".join(HEADINGS) + " |", "| " + " | ".join("---" for _ in HEADINGS) + " |"]
    lines += ["| " + " | ".join(cell.replace("|", "\\|") for cell in _cells(row)) + " |" for row in rows]
    return "\n".join(lines) + "\n\n" + _footnote(rows)


def _footnote(rows: list[Verdict]) -> str:
    seeds = max((row.seeds for row in rows), default=0)
    text = f"{seeds} seed{'s' * (seeds != 1)}; {rows[0].left_out if rows else 0} diverged iterations left out of the averages"
    return text + (" (one seed gives no interval: verdicts go by the value alone)" if seeds == 1 else "")
