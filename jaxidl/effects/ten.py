"""The ten inertial parameters of a body, in which its dynamics are linear.

Mass [kg], first moment (3) [kg m] and inertia (6) [kg m^2] about the origin of a frame; the inertia
as the elements xx, yy, zz, xy, xz, yz of the symmetric tensor (products with the tensor's own
sign).
"""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

Ten = Float[Array, "*L 10"]
Tensor = Float[Array, "*L 6"]

ROWS, COLUMNS = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)  # of the six elements within the tensor
PLACES = ((0, 3, 4), (3, 1, 5), (4, 5, 2))  # of the tensor's elements among the six


def ten(mass: Any = None, moment: Any = None, inertia: Any = None) -> Ten:
    """Return the ten numbers (..., 10) of mass, first moment and inertia.

    Their shapes are ``mass`` (...), ``moment`` (..., 3) and ``inertia`` (..., 6); zero where not
    given.
    """
    given = [x if x is None else jnp.asarray(x) for x in (mass, moment, inertia)]
    lead = (
        given[0].shape
        if given[0] is not None
        else next(x.shape[:-1] for x in given[1:] if x is not None)
    )
    parts = (None if given[0] is None else given[0][..., None], *given[1:])
    return jnp.concatenate(
        [jnp.zeros((*lead, n)) if x is None else x for x, n in zip(parts, (1, 3, 6), strict=True)],
        -1,
    )


def matrix(six: Any) -> Float[Array, "*L 3 3"]:
    """Return the tensor (..., 3, 3) of its six elements (..., 6)."""
    return jnp.asarray(six)[..., jnp.asarray(PLACES)]


def elements(tensor: Any) -> Tensor:
    """Return the six elements (..., 6) of a symmetric tensor (..., 3, 3)."""
    return jnp.asarray(tensor)[..., ROWS, COLUMNS]


def about(mass: Any, com: Any) -> Tensor:
    """Return the inertia (6,) about the origin of a point ``mass`` () [kg] at ``com`` (3,) [m]."""
    return elements(
        mass * ((com @ com) * jnp.eye(3, dtype=com.dtype) - com[:, None] * com[None, :])
    )


@jax.jit  # one program, where operations one by one would be twenty
def moved(
    numbers: Float[Array, "10"], turn: Float[Array, "3 3"], offset: Float[Array, "3"]
) -> Float[Array, "10"]:
    """Return the ten numbers (10,) in another frame.

    The old frame's axes are the columns of ``turn`` (3, 3), its origin is at ``offset`` (3,) [m].
    """
    mass, moment, inertia = numbers[0], turn @ numbers[1:4], turn @ matrix(numbers[4:]) @ turn.T
    cross = moment[:, None] * offset[None, :]
    shift = (2.0 * (moment @ offset) * jnp.eye(3, dtype=moment.dtype) - cross - cross.T) + matrix(
        about(mass, offset)
    )
    return ten(mass, moment + mass * offset, elements(inertia + shift))
