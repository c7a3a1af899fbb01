"""The share of reported effects that are right, by their reported confidence."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.optimize import minimize

from jaxidl.gap.benchmark import judge, robot_judge
from jaxidl.gap.benchmark.judge import Record
from jaxidl.gap.result.calibration import SIGNS

BINS = ((0.0, 0.5), (0.5, 0.8), (0.8, 0.9), (0.9, 1.0))
"""Edges of the bins of confidence; a bin excludes its upper edge, except the last."""

STRENGTH = 0.3  # strength of the ridge on the weights
# factor by which logs with one effect outside the catalogue are less frequent than others
SELDOM = {"outside": 0.05}


def is_right(truth: Record, report: Record, effect: Record) -> bool:
    """Return whether an effect of a report is hidden there.

    For a whole robot the equivalences of :mod:`.robot_judge` apply.
    """
    if truth["mechanism"] == "robot":
        return robot_judge.right(truth, report, effect)
    hidden = {judge.key(h) for h in truth["hidden"]}
    beside = {(name, joint) for whole, joint in hidden for name in judge.COMPANIONS.get(whole, ())}
    return judge.key(effect) in hidden.union(beside, *map(judge.sums, truth["hidden"]))


def calibration(
    pairs: Iterable[tuple[Record, Record | None]],
    share: Callable[[Iterable[float]], dict[str, float]],
) -> dict[str, dict[str, float]]:
    """Return the share of reported effects that are right in each bin of confidence.

    Bins are ``"0.9-1.0"`` and so on.
    """
    rows = [
        (judge.confidence(e), float(is_right(t, r, e)))
        for t, r in pairs
        if r is not None
        for e in r["effects"]
    ]
    last = BINS[-1]
    return {
        f"{low}-{high}": share(
            ok for c, ok in rows if low <= c and (c < high or (low, high) == last)
        )
        for low, high in BINS
    }


def training_rows(
    truth: Mapping[str, Record], reports: Mapping[str, Record | None]
) -> Iterator[dict[str, Any]]:
    """Yield a row for each reported effect.

    A row has ``case``, ``family``, ``effect``, ``joint``, every number of its entry, and ``right``.
    Numbers deeper in an entry have dotted names, such as ``parameters.level.stderr``; lists are
    left out.
    """
    for name, record in truth.items():
        report = reports.get(name)
        for effect in report["effects"] if report else ():
            numbers = {key: value for key, value in _numbers(effect) if key != "joint"}
            head = {
                "case": name,
                "family": record["family"],
                "effect": effect["effect"],
                "joint": effect["joint"],
            }
            kept = {
                "joints": record.get(
                    "joints", len(report["gap"]["noise_floor"]) if report else None
                )
            }
            yield head | kept | numbers | {"right": int(is_right(record, report or {}, effect))}


def fitted(
    rows: Iterable[tuple[str, Mapping[str, float], bool]],
    strength: float = STRENGTH,
    only: Sequence[str] = (),
    held: Mapping[str, float] | None = None,
) -> dict[str, float]:
    """Return weights of :mod:`jaxidl.gap.result.calibration`, by ridge logistic regression.

    Args:
        rows: family, signs and whether it is right, of each finding. Families have equal weights,
            except for ``SELDOM``.
        strength: of the ridge on the weights.
        only: signs to fit. Default: all, and the constant.
        held: weights of the others.
    """
    every = list(rows)
    x = np.array([[signs[name] for name in SIGNS] + [1.0] for _, signs, _ in every])
    y = np.array([right for _, _, right in every], float)
    counts = Counter(family for family, _, _ in every)
    weight = np.array(
        [
            SELDOM.get(family, 1.0) * len(every) / len(counts) / counts[family]
            for family, _, _ in every
        ]
    )

    def loss(w: np.ndarray) -> tuple[float, np.ndarray]:
        z = x @ w
        slope = x.T @ (weight * (1.0 / (1.0 + np.exp(-z)) - y))
        ridge = strength * np.append(w[:-1], 0.0)
        return float(weight @ (np.logaddexp(0.0, z) - y * z) + 0.5 * ridge @ w), slope + ridge

    ways = {1: (0.0, None), -1: (None, 0.0), 0: (None, None)}
    names = (*SIGNS, "constant")
    bounds = [
        ways[SIGNS.get(name, 0)] if not only or name in only else ((held or {}).get(name, 0.0),) * 2
        for name in names
    ]
    best = minimize(loss, np.zeros(len(names)), jac=True, method="L-BFGS-B", bounds=bounds).x
    return dict(zip(names, best.tolist(), strict=True))


def _numbers(entry: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, float]]:
    for key, value in entry.items():
        if isinstance(value, Mapping):
            yield from _numbers(value, f"{before}{key}.")
        elif isinstance(value, bool | int | float):
            yield f"{before}{key}", float(value)
