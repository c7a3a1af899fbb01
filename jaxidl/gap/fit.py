"""Fits of sets of effects to a log, and their errors on blocks that took no part.

The torque balance of joint j at a kept row is ``net = delivered + torques − inverse dynamics``; a moving joint's dry friction must
equal it, a resting one's may be anything within its level. All is linearised about the members' present parameters, solved by
least squares with bounds, and validated by leaving out one contiguous block after the other: residuals of real machines are correlated
from sample to sample, blocks hardly are.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jaxidl.effects import Effect, TorqueScale
from jaxidl.gap.candidates import Candidate
from jaxidl.gap.signals import Signals
from jaxidl.gap.terms import Contribution, contribution, parameters_of, with_parameters

BLOCKS = 48
FURTHER = 1.2  # times the rest's highest torque, speed or acceleration: such an end of a log is not kept aside
STRETCH = 1.5  # see ``kept_rows`` [s]
FINE = 6  # moments of a block
SHARE_AT_REST = 1.0  # an error at rest counts up to this share of the error in motion, however much friction could hold
STEP = 0.6  # a shape parameter moves by at most this share of itself in one linear step
RIDGE = 1e-9
TOGETHER = 1e-3  # of a table's mean information: how strongly its neighbouring values are held together
DIVERGED = 1e20  # the error of a fit that is not finite
LEAST_FLOOR = 0.003  # of the command's spread: no simulation is believed to be better


@dataclass(frozen=True, eq=False)
class Member:
    """A candidate with parameters, and what it contributes there."""

    candidate: Candidate
    effect: Effect
    value: Contribution
    slopes: Contribution
    delivered: np.ndarray | None = field(default=None, repr=False)  # (T, J) torque after it, if it changes the torque

    @property
    def theta(self) -> np.ndarray:
        return parameters_of(self.effect, self.candidate.free)

    @cached_property
    def joints(self) -> tuple[int, ...]:
        """The joints that it touches."""
        touched = [np.any(self.slopes.net, (0, 1)) | np.any(self.slopes.slide, (0, 1)) | np.any(self.slopes.grip, (0, 1))]
        touched += [np.any(part, 0) for part in self.value]
        return tuple(np.flatnonzero(np.any(touched, axis=0)).tolist())


def member(candidate: Candidate, effect: Effect, signals: Signals, tau: np.ndarray) -> Member:
    """The candidate at an effect's parameters, given the torque (T, J) that arrives at it."""
    value, slopes, delivered = contribution(
        effect,
        candidate.joint if candidate.name != "coupled_friction" else None,
        candidate.free,
        signals,
        tau,
        everywhere=candidate.spread,
    )
    changed = None if delivered is tau or np.array_equal(delivered, tau) else delivered
    return Member(candidate, effect, value, slopes, changed)


class Data(NamedTuple):
    """Rows that fits share: N of them on J joints, those of training in blocks."""

    base: Float[np.ndarray, "N J"]  # the balance of the model as it is believed
    slide: Float[np.ndarray, "N J"]  # its own dry friction of moving joints
    grip: Float[np.ndarray, "N J"]  # ... and of resting ones
    tau: Float[np.ndarray, "T K"]  # the command after its own actuators
    moving: Bool[np.ndarray, "N J"]
    resting: Bool[np.ndarray, "N J"]
    block: np.ndarray  # (N,) block number; −1 for rows kept aside
    peaks: tuple[np.ndarray, ...]  # (E, 2) of each joint: row and torque at which each rest of the training rows ended
    floor: Float[np.ndarray, " J"]  # of the noise
    command: Float[np.ndarray, " J"]  # spread of the commanded torque
    signals: Signals


def data_of(signals: Signals, effects: tuple[Effect, ...] = (), held_out: float = 0.3, blocks: int = BLOCKS) -> Data:
    """Rows of a log and what the model, a rigid body with ``effects``, makes of them; a share ``held_out`` is kept aside."""
    rows, tau = signals.rows, signals.tau
    base, slide = signals.balance, np.zeros((len(rows), signals.q.shape[1]))
    grip = np.zeros_like(slide)
    for effect in effects:
        value, _, tau = contribution(effect, None, (), signals, tau)
        base, slide, grip = base + value.net, slide + value.slide, grip + value.grip
    train = kept_rows(signals, held_out)
    block = np.full(len(rows), -1)
    block[train] = np.arange(train.sum()) * blocks // max(train.sum(), 1)
    spread = np.std(signals.tau[rows], axis=0)
    return Data(
        base,
        slide,
        grip,
        tau,
        signals.moving[rows],
        signals.resting[rows],
        block,
        tuple(_in_training(peaks, rows, block >= 0) for peaks in signals.peaks),
        np.maximum(signals.noise_floor, LEAST_FLOOR * spread),
        spread,
        signals,
    )


