"""The score of a workflow on the benchmark.

It consists of pure functions of the truth and of the reports, both by the cases' identities.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from jaxidl.gap.benchmark import judge, robot_judge
from jaxidl.gap.benchmark.calibration import calibration
from jaxidl.gap.benchmark.imitable import IMITABLE
from jaxidl.gap.benchmark.judge import Record

Pair = tuple[Record, Record | None]  # truth and report of a case
Z95 = 1.959963984540054


def score(truth: Mapping[str, Record], reports: Mapping[str, Record | None]) -> dict[str, Any]:
    """Return all results of the benchmark.

    Shares are dictionaries as :func:`share` returns them. A missing report is a wrong one.

    Args:
        truth: what :func:`jaxidl.gap.benchmark.cases.truth` returns for each case that counts.
        reports: the ``report.json`` of each case.
    """
    families: dict[str, list[Pair]] = {
        name: [] for name in ("single", "none", "outside", "pair", "robot", "worn")
    }
    for name, record in truth.items():
        families[record["family"]].append((record, reports.get(name)))
    return {
        "cases": {name: len(pairs) for name, pairs in families.items()},
        "failed": sum(report is None for pairs in families.values() for _, report in pairs),
        "singles": _singles(families["single"]),
        "none": _none(families["none"]),
        "outside": _outside(families["outside"]),
        "pairs": _pairs(families["pair"]),
        "robots": _robots(families["robot"]),
        "worn": _robots(families["worn"]),
        "calibration": {name: calibration(pairs, share) for name, pairs in families.items()},
        "parameters": _parameters(families["single"]),
        "gap_removed": _gap_removed(families),
        "confusion": confusion(families["single"] + families["none"] + families["outside"]),
    }


def share(credits: Iterable[float]) -> dict[str, float]:
    """Return the ``share`` of right answers among ``n``.

    ``low`` to ``high`` is Wilson's 95 % interval; half credits count half.
    """
    values = list(credits)
    n, k = len(values), float(sum(values))
    if not n:
        return {"share": math.nan, "n": 0, "low": 0.0, "high": 1.0}
    p, z2 = k / n, Z95**2
    centre = (p + z2 / (2 * n)) / (1 + z2 / n)
    half = Z95 * math.sqrt(p * (1 - p) / n + z2 / (4 * n * n)) / (1 + z2 / n)
    return {"share": p, "n": n, "low": max(0.0, centre - half), "high": min(1.0, centre + half)}


def quartiles(values: Iterable[float]) -> dict[str, float | int]:
    """Return ``n``, ``q25``, ``median`` and ``q75`` of the values; NaN if there are none."""
    array = np.array(list(values), float)
    low, middle, high = np.quantile(array, [0.25, 0.5, 0.75]) if len(array) else [math.nan] * 3
    return {"n": len(array), "q25": float(low), "median": float(middle), "q75": float(high)}


def confusion(pairs: Iterable[Pair]) -> dict[str, dict[str, int]]:
    """Return how often each hidden effect (rows) is given which name (columns).

    Rows include ``"none"`` and ``"outside"``; for columns see :func:`judge.column`.
    """
    counts: dict[str, dict[str, int]] = {}
    for truth, report in pairs:
        row = counts.setdefault(truth["hidden"][0]["effect"] if truth["hidden"] else "none", {})
        name = judge.column(truth, report)
        row[name] = row.get(name, 0) + 1
    return counts


def _singles(pairs: list[Pair]) -> dict[str, Any]:
    """Return ``right`` overall and by severity, mechanism and effect.

    ``right_or_tied`` gives full credit for an ambiguity that is physical.
    """
    credits = [judge.single_credit(truth["hidden"][0], report) for truth, report in pairs]
    rows = list(zip((truth for truth, _ in pairs), credits, strict=True))
    in_full = (_in_full(truth, truth["hidden"][0], credit) for truth, credit in rows)
    return {
        "right": share(credits),
        "right_or_tied": share(in_full),
        "by_severity": _by(rows, lambda truth: truth["severity"]),
        "by_mechanism": _by(rows, lambda truth: truth["mechanism"]),
        "by_effect": _by(rows, lambda truth: truth["hidden"][0]["effect"]),
        "verdicts": _verdicts(pairs),
    }


def _in_full(truth: Record, hidden: Record, credit: float) -> float:
    """Return the credit, in full for an ambiguity that is physical."""
    return 1.0 if credit == 0.5 and judge.tied(hidden, truth["mechanism"]) else credit


def _by(
    rows: list[tuple[Record, float]], group: Callable[[Record], str]
) -> dict[str, dict[str, float]]:
    names = dict.fromkeys(group(truth) for truth, _ in rows)
    return {name: share(credit for truth, credit in rows if group(truth) == name) for name in names}


def _verdicts(pairs: list[Pair]) -> dict[str, int]:
    verdicts = [report["verdict"] if report else "failed" for _, report in pairs]
    return {name: verdicts.count(name) for name in dict.fromkeys(verdicts)}


def _none(pairs: list[Pair]) -> dict[str, Any]:
    """Return ``false_alarm`` and ``not_nothing`` of cases where nothing is hidden.

    The former is that an effect is named, the latter any verdict other than nothing missing.
    """
    return {
        "false_alarm": share(float(bool(judge.named(report))) for _, report in pairs),
        "not_nothing": share(
            float(report is None or report["verdict"] != "nothing_missing") for _, report in pairs
        ),
        "verdicts": _verdicts(pairs),
    }


def _outside(pairs: list[Pair]) -> dict[str, Any]:
    """Return ``misnamed``, overall and by kind.

    It means that an effect of the catalogue is named with confidence for one outside it.
    ``imitable`` is that of the kinds that follow from the state.
    """
    rows = [(truth, float(judge.misnamed(report))) for truth, report in pairs]
    return {
        "misnamed": share(wrong for _, wrong in rows),
        "imitable": share(
            wrong for truth, wrong in rows if truth["hidden"][0]["parameters"]["kind"] in IMITABLE
        ),
        "by_kind": _by(rows, lambda truth: truth["hidden"][0]["parameters"]["kind"]),
        "by_severity": _by(rows, lambda truth: truth["severity"]),
        "verdicts": _verdicts(pairs),
    }


def _pairs(pairs: list[Pair]) -> dict[str, Any]:
    """Return ``both``, ``found`` and ``exact`` of pairs.

    ``both``: both effects found, the mean of their credits but 0 if one is missed; ``found``: share
    of all effects, and ``found_or_tied`` with full credit for an ambiguity that is physical;
    ``exact``: both are named and no other.
    """
    credits = [judge.pair_credits(truth["hidden"], report) for truth, report in pairs]
    rows = [
        (truth, float(np.mean(c)) if min(c) > 0 else 0.0)
        for (truth, _), c in zip(pairs, credits, strict=True)
    ]
    exact = [
        {judge.key(h) for h in truth["hidden"]} == set(judge.named(report))
        for truth, report in pairs
    ]
    return {
        "both": share(credit for _, credit in rows),
        "found": share(credit for both in credits for credit in both),
        "found_or_tied": share(
            _in_full(truth, hidden, credit)
            for (truth, _), both in zip(pairs, credits, strict=True)
            for hidden, credit in zip(truth["hidden"], both, strict=True)
        ),
        "exact": share(map(float, exact)),
        "by_mechanism": _by(rows, lambda truth: truth["mechanism"]),
        "verdicts": _verdicts(pairs),
    }


def _robots(pairs: list[Pair]) -> dict[str, Any]:
    """Return ``precision`` and ``recall`` of whole robots.

    ``precision`` is that of what is named with confidence, ``recall`` that of hidden effects of at
    least 3 % of a joint's command; both also by effect. Also return ``parameters`` of the names
    that are right, and ``links``: the remaining errors of the links.
    """
    named = [
        (e, robot_judge.right(t, r, e), t, r)
        for t, r in pairs
        if r
        for e in r["effects"]
        if _sure(e)
    ]
    hidden = [
        (h, robot_judge.found(t, r, h))
        for t, r in pairs
        for h in t["hidden"]
        if robot_judge.worth(h) >= robot_judge.WORTH
    ]
    errors = [(e["effect"], robot_judge.parameter_errors(t, r, e)) for e, ok, t, r in named if ok]
    return {
        "precision": share(float(ok) for _, ok, *_ in named),
        "recall": share(float(ok) for _, ok in hidden),
        "precision_by_effect": _by(
            [(e, float(ok)) for e, ok, *_ in named], lambda effect: effect["effect"]
        ),
        "recall_by_effect": _by(
            [(h, float(ok)) for h, ok in hidden], lambda effect: effect["effect"]
        ),
        "names_of_a_robot": quartiles(sum(map(_sure, r["effects"])) for _, r in pairs if r),
        "parameters": _summary(errors),
        "links": quartiles(robot_judge.link_error(t, r) for t, r in pairs),
        "verdicts": _verdicts(pairs),
    }


def _sure(effect: Record) -> bool:
    return judge.confidence(effect) >= judge.CONFIDENT


def _parameters(pairs: list[Pair]) -> dict[str, Any]:
    """Return relative errors where a single effect is named right.

    They are those of all parameters, by effect and parameter, with the correctness of their
    standard errors.
    """
    errors: list[tuple[str, dict[str, tuple[float, list[float]]]]] = []
    for truth, report in pairs:
        hidden = truth["hidden"][0]
        if report is not None and judge.single_credit(hidden, report) == 1:
            effect = next((e for e in report["effects"] if judge.key(e) == judge.key(hidden)), None)
            if effect is not None:  # named itself, not as the sum of others
                errors.append(
                    (hidden["effect"], judge.parameter_errors(hidden, effect, truth["mechanism"]))
                )
    return _summary(errors)


def _summary(errors: list[tuple[str, dict[str, tuple[float, list[float]]]]]) -> dict[str, Any]:
    """Return quartiles of relative errors, overall and by effect.

    Also return the share of true values within two standard errors.
    """
    grouped: dict[str, dict[str, list[float]]] = {}
    within: dict[str, list[float]] = {}
    for effect, found in errors:
        for name, (error, deviations) in found.items():
            grouped.setdefault(effect, {}).setdefault(name, []).append(error)
            within.setdefault(effect, []).extend(float(d <= 2) for d in deviations)
    return {
        "all": quartiles(
            e for parts in grouped.values() for values in parts.values() for e in values
        ),
        "by_effect": {
            effect: {name: quartiles(values) for name, values in parts.items()}
            for effect, parts in grouped.items()
        },
        "within_two_stderr": share(ok for values in within.values() for ok in values),
        "within_two_stderr_by_effect": {
            effect: share(values) for effect, values in within.items() if values
        },
    }


def _gap_removed(families: Mapping[str, list[Pair]]) -> dict[str, Any]:
    """Return the share of the excess held-out gap removed, where something is named.

    It is given for singles, those of them named right, and pairs.
    """
    values = {
        name: [judge.removed(*pair) for pair in families[name]] for name in ("single", "pair")
    }
    right = [
        judge.single_credit(truth["hidden"][0], report) == 1 for truth, report in families["single"]
    ]
    values["single_right"] = [
        v for v, is_right in zip(values["single"], right, strict=True) if is_right
    ]
    return {name: quartiles(v for v in found if v is not None) for name, found in values.items()}
