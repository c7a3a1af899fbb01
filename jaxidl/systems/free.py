"""One vector of free parameters of a plant's effects, for a fit, a tuning or a report."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jaxidl.effects import Effect, OnJoint
from jaxidl.errors import ConfigurationError
from jaxidl.systems.plant import Plant

Names = tuple[tuple[str, ...], ...]  # names of the free parameters, effect by effect
# lower and upper bound of each free parameter of an effect
Bounds = Mapping[str, tuple[float, float]]
Values = dict[str, np.ndarray]  # values of an effect's free parameters

_FIXED = {"mass": "kg", "length": "m", "mass length": "kg m"}  # on any kind of joint
_HINGE = {
    "N": "Nm",
    "m": "rad",
    "kg": "kg m^2",
    "m/s": "rad/s",
    "N/m": "Nm/rad",
    "N s/m": "Nm s/rad",
    "N s^2/m^2": "Nm s^2/rad^2",
    "1/N": "1/Nm",
}


@dataclass(frozen=True, eq=False)
class Free:
    """Some parameters of a plant's effects as one vector (P,).

    They stand effect after effect, in the order of ``where``. The plant may be traced:
    :attr:`vector` and :meth:`set` are pure and work under ``jit``, ``vmap`` and ``grad``.
    """

    plant: Plant
    # for each effect: the names of its free parameters, or narrower bounds for them
    where: Sequence[Iterable[str] | Bounds]

    @property
    def labels(self) -> Names:
        """Return the names of the free parameters of each effect.

        They are hashable, for use as a static argument.
        """
        return tuple(tuple(names) for names in self.where)

    @property
    def effects(self) -> list[Effect]:
        """Return the effects, those on one joint without the joint."""
        return [inner(effect) for effect in self.plant.effects]

    @property
    def _each(self) -> list[tuple[Effect, str]]:
        return [
            (effect, name)
            for effect, names in zip(self.effects, self.labels, strict=True)
            for name in names
        ]

    @property
    def names(self) -> list[str]:
        """Return a name of each number (P,).

        It includes the joint, and the index in a table where there is one.
        """
        out = []
        for effect, names in zip(self.plant.effects, self.labels, strict=True):
            joint = f"[{effect.joint}]" if isinstance(effect, OnJoint) else ""
            for name in names:
                label, size = (
                    f"{inner(effect).name}{joint}.{name}",
                    np.size(getattr(inner(effect), name)),
                )
                out += [label] if size == 1 else [f"{label}[{k}]" for k in range(size)]
        return out

    @property
    def units(self) -> list[str]:
        """Return the unit of each number (P,).

        It is that of a slide or a hinge, according to the body's joints.
        """
        kinds, out = getattr(self.plant.body, "kinds", ()), []
        for effect, names in zip(self.plant.effects, self.labels, strict=True):
            joint = getattr(effect, "joint", 0)
            for name in names:
                spec, size = inner(effect).parameters[name], np.size(getattr(inner(effect), name))
                own = (
                    [joint] * size
                    if isinstance(effect, OnJoint) or size != len(kinds)
                    else range(size)
                )
                out += [unit_of(spec.unit, kinds[j] if kinds else "slide") for j in own]
        return out

    @property
    def vector(self) -> Float[Any, " P"]:
        """Return the parameters' values."""
        parts = [
            jnp.ravel(jnp.asarray(getattr(effect, name), float)) for effect, name in self._each
        ]
        return jnp.concatenate([jnp.zeros(0), *parts])

    def set(self, vector: Float[Any, " P"]) -> Plant:
        """Return the plant with its free parameters set from a vector.

        All else stays, the sizes of hidden states included.
        """
        parts = iter(
            pieces(vector, [jnp.shape(getattr(effect, name)) for effect, name in self._each])
        )
        changed = []
        for effect, names in zip(self.plant.effects, self.labels, strict=True):
            if names:
                own = inner(effect).replace(**{name: jnp.asarray(next(parts)) for name in names})
                effect = effect.replace(effect=own) if isinstance(effect, OnJoint) else own
            changed.append(effect)
        return self.plant.replace(effects=tuple(changed))

    def named(self, vector: Float[Any, " P"]) -> tuple[Values, ...]:
        """Return a vector as the free parameters of each effect, flat arrays by name."""
        parts = iter(
            pieces(
                np.asarray(vector),
                [(np.size(getattr(effect, name)),) for effect, name in self._each],
            )
        )
        return tuple({name: next(parts) for name in names} for names in self.labels)

    def bounds(self) -> tuple[Float[np.ndarray, " P"], Float[np.ndarray, " P"]]:
        """Return lower and upper bounds (P,): those given, and no wider than the catalogue's.

        Raises:
            ConfigurationError: for a parameter whose value is not within its bounds.
        """
        lower, upper = [np.zeros(0)], [np.zeros(0)]
        for effect, names in zip(self.effects, self.where, strict=True):
            for name in names:
                spec, value = (
                    effect.parameters[name],
                    np.ravel(np.asarray(getattr(effect, name), float)),
                )
                low, high = names[name] if isinstance(names, Mapping) else (spec.lower, spec.upper)
                low, high = max(low, spec.lower), min(high, spec.upper)
                if not (low < high and np.all((value >= low) & (value <= high))):
                    expected = f"{effect.name}.{name} in [{low:g}, {high:g}] {spec.unit}"
                    raise ConfigurationError(
                        expected, str(value.tolist()), "start within the bounds, or widen them"
                    )
                lower.append(np.full(len(value), low))
                upper.append(np.full(len(value), high))
        return np.concatenate(lower), np.concatenate(upper)


def inner(effect: Any) -> Any:
    """Return the effect itself, without the joint that it is on."""
    return effect.effect if isinstance(effect, OnJoint) else effect


def pieces(vector: Any, shapes: Sequence[tuple[int, ...]]) -> list[Any]:
    """Return a vector (P,) cut into arrays of the given ``shapes``, one after the other."""
    ends = np.cumsum([0, *(int(np.prod(shape)) for shape in shapes)]).tolist()
    return [vector[a:b].reshape(shape) for a, b, shape in zip(ends, ends[1:], shapes, strict=False)]


def unit_of(unit: str, kind: str) -> str:
    """Return a parameter's unit on a ``kind`` of joint, slide or hinge.

    ``unit`` is the catalogue's, which is that of a slide.
    """
    if unit in _FIXED or kind == "slide":
        return _FIXED.get(unit, unit)
    return _HINGE.get(unit, unit)
