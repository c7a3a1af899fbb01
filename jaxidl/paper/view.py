"""What claims are made of: averages of a results file, seed by seed."""

from typing import Any

import xarray as xr

LAST = 5  # executions at the end that count as "final"


class View:
    """A results file seen through means or, ``typical``, through medians over settings; diverged
    iterations left out.
    """

    def __init__(self, data: xr.Dataset, typical: bool):
        self.data, self.typical = data, typical

    @property
    def noises(self) -> tuple[float, float]:
        """Lowest and highest noise [m]. Raises KeyError if there is but one."""
        low, high = float(self.data.noise.min()), float(self.data.noise.max())
        if low == high:
            raise KeyError("noise")
        return low, high

    def over(self, runs: xr.DataArray, keep: tuple[str, ...] = ("seed",)) -> xr.DataArray:
        """Mean or median over all dims but ``keep``."""
        dims = [dim for dim in runs.dims if dim not in keep]
        return runs.median(dims) if self.typical else runs.mean(dims)

    def runs(self, variable: str = "q_error", **where: Any) -> xr.DataArray:
        """The runs at the given values, NaN where diverged. Raises KeyError if the file lacks a
        value.
        """
        chosen = self.data[[variable, "finite"]].sel(**where)
        return chosen[variable].where(chosen["finite"])

    def curve(self, variable: str = "q_error", **where: Any) -> xr.DataArray:
        """(seed, iteration) average over all settings that ``where`` leaves open."""
        return self.over(self.runs(variable, **where), ("seed", "iteration"))

    def start(self, **where: Any) -> xr.DataArray:
        """(seed,) average in execution 0."""
        return self.curve(**where).isel(iteration=0)

    def end(self, variable: str = "q_error", **where: Any) -> xr.DataArray:
        """(seed,) average over the last executions."""
        return self.over(self.last(self.curve(variable, **where)))

    def last(self, runs: xr.DataArray) -> xr.DataArray:
        """The last executions. Raises KeyError if there are not enough to speak of an end."""
        if runs.sizes["iteration"] <= LAST:
            raise KeyError("iteration")
        return runs.isel(iteration=slice(-LAST, None))

    def ends(self, **where: Any) -> xr.DataArray:
        """(..., seed) final error of each run: its mean over the last executions."""
        return self.last(self.runs(**where)).mean("iteration")

    def lowest_before(self, **where: Any) -> xr.DataArray:
        """(seed,) lowest average of one execution before the last ones."""
        return self.curve(**where).isel(iteration=slice(None, -LAST)).min("iteration")

    def gain(self, **where: Any) -> xr.DataArray:
        """(seed,) final / first error."""
        return self.end(**where) / self.start(**where)

    def area(self, **where: Any) -> xr.DataArray:
        """(seed,) average over all executions after the first: small when learning is fast."""
        return self.over(self.curve(**where).isel(iteration=slice(1, None)))

    def rises(self, **where: Any) -> xr.DataArray:
        """(seed,) how erratic: what a run's log error rises from one execution to the next, falls
        counting zero.

        Averaged over the executions of the second half, so that it does not matter when a rise
        comes.
        """
        late = self.runs(**where).isel(iteration=slice(self.data.sizes["iteration"] // 2, None))
        steps = xr.ufuncs.log(late).diff("iteration")
        return self.over(steps.clip(min=0.0).mean("iteration"))

    def unreliable(self, **where: Any) -> xr.DataArray:
        """(seed,) the final / first error that one run in ten exceeds: small when a source
        converges in all settings.
        """
        ends = self.ends(**where) / self.runs(**where).isel(iteration=0)
        return ends.quantile(0.9, [dim for dim in ends.dims if dim != "seed"]).drop_vars("quantile")

    def spread(self, **where: Any) -> xr.DataArray:
        """(seed,) standard deviation, or interquartile range, of the log final error over
        settings.
        """
        runs = xr.ufuncs.log(self.ends(**where))
        dims = [dim for dim in runs.dims if dim != "seed"]
        if self.typical:
            # in units of a normal's deviation
            return (runs.quantile(0.75, dims) - runs.quantile(0.25, dims)) / 1.349
        return runs.std(dims)

    def paired(self, source: str, other: str, **where: Any) -> xr.DataArray:
        """(seed,) final error of one source over another one's in the same setting: geometric mean,
        or median, over settings.
        """
        ends = self.ends(**where)
        ratio = ends.sel(source=source, drop=True) / ends.sel(source=other, drop=True)
        return xr.ufuncs.exp(self.over(xr.ufuncs.log(ratio)))

    def not_best(self, source: str, **where: Any) -> xr.DataArray:
        """(seed,) share of settings in which ``source`` does not have the lowest final error of the
        three.
        """
        if self.data.sizes["source"] < 3:
            raise KeyError("source")
        ends = self.ends(**where)
        beaten = ends.sel(source=source) > ends.min("source")
        return beaten.mean([dim for dim in beaten.dims if dim != "seed"])
