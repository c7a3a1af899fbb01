"""What is to be designed: a motion's length and limits, the columns it is judged by, the noise."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from jaxidl.excite.criteria import Contest, a_optimal, condition, d_optimal, t_optimal
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
    # information (P, P) that an earlier log has already
    earlier: np.ndarray = field(default_factory=lambda: np.zeros(()))

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

    def gram(self, q: Any, qd: Any, qdd: Any, dt: float) -> tuple[Any, Any]:
        """Return the information (P, P) of a motion (T, J), and its torque (T, J)."""
        drive = self.know.drive(q, qd, qdd, dt)
        x = self.terms.columns(drive, self.know.body, self.know.rest, dt)
        slope: Any = jnp.gradient(drive.predicted, dt, axis=0)
        # when exactly a torque acts is the logger's convention, and known to nobody
        timing = slope[None] * jnp.eye(q.shape[1])[:, None, :]
        weight = jnp.sqrt(jnp.asarray(self.noise.rate * dt) / self.noise.torque**2)
        x = jnp.concatenate([x, timing]) * weight[None, None]
        flat = x.reshape(len(x), -1)
        return flat @ flat.T, drive.predicted

    def value(self, gram: Any) -> Any:
        """Return the criterion of a Gram matrix (P, P), together with the earlier log's."""
        whole = gram + jnp.asarray(self.earlier)
        if self.criterion == "t":
            assert self.contest is not None
            return t_optimal(whole, self.contest)
        size = jnp.asarray(self.size)
        return {"d": d_optimal, "a": a_optimal, "condition": condition}[self.criterion](whole, size)

    def judged(self, z: Any) -> tuple[Any, Any, Any]:
        """Return the criterion of coefficients ``z`` (J, K), torques and positions (T, J)."""
        q, qd, qdd, _ = self.motion(z)
        gram, torque = self.gram(q, qd, qdd, self.dt)
        return self.value(gram), torque, q


def random_start(plan: Plan, rng: np.random.Generator) -> np.ndarray:
    """Return random coefficients (J, K), each joint's as large as its limits allow."""
    joints, count = len(plan.limits.names), plan.basis.q.shape[1]
    z = 1e3 * rng.standard_normal((joints, count))
    share = np.asarray(plan.motion(z)[3])
    return z * share[:, None]
