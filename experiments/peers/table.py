"""The answers in ``figures/peers.json`` as Markdown: one table for each case, one row for each
peer.
"""

from collections import defaultdict
from typing import Any

KINDS = ("viscous", "dry", "rotor")
CERTAIN = 0.8  # what is named with less confidence is counted, not written out


def short(x: float | None) -> str:
    return "-" if x is None else f"{x:.3g}"


def named(answer: dict[str, Any]) -> str:
    """What a peer names by itself, by kind: the joints of it, or its value where it concerns the
    whole robot.
    """
    if "named" not in answer:
        return "all it was given"
    sure = [n for n in answer["named"] if n.get("confidence") is None or n["confidence"] >= CERTAIN]
    by_kind: dict[str, list[str]] = defaultdict(list)
    for n in sure:
        by_kind[n["effect"].replace("_", " ")].append("" if n["joint"] is None else str(n["joint"]))
    words = [
        f"{kind} {','.join(j for j in joints if j)}".strip() for kind, joints in by_kind.items()
    ]
    unsure = len(answer["named"]) - len(sure)
    return (
        "; ".join([*words, *([f"{unsure} with confidence < {CERTAIN}"] if unsure else [])])
        or "nothing"
    )


def estimated(answer: dict[str, Any]) -> str:
    """Friction, rotor inertia and payload, joint by joint."""
    values = answer.get("estimated", {})
    words = [
        f"{kind} {', '.join(map(short, values[kind]))}"
        for kind in KINDS
        if any(x is not None for x in values.get(kind, []))
    ]
    if values.get("payload") is not None:
        words.append(
            f"**payload {values['payload']:.2f} kg** at"
            f" ({', '.join(f'{x:.3f}' for x in values['payload_centre'])}) m"
        )
    return "; ".join(words) or "-"


def table(found: dict[str, Any]) -> str:
    """Markdown of all answers."""
    parts = []
    for case, about in found["cases"].items():
        parts += [
            f"### {case} (low-pass {about['low_pass_hz']:g} Hz)\n",
            "| peer | error on the last 30 %, by joint [%] | values | named | CPU s | lines |",
            "| --- | --- | --- | --- | --- | --- |",
        ]
        for peer in found["peers"].values():
            answer = peer["answers"].get(case)
            if answer is None:
                continue
            if answer["status"] != "ran":
                parts.append(
                    f"| {peer['title']} | {answer['status']}: {answer['reason']} | | | | |"
                )
                continue
            error = ", ".join(f"{100.0 * e:.1f}" for e in answer["held_out"])
            cells = [
                peer["title"],
                error,
                estimated(answer),
                named(answer),
                f"{answer['cpu_seconds']:.1f}",
                str(peer["lines"]),
            ]
            parts.append(f"| {' | '.join(cells)} |")
        parts.append("")
    return "\n".join(parts)
