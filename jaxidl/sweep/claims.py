"""The paper's statements about its simulation study, each as a number with an interval and a verdict.

Every statistic is a positive ratio, computed for each seed over all settings the statement speaks of; seeds then give a
geometric mean and a 95 % Student interval of its logarithm. It is computed twice, because a few runs run away (the mass is
thrown metres, in an unstable region kilometres) and such a run alone decides an average: *on average*, with means over settings
as in the paper's figures, and *typically*, with medians. Each interval is compared with the range in which the statement is
true: inside it holds, outside it does not, across the border it is undecided. The verdict is *holds* or *does not hold* where
both agree, *only partly* otherwise, with what each says. Iterations that diverged are left out and counted in ``left_out``.
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

    @property
    def noises(self) -> tuple[float, float]:
        """Lowest and highest noise [m]. Raises KeyError if there is but one."""
        low, high = float(self.data.noise.min()), float(self.data.noise.max())
        if low == high:
            raise KeyError("noise")
        return low, high

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
        """(seed,) average over the last executions. Raises KeyError if there are not enough of them."""
        if self.data.sizes["iteration"] <= LAST:
            raise KeyError("iteration")
        return self.over(self.curve(variable, **where).isel(iteration=slice(-LAST, None)))

    def gain(self, **where: Any) -> xr.DataArray:
        """(seed,) final / first error."""
        return self.end(**where) / self.start(**where)

    def area(self, **where: Any) -> xr.DataArray:
        """(seed,) average over all executions after the first: small when learning is fast."""
        return self.over(self.curve(**where).isel(iteration=slice(1, None)))

    def rises(self, **where: Any) -> xr.DataArray:
        """(seed,) how erratic: what a run's log error rises from one execution to the next, falls counting zero.

        Averaged over the executions of the second half, so that it does not matter when a rise comes.
        """
        late = self.runs(**where).isel(iteration=slice(self.data.sizes["iteration"] // 2, None))
        steps = xr.ufuncs.log(late).diff("iteration")
        return self.over(steps.clip(min=0.0).mean("iteration"))

    def unreliable(self, **where: Any) -> xr.DataArray:
        """(seed,) the final / first error that one run in ten exceeds: small when a source converges in all settings."""
        self.end(**where)  # are there enough executions?
        runs = self.runs(**where)
        ends = runs.isel(iteration=slice(-LAST, None)).mean("iteration") / runs.isel(iteration=0)
        return ends.quantile(0.9, [dim for dim in ends.dims if dim != "seed"]).drop_vars("quantile")

    def spread(self, **where: Any) -> xr.DataArray:
        """(seed,) standard deviation, or interquartile range, of the log final error over settings."""
        self.end(**where)
        runs = xr.ufuncs.log(self.runs(**where).isel(iteration=slice(-LAST, None)).mean("iteration"))
        dims = [dim for dim in runs.dims if dim != "seed"]
        if self.typical:
            return (runs.quantile(0.75, dims) - runs.quantile(0.25, dims)) / 1.349  # in units of a normal's deviation
        return runs.std(dims)

    def never_best(self, source: str, **where: Any) -> xr.DataArray:
        """(seed,) share of settings in which ``source`` does not have the lowest final error of the three."""
        self.end(**where)
        ends = self.runs(**where).isel(iteration=slice(-LAST, None)).mean("iteration")
        beaten = ends.sel(source=source) > ends.min("source")
        return beaten.mean([dim for dim in beaten.dims if dim != "seed"])


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
    average: Number | None
    typical: Number | None
    verdict: str  # holds, does not hold, only partly, not in these results
    why: str  # of "only partly": what each of the two numbers says
    left_out: int  # diverged iterations in the whole file


def _both(name: str, statement: str, measure: str, statistic: Callable, low: float = 0.0, high: float = np.inf) -> list[Claim]:
    """The same claim for either controller, low gain unless the statistic says otherwise."""
    return [
        Claim(f"{name}/{who}", f"{who.upper()}: {statement}", measure, lambda v, who=who: statistic(v, who), low, high)
        for who in ("pid", "doomed")
    ]


def _low(who: str, source: str, **where: Any) -> dict[str, Any]:
    return {"controller": who, "gain": "low", "source": source, **where}


def _better_other(statistic: Callable[..., xr.DataArray], who: str) -> xr.DataArray:
    """The indirect or the direct value, whichever is smaller over all seeds together."""
    values = [statistic(**_low(who, source)) for source in ("indirect", "direct")]
    return min(values, key=lambda value: float(np.nanmean(np.log(value))))


IMPROVES = 0.9  # final / first error below it is an improvement, above it is none

CLAIMS: list[Claim] = [
    Claim(
        "indirect-low-pid",
        "PID: with indirect data and low gain, tracking does not improve",
        "final / first error",
        lambda v: v.gain(**_low("pid", "indirect")),
        low=IMPROVES,
    ),
    Claim(
        "joint-low-pid",
        "PID: with joint data and low gain, it does",
        "final / first error",
        lambda v: v.gain(**_low("pid", "joint")),
        high=IMPROVES,
    ),
    *_both(
        "direct-low-noise",
        "with direct data, low gain and low noise, tracking improves",
        "final / first error at the lowest noise",
        lambda v, who: v.gain(**_low(who, "direct", noise=v.noises[0])),
        high=IMPROVES,
    ),
    *_both(
        "direct-high-noise",
        "with direct data, low gain and very high noise, it does not",
        "final / first error at the highest noise",
        lambda v, who: v.gain(**_low(who, "direct", noise=v.noises[1])),
        low=IMPROVES,
    ),
    Claim(
        "indirect-low-doomed",
        "DOOMED: with indirect data and low gain, tracking improves",
        "final / first error",
        lambda v: v.gain(**_low("doomed", "indirect")),
        high=IMPROVES,
    ),
    Claim(
        "indirect-slower",
        "DOOMED: but more slowly than with direct data (low noise)",
        "mean error over iterations, indirect / direct at the lowest noise",
        lambda v: v.area(**_low("doomed", "indirect", noise=v.noises[0])) / v.area(**_low("doomed", "direct", noise=v.noises[0])),
        low=1.0,
    ),
    *_both(
        "direct-erratic",
        "with direct data alone, convergence is erratic in very high noise",
        "rises of the log error between late iterations, direct / joint at the highest noise",
        lambda v, who: v.rises(**_low(who, "direct", noise=v.noises[1])) / v.rises(**_low(who, "joint", noise=v.noises[1])),
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
        "final / first error that one run in ten exceeds, joint / better of the others",
        lambda v, who: v.unreliable(**_low(who, "joint")) / _better_other(v.unreliable, who),
        high=1.0,
    ),
    *_both(
        "direct-variance",
        "results of direct data have a higher variance than those of joint data (low gain)",
        "spread of the log final error over settings, direct / joint",
        lambda v, who: v.spread(**_low(who, "direct")) / v.spread(**_low(who, "joint")),
        low=1.0,
    ),
    *_both(
        "joint-ordering",
        "on average joint data ends with the lowest error (low gain)",
        "final error, joint / better of the others",
        lambda v, who: v.end(**_low(who, "joint")) / _better_other(v.end, who),
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
        "final error / lowest before",
        lambda v: (
            v.end(**_low("pid", "direct")) / v.curve(**_low("pid", "direct")).isel(iteration=slice(None, -LAST)).min("iteration")
        ),
        low=1.0,
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
    Claim(
        "single-source-can-win",
        "there are settings in which a single source does better than both",
        "share of settings in which joint is not best (5 % count)",
        lambda v: v.never_best("joint"),
        low=0.05,
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
    numbers = average, typical = _number(claim, mean), _number(claim, median)
    verdict, why = "not in these results", ""
    if average and typical:
        found = [number.within(claim.low, claim.high) for number in (average, typical)]
        verdict = found[0] if found[0] == found[1] != "undecided" else "only partly"
        why = f"on average {found[0]}, typically {found[1]}" if verdict == "only partly" else ""
    return Verdict(claim.name, claim.statement, claim.measure, _range(claim), *numbers, verdict, why, left_out)


def _number(claim: Claim, view: View) -> Number | None:
    try:
        ratios = np.atleast_1d(claim.statistic(view).values).astype(float)
    except KeyError:
        return None
    logs = np.log(np.clip(ratios[~np.isnan(ratios)], 1e-12, 1e12))  # a share of none, or a ratio to it
    if len(logs) == 0:
        return None
    value, interval = float(np.exp(logs.mean())), None
    if len(logs) > 1:
        half = stats.t.ppf(0.975, len(logs) - 1) * logs.std(ddof=1) / np.sqrt(len(logs))
        interval = (float(np.exp(logs.mean() - half)), float(np.exp(logs.mean() + half)))
    return Number(value, interval, len(logs))


def _range(claim: Claim) -> str:
    if claim.low == 0.0:
        return f"< {claim.high:g}"
    return f"> {claim.low:g}" if claim.high == np.inf else f"{claim.low:g} to {claim.high:g}"


def as_json(rows: list[Verdict]) -> str:
    """The verdicts as a JSON list."""
    return json.dumps([asdict(row) for row in rows], indent=1)


HEADINGS = ("statement", "measured as", "true if", "on average", "typically", "verdict")


def _cells(row: Verdict) -> tuple[str, ...]:
    verdict = row.verdict + (f": {row.why}" if row.why else "")
    if row.average and row.average.interval is None:
        verdict += " (one seed)"
    return row.statement, row.measure, row.true_if, _text(row.average), _text(row.typical), verdict


def _text(number: Number | None) -> str:
    if number is None:
        return "-"
    interval = number.interval
    return f"{number.value:.2g}" + (f" [{interval[0]:.2g}, {interval[1]:.2g}]" if interval else "")


def as_table(rows: list[Verdict]) -> str:
    """The verdicts as a table for a terminal, and what was left out."""
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
    """The verdicts as a Markdown table."""
    lines = ["| " + " | ".join(HEADINGS) + " |", "| " + " | ".join("---" for _ in HEADINGS) + " |"]
    lines += ["| " + " | ".join(cell.replace("|", "\\|") for cell in _cells(row)) + " |" for row in rows]
    return "\n".join(lines) + "\n\n" + _footnote(rows)


def _footnote(rows: list[Verdict]) -> str:
    seeds = max((row.average.seeds for row in rows if row.average), default=0)
    text = "geometric mean over seeds [95 % interval]; on average: means over settings, typically: medians; "
    text += f"{seeds} seed{'s' * (seeds != 1)}; {rows[0].left_out} diverged iterations left out"
    return text + (" (one seed gives no interval: verdicts go by the value alone)" if seeds == 1 else "")
