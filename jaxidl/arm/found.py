"""What the gap workflow found of what is hidden in the arm, effect by effect, and why not the
rest.
"""

from typing import Any, NamedTuple

import numpy as np

from jaxidl.files import markdown
from jaxidl.gap.result.diagnosis import SURE

# noise floors, of which the least is 0.3 % of the command: no simulation is believed to be better
TOO_SMALL = 2.0
CLOSE = 0.2  # of a size: what is named within it is found

STATES = {
    "nothing": "nothing hidden, nothing named",
    "found": "named, size within 20 %",
    "off": "named, another size",
    "equal": "among equal explanations",
    "small": "too small for this log",
    "possible": "suspected, not certain",
    "missed": "missed",
    "doubt": "suspected, not hidden",
    "extra": "named, but not hidden",
}


class Judged(NamedTuple):
    """One effect on one joint, or on the whole arm (None)."""

    effect: str
    joint: int | None
    hidden: float | None  # size, in the effect's unit; None: not hidden
    found: float | None  # None: neither named nor suspected
    state: str  # see ``STATES``
    why: str


def judge(report: dict[str, Any]) -> list[Judged]:
    """Judge every effect that is hidden or named, of a report with its ``truth``.

    The truth is that of :func:`jaxidl.arm.hidden.find`.
    """
    hidden = {(row["effect"], row["joint"]): row for row in report["truth"]}
    sizes = {(e["effect"], e["joint"]): size_of(e) for e in report["effects"]}
    sure = {(e["effect"], e["joint"]) for e in report["effects"] if e["confidence"] >= SURE}
    ties = [[(c["effect"], c["joint"]) for c in a["candidates"]] for a in report["ambiguous"]]
    rows = []
    for key, row in hidden.items():
        tied = [_words(x) for tie in ties if key in tie for x in tie if x != key]
        found, why = sizes.get(key), f"as good an explanation: {', '.join(tied)}" if tied else ""
        if key in sure:
            assert found is not None
            state = "found" if abs(found - row["size"]) <= CLOSE * abs(row["size"]) else "off"
        elif tied:
            state = "equal"
        elif found is not None:
            state = "possible"
        elif row["visible"] < TOO_SMALL:
            state, why = "small", f"its torque is {row['visible']:.1f} noise floors"
        else:
            state, why = (
                "missed",
                (
                    f"its torque is {row['visible']:.1f} noise floors, but others named there take"
                    " its place"
                ),
            )
        if key[0] == "actuator_delay" and found is None:
            why += "; one sampling interval: where within it a command acts, a log does not say"
        rows.append(Judged(*key, row["size"], found, state, why))
    wrong = [
        (key, size, "extra" if key in sure else "doubt")
        for key, size in sizes.items()
        if key not in hidden
    ]
    return rows + [Judged(*key, None, size, state, "") for key, size, state in wrong]


def size_of(effect: dict[str, Any]) -> float:
    """Return one number for a named effect: its first parameter.

    Of a ripple the amplitude, of a link the mass; a rotor has none.
    """
    values = {name: p["value"] for name, p in effect["parameters"].items()}
    if effect["effect"] == "torque_ripple":
        return float(np.hypot(values["sine"], values["cosine"]))
    if effect["effect"] == "inertia_error":
        return float(values.get("mass", 0.0))
    return float(np.ravel(next(iter(values.values())))[0])


def as_text(report: dict[str, Any]) -> str:
    """Return the judgement as a Markdown table."""
    cells = []
    for row in judge(report):
        joint = "" if row.joint is None else row.joint + 1
        sizes = ("" if x is None else f"{x:.3g}" for x in (row.hidden, row.found))
        cells.append((row.effect, joint, *sizes, STATES[row.state], row.why))
    return markdown(("effect", "joint", "hidden", "found", "", "why"), cells)


def _words(key: tuple[str, int | None]) -> str:
    return key[0] if key[1] is None else f"{key[0]} on joint {key[1] + 1}"
