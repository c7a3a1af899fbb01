"""Physical parameters fitted to trajectories, by derivatives through the simulator.

The search fits the torque balance instant by instant (equation error): fast, convex where effects
are linear, but blind to how errors accumulate in motion. Here its result is the starting point for
fitting *simulated positions* to measured ones (output error) over short windows that begin at
measured states: multiple shooting with fixed initial states (Bock 1983; short windows keep the
problem smooth: Ribeiro et al., Automatica 2020). What the derivative means where an effect is
discontinuous is explained in :mod:`jaxidl.replay.trajectory`.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Float

from jaxidl.effects import Effect
from jaxidl.errors import ConfigurationError
from jaxidl.gap.evidence.rows import instants_of, kept_rows, rms
from jaxidl.gap.fit.balance import balance, parts_of
from jaxidl.logs.signals import Signals
from jaxidl.replay.rollout import SETTLE, rollout_errors
from jaxidl.replay.trajectory import MOMENTS, WindowFit
from jaxidl.systems.free import Bounds, Free, Values, inner
from jaxidl.systems.plant import Plant

WINDOW = 0.4  # length of a rollout [s]
FEWEST, MOST = 8, 96  # number of windows on either side
LEAST_GAIN = 0.05  # share of the held-out rollout error that must be removed,
CLEAR = 2.0  # and number of standard errors by which it must fall
# share by which a joint's held-out torque error, or its rollout error after the longest horizon,
# may grow
DEARER = 0.1


class Proof(NamedTuple):
    """One set of parameters on held-out data; J values each."""

    # root mean square position error over windows and joints, relative to the initial one in
    # training [1]
    score: float
    lost: int  # windows in which the simulation diverged
    torque_rms: list[float]  # [N or Nm]
    rollout_rms: dict[str, list[float]]  # by horizon [m or rad]


class Refinement(NamedTuple):
    """The result of :func:`refine`."""

    accepted: bool
    reason: str  # why it was accepted or not
    effects: tuple[Effect, ...]  # effects to use: refined if accepted, as given if not
    given: tuple[Values, ...]  # for each effect, its free parameters as given
    refined: tuple[Values, ...]  # the same as refined, accepted or not
    # their standard errors from the scatter between windows; zero without influence
    stderr: tuple[Values, ...]
    window: float  # [s]
    windows: tuple[int, int]  # number of training windows, and of held-out ones
    before: Proof | None = None  # None where nothing could be tried
    after: Proof | None = None  # with the refined parameters, accepted or not
    # residual of the torque balance with the refined parameters [N or Nm]
    residual: Float[np.ndarray, "N J"] | None = None


def refine(
    model: Plant,
    found: Sequence[Effect],
    signals: Signals,
    free: Sequence[Bounds],
    *,
    held_out: float = 0.3,
    window: float = WINDOW,
    strange: np.ndarray | None = None,
) -> Refinement:
    """Fit parameters of the effects ``found`` to measured trajectories through the simulator.

    The fit is a bounded trust-region least-squares method. Windows of ``window`` seconds, end to
    end and wholly in the training rows, start from measured (smoothed) states; hidden states follow
    the measured motion as in :func:`jaxidl.replay.rollout.rollout_errors`. The fit minimises the
    squared position error at ten moments of each window, each joint's relative to its initial
    error. The simulation uses the log's sampling interval: errors of integration with steps of that
    size affect the parameters.

    The refined parameters are accepted if, on windows wholly in the held-out rows, the root of this
    error falls by ``LEAST_GAIN``, and the windows' mean by more than ``CLEAR`` standard errors of
    their paired differences; if no more windows diverge; and if neither a joint's held-out torque
    error nor its error after the longest horizon grows by more than ``DEARER``. Otherwise the
    effects stay as given. A window that is not finite, or whose error exceeds a joint's whole
    range, counts as an error of that range and has no derivative: dry friction and delays have the
    derivative of the branch taken, encoders none (see :mod:`jaxidl.replay.trajectory`). Where the
    given parameters were fitted to the torques of the whole log, as a diagnosis reports them, this
    applies to both sides of the comparison.

    Args:
        model: the plant for which ``signals`` were prepared.
        found: effects of the whole mechanism that it lacks.
        signals: the log, T instants of J joints.
        free: for each effect found, its free parameters with bounds; those of encoders, which do
            not affect a rollout, are not fitted.
        held_out: share of the rows that is held out, as :func:`jaxidl.gap.evidence.rows.kept_rows`
            chooses them.
        window: length of the rollouts [s].
        strange: (N,) moments that are left out, such as collisions. Default: none.

    Raises:
        ConfigurationError: for a window of fewer than ten samples, or a parameter that starts out
            of its bounds.
    """
    length = round(window / signals.dt)
    if length < MOMENTS:
        wanted = f"a window of {MOMENTS} samples or more"
        raise ConfigurationError(wanted, f"{window:g} s", "choose a longer one")
    found, own = tuple(found), len(model.effects)
    senses = lambda effect: type(inner(effect)).sense is not Effect.sense
    free = [{} if senses(e) else dict(bounds) for e, bounds in zip(found, free, strict=True)]
    with jax.enable_x64(True):
        vector = Free(Plant(model.body, (*model.effects, *found)), (*[()] * own, *free))
        (lower, upper), start = vector.bounds(), np.asarray(vector.vector)
        named = lambda theta: vector.named(theta)[own:]
        seen, aside = signals.behind(found), instants_of(signals, ~kept_rows(signals, held_out))
        out = np.zeros(len(signals.rows), bool) if strange is None else strange
        usual = ~instants_of(signals, out)
        training, proving = (_starts(seen, at & usual, length) for at in (~aside, aside))
        given, windows = named(start), (len(training), len(proving))
        nothing = Refinement(False, "", found, given, given, named(0.0 * start), window, windows)
        if not len(start):
            return nothing._replace(reason="there is no parameter to refine")
        if min(windows) < FEWEST:
            few = f"there are fewer than {FEWEST} windows of {window:g} s to fit or to verify it"
            return nothing._replace(reason=few)
        problem = WindowFit(vector, seen, training, length, _tied(vector, signals))
        if problem.hopeless:
            return nothing._replace(reason="the simulation diverges in every window")
        theta = problem.solve(lower, upper)
        refined = vector.set(theta).effects[own:]

        def proved(theta: np.ndarray, effects: tuple[Effect, ...]) -> tuple[Any, Proof, Any]:
            """Return each held-out window's error (V,), a summary, and the residual (N, J)."""
            errors, lost = problem.score(theta, proving)
            rows, residual = balance(signals, model.effects, effects, held_out)
            torque = rms(residual, rows.used & ~(rows.training | out)[:, None])
            plant = Plant(model.body, (*model.effects, *effects))
            far = rollout_errors(plant, seen, aside & usual)
            proof = Proof(
                float(np.sqrt(np.mean(errors**2))),
                int(lost.sum()),
                torque.tolist(),
                {h: e.tolist() for h, e in far.items()},
            )
            return errors, proof, residual

        was, before, _ = proved(problem.start, found)
        now, after, residual = proved(theta, refined)
        objection = _objection(was - now, before, after)
        return nothing._replace(
            accepted=not objection,
            reason=objection or "the simulation follows the held-out motion more closely",
            effects=found if objection else refined,
            refined=named(theta),
            stderr=named(problem.stderr(theta)),
            before=before,
            after=after,
            residual=residual,
        )


