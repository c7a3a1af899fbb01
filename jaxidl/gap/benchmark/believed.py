"""The believed model: its torques, and the controller that relies on it."""

import math
from typing import Any

import mujoco as _mujoco
import numpy as np

from jaxidl.gap.benchmark.injected import Floats
from jaxidl.gap.benchmark.reference import Array, reference

# its names are made when it is imported, where a type checker does not see them
mujoco: Any = _mujoco

SPAN = {"slide": 0.35, "hinge": 1.2}  # m, rad; the range of motion to either side
# m, rad; of the encoder
NOISE, QUANTUM = {"slide": 5e-6, "hinge": 2e-5}, {"slide": 1e-5, "hinge": 5e-5}
# rad/s, 1; bandwidth 5.4 Hz, crossover 4 Hz, so that the loop tolerates 35 ms of delay
NATURAL, DAMPING = 2 * math.pi * 2.6, 0.7
DERIVATIVE = 30.0  # Hz, low pass of the measured speed
# a run whose reading is further than this share of the span from its reference is no measurement
ASTRAY = 0.6


class Diverged(RuntimeError):
    """The controller lost control of the mechanism."""


def believe(model_xml: str) -> Any:
    """Return the model without hidden effects, compiled."""
    return mujoco.MjModel.from_xml_string(model_xml)


def inverse_dynamics(model: Any, q: Array, qd: Array, qdd: Array) -> Array:
    """Return the torques (T, J) [N or Nm] that ``model`` needs for a motion.

    Positions, speeds and accelerations are (T, J) each.
    """
    data, tau = mujoco.MjData(model), np.empty_like(q)
    for k in range(len(q)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[k], qd[k], qdd[k]
        mujoco.mj_inverse(model, data)
        tau[k] = data.qfrc_inverse
    return tau


def inertia(model: Any, q: Array) -> Array:
    """Return the mass matrix (J, J) [kg or kg m²] at position ``q`` (J,)."""
    rest, still = np.zeros_like(q), np.eye(len(q))
    weight = inverse_dynamics(model, q[None], rest[None], rest[None])
    return (
        inverse_dynamics(model, np.tile(q, (len(q), 1)), np.zeros((len(q), len(q))), still) - weight
    )


class Controller:
    """Feed-forward of the believed model and proportional-derivative feedback, sample by sample.

    The feedback is on the encoder readings. Commands are cut at ``most`` (J,) [N or Nm], if given.

    Attributes:
        wanted: the reference (T, J) [m or rad], a different motion for every seed unless a
            ``motion`` is given: positions, speeds and accelerations (T, J) at the rate.
        ahead: the torques (T, J) [N or Nm] that the believed model needs for it.
    """

    def __init__(
        self,
        model_xml: str,
        seed: int,
        duration: float,
        rate: float,
        motion: tuple[Array, Array, Array] | None = None,
        most: Array | None = None,
    ):
        model, rng = believe(model_xml), np.random.default_rng(seed)
        kinds = [
            "slide" if kind == mujoco.mjtJoint.mjJNT_SLIDE else "hinge" for kind in model.jnt_type
        ]
        self.wanted, speed, acceleration = motion or reference(
            rng, np.array([SPAN[kind] for kind in kinds]), duration, rate
        )
        self.ahead = inverse_dynamics(model, self.wanted, speed, acceleration)
        noise = rng.standard_normal(self.wanted.shape) * [NOISE[kind] for kind in kinds]
        self._samples = list(
            zip(*(x.tolist() for x in (self.wanted, speed, self.ahead, noise)), strict=True)
        )
        self._quantum, self._astray = (
            [QUANTUM[kind] for kind in kinds],
            [ASTRAY * SPAN[kind] for kind in kinds],
        )
        self._gain = [float(m) * NATURAL**2 for m in np.diag(inertia(model, self.wanted[0]))]
        self._damp = [2 * DAMPING * gain / NATURAL for gain in self._gain]
        self._rate, self._share = rate, -math.expm1(-2 * math.pi * DERIVATIVE / rate)
        self._most = [math.inf] * len(kinds) if most is None else most.tolist()
        self._before: Floats = []
        self._speed = [0.0] * len(kinds)

    def __call__(self, k: int, true: Floats) -> tuple[Floats, Floats]:
        """Return the encoders' readings (J,) at sample ``k``, and the resulting commands (J,).

        The encoders are noisy and quantised.

        Raises:
            Diverged: if a reading is far from the reference.
        """
        wanted, speed, ahead, noise = self._samples[k]
        reading = [
            h * round((x + e) / h) for x, e, h in zip(true, noise, self._quantum, strict=True)
        ]
        command = []
        for j, (y, before) in enumerate(zip(reading, self._before or reading, strict=True)):
            off = wanted[j] - y
            if not abs(off) < self._astray[j]:
                raise Diverged(
                    f"joint {j} reads {y:.3g} instead of {wanted[j]:.3g}, {k / self._rate:.3f}"
                    " s into the run"
                )
            self._speed[j] += self._share * ((y - before) * self._rate - self._speed[j])
            asked = ahead[j] + self._gain[j] * off + self._damp[j] * (speed[j] - self._speed[j])
            command.append(min(max(asked, -self._most[j]), self._most[j]))
        self._before = reading
        return reading, command
