"""Physical parameters fitted to trajectories, by derivatives through the simulator.

The search fits the torque balance instant by instant (equation error): fast, convex where effects are linear, but blind to how
errors add up in motion. What it finds is here the start of a fit of *simulated positions* to measured ones (output error) over
short windows that begin at measured states: multiple shooting with the starts held (Bock 1983; short windows keep the problem
smooth: Ribeiro et al., Automatica 2020). What the derivative means where an effect is discontinuous is told in
:mod:`jaxidl.gap.trajectory`.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Float

from jaxidl.effects import AsymmetricFriction, Effect, OnJoint
from jaxidl.errors import ConfigurationError
from jaxidl.gap.data import data_of, instants_of, kept_rows, used
from jaxidl.gap.gauge import SHARED
from jaxidl.gap.rank import Ranking
from jaxidl.gap.rollout import SETTLE, rollout_errors
from jaxidl.gap.signals import Signals
from jaxidl.gap.terms import parameters_of
from jaxidl.gap.trajectory import MOMENTS, Free, Problem, changed
from jaxidl.systems import Plant

WINDOW = 0.4  # of a rollout [s]
FEWEST, MOST = 8, 96  # windows on either side
LEAST_GAIN = 0.05  # of the held-out rollout error,
SURE = 2.0  # and as many standard errors: what counts as better
DEARER = 0.1  # by so much may a joint's held-out torque error grow, or its rollout error after the longest horizon

Bounds = Mapping[str, tuple[float, float]]  # lower and upper bound of each free parameter of an effect
Values = dict[str, np.ndarray]  # of an effect's free parameters


class Proof(NamedTuple):
    """One set of parameters on the data kept aside. J values each."""

    score: float  # root mean square position error over windows and joints, relative to that of training at the start [1]
    lost: int  # windows in which the simulation ran away
    torque_rms: list[float]  # [N or Nm]
    rollout_rms: dict[str, list[float]]  # by horizon [m or rad]


class Refinement(NamedTuple):
    """What :func:`refine` found."""

    accepted: bool
    reason: str  # why, or why not
    effects: tuple[Effect, ...]  # to use: refined if accepted, as given if not
    given: tuple[Values, ...]  # of each effect: its free parameters as given,
    refined: tuple[Values, ...]  # as refined, accepted or not,
    stderr: tuple[Values, ...]  # and their standard errors, of the scatter between windows; zero of one without influence
    window: float  # [s]
    windows: tuple[int, int]  # of training, and kept aside
    before: Proof | None = None  # None where nothing could be tried
    after: Proof | None = None  # of the refined ones, accepted or not
    residual: Float[np.ndarray, "N J"] | None = None  # of the torque balance with the refined ones [N or Nm]


def refine(
    model: Plant,
    found: Sequence[Effect],
    signals: Signals,
    free: Sequence[Bounds],
    *,
    held_out: float = 0.3,
    window: float = WINDOW,
) -> Refinement:
    """Fit parameters of the effects ``found`` to measured trajectories: bounded Levenberg-Marquardt through the simulator.

    Windows of ``window`` seconds, end to end and wholly in the rows of training, start from measured (smoothed) states; hidden
    states are led along as in :func:`jaxidl.gap.rollout.rollout_errors`. Minimised is the squared error of position at ten
    moments of each window, each joint's relative to its own at the start. Simulated is with the log's sampling interval: what
    steps of that size make of a motion goes into the parameters.

    The refined parameters are accepted if, on windows wholly in the rows kept aside, the root of this error falls by
    ``LEAST_GAIN``, and the windows' mean by more than ``SURE`` standard errors of their paired differences; if no more windows
    run away; and if neither a joint's held-out torque error nor its error after the longest horizon grows by more than
    ``DEARER``. Else the effects stay as given. A window that is not finite, or off by more than a joint's whole range, counts as
    off by that range and has no derivative: dry friction and delays have the derivative of the branch taken, encoders none (see
    :mod:`jaxidl.gap.trajectory`). Where the parameters given were fitted to the torques of the whole log, as a diagnosis tells
    them, both sides of the comparison have that in common.

    Args:
        model: the plant for which ``signals`` were prepared.
        found: effects of the whole mechanism that it lacks.
        signals: the log, T instants of J joints.
        free: of each effect found, its free parameters with bounds; those of encoders, which no rollout sees, are left alone.
        held_out: share of the rows that is kept aside, as :func:`jaxidl.gap.data.kept_rows` chooses them.
        window: [s].

    Raises:
        ConfigurationError: for a window of fewer than ten samples, or a parameter that starts out of its bounds.
    """
    length = round(window / signals.dt)
    if length < MOMENTS:
        raise ConfigurationError(f"a window of {MOMENTS} samples or more", f"{window:g} s", "choose a longer one")
    found = tuple(found)
    free = tuple({} if _senses(effect) else dict(bounds) for effect, bounds in zip(found, free, strict=True))
    names: Free = (*(() for _ in model.effects), *map(tuple, free))
    lower, upper = _limits(found, free)
    with jax.enable_x64(True):
        plant = Plant(model.body, (*model.effects, *found))
        seen, aside = signals.behind(found), instants_of(signals, ~kept_rows(signals, held_out))
        training, proving = (_starts(seen, rows, length) for rows in (~aside, aside))
        given = _named(np.concatenate([np.zeros(0), *_vectors(found, free)]), found, free)
        nothing = Refinement(False, "", found, given, given, _zero(given), window, (len(training), len(proving)))
        if not len(lower):
            return nothing._replace(reason="there is no parameter to refine")
        if min(nothing.windows) < FEWEST:
            return nothing._replace(reason=f"there are fewer than {FEWEST} windows of {window:g} s to fit or to prove it")
        problem = Problem(plant, names, seen, training, length, _tied(found, free))
        if problem.hopeless:
            return nothing._replace(reason="the simulation runs away in every window")
        theta = problem.solve(lower, upper)
        refined = changed(plant, names, theta).effects[len(model.effects) :]
        (was, before, _), (now, after, residual) = (
            _prove(problem, x, proving, effects, model, signals, seen, aside, held_out)
            for x, effects in ((problem.start, found), (theta, refined))
        )
        objection = _objection(was - now, before, after)
        return nothing._replace(
            accepted=not objection,
            reason=objection or "the simulation follows the motion kept aside more closely",
            effects=found if objection else refined,
            refined=_named(theta, found, free),
            stderr=_named(problem.stderr(theta), found, free),
            before=before,
            after=after,
            residual=residual,
        )


def torque_residual(model: Plant, effects: Sequence[Effect], signals: Signals, held_out: float) -> tuple[np.ndarray, np.ndarray]:
    """What the model with the effects lacks in torque (N, J), and its root mean square (J,) on the rows kept aside [N or Nm].

    As a diagnosis of the patched model would begin: no effect is fitted, but where within a sample a torque acts is.
    """
    data = data_of(signals, model.effects, held_out, effects)
    residual = Ranking(data, (), 0.0).fit.residual
    counted = (data.block < 0)[:, None] & used(data)
    return residual, np.sqrt(np.sum(residual**2 * counted, 0) / np.maximum(counted.sum(0), 1))


def _prove(
    problem: Problem,
    theta: np.ndarray,
    proving: np.ndarray,
    effects: tuple[Effect, ...],
    model: Plant,
    signals: Signals,
    seen: Signals,
    aside: np.ndarray,
    held_out: float,
) -> tuple[np.ndarray, Proof, np.ndarray]:
    """Error (V,) of each window kept aside, what they say together, and the torque balance's residual (N, J)."""
    errors, lost = problem.score(theta, proving)
    residual, torque = torque_residual(model, effects, signals, held_out)
    far = rollout_errors(Plant(model.body, (*model.effects, *effects)), seen, aside)
    proof = Proof(float(np.sqrt(np.mean(errors**2))), int(lost.sum()), torque.tolist(), {h: e.tolist() for h, e in far.items()})
    return errors, proof, residual


