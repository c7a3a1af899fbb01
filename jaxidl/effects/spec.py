"""What an effect declares: its parameters, and the shapes in which a search tries it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from jaxidl.errors import EffectError


@dataclass(frozen=True)
class Parameter:
    """Bounds, unit and meaning of one numeric field of an effect."""

    unit: str
    lower: float
    upper: float
    meaning: str

    def check(self, name: str, value: object) -> None:
        """Raise if ``value``, a number or an array, is out of bounds or NaN.

        Raises:
            EffectError: naming the parameter ``name``.
        """
        numbers = np.asarray(value, float)
        if not ((numbers >= self.lower) & (numbers <= self.upper)).all():  # NaN fails too
            bounds = f"{name} in [{self.lower:g}, {self.upper:g}] {self.unit}"
            raise EffectError(
                bounds, str(numbers.tolist()), f"set {self.meaning} within these bounds"
            )


class Scale(NamedTuple):
    """Magnitudes on one joint of a log, from which an effect derives its starting values."""

    torque: float  # largest command [N or Nm]
    speed: float  # largest speed [m/s or rad/s]
    lower: float  # least position [m or rad]
    upper: float  # largest position [m or rad]
    inertia: float  # median inertia seen by the joint [kg or kg m^2]
    residual: float  # root mean square of the torque that the model lacks [N or Nm]
    band: float  # frequency up to which the log can be trusted [Hz]
    dt: float  # sampling interval [s]
    joint: int = 0  # number of the joint
    joints: int = 1  # number of joints of the mechanism, J
    # (J,) least positions of all joints [m or rad]; empty: this one only
    lows: Sequence[float] = ()
    highs: Sequence[float] = ()  # (J,) largest positions
    rest_speed: float = 0.0  # speed below which a joint seems to rest [m/s or rad/s]
    effort: float = 0.0  # root mean square of the command [N or Nm]; 0: unknown
    typical: float = 0.0  # median of the command's size [N or Nm]; 0: unknown
    # least inertia felt by the joint while the others are free [kg or kg m^2]; inf: unknown
    free: float = float("inf")
    apart: Sequence[int] = ()  # joints that hardly ever move while this one does

    @property
    def width(self) -> float:
        """Range of the joint's positions [m or rad], never zero."""
        return max(self.upper - self.lower, 1e-9)

    def others(self) -> list[tuple[int, float, float]]:
        """Return number, least and largest position of each other joint that moves."""
        pairs = zip(range(self.joints), self.lows, self.highs, strict=False)
        return [
            (j, float(low), float(high)) for j, low, high in pairs if j != self.joint and high > low
        ]

    def neighbours(self) -> list[int]:
        """Return the joints next to it that move together with it.

        If two joints move in turn, no log can tell what connects them from what each has alone.
        """
        beside = [j for j, _, _ in self.others() if abs(j - self.joint) == 1]
        return [j for j in beside if j not in self.apart]


# starting values of the parameters; those not named are zero
Guess = Mapping[str, float | np.ndarray]
Bounds = Mapping[str, tuple[float, float]]
NOTHING: Mapping[str, Any] = MappingProxyType({})


class Variant(NamedTuple):
    """One starting shape of an effect on one joint, as a search tries it.

    Values are those of a mechanism of one joint: a number for each parameter, a table of shape (1,
    K). For effects of the whole mechanism, and those that name their joints themselves, they have
    the shapes of the effect's fields.
    """

    values: Guess  # starting values of the parameters; those not named are zero
    free: tuple[str, ...] = ()
    """Amplitudes: parameters in which what the effect adds is linear, and zero at zero.

    The other parameters are kept at ``values``. Empty: what the effect adds at ``values`` is
    scaled as a whole.
    """
    within: Bounds = NOTHING  # plausible bounds of any parameters, narrower than the catalogue's
    options: Mapping[str, Any] = NOTHING  # static fields
    prior: float | None = None  # probability, where it differs from the effect's


class Motor(NamedTuple):
    """MuJoCo's motor of one joint.

    The command passes a lag, is clipped to ``force`` and multiplied by ``gear`` to give the torque.
    """

    gear: float = 1.0
    force: float = np.inf  # [N or Nm] before the gear
    lag: float = 0.0  # [s]
