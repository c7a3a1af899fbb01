"""The design of a motion: gradient descent from several random starts side by side.

Position, speed and acceleration are within their limits by construction
(:meth:`jaxidl.excite.plan.Plan.motion`). Torques and distances between shapes are penalised on the
way, distances by their linearisation where shapes are close (as in TrajOpt, Schulman et al. 2014);
at the end each motion is made smaller about its start until it keeps them all, at every sample.
The random starts are made smaller likewise, and the best of all of them is returned: where limits
of torque or clearance leave little room, the descent may end below its start.
"""

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxidl.backend import jit_quickly
from jaxidl.errors import ConfigurationError
from jaxidl.excite.motion import basis, instants
from jaxidl.excite.plan import Plan, random_start
from jaxidl.models.training import adam
from jaxidl.systems.bounds import Near, Shapes
from jaxidl.systems.tables import inverse_dynamics

RATE = 0.06  # of Adam, in units of the random start's coefficients
CHUNK = 10  # steps between two looks at shapes, progress and Ctrl-C
PENALTY = (3.0, 100.0)  # weight of violated limits, from the first step to the last
PLACES = 64  # close places of shapes that one step sees
AHEAD = 2.0  # clearances within which shapes count as close
SMALLER = 0.97  # factor by which a motion is made smaller until it keeps its limits
LEAST = 0.02  # smaller than this, it is none


@dataclass(frozen=True)
class Effort:
    """How much is searched."""

    starts: int = 4
    steps: int = 150
    seed: int = 0


class Designed(NamedTuple):
    """A motion that keeps its limits: T samples of J joints."""

    time: np.ndarray  # (T,) [s]
    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray
    tau: np.ndarray  # what the model needs for it [N or Nm]
    value: float  # of the criterion
    random: float  # of the criterion, the median of the random starts within the same limits
    smaller: float  # factor by which it was made smaller at the end
    course: tuple[float, ...]  # best value after each chunk
    chance: tuple[np.ndarray, np.ndarray, np.ndarray]  # that random motion's q, qd, qdd
    descended: bool  # whether the descent found more than the best random start


class _Places(NamedTuple):
    """Close places of one start (M), padded."""

    row: Any
    distance: Any
    slope: Any  # (M, J)
    q: Any  # (M, J) position that they were found at