def _objection(drop: np.ndarray, before: Proof, after: Proof) -> str:
    """Why the refined parameters are not to be used, given by how much each window's error (V,) fell; or nothing."""
    if after.lost > before.lost:
        return "the simulation runs away in more windows than before"
    if not after.score < (1.0 - LEAST_GAIN) * before.score:
        return f"the error of motion kept aside does not fall by {LEAST_GAIN:.0%}"
    if not drop.mean() > SURE * drop.std(ddof=1) / np.sqrt(len(drop)):
        return "the error of motion kept aside falls by no more than its uncertainty"
    if _dearer(before.torque_rms, after.torque_rms):
        return f"the error of torques kept aside grows by more than {DEARER:.0%}"
    horizon = max(before.rollout_rms, key=float)
    if _dearer(before.rollout_rms[horizon], after.rollout_rms[horizon]):
        return f"the error after {horizon} s of motion kept aside grows by more than {DEARER:.0%} on a joint"
    return ""


def _dearer(before: list[float], after: list[float]) -> bool:
    return any(b > (1.0 + DEARER) * a or (np.isnan(b) and not np.isnan(a)) for a, b in zip(before, after, strict=True))


def _starts(signals: Signals, rows: np.ndarray, length: int) -> np.ndarray:
    """First instants (W,) of at most ``MOST`` windows wholly in ``rows`` (T,), end to end; see also ``window_starts``."""
    starts = []
    for run in signals.slices:
        first = run.start + round(SETTLE / signals.dt)
        while first + length < run.stop - signals.late:
            outside = np.flatnonzero(~rows[first : first + length + 1])
            if len(outside):
                first += int(outside[-1]) + 1
            else:
                starts.append(first)
                first += length
    picked = np.linspace(0, len(starts) - 1, min(MOST, len(starts))).astype(int)
    return np.array(starts, int)[picked]


