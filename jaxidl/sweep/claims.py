"""The paper's statements about its simulation study, each as a number with an interval and a verdict.

Every statistic is a positive ratio, computed for each seed over all settings the statement speaks of; seeds then give a
geometric mean and a 95 % Student interval of its logarithm. It is computed twice, because a few runs run away (the mass is
thrown metres, in an unstable region kilometres) and such a run alone decides an average: *on average*, with means over settings
as in the paper's figures, and *typically*, with medians. Each interval is compared with the range in which the statement is
true: inside it holds, outside it does not, across the border it does so partly. The verdict is *holds* or *does not hold* where
both agree, *only partly* otherwise. Iterations that diverged are left out and counted in ``left_out``.
"""

import json
import warnings
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
    """A results file seen through means or, ``typical``, through medians over settings; diverged iterations left out."""

    def __init__(self, data: xr.Dataset, typical: bool):
        self.data, self.typical = data, typical
        self.noises = (float(data.noise.min()), float(data.noise.max()))

    def over(self, runs: xr.DataArray, keep: tuple[str, ...] = ("seed",)) -> xr.DataArray:
        """Mean or median over all dims but ``keep``."""
        dims = [dim for dim in runs.dims if dim not in keep]
        return runs.median(dims) if self.typical else runs.mean(dims)

    def runs(self, variable: str = "q_error", **where: Any) -> xr.DataArray:
        """The runs at the given values, NaN where diverged. Raises KeyError if the file lacks a value."""
        chosen = self.data[[variable, "finite"]].sel(**where)
        return chosen[variable].where(chosen["finite"])

    def curve(self, variable: str = "q_error", **where: Any) -> xr.DataArray:
        """(seed, iteration) average over all settings that ``where`` leaves open."""
        return self.over(self.runs(variable, **where), ("seed", "iteration"))

    def start(self, **where: Any) -> xr.DataArray:
        """(seed,) average in execution 0."""
        return self.curve(**where).isel(iteration=0)

    def end(self, variable: str = "q_error", **where: Any) -> xr.DataArray:
        """(seed,) average over the last executions."""
        return self.over(self.curve(variable, **where).isel(iteration=slice(-LAST, None)))

    def area(self, **where: Any) -> xr.DataArray:
        """(seed,) average over all executions after the first: small when learning is fast."""
        return self.over(self.curve(**where).isel(iteration=slice(1, None)))

    def jumps(self, **where: Any) -> xr.DataArray:
        """(seed,) how erratic: |log ratio| of a run's errors in successive executions of the second half."""
        late = self.runs(**where).isel(iteration=slice(self.data.sizes["iteration"] // 2, None))
        return self.over(abs(xr.ufuncs.log(late).diff("iteration")))

    def spread(self, **where: Any) -> xr.DataArray:
        """(seed,) standard deviation, or interquartile range, over settings and the last executions."""
        runs = self.runs(**where).isel(iteration=slice(-LAST, None))
        dims = [dim for dim in runs.dims if dim != "seed"]
        if self.typical:
            return runs.quantile(0.75, dims) - runs.quantile(0.25, dims)
        return runs.std(dims)


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
class Number:
    """One ratio over seeds."""

    value: float  # geometric mean
    interval: tuple[float, float] | None  # 95 % over seeds; None with fewer than two
    seeds: int

    def within(self, low: float, high: float) -> str:
        bottom, top = self.interval or (self.value, self.value)
        if low <= bottom and top <= high:
            return "holds"
        return "does not hold" if top < low or bottom > high else "only partly"


@dataclass(frozen=True)
class Verdict:
    """A claim, computed."""

    name: str
    statement: str
    measure: str
    true_if: str
    average: Number | None
    typical: Number | None
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
    views = View(data, typical=False), View(data, typical=True)
    left_out = int((~data["finite"]).sum())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # settings of which nothing is left average to NaN, and are dropped
        return [_check(claim, *views, left_out) for claim in CLAIMS]


def _check(claim: Claim, mean: View, median: View, left_out: int) -> Verdict:
    numbers = _number(claim, mean), _number(claim, median)
    found = {number.within(claim.low, claim.high) for number in numbers if number}
    verdict = "not in these results" if None in numbers else found.pop() if len(found) == 1 else "only partly"
    return Verdict(claim.name, claim.statement, claim.measure, _range(claim), *numbers, verdict, left_out)


def _number(claim: Claim, view: View) -> Number | None:
    try:
        ratios = np.atleast_1d(claim.statistic(view).values).astype(float)
    except KeyError:
        return None
    logs = np.log(ratios[np.isfinite(ratios) & (ratios > 0)])
    if len(logs) == 0:
        return None
    value, interval = float(np.exp(logs.mean())), None
    if len(logs) > 1:
        half = stats.t.ppf(0.975, len(logs) - 1) * logs.std(ddof=1) / np.sqrt(len(logs))
        interval = (float(np.exp(logs.mean() - half)), float(np.exp(logs.mean() + half)))
    return Number(value, interval, len(logs))


def _range(claim: Claim) -> str:
    if claim.low == 0.0:
        return f"<= {claim.high:g}"
    return f">= {claim.low:g}" if claim.high == np.inf else f"{claim.low:g} to {claim.high:g}"


def as_json(rows: list[Verdict]) -> str:
    """The verdicts as a JSON list."""
    return json.dumps([asdict(row) for row in rows], indent=1)


HEADINGS = ("statement", "measured as", "true if", "on average", "typically", "verdict")


def _cells(row: Verdict) -> tuple[str, ...]:
    return row.statement, row.measure, row.true_if, _text(row.average), _text(row.typical), row.verdict


def _text(number: Number | None) -> str:
    if number is None:
        return "-"
    interval = number.interval
    return f"{number.value:.2g}" + (f" [{interval[0]:.2g}, {interval[1]:.2g}]" if interval else "")


def as_table(rows: list[Verdict]) -> str:
    """The verdicts as a table for a terminal, and what was left out."""
    table = Table(box=box.SIMPLE)
    for heading in HEADINGS:
        table.add_column(heading, no_wrap=heading in HEADINGS[2:])
    for row in rows:
        table.add_row(*_cells(row))
    console = Console(width=170)
    with console.capture() as text:
        console.print(table)
    return "\n".join(line.rstrip() for line in text.get().splitlines()) + "\n" + _footnote(rows)


def as_markdown(rows: list[Verdict]) -> str:
    """The verdicts as a Markdown table."""
    lines = ["| " + " | ".join(HEADINGS) + " |", "| " + " | ".join("---" for _ in HEADINGS) + " |"]
    lines += ["| " + " | ".join(cell.replace("|", "\\|") for cell in _cells(row)) + " |" for row in rows]
    return "\n".join(lines) + "\n\n" + _footnote(rows)


def _footnote(rows: list[Verdict]) -> str:
    seeds = max((row.average.seeds for row in rows if row.average), default=0)
    text = "geometric mean over seeds [95 % interval]; on average: means over settings, typically: medians; "
    text += f"{seeds} seed{'s' * (seeds != 1)}; {rows[0].left_out} diverged iterations left out"
    return text + (" (one seed gives no interval: verdicts go by the value alone)" if seeds == 1 else "")