def kept_rows(signals: Signals, held_out: float) -> np.ndarray:
    """Which of the kept rows (N,) are fitted: all but the last share ``held_out``, or all but the last share of every stretch.

    What happens at the end of a log only, saturation in fast motion for one, could neither be found if that end were kept aside nor be
    shown if it were not. So where the end holds faster or harder motion than the rest, stretches of ``STRETCH`` seconds each
    give their own last part.
    """
    n = len(signals.rows)
    last = np.arange(n) >= round(n * (1.0 - held_out))
    if not last.any():
        return ~last
    sizes = [np.abs(x[signals.rows]) for x in (signals.tau, signals.qd, signals.qdd)]
    reach = lambda part: np.stack([np.quantile(x[part], 0.995, axis=0) for x in sizes])  # noqa: E731
    if np.all(reach(last) <= FURTHER * reach(~last)):
        return ~last
    duration = n * np.median(np.diff(signals.rows)) * signals.dt
    stretches = max(2, round(duration / STRETCH))
    return (np.arange(n) * stretches / n) % 1.0 < 1.0 - held_out


def _in_training(peaks: np.ndarray, rows: np.ndarray, training: np.ndarray) -> np.ndarray:
    """Instants as numbers of the kept rows next to them; those of the training part."""
    place = np.clip(np.searchsorted(rows, peaks[:, 0]), 0, len(rows) - 1)
    return np.column_stack([place, peaks[:, 1]])[training[place.astype(int)]]


class Fit(NamedTuple):
    """A set of members with fitted parameters."""

    members: tuple[Member, ...]  # as given: linearised where they were
    thetas: tuple[np.ndarray, ...]  # fitted parameters of each
    samples: tuple[np.ndarray, ...]  # (B, P) of each: fitted without block b
    error: Float[np.ndarray, "B J"]  # sum of squares on block b, fitted without it
    moments: Float[np.ndarray, "E J"]  # the same on stretches a fraction of a block long
    count: Float[np.ndarray, "B J"]  # rows of block b
    residual: Float[np.ndarray, "N J"]  # fitted on all blocks, on all rows
    feasible: bool  # is no parameter at a bound of its effect?

    def rms(self, joint: int) -> float:
        """Held-out root mean square error over the training blocks of one joint."""
        return float(np.sqrt(self.error[:, joint].sum() / max(self.count[:, joint].sum(), 1)))

    def stderr(self, which: int) -> np.ndarray:
        """Standard errors (P,) of one member's parameters: block jackknife."""
        samples = self.samples[which]
        b = len(samples)
        return np.sqrt((b - 1) / b * np.sum((samples - samples.mean(0)) ** 2, axis=0))


def used(data: Data) -> np.ndarray:
    """Rows (N, J) that count: not those where a rest begins or ends."""
    return data.moving | data.resting


def only(data: Data, joints: tuple[int, ...]) -> Data:
    """The rows of some joints."""
    pick = list(joints)
    return data._replace(
        base=data.base[:, pick],
        slide=data.slide[:, pick],
        grip=data.grip[:, pick],
        peaks=tuple(data.peaks[j] for j in pick),
        moving=data.moving[:, pick],
        resting=data.resting[:, pick],
        floor=data.floor[pick],
        command=data.command[pick],
    )