def _inner(effect: Effect) -> Effect:
    return effect.effect if isinstance(effect, OnJoint) else effect


def _senses(effect: Effect) -> bool:
    """Does the effect lie between the joint and its encoder?"""
    return type(_inner(effect)).sense is not Effect.sense


def _tied(found: Sequence[Effect], free: Sequence[Bounds]) -> list[tuple[int, int]]:
    """Pairs of places of what friction by direction has in common with plain friction on the same joint: that stays there."""
    places, at = {}, 0
    for effect, bounds in zip(found, free, strict=True):
        for name in bounds:
            joint = effect.joint if isinstance(effect, OnJoint) else None
            places[_inner(effect).name, joint, name] = at
            at += np.size(getattr(_inner(effect), name))
    pairs = []
    for (effect, joint, name), place in places.items():
        other = places.get((effect, joint, name.replace("positive", "negative")))
        if effect == AsymmetricFriction.name and name in SHARED and other is not None:
            partner, parameter = SHARED[name]
            pairs += [(place, other)] * ((partner, joint, parameter) in places)
    return pairs


def _vectors(found: Sequence[Effect], free: Sequence[Bounds]) -> list[np.ndarray]:
    return [parameters_of(_inner(effect), tuple(bounds)) for effect, bounds in zip(found, free, strict=True)]


def _limits(found: Sequence[Effect], free: Sequence[Bounds]) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper bounds (P,), within which the parameters start and which are no wider than the catalogue's."""
    lower, upper = [np.zeros(0)], [np.zeros(0)]
    for effect, bounds in zip(map(_inner, found), free, strict=True):
        for name, (low, high) in bounds.items():
            spec, value = effect.parameters[name], np.ravel(np.asarray(getattr(effect, name), float))
            low, high = max(low, spec.lower), min(high, spec.upper)
            if not (low < high and np.all((value >= low) & (value <= high))):
                expected = f"{effect.name}.{name} in [{low:g}, {high:g}] {spec.unit}"
                raise ConfigurationError(expected, str(value.tolist()), "start within the bounds, or widen them")
            lower.append(np.full(len(value), low))
            upper.append(np.full(len(value), high))
    return np.concatenate(lower), np.concatenate(upper)


def _named(theta: np.ndarray, found: Sequence[Effect], free: Sequence[Bounds]) -> tuple[Values, ...]:
    """The vector (P,) as the free parameters of each effect."""
    out, at = [], 0
    for effect, bounds in zip(map(_inner, found), free, strict=True):
        values: Values = {}
        for name in bounds:
            size = np.size(getattr(effect, name))
            values[name] = theta[at : at + size]
            at += size
        out.append(values)
    return tuple(out)


def _zero(values: tuple[Values, ...]) -> tuple[Values, ...]:
    return tuple({name: 0.0 * x for name, x in of.items()} for of in values)
