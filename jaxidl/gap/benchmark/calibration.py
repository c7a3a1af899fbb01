"""How often the effects of reports are right, by the confidence that they are reported with."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from jaxidl.gap.benchmark import judge, robot_judge
from jaxidl.gap.benchmark.judge import Record

BINS = ((0.0, 0.5), (0.5, 0.8), (0.8, 0.9), (0.9, 1.0))
"""Of confidence; each without its upper end but the last."""


def is_right(truth: Record, report: Record, effect: Record) -> bool:
    """Return whether an effect of a report is hidden there; for a whole robot by the equivalences of :mod:`.robot_judge`."""
    if truth["family"] == "robot":
        return robot_judge.right(truth, report, effect)
    hidden = {judge.key(h) for h in truth["hidden"]}
    beside = {(name, joint) for whole, joint in hidden for name in judge.COMPANIONS.get(whole, ())}
    return judge.key(effect) in hidden | beside


def calibration(
    pairs: Iterable[tuple[Record, Record | None]], share: Callable[[Iterable[float]], dict[str, float]]
) -> dict[str, dict[str, float]]:
    """Return the share right of the reported effects in each bin of confidence, ``"0.9-1.0"`` and so on."""
    rows = [(judge.confidence(e), float(is_right(t, r, e))) for t, r in pairs if r is not None for e in r["effects"]]
    last = BINS[-1]
    return {f"{low}-{high}": share(ok for c, ok in rows if low <= c and (c < high or (low, high) == last)) for low, high in BINS}


def training_rows(truth: Mapping[str, Record], reports: Mapping[str, Record | None]) -> Iterator[dict[str, Any]]:
    """Yield a row for each reported effect: ``case``, ``family``, ``effect``, ``joint``, every number of its entry, ``right``.

    Numbers deeper in an entry have dotted names, such as ``parameters.level.stderr``; lists are left out.
    """
    for name, record in truth.items():
        report = reports.get(name)
        for effect in report["effects"] if report else ():
            numbers = {key: value for key, value in _numbers(effect) if key != "joint"}
            head = {"case": name, "family": record["family"], "effect": effect["effect"], "joint": effect["joint"]}
            kept = {"joints": record.get("joints", len(report["gap"]["noise_floor"]) if report else None)}
            yield head | kept | numbers | {"right": int(is_right(record, report or {}, effect))}


def _numbers(entry: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, float]]:
    for key, value in entry.items():
        if isinstance(value, Mapping):
            yield from _numbers(value, f"{before}{key}.")
        elif isinstance(value, bool | int | float):
            yield f"{before}{key}", float(value)
