"""What the arm study says in numbers: falls, rises, and the ranking of the sources, with intervals
over seeds.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from jaxidl.files import markdown
from jaxidl.jobs.statistics import geometric

HEADINGS = (
    "accelerations",
    "encoder noise",
    "source",
    "after 1 iteration",
    "over all later ones",
    "against the best",
)


def interval(values: Sequence[float] | np.ndarray) -> tuple[float, float, float]:
    """Return the geometric mean of positive ``values`` (N,) and its 95 % interval; NaN where there
    are too few.
    """
    mean = geometric(np.asarray(values, float))
    return (
        (np.nan, np.nan, np.nan)
        if mean is None
        else (mean.value, *(mean.interval or (np.nan, np.nan)))
    )


def ranking(data: xr.Dataset) -> list[dict[str, Any]]:
    """Rank sources for each acceleration and noise, best first.

    By feedback after the first learning iteration and over all later ones.

    ``data`` has ``feedback_mse`` and ``finite`` over (acceleration, source, noise, seed,
    iteration). Seeds are paired: ``worse`` is the ratio to the best source with its interval;
    ``apart`` says whether that excludes 1. A source of which runs ``diverged`` comes last; the
    numbers are those of its other runs.
    """
    rows = []
    for acceleration in data.acceleration.values.tolist():
        for noise in data.noise.values.tolist():
            cells = data["feedback_mse"].sel(acceleration=acceleration, noise=noise)
            runs = cells.transpose("source", "seed", "iteration").values
            kept = (
                data["finite"]
                .sel(acceleration=acceleration, noise=noise)
                .all("iteration")
                .transpose("source", "seed")
                .values
            )
            first, later = runs[..., 1], np.exp(np.log(runs[..., 1:]).mean(-1))
            order = sorted(
                range(len(kept)), key=lambda k: ((~kept[k]).sum(), np.log(later[k][kept[k]]).sum())
            )
            for rank, k in enumerate(order):
                both = kept[k] & kept[order[0]]
                worse = interval(later[k][both] / later[order[0]][both])
                rows.append(
                    {
                        "acceleration": acceleration,
                        "noise": noise,
                        "rank": rank + 1,
                        "source": str(data.source.values[k]),
                        "diverged": int((~kept[k]).sum()),
                        "after_first": interval(first[k][kept[k]]),
                        "later": interval(later[k][kept[k]]),
                        "worse": worse,
                        "apart": bool(rank and worse[1] > 1.0),
                    }
                )
    return rows


def falls(data: xr.Dataset) -> list[dict[str, Any]]:
    """Return how far feedback falls by the first learning iteration, and its largest later rise.

    One row for every condition and source.

    ``rise`` is how far a later execution's geometric mean lies above the least one before it, as a
    ratio; ``spread`` the ratio of the seeds' largest to smallest value there: a rise within it is
    none. Runs that diverged are left out.
    """
    rows = []
    for acceleration in data.acceleration.values.tolist():
        for noise in data.noise.values.tolist():
            for source in data.source.values.tolist():
                cell = data.sel(acceleration=acceleration, noise=noise, source=source)
                runs = (
                    cell["feedback_mse"]
                    .transpose("seed", "iteration")
                    .values[cell["finite"].all("iteration").values]
                )
                if not len(runs):
                    continue
                mean = np.exp(np.log(runs).mean(0))[1:]
                rises = mean / np.minimum.accumulate(mean)
                worst = int(np.argmax(rises)) + 1
                rows.append(
                    {
                        "acceleration": acceleration,
                        "noise": noise,
                        "source": source,
                        "fall": float(1.0 - (runs[:, 1] / runs[:, 0]).max()),
                        "rise": float(rises.max()),
                        "spread": float(runs[:, worst].max() / runs[:, worst].min()),
                    }
                )
    return rows


def as_text(rows: list[dict[str, Any]]) -> str:
    """Return the ranking as a table for terminals and Markdown."""
    cells = []
    for row in rows:
        first, later, worse = (
            f"{m:.3g} [{a:.3g}, {b:.3g}]"
            for m, a, b in (row["after_first"], row["later"], row["worse"])
        )
        against = (
            "best" if row["rank"] == 1 else f"{worse} times" + ("" if row["apart"] else " (a tie)")
        )
        name = row["acceleration"].replace("_", "-")
        against += f"; {row['diverged']} of the runs diverged" if row["diverged"] else ""
        cells.append((name, f"{row['noise']:g} rad", row["source"], first, later, against))
    return markdown(HEADINGS, cells)
