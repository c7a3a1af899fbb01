"""The shape of an effect on a joint.

It says what a fit may change, within which bounds, and which effect results. *Amplitudes* are the
parameters in which an effect is linear. The other parameters are its shape (a speed, a period, a
delay ...), of which an effect offers a few starting values.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from jaxidl.effects import Effect, OnJoint, Scale
from jaxidl.systems.free import inner, pieces

ON_BOUND = 1e-3  # relative distance to a bound within which a value is on it
ROUNDING = 1e-9  # share of an effect that stays where all of it is gone
MOST_SCALED = 2.0  # most by which an effect may be scaled before its shape is fitted

Present = Mapping[tuple[str, int | None], Mapping[str, np.ndarray]]


def present(effects: Sequence[Effect]) -> Present:
    """Return what a model has: by name and joint, the sum of its effects' parameters."""
    found: dict[tuple[str, int | None], dict[str, np.ndarray]] = {}
    for effect in effects:
        alone = inner(effect)
        own = found.setdefault((alone.name, getattr(effect, "joint", None)), {})
        for name in alone.parameters:
            own[name] = np.asarray(own.get(name, 0.0) + np.asarray(getattr(alone, name), float))
    return found


class Shape(NamedTuple):
    """An effect on a joint with values of all its parameters; ``free`` are its amplitudes."""

    cls: type[Effect]
    joint: int | None
    joints: int
    free: tuple[str, ...]
    values: Mapping[str, Any]
    options: Mapping[str, Any]
    within: Mapping[str, tuple[float, float]]
    odds: float = 0.0  # log prior odds of the effect
    amplitudes: frozenset[str] = frozenset()  # amplitudes of all shapes of the effect
    # (A, P) combinations of the amplitudes that the effect's parts cannot imitate
    basis: np.ndarray | None = None
    # names of the parts, and the amplitudes (A,) that add what one unit of them adds
    parts: tuple[tuple[str, np.ndarray], ...] = ()

    def probes(self) -> tuple[list[Effect], np.ndarray]:
        """Return an effect for each amplitude (P), or one at the values, and divisors (P,).

        What the effects add is to be divided by the divisors.
        """
        if not self.free:
            return [self.effect()], np.ones(1)
        whole = self._replace(basis=None)
        far = np.abs(whole.limits()[1])
        # a motor's curve ends at its bound
        size = np.where(np.isfinite(far) & (far > 0.0), np.minimum(0.5 * far, 1.0), 1.0)
        return [whole.at(row) for row in np.diag(size)], size

    def effect(self, **changes: Any) -> Effect:
        """Return the effect of the whole mechanism with some parameters changed."""
        return build(self.cls, self.joint, self.joints, {**self.values, **changes}, self.options)

    def at(self, x: np.ndarray) -> Effect:
        """Return the effect with amplitudes ``x`` (P,).

        An effect without amplitudes is scaled, to a first approximation, by the one number ``x``.
        """
        if not self.free:
            return self.effect(**self.scaled(float(x[0])))
        return self.effect(
            **self.cut(self.free, np.asarray(x, float) if self.basis is None else self.basis @ x)
        )

    def cut(self, names: Sequence[str], numbers: np.ndarray) -> dict[str, np.ndarray]:
        """Return parameters by name from their numbers, one after the other."""
        shapes = [np.shape(self.values[name]) for name in names]
        return dict(zip(names, pieces(numbers, shapes), strict=True))

    def scaled(self, share: float) -> dict[str, np.ndarray]:
        """Return values at which an effect without amplitudes adds about ``share`` as much."""
        neutral = self.cls.neutral
        if len(self.values) != 1 or not np.isfinite(neutral):
            return {}
        ((name, value),) = self.values.items()
        there = np.clip(neutral + share * (value - neutral), *self.bounds(name))
        return {name: np.asarray(there)}

    def bounds(self, name: str) -> tuple[float, float]:
        """Return the bounds of a parameter: the variant's within the catalogue's."""
        spec = self.cls.parameters[name]
        return self.within.get(name, (spec.lower, spec.upper))

    def limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Return lower and upper bounds (P,) of the coefficients."""
        if self.free:
            each = (np.size(self.values[name]) * [self.bounds(name)] for name in self.free)
            pairs = np.array([pair for pairs in each for pair in pairs]).T
            if self.basis is None:
                return pairs[0], pairs[1]
            # the least and the most that amplitudes within their bounds can be of each combination
            weight = self.basis.T[:, None]  # (P, 1, A)
            with np.errstate(invalid="ignore"):  # zero times no bound
                ends = np.nan_to_num(weight * pairs, nan=0.0, posinf=np.inf, neginf=-np.inf)
            return ends.min(1).sum(1), ends.max(1).sum(1)
        least, neutral = 0.0, self.cls.neutral
        for name, other in self.scaled(-MOST_SCALED).items():
            reached = neutral - MOST_SCALED * (self.values[name] - neutral)
            least = -MOST_SCALED if np.all(other == reached) else 0.0  # no bound is in the way
        return np.array([least]), np.array([MOST_SCALED])


def gone(shape: Shape) -> np.ndarray:
    """Return at which lower limits (P,) an effect is gone that the model has."""
    low, _ = shape.limits()
    if not shape.free or shape.basis is not None:
        return np.zeros(len(low), bool)
    sizes = [np.size(shape.values[n]) for n in shape.free]
    return low < np.repeat([shape.cls.parameters[n].lower for n in shape.free], sizes)


def acts_on_predicted(shape: Shape) -> bool:
    """Return whether an effect acts on the predicted command, not on the logged one."""
    return shape.cls.seen is not Effect.seen


def reads_load(shape: Shape) -> bool:
    """Return whether what effects of a class add depends on the torque at the joint."""
    if shape.cls not in _READS:
        _READS[shape.cls] = shape.effect().reads_torque(shape.joints)
    return _READS[shape.cls]


# called for every column of every set, so an effect is not built each time
_READS: dict[type[Effect], bool] = {}


def build(
    cls: type[Effect],
    joint: int | None,
    joints: int,
    values: Mapping[str, Any],
    options: Mapping[str, Any],
) -> Effect:
    """Return an effect of the whole mechanism from values of one joint, or of all if of none."""
    own = cls.alone() and joint is not None
    array = lambda v: jnp.asarray(np.array(v, float, ndmin=int(own)))
    effect = cls(**{n: array(v) for n, v in values.items()}, **options)
    return OnJoint(effect, joint, joints) if own and joint is not None else effect


def shapes_of(
    cls: type[Effect], scale: Scale, own: Present = MappingProxyType({}), changed: bool = False
) -> list[Shape]:
    """Return the shapes that an effect offers on a joint.

    Shapes that compete share the effect's prior. Where the model has the effect already (``own``),
    it may also be less by as much. If the question is what ``changed`` since another log, the prior
    is that of a change.
    """
    found = []
    variants = cls.variants(scale)
    amplitudes = frozenset(name for v in variants for name in v.free)
    # the starting value is no choice between shapes: fits change it
    rivals = len({v.free for v in variants}) if not cls.linear else 1
    for variant in variants:
        values = {name: np.asarray(variant.values.get(name, 0.0), float) for name in cls.parameters}
        bounds = {n: variant.within[n] for n in variant.within if n not in variant.free}
        if any(
            np.any(values[n] < low) or np.any(values[n] > high) for n, (low, high) in bounds.items()
        ):
            continue  # not plausible on this joint
        joint = None if cls.whole else scale.joint
        within, there = {**variant.within}, own.get((cls.name, joint), {})
        less = [n for n in variant.free if n in there and np.ndim(there[n]) <= 1]
        for n in less:
            low, high = within.get(n, (cls.parameters[n].lower, cls.parameters[n].upper))
            within[n] = low - (1.0 - ROUNDING) * max(float(np.min(there[n])), 0.0), high
        # a change may be less, such as a load that is gone; friction that was not there may not
        if changed and not cls.friction:
            free = [n for n in variant.free if n not in less]
            within |= {n: (-np.inf, within.get(n, (0.0, np.inf))[1]) for n in free}
        prior = (
            cls.changes if changed else cls.prior if variant.prior is None else variant.prior
        ) / rivals
        odds = float(np.log(prior / (1.0 - prior)))
        shape = Shape(cls, joint, scale.joints, variant.free, values, variant.options, within)
        found.append(shape._replace(odds=odds, amplitudes=amplitudes))
    return found


def movable(shape: Shape) -> tuple[str, ...]:
    """Return names of the parameters besides the amplitudes that a fit may change."""
    cls = shape.cls
    if cls.linear:
        return ()
    taken = {*shape.amplitudes, *shape.free, *cls.fixed}
    return tuple(n for n in cls.parameters if n not in taken and np.isfinite(shape.values[n]).all())


def effect_at(shape: Shape, theta: np.ndarray) -> Effect:
    """Return the effect at parameters theta (P,), amplitudes first."""
    moved = at_parameters(shape, theta)
    return moved.at(theta[: amplitudes(shape)]) if shape.free else moved.effect()


def amplitudes(shape: Shape) -> int:
    """Return the number of amplitudes."""
    return len(shape.limits()[0]) if shape.free else 0


def at_parameters(shape: Shape, theta: np.ndarray) -> Shape:
    """Return the shape with the parameters besides its amplitudes set from theta (P,)."""
    rest = np.asarray(theta, float)[amplitudes(shape) :]
    return shape._replace(values={**shape.values, **shape.cut(movable(shape), rest)})


def vector(shape: Shape, x: np.ndarray) -> np.ndarray:
    """Return parameters theta (P,) of a shape whose coefficients are ``x``.

    Its amplitudes come first, or the share of it that is there.
    """
    values = shape.values if shape.free else {**shape.values, **shape.scaled(float(x[0]))}
    own = x if shape.free else np.zeros(0)
    return np.concatenate([own, *(np.ravel(np.asarray(values[n], float)) for n in movable(shape))])


def limits(shape: Shape) -> tuple[np.ndarray, np.ndarray]:
    """Return lower and upper bounds (P,) of theta."""
    pairs = [shape.bounds(n) for n in movable(shape) for _ in range(np.size(shape.values[n]))]
    own = shape.limits() if shape.free else (np.zeros(0), np.zeros(0))
    return np.append(own[0], [p[0] for p in pairs]), np.append(own[1], [p[1] for p in pairs])


def on_bound(shape: Shape, theta: np.ndarray) -> bool:
    """Return whether a parameter besides the amplitudes is on, or very near, a plausible bound."""
    low, high = limits(shape)
    rest, near = np.arange(len(low)) >= amplitudes(shape), ON_BOUND * np.abs(theta)
    return bool(np.any(rest & ((theta <= low + near) | (theta >= high - near))))