def fit(data: Data, members: tuple[Member, ...], weight: np.ndarray, joints: tuple[int, ...] | None = None) -> Fit:
    """Least squares over the training rows, weighted by ``weight`` (J,) or (N, J) [1/N or 1/Nm]; ``joints`` alone if given."""
    pick: slice | list[int] = slice(None)
    if joints is not None and len(joints) < data.base.shape[1]:
        pick, data, weight = list(joints), only(data, joints), weight[..., list(joints)]
    sizes = [len(m.theta) for m in members]
    theta0 = np.concatenate([m.theta for m in members]) if members else np.zeros(0)
    stack = lambda part: np.concatenate([getattr(m.slopes, part)[..., pick] for m in members])  # noqa: E731
    total = lambda part: sum(getattr(m.value, part)[..., pick] for m in members)  # noqa: E731
    zeros = [data.base, data.slide, data.grip]
    if members:
        zeros = [zero + total(part) for zero, part in zip(zeros, Contribution._fields, strict=True)]
        parts = [*zeros, *map(stack, Contribution._fields)]
        problem = _Problem(data, weight, *_in_commands(parts, members, sizes, pick), theta0)
    else:
        problem = _Problem(data, weight, *zeros, *[np.zeros((0, *data.base.shape))] * 3, theta0)
    limits = [_limits(m) for m in members]
    lower = np.concatenate([low for low, _ in limits]) - theta0 if members else theta0
    upper = np.concatenate([high for _, high in limits]) - theta0 if members else theta0
    places = np.cumsum([0, *sizes])
    penalty = np.concatenate([_smoothness(m, at) for m, at in zip(members, places, strict=False)] or [np.zeros((0, 2), int)])
    problem.shaped = [
        _shaping(m, at, data, pick) for m, at in zip(members, places, strict=False) if "motor_inertia" in m.candidate.free
    ]
    step, steps = problem.solve(lower, upper, penalty)
    feasible = all(map(_inside, members, np.split(theta0 + step, np.cumsum(sizes)[:-1]))) if members else True
    cuts = np.cumsum(sizes)[:-1]
    size = problem.typical(step)
    residual = problem.residual(np.broadcast_to(step, (len(data.base), len(step))), np.arange(len(data.base)), size)
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
    return Fit(members, split(theta0 + step), split(theta0 + steps), error, moments, count, residual, feasible)


def _in_commands(
    parts: list[np.ndarray], members: tuple[Member, ...], sizes: list[int], pick: slice | list[int]
) -> list[np.ndarray]:
    """The balance in units of the command.

    Where the motor delivers s times its command the balance is divided by s: the error of the command that the model predicts.
    In torques delivered, s = 0 would leave no error at all.
    """
    for m, at in zip(members, np.cumsum([0, *sizes]), strict=False):
        if m.candidate.name != TorqueScale.name:
            continue
        scale = np.ones(m.value.net.shape[1])
        scale[m.candidate.joint] = m.theta[0]
        parts = [part / scale[pick] for part in parts]
        own = np.zeros(m.value.net.shape[1])
        own[m.candidate.joint] = 1.0 / m.theta[0]
        parts[3][at] -= (parts[0] - parts[1]) * own[pick]
    return parts


def _shaping(m: Member, at: int, data: Data, pick: slice | list[int]) -> tuple[int, int, float]:
    """Place of the motor's inertia among the parameters, its joint among those fitted, and the joint's whole inertia.

    Inertia on the motor's side does not multiply the encoder's noise: the more of it, the quieter the residual, whatever is true. The
    noise that is so taken away is added again.
    """
    name = m.candidate.free.index("motor_inertia")
    before = sum(np.size(getattr(m.effect, other)) for other in m.candidate.free[:name])
    joint = m.candidate.joint or 0
    column = joint if isinstance(pick, slice) else pick.index(joint)
    return at + before, column, float(np.median(data.signals.tables.inertia[:, joint, joint]))


def _limits(m: Member) -> tuple[np.ndarray, np.ndarray]:
    """How far one linear step may go: within the bounds, and for shapes not too far from where they are linearised."""
    low, high = m.candidate.bounds()
    theta = m.theta
    if not (m.candidate.loose or m.effect.linear):
        small = np.array([name in ("sine", "cosine", "bias", "scale", "level", "excess", "mass", "com") for name in _names(m)])
        reach = np.where(small, np.inf, STEP * np.abs(theta) + 1e-12)
        low, high = np.maximum(low, theta - reach), np.minimum(high, theta + reach)
    return low, high


def _inside(m: Member, theta: np.ndarray) -> bool:
    low, high = m.candidate.bounds()
    return m.candidate.at_bounds or bool(np.all(theta > low) and np.all(theta < high))


def _smoothness(m: Member, at: int) -> np.ndarray:
    """Pairs of neighbours in tables, by their places among all parameters from ``at`` on."""
    pairs, place = [], at
    for name in m.candidate.free:
        size = np.size(getattr(m.effect, name))
        if size > 3:
            pairs += [(place + k, place + k + 1) for k in range(size - 1)]
        place += size
    return np.array(pairs, int).reshape(-1, 2)


def _names(m: Member) -> list[str]:
    return [name for name in m.candidate.free for _ in range(np.size(getattr(m.effect, name)))]


