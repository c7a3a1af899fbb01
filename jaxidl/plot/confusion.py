"""The benchmark's confusion matrix."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jaxidl.plot.style import house_style, save

# placed after the effects, where they occur
OTHERS = ("none", "outside", "pair", "ambiguous", "unexplained", "nothing", "failed")


def plot_confusion(score: dict[str, Any]) -> Figure:
    """Plot hidden effects (rows) against the names given to them (columns).

    Shown are numbers of cases, coloured by their share of the row.
    """
    matrix = score["confusion"]
    rows = _ordered(matrix)
    columns = _ordered(
        {name for row in matrix.values() for name in row} | (set(rows) - {"outside"})
    )
    counts = np.array([[matrix[r].get(c, 0) for c in columns] for r in rows], float)
    shares = counts / np.maximum(counts.sum(1, keepdims=True), 1)
    with house_style():
        figure = Figure(
            figsize=(0.36 * len(columns) + 3.2, 0.3 * len(rows) + 3.0), layout="constrained"
        )
        axes = figure.add_subplot()
        axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
        for (i, j), count in np.ndenumerate(counts):
            if count:
                axes.text(
                    j,
                    i,
                    f"{count:.0f}",
                    ha="center",
                    va="center",
                    fontsize=7,
                    color="white" if shares[i, j] > 0.6 else "black",
                )
        axes.set_xticks(
            range(len(columns)),
            [c.replace("_", " ") for c in columns],
            rotation=60,
            ha="right",
            fontsize=7,
        )
        axes.set_yticks(range(len(rows)), [r.replace("_", " ") for r in rows], fontsize=7)
        axes.set_xlabel("named")
        axes.set_ylabel("hidden")
        axes.grid(False)
        right, none = score["singles"]["right"], score["none"]["false_alarm"]
        title = f"single effects right: {_percent(right)}; false alarms: {_percent(none)}"
        robots = score.get("robots", {}).get("precision", {"n": 0})
        if robots["n"]:
            title += (
                f"\nwhole robots: precision {_percent(robots)}; recall"
                f" {_percent(score['robots']['recall'])}"
            )
        axes.set_title(title, fontsize=9)
    return figure


def _percent(share: dict[str, float]) -> str:
    if not share["n"]:
        return "none tried"
    return (
        f"{100 * share['share']:.1f} % of {share['n']} [{100 * share['low']:.1f},"
        f" {100 * share['high']:.1f}]"
    )


def _ordered(names: Any) -> list[str]:
    return sorted(
        names, key=lambda name: (name in OTHERS, OTHERS.index(name) if name in OTHERS else 0, name)
    )


def write_confusion(score: dict[str, Any], out: Path) -> list[Path]:
    """Write confusion.png and confusion.pdf into ``out``.

    There is no matrix, and nothing is written, if all cases are whole robots.
    """
    if not score["confusion"]:
        return []
    with house_style():
        return save(plot_confusion(score), out, "confusion")
