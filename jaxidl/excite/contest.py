"""The plan of a motion that tells the explanations of a diagnosis apart (T-optimal)."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from jaxidl.backend import jit_quickly
from jaxidl.effects import Effect
from jaxidl.errors import ConfigurationError
from jaxidl.excite.criteria import Contest, Evidence
from jaxidl.excite.doubt import Doubt, Explanation
from jaxidl.excite.limits import Limits
from jaxidl.excite.parameters import Parameter, known, states, terms_of
from jaxidl.excite.plan import Plan, random_start
from jaxidl.excite.prepare import ALIGNMENT, Prepared
from jaxidl.gap.result.diagnosis import Key
from jaxidl.logs.low_pass import BAND, HIGHEST_BAND
from jaxidl.logs.signals import Signals
from jaxidl.systems.mjcf import Model

STATEFUL = 50.0  # least rate of rows where an explanation has a hidden state [Hz]
PROBED = 3  # random motions on which it must stay finite
FASTER = 2.0  # factor of the highest frequency there
FIFTH = 2.5  # power of the band with which encoder noise in the torque grows


def pairs(sets: Sequence[tuple[Key, ...]]) -> tuple[tuple[int, int], ...]:
    """Return which explanations could be refuted in favour of which: (true one, fitted one).

    One that has all effects of another imitates it on any motion, with its others at zero.
    """
    return tuple(
        (a, b)
        for a, one in enumerate(sets)
        for b, other in enumerate(sets)
        if not set(one) <= set(other)
    )


def contested(found: Doubt, model: Model, limits: Limits, **options: Any) -> Prepared:
    """Return the plan of a motion that tells the explanations of a doubt apart.

    A fit of one explanation to another may change its own parameters, and by how much the torque is
    logged late. Other effects may not help: each would cost more of the gap finder's prior than it
    allows an equal explanation.
    """
    inside = limits.planned()
    know = known(model, inside)
    at = states(know, inside)
    joints = len(model.names)
    rows: list[np.ndarray] = []
    whole: list[Effect] = []
    value: list[int] = []
    places: list[tuple[int, ...]] = []
    parameters: list[Parameter] = []
    wide: list[float] = []
    for e in found.explanations:
        first = len(whole)
        whole += [*e.effects, *(m[1] for m in e.moved)]
        total = np.zeros(len(whole))
        total[first : first + len(e.effects)] = 1.0
        value.append(len(rows))
        rows.append(total)
        parameters.append(Parameter("explanation", None, f"{len(value)}", "1"))
        wide.append(1.0)
        start = len(rows)
        for n, (which, _, step) in enumerate(e.moved):
            row = np.zeros(len(whole))
            row[first + len(e.effects) + n], row[first + which] = 1.0 / step, -1.0 / step
            rows.append(row)
        places.append(tuple(range(start, len(rows))))
        parameters += e.labels
        wide += e.wide
    mix = np.stack([np.pad(r, (0, len(whole) - len(r))) for r in rows])
    terms = terms_of(whole, mix, joints)
    sizes = np.array([*wide, *[found.signals.dt] * joints])
    shared = tuple(range(len(rows), len(rows) + joints))
    contest = Contest(
        tuple(value),
        tuple((*shared, *own) for own in places),
        tuple(sizes.tolist()),
        pairs([e.keys for e in found.explanations]),
        tuple(found.left.tolist()),
        tuple(found.floor.tolist()),
        tuple(np.std(found.signals.tau, axis=0).tolist()),
        (BAND[0] / found.signals.band) ** FIFTH,
        (min(BAND[1], HIGHEST_BAND / found.signals.dt) / found.signals.band) ** FIFTH,
        tuple(found.rate.tolist()),
        tuple(e.asked for e in found.explanations),
    )
    stateful = any(map(_stateful, found.explanations))
    # what a drive does in time shows in how torques differ by frequency
    top = options.get("top", Plan.top) * (FASTER if stateful else 1.0)
    own = {**options, "top": top}
    plan = Plan(know, inside, terms, sizes, found.noise, criterion="t", contest=contest, **own)
    if stateful:
        steady = simulable(plan, 1.0 / found.signals.dt)
        if steady is None:
            return contested(without(found), model, limits, **options)
        plan = steady
    timing = [Parameter(ALIGNMENT, j, "late", "s") for j in range(joints)]
    old = earlier(plan, found.signals)
    return Prepared(replace(plan, earlier=old), (*parameters, *timing), at)


def simulable(plan: Plan, most: float) -> Plan | None:
    """Return the plan with so many rows that its explanations stay finite on random motions.

    An explanation with a hidden state, such as an elastic drive, is simulated from row to row. None
    if that fails even at the rate ``most`` [Hz].
    """
    rng = np.random.default_rng(0)
    for rate in (*(STATEFUL * 2**k for k in range(6) if STATEFUL * 2**k < most), most):
        finer = replace(plan, rate=max(rate, plan.rate))
        run = jit_quickly(lambda q, qd, qdd, p=finer: p.evidence(q, qd, qdd, p.dt)[0])
        motions = (finer.motion(random_start(finer, rng))[:3] for _ in range(PROBED))
        if all(np.isfinite(x).all() for motion in motions for x in run(*motion)):
            return finer
    return None


def without(found: Doubt) -> Doubt:
    """Return a doubt without the explanations that have a hidden state.

    Raises:
        ConfigurationError: if fewer than two are left.
    """
    kept = [n for n, e in enumerate(found.explanations) if not _stateful(e)]
    if len(kept) < 2:
        raise ConfigurationError(
            "two explanations that can be simulated on other motions",
            ", ".join(found.titles),
            "leave out --for: a motion for all effects",
        )
    return found._replace(
        explanations=tuple(found.explanations[n] for n in kept),
        titles=tuple(found.titles[n] for n in kept),
    )


def _stateful(explanation: Explanation) -> bool:
    inner = (getattr(effect, "effect", effect) for effect in explanation.effects)
    return any(type(effect).actuate is not Effect.actuate for effect in inner)


def earlier(plan: Plan, signals: Signals) -> Evidence:
    """Return what a log tells about a plan's columns; the torque is the log's command."""
    run = jit_quickly(lambda q, qd, qdd, dt: plan.evidence(q, qd, qdd, dt)[0], static_argnums=3)
    found: list[Evidence] = []
    stride = max(1, round(plan.dt / signals.dt))
    for part in signals.slices:
        pick = slice(part.start, part.stop, stride)
        motion = (signals.q[pick], signals.qd[pick], signals.qdd[pick])
        if len(motion[0]) > 2:
            dt = float(stride * signals.dt)
            sums = dt * signals.tau[pick].sum(0), dt * (signals.tau[pick] ** 2).sum(0)
            found.append(run(*motion, dt)._replace(total=sums[0], square=sums[1]))
    return Evidence(*(sum(np.asarray(x) for x in part) for part in zip(*found, strict=True)))
