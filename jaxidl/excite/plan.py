"""The plan of a motion: its length and limits, the columns that judge it, the noise."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from jaxidl.backend import jit_quickly
from jaxidl.excite.criteria import (
    Contest,
    Evidence,
    a_optimal,
    condition,
    d_optimal,
    t_optimal,
)
from jaxidl.excite.limits import Limits
from jaxidl.excite.motion import Basis, basis, instants
from jaxidl.excite.parameters import Known, Terms

ROWS_PER_HERTZ = 5.0  # rows of the criterion per second, over the motion's highest frequency


class Noise(NamedTuple):
    """The residual that a good model leaves, J values each."""

    torque: np.ndarray  # root mean square [N or Nm]
    rate: np.ndarray  # independent samples per second
    encoder: np.ndarray  # [m or rad]


@dataclass(frozen=True, eq=False)
class Plan:
    """A motion to be designed."""

    know: Known
    limits: Limits  # of the plan, margins taken off
    terms: Terms
    size: np.ndarray  # (P,) scale of each coefficient
    noise: Noise
    criterion: str = "d"  # d, a, condition or t
    seconds: float = 20.0
    kind: str = "fourier"
    top: float = 1.5  # highest frequency [Hz]
    rate: float = 0.0  # of the criterion's rows [Hz]; 0: by ``top``
    contest: Contest | None = None  # of a t criterion
    earlier: Evidence | None = None  # of a log that there is already

    @cached_property
    def times(self) -> np.ndarray:
        """Instants (T,) [s] at which the motion is judged."""
        return instants(self.seconds, self.rate or ROWS_PER_HERTZ * self.top)

    @cached_property
    def basis(self) -> Basis:
        """The basis (T, K) of each joint's motion."""
        return basis(self.kind, self.seconds, self.top, self.times)

    @property
    def dt(self) -> float:
        """Interval of the rows [s]."""
        return float(self.times[1] - self.times[0])

    def motion(self, z: Any, at: Basis | None = None) -> tuple[Any, Any, Any, Any]:
        """Return position, speed, acceleration (T, J), and by what each joint was scaled (J,).

        Coefficients ``z`` (J, K) that would leave the limits are made smaller until they keep
        them; this is exact at the instants of the basis ``at``.
        """
        basis, limits = at or self.basis, self.limits
        parts = [jnp.asarray(b) @ jnp.asarray(z).T for b in basis]
        q, qd, qdd = parts
        over = [
            jnp.max(q, 0) / (limits.upper - limits.start),
            jnp.max(-q, 0) / (limits.start - limits.lower),
            jnp.max(jnp.abs(qd), 0) / limits.speed,
            jnp.max(jnp.abs(qdd), 0) / limits.acceleration,
        ]
        share = 1.0 / jnp.maximum(jnp.max(jnp.stack(over), 0), 1.0)
        along = share[None]
        return jnp.asarray(limits.start)[None] + q * along, qd * along, qdd * along, share

    def evidence(self, q: Any, qd: Any, qdd: Any, dt: float) -> tuple[Evidence, Any]:
        """Return what a motion (T, J) tells, and its torque (T, J)."""
        drive = self.know.drive(q, qd, qdd, dt)
        x = self.terms.columns(drive, self.know.body, self.know.rest, dt)
        slope: Any = jnp.gradient(drive.predicted, dt, axis=0)
        # when exactly a torque acts is the logger's convention, and known to nobody
        timing = slope[None] * jnp.eye(q.shape[1])[:, None, :]
        x, torque = jnp.concatenate([x, timing]), drive.predicted
        gram = dt * jnp.einsum("ptj,qtj->jpq", x, x)
        seconds, total, square = dt * len(q), dt * torque.sum(0), dt * (torque**2).sum(0)
        return Evidence(gram, seconds, total, square), torque

    def gram(self, seen: Evidence) -> Any:
        """Return the information (P, P) of evidence, weighed with the noise."""
        return jnp.tensordot(jnp.asarray(self.noise.rate / self.noise.torque**2), seen.gram, 1)

    def value(self, seen: Evidence) -> Any:
        """Return the criterion of evidence, together with the earlier log's."""
        whole = seen if self.earlier is None else seen.plus(self.earlier)
        if self.criterion == "t":
            assert self.contest is not None
            return t_optimal(whole, self.contest)
        by = {"d": d_optimal, "a": a_optimal, "condition": condition}[self.criterion]
        return by(self.gram(whole), jnp.asarray(self.size))

    @cached_property
    def _drive(self) -> Callable[..., Any]:
        return jit_quickly(self.know.drive, static_argnames="dt")

    def needed(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
        """Return the torque (T, J) [N or Nm] that the model and its effects need for a motion."""
        dt = self.seconds / (len(q) - 1)
        return np.asarray(self._drive(q, qd, qdd, dt=dt).predicted)

    def judged(self, z: Any) -> tuple[Any, Any, Any]:
        """Return the criterion of coefficients ``z`` (J, K), torques and positions (T, J)."""
        q, qd, qdd, _ = self.motion(z)
        seen, torque = self.evidence(q, qd, qdd, self.dt)
        return self.value(seen), torque, q


def random_start(plan: Plan, rng: np.random.Generator) -> np.ndarray:
    """Return random coefficients (J, K), each joint's as large as its limits allow."""
    joints, count = len(plan.limits.names), plan.basis.q.shape[1]
    z = 1e3 * rng.standard_normal((joints, count))
    share = np.asarray(plan.motion(z)[3])
    return z * share[:, None]
