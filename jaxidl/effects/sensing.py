"""Effects of sensing: the motion is true, the encoders read something else."""

from typing import Any, ClassVar

import jax.numpy as jnp

from jaxidl.effects.base import Effect
from jaxidl.effects.delay import Delay, late, line, push
from jaxidl.effects.spec import Guess, Parameter, Scale, Variant
from jaxidl.types import History, Joints, Scalar

BIGGEST = 0.5  # largest bias that a search looks for [m or rad]


class SensingNoise(Effect):
    """Encoder noise clip(σ·N(0, 1), −σ, σ), drawn independently at every instant."""

    scale: Joints | Scalar  # σ, also the largest error [m]

    name: ClassVar[str] = "sensing_noise"
    sentence: ClassVar[str] = "the encoders read the position with bounded random error"
    parameters: ClassVar = {"scale": Parameter("m", 0.0, 1.0, "the noise scale")}

    def sense(self, memory: Any, q: Joints, noise: Joints) -> Joints:
        return q + jnp.clip(self.scale * noise, -self.scale, self.scale)


class EncoderQuantisation(Effect):
    """The encoder reads the nearest whole count.

    Its derivative is zero almost everywhere: a small change of position leaves the reading
    unchanged. A derivative through a feedback loop that contains it is therefore that of an open
    loop, and can be of any size. When differentiating, leave the effect out; its error is at most
    half a count.
    """

    count: Joints | Scalar  # [m or rad]

    name: ClassVar[str] = "encoder_quantisation"
    sentence: ClassVar[str] = "the encoders read whole counts only, not positions between them"
    parameters: ClassVar = {"count": Parameter("m", 1e-12, 1.0, "the size of a count")}

    def sense(self, memory: Any, q: Joints, noise: Joints) -> Joints:
        return self.count * jnp.round(q / self.count)


class PositionBias(Effect):
    """The encoder reads q + bias.

    A log shows it only where forces depend on position (gravity, coupling).
    """

    bias: Joints  # (J,) [m or rad]

    name: ClassVar[str] = "position_bias"
    sentence: ClassVar[str] = "the encoder's zero is not where the model has it"
    parameters: ClassVar = {"bias": Parameter("m", -10.0, 10.0, "the encoder's offset")}
    advice: ClassVar[str] = (
        "hold still at many positions over the whole range, in several postures, or compare the"
        " encoder with a mechanical mark: a wrong zero shifts everything that depends on position"
    )

    def sense(self, memory: Any, q: Joints, noise: Joints) -> Joints:
        return q + self.bias

    def true_position(self, q: History, dt: Scalar) -> History:
        return q - jnp.broadcast_to(self.bias, q.shape)

    @classmethod
    def guesses(cls, scale: Scale) -> list[Guess]:
        return [{"bias": 0.0}]

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        """Return a small and a larger bias to each side.

        One of more than ``BIGGEST`` would have been noticed.
        """
        return [
            Variant({"bias": bias}, within={"bias": (-BIGGEST, BIGGEST)})
            for bias in (0.01, -0.01, 0.1, -0.1)
        ]


class SensorDelay(Delay):
    """The encoder's reading is ``delay`` old, interpolated linearly between past positions.

    The delay is at most ``steps`` steps.
    """

    name: ClassVar[str] = "sensor_delay"
    sentence: ClassVar[str] = "the measured position lags behind the torque"
    parameters: ClassVar = {"delay": Parameter("s", 0.0, 1.0, "the age of the reading")}

    def start(self, q: Joints) -> Any:
        return line(q, self.steps), jnp.zeros_like(q)

    def actuate(
        self, memory: Any, q: Joints, qd: Joints, tau: Joints, dt: Scalar
    ) -> tuple[Joints, Any]:
        """Return the torque unchanged; remember the position and the delay in steps."""
        return tau, (push(memory[0], q), self.delay / dt + jnp.zeros_like(q))

    def sense(self, memory: Any, q: Joints, noise: Joints) -> Joints:
        return late(q, *memory)

    def true_position(self, q: History, dt: Scalar) -> History:
        last = q.shape[0] - 1
        older = jnp.broadcast_to(self.delay / dt, q.shape)
        place = jnp.clip(jnp.arange(last + 1.0)[:, None] + older, 0.0, last)
        before = jnp.floor(place).astype(int)
        at = lambda row: jnp.take_along_axis(q, jnp.clip(row, 0, last), 0)
        weights = jnp.stack(cubic(place - before))
        return jnp.sum(weights * jnp.stack([at(before + k) for k in range(-1, 3)]), axis=0)


def cubic(share: History) -> tuple[History, ...]:
    """Return the weights of four samples for a place between the middle two, by a cubic.

    Straight lines would smooth what lies between samples, accelerations most: an error would have
    a kink where a delay is a whole number of samples.
    """
    s = share
    return (
        -s * (s - 1.0) * (s - 2.0) / 6.0,
        (s + 1.0) * (s - 1.0) * (s - 2.0) / 2.0,
        -(s + 1.0) * s * (s - 2.0) / 2.0,
        (s + 1.0) * s * (s - 1.0) / 6.0,
    )
