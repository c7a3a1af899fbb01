"""What an ablation found: the final error of every setting, over seeds, with intervals."""

import numpy as np
import xarray as xr

from jaxidl.errors import StoreError
from jaxidl.files import markdown
from jaxidl.jobs.statistics import geometric
from jaxidl.paper.runs import META, added
from jaxidl.paper.view import LAST

INNER = ("seed", "source", "iteration")  # dims that are within a panel


def final(data: xr.Dataset, variable: str) -> xr.DataArray:
    """Return a variable's mean over the last executions of each run.

    The last half where there are few executions; NaN for a run that diverged.
    """
    last = max(1, min(LAST, (data.sizes["iteration"] - 1) // 2))
    return (
        data[variable]
        .where(data["finite"])
        .isel(iteration=slice(-last, None))
        .mean("iteration", skipna=False)
    )


def axes(data: xr.Dataset) -> tuple[str, list[str]]:
    """Return the axis of the abscissa and the others with several values.

    The abscissa is the first axis that an ablation added, else the first numeric one.

    Raises:
        StoreError: if nothing is varied.
    """
    base = [
        str(dim)
        for dim in data["q_error"].dims
        if dim not in (*INNER, *added(data)) and data.sizes[dim] > 1
    ]
    # numbers first
    found = [*added(data), *sorted(base, key=lambda dim: dim in ("controller", "gain"))]
    if not found:
        raise StoreError(
            "results in which something varies",
            "one setting only",
            "run `jaxidl ablate --vary NAME VALUES …`",
        )
    return found[0], [dim for dim in found[1:] if data.sizes[dim] > 1]


def panels_of(data: xr.Dataset) -> list[dict[str, object]]:
    """Return every combination of values on the axes beside the abscissa: one panel each."""
    _, others = axes(data)
    index = np.ndindex(*(data.sizes[dim] for dim in others))
    return [{dim: data[dim].values[i] for dim, i in zip(others, at, strict=True)} for at in index]


def chosen(data: xr.Dataset, where: dict[str, object]) -> xr.Dataset:
    """Return the settings of one panel: dims (abscissa, seed, source, iteration)."""
    return (
        data[list(META)]
        .sel(where)
        .squeeze([d for d in data["q_error"].dims if d not in (*INNER, axes(data)[0], *where)])
    )


def rows(data: xr.Dataset) -> list[dict[str, object]]:
    """Return one row for each setting and source: final error and feedback over seeds."""
    first, _ = axes(data)
    out = []
    for where in panels_of(data):
        part = chosen(data, where)
        for value in part[first].values:
            for source in part.source.values:
                run = part.sel({first: value, "source": source})
                numbers = {
                    name: geometric(final(run, name).values)
                    for name in ("q_error", "feedback_applied")
                }
                out.append(
                    {
                        first: value,
                        **where,
                        "source": source,
                        **numbers,
                        "diverged": int((~run["finite"]).sum()),
                    }
                )
    return out


def as_markdown(data: xr.Dataset) -> str:
    """Return the rows as a Markdown table."""
    table = rows(data)
    units = {name: about.units for name, about in META.items()}
    heads = [f"{name} [{units[name]}]" if name in units else name for name in table[0]]
    return markdown(heads, ([_cell(value) for value in row.values()] for row in table))


def _cell(value: object) -> str:
    return "-" if value is None else f"{value:g}" if isinstance(value, float) else str(value)