def _objection(drop: np.ndarray, before: Proof, after: Proof) -> str:
    """Return why refined parameters are not used, or nothing; errors fell by ``drop`` (V,)."""
    if after.lost > before.lost:
        return "the simulation diverges in more windows than before"
    if not after.score < (1.0 - LEAST_GAIN) * before.score:
        return f"the error of held-out motion does not fall by {LEAST_GAIN:.0%}"
    if not drop.mean() > CLEAR * drop.std(ddof=1) / np.sqrt(len(drop)):
        return "the error of held-out motion falls by no more than its uncertainty"
    if _dearer(before.torque_rms, after.torque_rms):
        return f"the error of held-out torques grows by more than {DEARER:.0%}"
    horizon = max(before.rollout_rms, key=float)
    if _dearer(before.rollout_rms[horizon], after.rollout_rms[horizon]):
        held_out = f"the error after {horizon} s of held-out motion"
        return f"{held_out} grows by more than {DEARER:.0%} on a joint"
    return ""


def _dearer(before: list[float], after: list[float]) -> bool:
    return any(
        b > (1.0 + DEARER) * a or (np.isnan(b) and not np.isnan(a))
        for a, b in zip(before, after, strict=True)
    )


def _starts(signals: Signals, rows: np.ndarray, length: int) -> np.ndarray:
    """Return first instants (W,) of at most ``MOST`` windows in ``rows`` (T,), end to end."""
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


def _tied(free: Free, signals: Signals) -> list[np.ndarray]:
    """Return directions (P,) of parameters that add what a simpler effect on the joint does."""
    found, at = [], 0
    where = {
        (inner(e).name, getattr(e, "joint", None)): n
        for e, n in zip(free.plant.effects, free.labels, strict=True)
    }
    start = np.asarray(free.vector)
    for effect, names in zip(free.plant.effects, free.labels, strict=True):
        size = sum(np.size(getattr(inner(effect), name)) for name in names)
        present = {
            part
            for part, joint in where
            if joint == getattr(effect, "joint", None) and where[part, joint]
        }
        for amplitudes in parts_of(effect, names, present, signals):
            row = np.zeros(len(start))
            row[at : at + size] = amplitudes / np.linalg.norm(amplitudes)
            found.append(row)
        at += size
    return found
