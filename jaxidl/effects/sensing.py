"""Effects on the measurement side: the plant moves truly, the encoders tell something else."""

from typing import ClassVar

import jax.numpy as jnp

from jaxidl.effects.base import Effect, Parameter
from jaxidl.types import Joints, Scalar


class SensingNoise(Effect):
    """Encoder noise clip(σ·N(0, 1), −σ, σ), drawn anew at every instant."""

    scale: Scalar  # σ, also the largest error [m]

    name: ClassVar[str] = "sensing_noise"
    sentence: ClassVar[str] = "the encoders read the position with bounded random error"
    parameters: ClassVar = {"scale": Parameter("m", 0.0, 1.0, "the noise scale")}

    def sense(self, q: Joints, noise: Joints) -> Joints:
        return q + jnp.clip(self.scale * noise, -self.scale, self.scale)
