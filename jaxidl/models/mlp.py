"""The error model: one multi-layer perceptron per joint.

This is the only file that imports Flax's layers. Linen's ``init`` and ``apply`` keep the networks
pure: parameters are an argument, never an attribute. Activations are feature-major (features, rows)
and weights (out, in): bias and slope gradients then reduce along the contiguous axis, and XLA
inserts no transposes.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from flax import linen as nn
from jaxtyping import Array, Float

from jaxidl.errors import ConfigurationError
from jaxidl.types import Circumstances, Joints, Key, State

Params = Any  # the pytree of all joints' networks, with a leading axis J on every leaf


def prelu(z: Float[Array, "N B"], slopes: Float[Array, "N 1"]) -> Float[Array, "N B"]:
    """Return z where positive and slopes · z elsewhere (He et al. 2015)."""
    return jnp.where(z >= 0, z, slopes * z)


def smooth_prelu(
    z: Float[Array, "N B"], slopes: Float[Array, "N 1"], width: float
) -> Float[Array, "N B"]:
    """Return :func:`prelu` with its kink rounded over ``width``.

    It is slopes · z + (1 − slopes) · width · log(1 + exp(z / width)).
    """
    return slopes * z + (1.0 - slopes) * width * jax.nn.softplus(z / width)


@jax.custom_vjp
def prelu_in_training(z: Float[Array, "N B"], slopes: Float[Array, "N 1"]) -> Float[Array, "N B"]:
    """Return :func:`prelu`, with a hand-written backward pass for training steps.

    The values are the same; only reverse mode can differentiate it. XLA's own backward pass stores
    one more (N, B) array for each layer; without it a training step takes 7 % less time.
    """
    return prelu(z, slopes)


def _prelu_forward(z: Array, slopes: Array) -> tuple[Array, tuple[Array, Array]]:
    return prelu(z, slopes), (z, slopes)


def _prelu_backward(saved: tuple[Array, Array], cotangent: Array) -> tuple[Array, Array]:
    z, slopes = saved
    to_slopes = jnp.where(z >= 0, 0, cotangent * z).sum(axis=1, keepdims=True)
    return jnp.where(z >= 0, cotangent, cotangent * slopes), to_slopes


prelu_in_training.defvjp(_prelu_forward, _prelu_backward)


class Mlp(nn.Module):
    """Dense layers with PReLU after all but the last; one learned slope per unit."""

    layers: tuple[int, ...]
    slope: float = 0.01
    activation: Callable[[Array, Array], Array] = prelu

    @nn.compact
    def __call__(self, x: Float[Array, "F B"]) -> Float[Array, "1 B"]:
        glorot = nn.initializers.variance_scaling(1.0, "fan_avg", "uniform", in_axis=1, out_axis=0)
        for i, width in enumerate(self.layers):
            weights = self.param(f"weights_{i}", glorot, (width, x.shape[0]), jnp.float32)
            x = weights @ x + self.param(
                f"biases_{i}", nn.initializers.zeros, (width, 1), jnp.float32
            )
            if i < len(self.layers) - 1:
                slopes = self.param(
                    f"slopes_{i}", nn.initializers.constant(self.slope), (width, 1), jnp.float32
                )
                x = self.activation(x, slopes)
        return x


@dataclass(frozen=True)
class ErrorModel:
    """One network per joint, from the motion of all joints to a torque.

    Its inputs are the scaled (q, qd, qdd) of all joints; its output, scaled back, is a torque.
    Parameters decide the precision: inputs are cast to the weights' type and torques are returned
    in the type of ``q``.

    A network with PReLU is continuous but its slope jumps at the kinks, and training follows
    slopes: where a sample crosses a kink the trained weights jump. A derivative through training is
    exact between two jumps, and those of the paper's networks are so close together that a change
    of a gain by 1e-7 changes the error after three executions by some per cent. With
    ``activation_width`` > 0 the kinks are rounded; with 0.5 the derivative predicts the result of a
    change by 0.1 %, but networks learn more slowly.
    """

    joints: int = 2
    layers: tuple[int, ...] = (200, 100, 50, 20, 1)
    position_scale: float = 1.0  # [m]
    velocity_scale: float = 20.0  # [m/s]
    acceleration_scale: float = 800.0  # [m/s^2]
    torque_scale: float = 800.0  # [N]
    # one for each circumstance (C) that is an input; the others are not inputs
    circumstance_scales: tuple[float, ...] = ()
    slope: float = 0.01  # initial PReLU slope [-]
    # width over which PReLU's kink is rounded [-]; 0: sharp, as in the paper
    activation_width: float = 0.0

    def __post_init__(self) -> None:
        for name in ("position_scale", "velocity_scale", "acceleration_scale", "torque_scale"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise ConfigurationError(f"{name} > 0", str(getattr(self, name)), "correct it")
        if not (np.isfinite(self.slope) and 0.0 <= self.activation_width < np.inf):
            got = f"{self.slope}, {self.activation_width}"
            raise ConfigurationError(
                "a finite slope and activation_width >= 0", got, "correct them"
            )

    def init(self, key: Key) -> Params:
        """Return new float32 parameters; every joint's network has its own draw."""
        inputs = jnp.zeros((len(self._scales()), 1), jnp.float32)
        network = Mlp(self.layers, self.slope)  # initial weights are the same for any activation
        return jax.vmap(lambda k: network.init(k, inputs))(jax.random.split(key, self.joints))

    def _scales(self) -> np.ndarray:
        motion = np.repeat(
            [self.position_scale, self.velocity_scale, self.acceleration_scale], self.joints
        )
        return np.concatenate([motion, self.circumstance_scales])

    def scale_inputs(self, x: Float[Array, "*N X"]) -> Float[Array, "*N F"]:
        """Return the inputs among ``x`` (..., X >= 3J), scaled.

        They are divided by the scales of position, velocity, acceleration and circumstances.
        """
        scales = self._scales().astype(x.dtype)
        x = x[..., : len(scales)]
        return x / jnp.broadcast_to(scales, x.shape)

    def apply(
        self, params: Params, x: Float[Array, "F B"], *, in_training: bool = False
    ) -> Float[Array, "J B"]:
        """Return all networks' scaled outputs (J, B) for scaled, feature-major inputs (F, B).

        ``in_training`` selects the faster backward pass, which forward mode cannot differentiate;
        the values are the same.
        """
        activation = prelu_in_training if in_training else prelu
        if self.activation_width > 0.0:
            activation = partial(smooth_prelu, width=self.activation_width)
        network = Mlp(self.layers, self.slope, activation)
        outputs: Any = jax.vmap(network.apply, in_axes=(0, None))(params, x)
        return outputs[:, 0]

    def torque(
        self, params: Params, state: State, qdd: Joints, circumstances: Circumstances | None = None
    ) -> Joints:
        """Return the predicted modelling error (J,) [N].

        It is that in ``state`` at the acceleration ``qdd`` (J,) [m/s^2].
        """
        told = () if circumstances is None else (circumstances,)
        x = self.scale_inputs(jnp.concatenate([state.q, state.qd, qdd, *told]))
        dtype = jax.tree.leaves(params)[0].dtype
        return (
            self.apply(params, x.astype(dtype)[:, None])[:, 0].astype(state.q.dtype)
            * self.torque_scale
        )
