"""Candidates with parameters: what they contribute to the torque balance there, and how far a fit may move them."""

from dataclasses import dataclass, field, replace

import numpy as np

from jaxidl.effects import Effect
from jaxidl.gap.candidates import Candidate
from jaxidl.gap.signals import Signals
from jaxidl.gap.terms import Contribution, contribution, parameters_of

STEP = 0.6  # a shape parameter moves by at most this share of itself in one linear step


@dataclass(frozen=True, eq=False)
class Member:
    """A candidate with parameters, and what it contributes there."""

    candidate: Candidate
    effect: Effect
    joints: tuple[int, ...]  # those that it touches,
    value: Contribution  # on these
    slopes: Contribution
    delivered: np.ndarray | None = field(default=None, repr=False)  # (T,) torque after it on its joint, if it changes the torque

    @property
    def theta(self) -> np.ndarray:
        """Its free parameters (P,)."""
        return parameters_of(self.effect, self.candidate.free)

    def on(self, joint: int) -> tuple[Contribution, Contribution]:
        """Value (N,) and derivatives (P, N) on one of its joints."""
        k = self.joints.index(joint)
        return Contribution(*(x[:, k] for x in self.value)), Contribution(*(x[:, :, k] for x in self.slopes))

    def through(self, tau: np.ndarray) -> np.ndarray:
        """The torque (T, J) after it, of what arrives at it."""
        if self.delivered is None:
            return tau
        out = tau.copy()
        out[:, self.candidate.joint] = self.delivered
        return out


def member(candidate: Candidate, effect: Effect, signals: Signals, tau: np.ndarray) -> Member:
    """The candidate at an effect's parameters, given the torque (T, J) that arrives at it."""
    joint, free = candidate.joint, candidate.free
    of = None if candidate.name == "coupled_friction" else joint
    concerned, value, slopes, after = contribution(effect, of, free, signals, tau, everywhere=candidate.spread)
    says = np.any([np.any(x, 0) for x in value] + [np.any(x, (0, 1)) for x in slopes], axis=0)
    cut = lambda terms: Contribution(*(x if says.all() else x[..., says] for x in terms))  # noqa: E731
    delivered = None
    if joint is not None and not np.array_equal(own := after[:, concerned.index(joint)], tau[:, joint]):
        delivered = own
    return Member(candidate, effect, tuple(np.array(concerned)[says].tolist()), cut(value), cut(slopes), delivered)


def limits(m: Member) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest parameters (P,) that one linear step may reach.

    Within the bounds, and for shapes not too far from where they are linearised.
    """
    low, high = m.candidate.bounds()
    theta = m.theta
    if not (m.candidate.loose or m.effect.linear):
        small = np.array([name in ("sine", "cosine", "bias", "scale", "level", "excess", "mass", "com") for name in _names(m)])
        reach = np.where(small, np.inf, STEP * np.abs(theta) + 1e-12)
        low, high = np.maximum(low, theta - reach), np.minimum(high, theta + reach)
    return low, high


def inside(m: Member, theta: np.ndarray) -> bool:
    """Do fitted parameters (P,) lie within their bounds, where that matters?"""
    low, high = m.candidate.bounds()
    return m.candidate.at_bounds or bool(np.all(theta > low) and np.all(theta < high))


def neighbours(m: Member, at: int) -> np.ndarray:
    """Pairs (n, 2) of neighbours in tables, by their places among all parameters from ``at`` on."""
    pairs, place = [], at
    for name in m.candidate.free:
        size = np.size(getattr(m.effect, name))
        if size > 3:
            pairs += [(place + k, place + k + 1) for k in range(size - 1)]
        place += size
    return np.array(pairs, int).reshape(-1, 2)


def _names(m: Member) -> list[str]:
    """The name of each of its P parameters."""
    return [name for name in m.candidate.free for _ in range(np.size(getattr(m.effect, name)))]


def needs_torque(effect: Effect) -> bool:
    """Does what it adds depend on the torque that arrives at it?"""
    return effect.name == "load_dependent_friction"


def moved(m: Member, effect: Effect, theta: np.ndarray) -> Member:
    """A member linear in its parameters, at others, ``theta`` (P,): no need to compute it again."""
    step = theta - m.theta
    value = Contribution(*(v + np.tensordot(step, s, 1) for v, s in zip(m.value, m.slopes, strict=True)))
    return replace(m, effect=effect, value=value)
