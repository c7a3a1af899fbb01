"""The plan of a motion that makes the standard errors of all common effects small."""

from typing import Any, NamedTuple

import numpy as np

from jaxidl.backend import jit_quickly
from jaxidl.excite.limits import Limits
from jaxidl.excite.parameters import (
    Known,
    Parameter,
    common,
    independent,
    known,
    probed,
    scales,
    shapes,
    states,
    terms_of,
)
from jaxidl.excite.plan import Noise, Plan
from jaxidl.gap.evidence.additions import Drive
from jaxidl.systems.mjcf import Model

SHARE = 0.05  # share of a joint's torque that a coefficient of one size adds
ERROR = 0.02  # share of a joint's torque that a good model leaves, where nothing was measured
INDEPENDENT = 20.0  # independent samples of it per second, likewise
ENCODER = 1e-4  # noise of the encoders, likewise [m or rad]
TIMING = 0.005  # by how much later or earlier torques may be logged [s]
ALIGNMENT = "timing"


class Prepared(NamedTuple):
    """A plan, and the parameter that each of its columns stands for."""

    plan: Plan
    labels: tuple[Parameter, ...]  # (P,); timing of the joints last
    states: Drive  # random states within the limits
    notes: tuple[str, ...] = ()


def assumed_noise(torque: np.ndarray) -> Noise:
    """Return the noise assumed where none was measured, from torques (N, J) [N or Nm]."""
    effort = np.sqrt(np.mean(torque**2, 0))
    joints = torque.shape[1]
    least = 1e-3 * effort.max(initial=1e-9)
    return Noise(
        ERROR * np.maximum(effort, least), np.full(joints, INDEPENDENT), np.full(joints, ENCODER)
    )


def prepared(model: Model, limits: Limits, noise: Noise | None = None, **options: Any) -> Prepared:
    """Return the plan of a motion for the common effects' standard errors.

    Args:
        model: of J joints.
        limits: of execution; the plan keeps their margins.
        noise: as measured; default: a share of the torque.
        options: of the plan: criterion, seconds, kind, top, rate, earlier.
    """
    inside = limits.planned()
    know = known(model, inside)
    at = states(know, inside)
    torque = np.asarray(at.predicted)
    noise = noise or assumed_noise(torque)
    every = scales(know, inside, at, 10.0, 0.01)
    labels, effects, sizes = probed(shapes(common(), every), model.kinds)
    whole = terms_of(effects, np.diag(1.0 / sizes), len(model.names))
    columns = _columns(know, whole, at)
    kept = np.flatnonzero(independent(columns))
    size = np.append(sizes_of(columns[kept], torque), np.full(len(model.names), TIMING))
    terms = terms_of([effects[n] for n in kept], np.diag(1.0 / sizes[kept]), len(model.names))
    plan = Plan(know, inside, terms, size, noise, **options)
    timing = [Parameter(ALIGNMENT, j, "late", "s") for j in range(len(model.names))]
    return Prepared(plan, (*(labels[n] for n in kept), *timing), at)


def sizes_of(columns: np.ndarray, torque: np.ndarray, share: float = SHARE) -> np.ndarray:
    """Return the coefficients (P,) at which columns (P, N, J) add ``share`` of the torque (N, J).

    Of a column that adds nothing it is zero.
    """
    effort = np.sqrt(np.mean(torque**2, 0))
    effort = np.maximum(effort, 1e-3 * effort.max(initial=1e-9))
    size = np.sqrt(np.mean((columns / effort) ** 2, 1)).max(1, initial=0.0)
    return np.where(size > 1e-9, share / np.maximum(size, 1e-9), 0.0)


def _columns(know: Known, terms: Any, at: Drive) -> np.ndarray:
    run = jit_quickly(lambda drive: terms.columns(drive, know.body, know.rest, 1.0))
    return np.asarray(run(at))
