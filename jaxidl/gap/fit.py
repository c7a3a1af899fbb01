"""Fits of sets of effects to a log, and their errors on blocks that took no part.

The torque balance of joint j at a kept row is ``net = delivered + torques − inverse dynamics``; a moving joint's dry friction
must equal it, a resting one's may be anything within its level. All is linearised about the members' present parameters, solved
by least squares with bounds, and validated by leaving out one contiguous block after the other: residuals of real machines are
correlated from sample to sample, blocks hardly are.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jaxidl.effects import TorqueScale
from jaxidl.gap.data import Data, only, used
from jaxidl.gap.least_squares import Columns, Problem
from jaxidl.gap.members import Member, inside, limits, member, moved, needs_torque, neighbours
from jaxidl.gap.terms import with_parameters

FINE = 6  # moments of a block
DIVERGED = 1e20  # the error of a fit that is not finite
ROUNDS = 10  # of polishing


class Fit(NamedTuple):
    """A set of members with fitted parameters."""

    members: tuple[Member, ...]  # as given: linearised where they were
    held: tuple[Member, ...]  # those that reach beyond the fitted joints: they take part as they are
    thetas: tuple[np.ndarray, ...]  # fitted parameters of each
    samples: tuple[np.ndarray, ...]  # (B, P) of each: fitted without block b
    error: Float[np.ndarray, "B J"]  # sum of squares on block b, fitted without it
    moments: Float[np.ndarray, "E J"]  # the same on stretches a fraction of a block long
    counts: Float[np.ndarray, "B J"]  # rows of block b
    residual: Float[np.ndarray, "N J"]  # fitted on all blocks, on all rows
    feasible: bool  # is no parameter at a bound of its effect?

    def rms(self, joint: int) -> float:
        """Held-out root mean square error over the training blocks of one joint."""
        return float(np.sqrt(self.error[:, joint].sum() / max(self.counts[:, joint].sum(), 1)))


def fit(data: Data, members: tuple[Member, ...], weight: np.ndarray, joints: tuple[int, ...] | None = None) -> Fit:
    """Least squares over the training rows, weighted by ``weight`` (J,) or (N, J) [1/N or 1/Nm]; ``joints`` alone if given.

    Members that reach beyond the ``joints`` are held where they are.
    """
    fitted = tuple(range(data.base.shape[1])) if joints is None else joints
    held = tuple(m for m in members if not set(m.joints) <= set(fitted))
    members = tuple(m for m in members if m not in held)
    if len(fitted) < data.base.shape[1]:
        data, weight = only(data, fitted), weight[..., list(fitted)]
    theta0 = np.concatenate([np.zeros(0), *(m.theta for m in members)])
    places = np.cumsum([0, *(len(m.theta) for m in members)]).tolist()
    cuts = places[1:-1]
    columns = [_columns(data, members, held, k, j) for k, j in enumerate(fitted)]
    bounds = [limits(m) for m in members]
    lower, upper = (np.concatenate([np.zeros(0), *side]) - theta0 for side in (zip(*bounds, strict=True) if bounds else ((), ())))
    penalty = np.concatenate([np.zeros((0, 2), int), *map(neighbours, members, places)])
    motors = [(m, at) for m, at in zip(members, places, strict=False) if "motor_inertia" in m.candidate.free]
    shaped = [_shaping(m, at, data, fitted) for m, at in motors]
    problem = Problem(data, weight, theta0, columns, shaped=shaped)
    step, steps = problem.solve(lower, upper, penalty)
    feasible = all(map(inside, members, np.split(theta0 + step, cuts))) if members else True
    size = problem.typical(step)
    residual = problem.residual(step, np.arange(len(data.base)), size)
    train = np.flatnonzero(data.block >= 0)
    kept_out = problem.residual(steps[data.block[train]], train, size)
    counted = used(data)[train]
    edges = np.flatnonzero(np.diff(data.block[train], prepend=-1))
    count = np.add.reduceat(counted.astype(float), edges, axis=0)
    with np.errstate(over="ignore", invalid="ignore"):
        square = kept_out**2 * counted
        square = np.where(np.isfinite(square), np.minimum(square, DIVERGED), DIVERGED)
    error = np.add.reduceat(square, edges, axis=0)
    for place, joint, inertia in problem.shaped:
        taken = 1.0 - (1.0 - np.clip((theta0 + step)[place] / inertia, 0.0, 1.0)) ** 2
        error[:, joint] += count[:, joint] * data.floor[joint] ** 2 * taken
    moments = np.add.reduceat(square, np.unique(np.linspace(0, len(train) - 1, FINE * len(edges)).astype(int)), axis=0)
    split = lambda x: tuple(np.split(x, cuts, axis=-1)) if members else ()  # noqa: E731
    return Fit(members, held, split(theta0 + step), split(theta0 + steps), error, moments, count, residual, feasible)


def _columns(data: Data, members: tuple[Member, ...], held: tuple[Member, ...], k: int, joint: int) -> Columns:
    """What the k-th of the fitted joints adds to the problem; ``held`` members contribute, but have no parameters.

    Where the motor delivers s times its command the balance is divided by s: the error of the command that the model predicts.
    In torques delivered, s = 0 would leave no error at all.
    """
    here = [m for m in (*members, *held) if joint in m.joints]
    free = [m for m in here if m not in held]
    places = dict(zip(members, np.cumsum([0, *(len(m.theta) for m in members)]), strict=False))
    which = np.concatenate([np.zeros(0, int), *(places[m] + np.arange(len(m.theta)) for m in free)])
    values = [m.on(joint)[0] for m in here]
    slopes = [m.on(joint)[1] for m in free]
    parts = [x[:, k] + sum(v[i] for v in values) for i, x in enumerate((data.base, data.slide, data.grip))]
    none = np.zeros((0, len(data.base)))
    parts += [np.concatenate([none, *(s[i] for s in slopes)]) for i in range(3)]
    for m in free:
        if m.candidate.name == TorqueScale.name and m.candidate.joint == joint:
            parts = [part / m.theta[0] for part in parts]
            parts[3][which == places[m]] -= (parts[0] - parts[1]) / m.theta[0]
    return Columns(which, *parts)


def _shaping(m: Member, at: int, data: Data, joints: tuple[int, ...]) -> tuple[int, int, float]:
    """Place of the motor's inertia among the parameters, its joint among those fitted, and the joint's whole inertia.

    Inertia on the motor's side does not multiply the encoder's noise: the more of it, the quieter the residual, whatever is true.
    The noise that is so taken away is added again.
    """
    name = m.candidate.free.index("motor_inertia")
    before = sum(np.size(getattr(m.effect, other)) for other in m.candidate.free[:name])
    joint = m.candidate.joint or 0
    return at + before, joints.index(joint), float(np.median(data.signals.tables.inertia[:, joint, joint]))


def updated(found: Fit, data: Data) -> tuple[Member, ...]:
    """The members at their fitted parameters: the torque passes through them in their order."""
    signals, tau, out = data.signals, data.tau, []
    for m, theta in zip(found.members, found.thetas, strict=True):
        low, high = m.candidate.bounds()
        effect = with_parameters(m.effect, m.candidate.free, np.clip(theta, low, high))
        if effect.linear and m.delivered is None and not needs_torque(effect):
            out.append(moved(m, effect, theta))
        else:
            out.append(member(m.candidate, effect, signals, tau))
        tau = out[-1].through(tau)
    return tuple(out)


def polished(data: Data, found: Fit, weight: np.ndarray, joints: tuple[int, ...]) -> Fit:
    """Linearise anew where the last fit ended, until it no longer gets better."""
    if all(m.effect.linear and m.delivered is None for m in found.members):
        return found
    best = found
    for _ in range(ROUNDS):
        after = fit(data, (*updated(best, data), *best.held), weight, joints)
        if not np.isfinite(after.error).all() or not after.error.sum() < 0.999 * best.error.sum():
            return after if np.isfinite(after.error).all() and after.error.sum() <= best.error.sum() else best
        best = after
    return best