@dataclass
class _Problem:
    """The linearised balance about the members' parameters: ``net0 + net @ step`` and so on."""

    data: Data
    weight: np.ndarray
    net0: np.ndarray
    slide0: np.ndarray
    grip0: np.ndarray
    net: np.ndarray  # (P, N, J)
    slide: np.ndarray
    grip: np.ndarray
    theta0: np.ndarray  # (P,) where it is linearised
    shaped: list[tuple[int, int, float]] = field(default_factory=list)  # see ``_shaping``

    def __post_init__(self) -> None:
        self.dry = np.any(self.slide0, 0) | np.any(self.grip0, 0) | np.any(self.slide, (0, 1)) | np.any(self.grip, (0, 1))
        self.at_rest_only = np.any(self.grip, (1, 2)) & ~np.any(self.slide, (1, 2)) & ~np.any(self.net, (1, 2))

    def _balance(self, step: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Balance, sliding friction and hold at ``rows`` (n,); ``step`` (P,), or (n, P) with one of its own for each row."""

        def at(zero: np.ndarray, slope: np.ndarray) -> np.ndarray:
            if not slope.any():
                return zero[rows]
            if step.ndim == 1:
                return zero[rows] + np.tensordot(step, slope[:, rows], 1)
            return zero[rows] + sum(step[:, p, None] * slope[p, rows] for p in range(len(slope)))

        return at(self.net0, self.net), at(self.slide0, self.slide), np.maximum(at(self.grip0, self.grip), 0.0)

    def residual(self, step: np.ndarray, rows: np.ndarray, size: np.ndarray) -> np.ndarray:
        """What is left (n, J) at ``rows``; at rest nothing is thought to be known to better than ``size`` (J,)."""
        net, slide, grip = self._balance(step, rows)
        moving = net - slide
        resting = self.data.resting[rows] & self.dry
        if not resting.any():
            return moving
        beyond = np.maximum(np.abs(net) - grip, 0.0)
        held = np.sign(net) * np.maximum(beyond, np.minimum(np.abs(net), size))
        return np.where(resting, held, moving)

    def typical(self, step: np.ndarray) -> np.ndarray:
        """Error in motion (J,), which friction is not believed to undo at rest; never below three times the noise."""
        rows = np.flatnonzero(self.data.block >= 0)[::4]
        net, slide, _ = self._balance(step, rows)
        moving = self.data.moving[rows]
        rms = np.sqrt(np.sum((net - slide) ** 2 * moving, 0) / np.maximum(moving.sum(0), 1))
        return SHARE_AT_REST * np.maximum(rms, 3.0 * self.data.floor)

    def solve(self, lower: np.ndarray, upper: np.ndarray, neighbours: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Step (P,) from all blocks, and (B, P) from all but one each; ``neighbours`` (n, 2) are held together a little."""
        blocks = self.data.block.max() + 1
        step = np.clip(np.zeros(len(lower)), lower, upper)
        if not len(lower):
            return step, np.tile(step, (blocks, 1))
        pinned = self.at_rest_only.copy()
        gram, right = np.zeros(0), np.zeros(0)
        sticking = bool((self.data.resting & self.dry).any())
        for _ in range(3 if sticking else 1):
            gram, right = self._normal(step)
            gram += _together(gram, neighbours)
            self._quieten(gram, right)
            for _ in range(4):
                step[~pinned] = _solve(gram.sum(0), right.sum(0), step, ~pinned)
                wrong = ~pinned & ((step < lower) | (step > upper))
                step = np.clip(step, lower, upper)
                if not wrong.any():
                    break
                pinned |= wrong
            self._cover(step, np.ones(len(self.data.base), bool), lower)
        steps = np.tile(step, (blocks, 1))
        steps[:, ~pinned] = _solve(gram.sum(0) - gram, right.sum(0) - right, step, ~pinned)
        if self.at_rest_only.any():
            for b in range(blocks):
                self._cover(steps[b], self.data.block != b, lower)
        return step, steps

    def _normal(self, step: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Normal equations (B, P, P) and (B, P) of each training block."""
        rows = np.flatnonzero(self.data.block >= 0)
        counted = used(self.data)[rows].astype(float)
        columns, target = self.net[:, rows] - self.slide[:, rows], self.net0[rows] - self.slide0[rows]
        resting = self.data.resting[rows] & self.dry
        if resting.any():
            net, _, grip = self._balance(step, rows)
            loose = np.abs(net) > grip + self.typical(step)
            columns = np.where(resting, self.net[:, rows] - np.sign(net) * self.grip[:, rows], columns)
            target = np.where(resting, self.net0[rows] - np.sign(net) * self.grip0[rows], target)
            counted = np.where(resting & ~loose, 0.0, counted)
        weight = self.weight[rows] if self.weight.ndim == 2 else self.weight
        both = np.concatenate([columns, target[None]]) * (counted * weight)
        edges = np.flatnonzero(np.diff(self.data.block[rows], prepend=-1))
        parts = [part.reshape(len(both), -1) for part in np.split(both, edges[1:], axis=1)]
        product = np.stack([part @ part.T for part in parts])
        return product[:, :-1, :-1], -product[:, :-1, -1]

    def _quieten(self, gram: np.ndarray, right: np.ndarray) -> None:
        """The noise that motor inertia takes away, as one more residual √n·floor·√(1 − (1 − share)²) spread over the blocks."""
        for place, joint, inertia in self.shaped:
            share = np.clip(self.theta0[place] / inertia, 1e-3, 1.0 - 1e-3)
            weight = self.weight[..., joint].mean() * self.data.floor[joint]
            size = weight * np.sqrt(np.sum(self.data.block >= 0) / len(gram))
            value = np.sqrt(1.0 - (1.0 - share) ** 2)
            slope = size * (1.0 - share) / (value * inertia)
            gram[:, place, place] += slope**2
            right[:, place] -= slope * size * value

    def _cover(self, step: np.ndarray, among: np.ndarray, lower: np.ndarray) -> None:
        """Levels that act at rest only: what rests typically withstood before they ended, beyond what other friction holds."""
        for p in np.flatnonzero(self.at_rest_only):
            step[p] = lower[p]
            (j,) = np.flatnonzero(np.any(self.grip[p], 0))[:1]
            rows = np.flatnonzero((self.data.block >= 0) & among & self.data.resting[:, j])
            peaks = self.data.peaks[j]
            peaks = peaks[among[peaks[:, 0].astype(int)]]
            if len(rows) and len(peaks):
                _, _, grip = self._balance(step, rows)
                step[p] = max(lower[p] + np.median(peaks[:, 1]) - np.median(grip[:, j]), lower[p])


def _together(gram: np.ndarray, neighbours: np.ndarray) -> np.ndarray:
    """Penalty (P, P), spread over the blocks, on differences of neighbours: what no data shows is as beside it."""
    out = np.zeros(gram.shape[1:])
    size = np.diagonal(gram.sum(0))
    for a, b in neighbours:
        strength = TOGETHER * np.mean(size[neighbours])
        out[[a, b], [a, b]] += strength
        out[[a, b], [b, a]] -= strength
    return out / len(gram)


def _solve(gram: np.ndarray, right: np.ndarray, step: np.ndarray, free: np.ndarray) -> np.ndarray:
    """The free part of the solution (..., F), the rest of ``step`` being given.

    Scaled, and slightly damped so that what the data does not show stays where it is.
    """
    if not free.any():
        return np.zeros((*gram.shape[:-2], 0))
    a = gram[..., free, :][..., :, free]
    y = right[..., free] - gram[..., free, :][..., :, ~free] @ step[~free]
    scale = np.sqrt(np.maximum(np.diagonal(a, axis1=-2, axis2=-1), 1e-300))
    a = a / (scale[..., :, None] * scale[..., None, :]) + RIDGE * np.eye(a.shape[-1])
    return np.linalg.solve(a, (y / scale)[..., None])[..., 0] / scale


def updated(found: Fit, data: Data) -> tuple[Member, ...]:
    """The members at their fitted parameters: the torque passes through them in their order."""
    signals, tau, out = data.signals, data.tau, []
    for m, theta in zip(found.members, found.thetas, strict=True):
        low, high = m.candidate.bounds()
        effect = with_parameters(m.effect, m.candidate.free, np.clip(theta, low, high))
        if effect.linear and m.delivered is None and not _needs_torque(effect):
            out.append(_moved(m, effect, theta))
        else:
            out.append(member(m.candidate, effect, signals, tau))
        if out[-1].delivered is not None:
            tau = out[-1].delivered
    return tuple(out)


def _needs_torque(effect: Effect) -> bool:
    return effect.name == "load_dependent_friction"


def _moved(m: Member, effect: Effect, theta: np.ndarray) -> Member:
    """A member linear in its parameters, elsewhere: no need to compute it again."""
    step = theta - m.theta
    value = Contribution(*(v + np.tensordot(step, s, 1) for v, s in zip(m.value, m.slopes, strict=True)))
    return replace(m, effect=effect, value=value)
