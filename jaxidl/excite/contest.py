"""The plan of a motion that tells the explanations of a diagnosis apart (T-optimal)."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from jaxidl.backend import jit_quickly
from jaxidl.effects import CATALOGUE, Effect
from jaxidl.errors import ConfigurationError
from jaxidl.excite.criteria import Contest
from jaxidl.excite.doubt import Doubt, Explanation
from jaxidl.excite.limits import Limits
from jaxidl.excite.parameters import (
    Known,
    Parameter,
    Terms,
    common,
    known,
    probed,
    states,
    terms_of,
)
from jaxidl.excite.plan import Plan, random_start
from jaxidl.excite.prepare import ALIGNMENT, Prepared, unit_of
from jaxidl.gap.additions import Drive
from jaxidl.gap.diagnosis import Key
from jaxidl.gap.library import scales
from jaxidl.gap.shape import shapes_of
from jaxidl.logs.signals import Signals
from jaxidl.systems.mjcf import Model

# share of a joint's torque by which effects beside those in question may help: a good model's error
BESIDE = 0.005
STATEFUL = 50.0  # least rate of rows where an explanation has a hidden state [Hz]
PROBED = 3  # random motions on which it must stay finite


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

    In a fit of one explanation to another, the common effects that are not in question may take
    part, too, each by as little as a good model may be wrong: many small helpers could imitate
    almost anything, but no diagnosis would name them all.
    """
    inside = limits.planned()
    know = known(model, inside)
    at = states(know, inside)
    joints = len(model.names)
    disputed = {k for e in found.explanations for k in e.keys}
    every = scales(found.signals, np.asarray(found.noise.torque))
    offered = [s for name in common() for scale in every for s in shapes_of(CATALOGUE[name], scale)]
    free = [s for s in offered if (s.cls.name, s.joint) not in disputed]
    labels, effects, sizes = probed(free, model.kinds)
    rows: list[np.ndarray] = list(np.diag(1.0 / sizes)) if len(sizes) else []
    whole: list[Effect] = list(effects)
    value: list[int] = []
    places: list[tuple[int, ...]] = []
    parameters, wide = list(labels), [0.0] * len(labels)
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
    common_size = _plausible(know, terms, at, len(labels))
    sizes = np.array([*common_size, *wide[len(labels) :], *[found.signals.dt] * joints])
    shared = (*range(len(labels)), *range(len(rows), len(rows) + joints))
    contest = Contest(
        tuple(value),
        tuple((*shared, *own) for own in places),
        tuple(sizes.tolist()),
        pairs([e.keys for e in found.explanations]),
    )
    plan = Plan(know, inside, terms, sizes, found.noise, criterion="t", contest=contest, **options)
    if any(map(_stateful, found.explanations)):
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
        run = jit_quickly(lambda q, qd, qdd, p=finer: p.gram(q, qd, qdd, p.dt)[0])
        motions = (finer.motion(random_start(finer, rng))[:3] for _ in range(PROBED))
        if all(np.isfinite(run(*motion)).all() for motion in motions):
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


def _plausible(know: Known, terms: Terms, at: Drive, count: int) -> np.ndarray:
    """Return the coefficients of the first columns that add ``BESIDE`` of the torque."""
    run = jit_quickly(lambda drive: terms.columns(drive, know.body, know.rest, 1.0))
    return unit_of(np.asarray(run(at))[:count], np.asarray(at.predicted), BESIDE)


def _stateful(explanation: Explanation) -> bool:
    inner = (getattr(effect, "effect", effect) for effect in explanation.effects)
    return any(type(effect).actuate is not Effect.actuate for effect in inner)


def earlier(plan: Plan, signals: Signals) -> np.ndarray:
    """Return the information (P, P) of a log about a plan's columns."""
    run = jit_quickly(lambda q, qd, qdd, dt: plan.gram(q, qd, qdd, dt)[0], static_argnums=3)
    total = np.zeros(())
    stride = max(1, round(plan.dt / signals.dt))
    for part in signals.slices:
        pick = slice(part.start, part.stop, stride)
        motion = (signals.q[pick], signals.qd[pick], signals.qdd[pick])
        if len(motion[0]) > 2:
            total = total + np.asarray(run(*motion, float(stride * signals.dt)))
    return np.asarray(total)
