"""The share of right findings of the benchmark, by their reported confidence."""

from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from jaxidl.plot.style import house_style, save

MARKS = {
    "single": ("o", "single effects"),
    "pair": ("s", "pairs"),
    "robot": ("^", "whole robots"),
    "worn": ("v", "worn robots"),
    "outside": ("x", "outside the catalogue"),
}


def plot_reliability(score: dict[str, Any]) -> Figure:
    """Plot the share of right names over bins of confidence, for each family of cases.

    Bars are 95 % intervals; numbers count names.
    """
    with house_style():
        figure = Figure(figsize=(7.2, 3.6), layout="constrained")
        axes = figure.add_subplot()
        bins = list(next(iter(score["calibration"].values())))
        edges = [tuple(float(x) for x in name.split("-")) for name in bins]
        for place, (low, high) in enumerate(edges):
            axes.fill_between(
                [place - 0.45, place + 0.45],
                low,
                high,
                color="0.9",
                label=None if place else "as reported",
            )
        shown = [
            name
            for name in MARKS
            if any(b["n"] for b in score["calibration"].get(name, {}).values())
        ]
        for k, name in enumerate(shown):
            mark, label = MARKS[name]
            points = [
                (p, score["calibration"][name][b])
                for p, b in enumerate(bins)
                if score["calibration"][name][b]["n"]
            ]
            x = [p + 0.2 * (k - (len(shown) - 1) / 2) for p, _ in points]
            y = [b["share"] for _, b in points]
            reach = [
                [max(b["share"] - b["low"], 0.0) for _, b in points],
                [max(b["high"] - b["share"], 0.0) for _, b in points],
            ]
            axes.errorbar(x, y, reach, fmt=mark, capsize=2, markersize=5, linewidth=1, label=label)
            for at, (_, b) in zip(x, points, strict=True):
                axes.annotate(
                    f"{b['n']}", (at, b["share"]), (4, 3), textcoords="offset points", fontsize=6.5
                )
        axes.set_xticks(range(len(bins)), [name.replace("-", " to ") for name in bins])
        axes.set_xlim(-0.5, len(bins) - 0.5)
        axes.set_ylim(-0.02, 1.05)
        axes.set_xlabel("reported confidence")
        axes.set_ylabel("share that is right")
        axes.legend(fontsize=7.5, loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    return figure


def write_reliability(score: dict[str, Any], out: Path) -> list[Path]:
    """Write reliability.png and reliability.pdf into ``out``."""
    with house_style():
        return save(plot_reliability(score), out, "reliability")
