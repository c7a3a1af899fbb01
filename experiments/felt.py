"""What of the pushes in ``pushes.py`` is felt, and how often falsely."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from scipy.stats import binomtest

from jaxidl.arm.setup import ArmStudy
from jaxidl.learning.detector import calibrate
from jaxidl.systems.arm import JOINTS

AFTER = 0.1  # [s] after a push in which it may still be felt
ASKED = 60.0  # false alarms an hour
MARGINS = np.linspace(-2.0, 20.0, 221)  # standard deviations above the mean largest residual
LARGE, LONG = 3.0, 0.06  # [Nm], [s] from which on a push is called so
Pushes = dict[str, np.ndarray]  # joint, size, begin, end: (N,) each


def heights(residual: np.ndarray, earlier: np.ndarray) -> np.ndarray:
    """Return the height (N, T) of residuals (N, T, J) above the largest of earlier executions.

    In their standard deviations, of the joint that is highest.
    """
    largest = np.abs(earlier).max(1)
    return ((np.abs(residual) - largest.mean(0)) / largest.std(0, ddof=1)).max(-1)


def delays(height: np.ndarray, pushes: Pushes, margins: np.ndarray, dt: float) -> np.ndarray:
    """Return the delay (N, M) [s] with which each push is felt at each margin.

    NaN: not felt until ``AFTER`` its end, or there was an alarm before it.
    """
    steps, begin = np.arange(height.shape[1]), pushes["begin"][:, None]
    during = (steps >= begin) & (steps < pushes["end"][:, None] + AFTER / dt)
    # the first step at which the height so far exceeds the margin
    rising = np.maximum.accumulate(np.where(during, height, -np.inf), axis=1)
    first = np.stack([np.searchsorted(row, margins, "right") for row in rising])
    before = np.where(steps < begin, height, -np.inf).max(1)[:, None]
    missed = (first == len(steps)) | (before > margins)
    return np.where(missed, np.nan, dt * (first - begin))


def scored(seeds: list[tuple[ArmStudy, Pushes, dict[str, Any]]]) -> dict[str, Any]:
    """Return for each model its curve, and what it feels at the rate of alarms that was asked."""
    out = {}
    for model in seeds[0][2]["quiet"]:
        alarms, felt, asked = [], [], []
        for study, pushes, found in seeds:
            earlier, quiet, push = (found[kind][model] for kind in ("earlier", "quiet", "pushed"))
            alarms.append(heights(quiet, earlier).max(1)[:, None] > MARGINS)
            felt.append(np.isfinite(delays(heights(push, earlier), pushes, MARGINS, study.dt)))
            detector = calibrate(jnp.asarray(earlier), study.dt, ASKED)
            # one where a joint is above its threshold, minus one elsewhere
            signs = [
                2.0 * np.asarray(detector.feels(jnp.asarray(kind))) - 1.0 for kind in (quiet, push)
            ]
            asked.append(
                {
                    "alarms": signs[0].max(1) > 0.0,
                    "delay": delays(signs[1], pushes, np.zeros(1), study.dt)[:, 0],
                    "threshold": np.asarray(detector.threshold),
                    **pushes,
                }
            )
        hours = seeds[0][0].steps * seeds[0][0].dt / 3600.0  # of an execution
        out[model] = {
            "alarms_per_hour": np.concatenate(alarms).mean(0) / hours,
            "fewest": 1.0 / (hours * len(np.concatenate(alarms))),
            "felt": np.concatenate(felt).mean(0),
            **at_asked({k: np.concatenate([part[k] for part in asked]) for k in asked[0]}, hours),
        }
    return out


def counted(found: np.ndarray) -> list[float]:
    """Return Wilson's 95 % interval of the share of (N,) that is true."""
    near = binomtest(int(found.sum()), len(found)).proportion_ci(method="wilson")
    return [near.low, near.high]


def at_asked(found: dict[str, np.ndarray], hours: float) -> dict[str, Any]:
    """Return what is felt, and how often falsely, at the threshold of ``ASKED`` alarms an hour."""
    alarms, delay = found["alarms"], found["delay"]
    between = counted(alarms)
    large = np.abs(found["size"]) >= LARGE
    long = found["end"] - found["begin"] >= LONG / 1e-3
    felt = np.isfinite(delay)
    return {
        "false": alarms.mean() / hours,
        "false_between": [end / hours for end in between],
        "threshold": found["threshold"].reshape(-1, JOINTS).mean(0),
        "share": felt.mean(),
        "share_between": counted(felt),
        "share_of": {
            name: felt[which].mean()
            for name, which in {
                "small, short": ~large & ~long,
                "small, long": ~large & long,
                "large, short": large & ~long,
                "large, long": large & long,
            }.items()
            if which.any()
        },
        "delay": np.nanpercentile(delay, (50, 90)),
    }
