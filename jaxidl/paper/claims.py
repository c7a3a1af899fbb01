"""The paper's statements about its simulation study, each with the ratio that tests it.

Every statistic is a positive ratio for each seed, over all settings that the statement speaks of;
:mod:`jaxidl.paper.verdicts` computes it twice, with means and with medians over settings, and
judges.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from jaxidl.paper.grid import SOURCES
from jaxidl.paper.view import View


@dataclass(frozen=True)
class Claim:
    """One statement, the ratio that tests it, and the range of the ratio in which it is true."""

    name: str
    statement: str
    measure: str
    statistic: Callable[[View], xr.DataArray]
    low: float = 0.0
    high: float = np.inf
    # the same of the other sources, by name
    beside: tuple[tuple[str, Callable[[View], xr.DataArray]], ...] = ()


def _of(
    name: str,
    statement: str,
    measure: str,
    source: str,
    statistic: Callable[..., xr.DataArray],
    *,
    but: str = "",
    **within: float,
) -> Claim:
    """A claim about one source, with the same statistic of the others beside it: what holds for all
    says nothing about one.

    ``but``: the source that it is compared with, of which it would say nothing.
    """
    by = {other: partial(statistic, source=other) for other in SOURCES}
    beside = tuple((other, by[other]) for other in SOURCES if other not in (source, but))
    return Claim(name, statement, measure, by[source], beside=beside, **within)


def _both(
    name: str,
    statement: str,
    measure: str,
    statistic: Callable[..., xr.DataArray],
    low: float = 0.0,
    high: float = np.inf,
    source: str = "",
    but: str = "",
) -> list[Claim]:
    """The same claim for either controller, low gain unless the statistic says otherwise; with
    ``source`` about that one.
    """
    found = []
    for who in ("pid", "doomed"):
        words = f"{name}/{who}", f"{who.upper()}: {statement}", measure
        own = partial(statistic, who=who)
        if source:
            found.append(_of(*words, source, own, but=but, low=low, high=high))
        else:
            found.append(Claim(*words, own, low, high))
    return found


def _low(who: str, **where: Any) -> dict[str, Any]:
    return {"controller": who, "gain": "low", **where}


def _ratio(
    statistic: Callable[..., xr.DataArray], over: str, under: str, **where: Any
) -> xr.DataArray:
    """A statistic of one source relative to that of another."""
    return statistic(source=over, **where) / statistic(source=under, **where)


def _to_best_other(
    statistic: Callable[..., xr.DataArray], source: str, **where: Any
) -> xr.DataArray:
    """A statistic of one source relative to the other whose value over all seeds is smallest."""
    own = statistic(source=source, **where)
    values = [statistic(source=other, **where) for other in SOURCES if other != source]
    return own / min(values, key=lambda value: float(np.nanmean(np.log(value))))


def _by_noise(
    statistic: Callable[..., xr.DataArray], noises: tuple[float, float], **where: Any
) -> xr.DataArray:
    """A statistic at the highest noise relative to that at the lowest."""
    return statistic(noise=noises[1], **where) / statistic(noise=noises[0], **where)


IMPROVES = 0.9  # final / first error below it is an improvement, above it is none

CLAIMS: list[Claim] = [
    _of(
        "joint-overall-faster",
        "on average over all settings, joint data is faster",
        "mean error over iterations, source / best of the others, all settings",
        "joint",
        lambda v, source: _to_best_other(v.area, source),
        high=1.0,
    ),
    _of(
        "joint-overall-consistent",
        "over all settings, joint data is more consistent",
        "final / first error that one run in ten exceeds, source / best of the others, all"
        " settings",
        "joint",
        lambda v, source: _to_best_other(v.unreliable, source),
        high=1.0,
    ),
    _of(
        "indirect-low-pid",
        "PID: with indirect data and low gain, tracking does not improve",
        "final / first error",
        "indirect",
        lambda v, source: v.improvement(**_low("pid", source=source)),
        low=IMPROVES,
    ),
    _of(
        "joint-low-pid",
        "PID: with joint data and low gain, tracking improves",
        "final / first error",
        "joint",
        lambda v, source: v.improvement(**_low("pid", source=source)),
        high=IMPROVES,
    ),
    *_both(
        "direct-low-noise",
        "with direct data, low gain and low noise, tracking improves",
        "final / first error at the lowest noise",
        lambda v, who, source: v.improvement(**_low(who, source=source, noise=v.noises[0])),
        high=IMPROVES,
        source="direct",
    ),
    *_both(
        "direct-high-noise",
        "with direct data, low gain and very high noise, tracking does not improve",
        "final / first error at the highest noise",
        lambda v, who, source: v.improvement(**_low(who, source=source, noise=v.noises[1])),
        low=IMPROVES,
        source="direct",
    ),
    _of(
        "indirect-low-doomed",
        "DOOMED: with indirect data and low gain, tracking improves",
        "final / first error",
        "indirect",
        lambda v, source: v.improvement(**_low("doomed", source=source)),
        high=IMPROVES,
    ),
    Claim(
        "indirect-slower",
        "DOOMED: indirect data improves tracking more slowly than direct data (low gain, low"
        " noise)",
        "mean error over iterations, indirect / direct at the lowest noise",
        lambda v: _ratio(v.area, "indirect", "direct", **_low("doomed", noise=v.noises[0])),
        low=1.0,
    ),
    *_both(
        "direct-erratic",
        "with direct data alone, convergence is erratic in very high noise",
        "rises of the log error between late iterations, direct / joint at the highest noise",
        lambda v, who: _ratio(v.rises, "direct", "joint", **_low(who, noise=v.noises[1])),
        low=1.0,
    ),
    *_both(
        "indirect-noise",
        "noise does not affect learning from indirect data much",
        "mean error over iterations, highest / lowest noise",
        lambda v, who, source: _by_noise(v.area, v.noises, **_low(who, source=source)),
        low=0.8,
        high=1.25,
        source="indirect",
    ),
    *_both(
        "direct-noise",
        "direct data is affected more by noise than indirect data",
        "(final error, highest / lowest noise) direct / indirect",
        lambda v, who: (
            _by_noise(v.end, v.noises, **_low(who, source="direct"))
            / _by_noise(v.end, v.noises, **_low(who, source="indirect"))
        ),
        low=1.0,
    ),
    *_both(
        "joint-consistent",
        "joint data converges most consistently (low gain)",
        "final / first error that one run in ten exceeds, source / best of the others",
        lambda v, who, source: _to_best_other(v.unreliable, source, **_low(who)),
        high=1.0,
        source="joint",
    ),
    *_both(
        "direct-variance",
        "results of direct data have a higher variance than those of joint data (low gain)",
        "spread of the log final error over settings, direct / joint",
        lambda v, who: _ratio(v.spread, "direct", "joint", **_low(who)),
        low=1.0,
    ),
    *_both(
        "joint-ordering",
        "on average joint data ends with the lowest error (low gain)",
        "final error, source / best of the others",
        lambda v, who, source: _to_best_other(v.end, source, **_low(who)),
        high=1.0,
        source="joint",
    ),
    *_both(
        "joint-faster",
        "joint data converges faster than indirect data (low gain)",
        "mean error over iterations, source / indirect",
        lambda v, who, source: _ratio(v.area, source, "indirect", **_low(who)),
        high=1.0,
        source="joint",
        but="indirect",
    ),
    _of(
        "direct-degrades",
        "PID: with direct data and low gain, mean tracking degrades again after a few iterations",
        "final error / lowest before",
        "direct",
        lambda v, source: (
            v.end(**_low("pid", source=source)) / v.lowest_before(**_low("pid", source=source))
        ),
        low=1.0,
    ),
    *_both(
        "indirect-feedback",
        "with low gain, indirect data needs more feedback torque than joint data",
        "final applied feedback, indirect / joint",
        lambda v, who: _ratio(v.end, "indirect", "joint", variable="feedback_applied", **_low(who)),
        low=1.0,
    ),
    Claim(
        "joint-torque",
        "joint data leads to lower exerted torques than indirect data (low gain, both controllers)",
        "final commanded torque, joint / indirect",
        lambda v: _ratio(v.end, "joint", "indirect", variable="torque", gain="low"),
        high=1.0,
    ),
    *_both(
        "joint-high-gain",
        "with high gain, joint data is no worse than indirect data",
        "final error, source / indirect, setting by setting (10 % allowed)",
        lambda v, who, source: v.paired(source, "indirect", controller=who, gain="high"),
        high=1.1,
        source="joint",
        but="indirect",
    ),
    Claim(
        "high-gain-less",
        "with high gain, the advantage of joint over indirect data is less pronounced",
        "(final error, indirect / joint) low gain / high gain",
        lambda v: (
            _ratio(v.end, "indirect", "joint", gain="low")
            / _ratio(v.end, "indirect", "joint", gain="high")
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
        lambda v: v.not_best("joint"),
        low=0.05,
    ),
]
