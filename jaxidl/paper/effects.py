"""Resistance to motion on the paper's plant: its friction, and the numbers of its stiction."""

from functools import partial
from typing import ClassVar

import jax.numpy as jnp
from flax import struct

from jaxidl.effects import Effect, Parameter, Stiction
from jaxidl.effects.smooth import choose, inside
from jaxidl.types import Joints, Scalar

STICTION_LEVEL = Parameter("1", 0.0, 1000.0, "the stiction level")


class PaperFriction(Effect):
    """The paper's friction: viscous, with a coefficient c(q) that differs by region.

    It acts on joints 0 and 1, and is not in the catalogue: a plant with it simulates and learns,
    but it is neither looked for in a log nor read from a file. In the catalogue's words it is
    ``position_dependent_friction`` on joints 0 and 1 (on joint 1 with a band where the coefficient
    is negative and feeds motion) together with ``coupled_friction`` of joint 0 with the position of
    joint 1. The rules, each overwriting the ones before, with level f (reference experiment,
    section "Plant"):

    1. q₀ < 0.2: c₀ = 10·exp(f)·sin²q₀
    2. q₁ < 0.2: c₁ = 10·f·cos²q₁
    3. 0.2 < q₁ < 0.4: c₁ = −f²·sin²q₁
    4. 0.4 < q₁ < 1.2: c₀ = max(0, f)·sin²q₁

    Joints from the third on have no friction.

    The coefficient jumps at the borders. A derivative through an execution is then that of the
    regions passed, each with its own slope, and contains nothing of the jumps: another level, gain
    or torque also moves the instant at which a border is crossed and a coefficient of thousands
    begins, and the derivative does not show it. It is exact for a change so small that no step
    changes region, and misleading for any larger one: with the paper's numbers it can have the
    wrong sign. With ``width`` > 0 each border is a logistic of that width [m] instead, which a
    derivative takes fully into account; 0.01 to 0.05 m are suitable. Values converge to the sharp
    ones as the width goes to 0.
    """

    level: Scalar  # f [-]: 5 medium, 8 high
    # width of the borders [m]; 0: sharp, as in the paper
    width: float = struct.field(pytree_node=False, default=0.0)

    name: ClassVar[str] = "paper_friction"
    sentence: ClassVar[str] = (
        "viscous friction that changes with position and couples joint 0 to joint 1"
    )
    parameters: ClassVar = {"level": Parameter("1", 0.0, 12.0, "the friction level")}

    def coefficient(self, q: Joints) -> Joints:
        """Return c(q) (J,) [N s/m] at positions ``q`` (J,), J >= 2."""
        f, (q0, q1) = self.level, (q[0], q[1])
        within = partial(inside, self.width)
        c0 = choose(within(0.2 - q0), 10.0 * jnp.exp(f) * jnp.sin(q0) ** 2, 0.0)
        c1 = choose(within(0.2 - q1), 10.0 * f * jnp.cos(q1) ** 2, 0.0)
        c1 = choose(within(q1 - 0.2, 0.4 - q1), -(f**2) * jnp.sin(q1) ** 2, c1)
        c0 = choose(within(q1 - 0.4, 1.2 - q1), jnp.maximum(0.0, f) * jnp.sin(q1) ** 2, c0)
        return jnp.zeros_like(q).at[0].set(c0).at[1].set(c1)

    def torque(self, q: Joints, qd: Joints, tau: Joints) -> Joints:
        return -self.coefficient(q) * qd


def paper_stiction(level: Scalar, width: float = 0.0) -> Stiction:
    """Return the paper's stiction of level s.

    Its breakaway torques are (100 s, 50 s) N on joints 0 and 1, below 0.2 m and 0.0001 m/s, signed.
    """
    return Stiction(
        jnp.asarray([100.0, 50.0]) * level,
        jnp.asarray(1e-4),
        jnp.asarray(0.2),
        signed=True,
        width=width,
    )