def design(
    plan: Plan,
    shapes: Shapes | None = None,
    effort: Effort = Effort(),
    sampling: float = 100.0,
    watch: Callable[[float], None] = lambda share: None,
) -> Designed:
    """Return the best motion found, also if it is interrupted.

    Args:
        plan: what is to be designed.
        shapes: of the mechanism; None: nothing can touch.
        effort: number of starts and steps, and the seed of the starts.
        sampling: rate of the result [Hz].
        watch: called with the share that is done; what it raises as KeyboardInterrupt ends the
            search, and the best motion so far is returned.

    Raises:
        ConfigurationError: if the start posture itself is not within the limits of torque and
            clearance.
    """
    check_start(plan, shapes)
    rng = np.random.default_rng(effort.seed)
    size = np.stack([random_start(plan, rng) for _ in range(effort.starts)])
    # a unit of a coefficient is the same for all of a joint
    unit = np.sqrt(np.mean(size**2, axis=(0, 2)))[:, None]
    u = jnp.asarray(size / unit)
    optimiser = adam(RATE)
    state = jax.vmap(optimiser.init)(u)
    advance = jit_quickly(jax.vmap(_chunk(plan, unit, optimiser), (0, 0, 0, None)))
    best = np.asarray(u).copy()
    course: list[float] = []
    try:
        for done in range(0, effort.steps, CHUNK):
            watch(done / effort.steps)
            places = _stacked([_places(plan, np.asarray(z) * unit, shapes) for z in u])
            weight = PENALTY[0] * (PENALTY[1] / PENALTY[0]) ** (done / max(effort.steps, 1))
            u, state, values = advance(u, state, places, jnp.asarray(weight))
            good = np.isfinite(values)
            best = np.where(good[:, None, None], u, best)
            course.append(float(np.min(values, where=good, initial=np.inf)))
    except KeyboardInterrupt:
        pass  # the best so far is what was asked for
    watch_safely(watch, 0.95)
    judge = jit_quickly(plan.judged)
    chances = _all_finished(plan, size, shapes, sampling, judge)
    ends = _all_finished(plan, best * unit, shapes, sampling, judge)
    if not chances + ends:
        raise ConfigurationError(
            "room for a motion around the start",
            "none within the limits of torque and clearance",
            "give another --start, or wider limits",
        )
    end = min(ends + chances, key=lambda e: e.value)
    middle = chances[len(chances) // 2] if chances else end
    return end._replace(
        random=middle.value,
        course=tuple(course),
        chance=(middle.q, middle.qd, middle.qdd),
        descended=any(end is e for e in ends),
    )


def _all_finished(plan: Plan, each: Any, *how: Any) -> list[Designed]:
    """Return the motions that have room within the limits, the best one first."""
    found = (finished(plan, z, *how) for z in each)
    return sorted((f for f in found if f is not None), key=lambda f: f.value)


def random_motion(plan: Plan, shapes: Shapes | None, seed: int, sampling: float) -> Designed:
    """Return a random motion of the plan's kind that keeps the same limits, to compare with."""
    z = random_start(plan, np.random.default_rng([seed, 1]))
    found = finished(plan, z, shapes, sampling, jit_quickly(plan.judged))
    assert found is not None, "a random motion without room"
    return found


def watch_safely(watch: Callable[[float], None], share: float) -> None:
    """Report progress; an interruption now would lose what was found."""
    with contextlib.suppress(KeyboardInterrupt):
        watch(share)


def check_start(plan: Plan, shapes: Shapes | None) -> None:
    """Raise ConfigurationError unless the mechanism can rest at the start within its limits."""
    q, limits = plan.limits.start[None], plan.limits
    torque = np.abs(inverse_dynamics(plan.know.body, q, 0.0 * q, 0.0 * q)[0])
    for name, needed, most in zip(limits.names, torque, limits.torque, strict=True):
        if needed > most:
            raise ConfigurationError(
                f"a start that {name} holds with {most:.4g}, its torque limit less the margin",
                f"{needed:.4g} needed there",
                "give another --start, or a higher torque limit",
            )
    if shapes is not None and (near := shapes.near(q)).bodies:
        raise ConfigurationError(
            f"shapes at least {shapes.clearance:g} m apart at the start",
            f"{near.distance[0]:.3g} m between {near.bodies[0]}",
            "give another --start, or a smaller clearance in --limits",
        )


def _chunk(plan: Plan, unit: np.ndarray, optimiser: Any) -> Callable[..., Any]:
    """Return a function that takes some steps from one start."""

    def loss(u: Any, places: _Places, weight: Any) -> Any:
        value, torque, q = plan.judged(u * unit)
        over = jnp.maximum(jnp.abs(torque) / plan.limits.torque[None] - 1.0, 0.0)
        moved = jnp.sum(places.slope * (q[places.row] - places.q), 1)
        inside = jnp.maximum(-(places.distance + moved), 0.0)
        return value + weight * (jnp.mean(jnp.sum(over**2, 1)) + jnp.mean(inside**2)), value

    def step(carry: Any, _: None) -> Any:
        u, state, places, weight = carry
        (_, value), slope = jax.value_and_grad(loss, has_aux=True)(u, places, weight)
        updates, state = optimiser.update(jnp.nan_to_num(slope), state)
        return (u + updates, state, places, weight), value

    def run(u: Any, state: Any, places: _Places, weight: Any) -> Any:
        carry, values = jax.lax.scan(step, (u, state, places, weight), None, CHUNK)
        return carry[0], carry[1], values[-1]

    return run


def _places(plan: Plan, z: np.ndarray, shapes: Shapes | None) -> _Places:
    """Return the closest places of a motion; distances are in clearances, less the clearance."""
    joints = len(plan.limits.names)
    if shapes is None:
        return _Places(*(np.zeros(0, int), np.zeros(0)), *(np.zeros((0, joints)),) * 2)
    q = np.asarray(plan.motion(z)[0])
    near: Near = shapes.near(q, AHEAD * shapes.clearance)
    worst = np.argsort(near.distance)[:PLACES]
    count = PLACES - len(worst)
    row = np.append(near.row[worst], np.zeros(count, int))
    distance = np.append(near.distance[worst] / shapes.clearance - 1.0, np.ones(count))
    slope = np.concatenate([near.slope[worst] / shapes.clearance, np.zeros((count, joints))])
    return _Places(row, distance, slope, q[row])


def _stacked(each: list[_Places]) -> _Places:
    return _Places(*(jnp.stack(list(map(jnp.asarray, x))) for x in zip(*each, strict=True)))


def finished(
    plan: Plan, z: np.ndarray, shapes: Shapes | None, sampling: float, judge: Any
) -> Designed | None:
    """Return the motion of coefficients ``z`` (J, K) at ``sampling`` [Hz], within all limits.

    None where it has no room.
    """
    times = instants(plan.seconds, sampling)
    at = basis(plan.kind, plan.seconds, plan.top, times)
    z = z * np.asarray(plan.motion(z, at)[3])[:, None]
    smaller = 1.0
    while True:
        q, qd, qdd, _ = (np.asarray(x) for x in plan.motion(smaller * z, at))
        tau = plan.needed(q, qd, qdd)
        kept = np.all(np.abs(tau) <= plan.limits.torque)
        if kept and (shapes is None or not len(shapes.near(q).row)):
            break
        smaller *= SMALLER
        if smaller < LEAST:
            return None
    value = float(judge(smaller * z)[0])
    return Designed(times, q, qd, qdd, tau, value, value, smaller, (), (q, qd, qdd), False)
