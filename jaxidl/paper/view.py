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
        self._finite: dict[str, xr.DataArray] = {}  # by variable, NaN where diverged

    @property
    def noises(self) -> tuple[float, float]:
        """Lowest and highest noise [m]. Raises KeyError if there is but one."""
        low, high = float(self.data.noise.min()), float(self.data.noise.max())
        if low == high:
            raise KeyError("noise")
        return low, high

    def over(self, runs: xr.DataArray, keep: tuple[str, ...] = ("seed",)) -> xr.DataArray:
        """Return the mean or median over all dims but ``keep``."""
        dims = [dim for dim in runs.dims if dim not in keep]
        return runs.median(dims) if self.typical else runs.mean(dims)

    def runs(self, variable: str = "q_error", **where: Any) -> xr.DataArray:
        """Return the runs at the given values, NaN where diverged.

        Raises KeyError if the file lacks a value.
        """
        if variable not in self._finite:
            self._finite[variable] = self.data[variable].where(self.data["finite"])
        return self._finite[variable].sel(**where)

    def curve(self, variable: str = "q_error", **where: Any) -> xr.DataArray:
        """Return the (seed, iteration) average over all settings that ``where`` leaves open."""
        return self.over(self.runs(variable, **where), ("seed", "iteration"))

    def start(self, **where: Any) -> xr.DataArray:
        """Return the (seed,) average in execution 0."""
        return self.curve(**where).isel(iteration=0)

    def end(self, variable: str = "q_error", **where: Any) -> xr.DataArray:
        """Return the (seed,) average over the last executions."""
        return self.over(self.last(self.curve(variable, **where)))

    def last(self, runs: xr.DataArray) -> xr.DataArray:
        """Return the last executions.

        Raises KeyError if there are not enough to speak of an end.
        """
        if runs.sizes["iteration"] <= LAST:
            raise KeyError("iteration")
        return runs.isel(iteration=slice(-LAST, None))

    def ends(self, **where: Any) -> xr.DataArray:
        """Return the (..., seed) final error of each run: its mean over the last executions."""
        return self.last(self.runs(**where)).mean("iteration")

    def lowest_before(self, **where: Any) -> xr.DataArray:
        """Return the (seed,) lowest average of one execution before the last ones."""
        return self.curve(**where).isel(iteration=slice(None, -LAST)).min("iteration")

    def improvement(self, **where: Any) -> xr.DataArray:
        """Return the (seed,) ratio final / first error."""
        return self.end(**where) / self.start(**where)

    def area(self, **where: Any) -> xr.DataArray:
        """Return the (seed,) average over executions after the first: small if learning is fast."""
        return self.over(self.curve(**where).isel(iteration=slice(1, None)))

    def rises(self, **where: Any) -> xr.DataArray:
        """Return (seed,) how erratic runs are: the rise of the log error between executions.

        Falls count as zero.

        Averaged over the executions of the second half, so that it does not matter when a rise
        comes.
        """
        late = self.runs(**where).isel(iteration=slice(self.data.sizes["iteration"] // 2, None))
        steps = xr.ufuncs.log(late).diff("iteration")
        return self.over(steps.clip(min=0.0).mean("iteration"))

    def unreliable(self, **where: Any) -> xr.DataArray:
        """Return the (seed,) ratio final / first error that one run in ten exceeds.

        It is small when a source converges in all settings.
        """
        ends = self.ends(**where) / self.runs(**where).isel(iteration=0)
        return ends.quantile(0.9, [dim for dim in ends.dims if dim != "seed"]).drop_vars("quantile")

    def spread(self, **where: Any) -> xr.DataArray:
        """Return the (seed,) spread of the log final error over settings.

        The standard deviation, or for medians the interquartile range in its units.
        """
        runs = xr.ufuncs.log(self.ends(**where))
        dims = [dim for dim in runs.dims if dim != "seed"]
        if self.typical:
            # in units of a normal's deviation
            return (runs.quantile(0.75, dims) - runs.quantile(0.25, dims)) / 1.349
        return runs.std(dims)

    def paired(self, source: str, other: str, **where: Any) -> xr.DataArray:
        """Return the (seed,) ratio of two sources' final errors, setting by setting.

        The geometric mean, or the median, over settings.
        """
        ends = self.ends(**where)
        ratio = ends.sel(source=source, drop=True) / ends.sel(source=other, drop=True)
        return xr.ufuncs.exp(self.over(xr.ufuncs.log(ratio)))

    def not_best(self, source: str, **where: Any) -> xr.DataArray:
        """Return the (seed,) share of settings in which ``source`` is not the best of the three."""
        if self.data.sizes["source"] < 3:
            raise KeyError("source")
        ends = self.ends(**where)
        beaten = ends.sel(source=source) > ends.min("source")
        return beaten.mean([dim for dim in beaten.dims if dim != "seed"])
