"""The plan of a motion that tells the explanations of a diagnosis apart (T-optimal)."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from jaxidl.backend import jit_quickly
from jaxidl.effects import CATALOGUE, Effect
from jaxidl.excite.criteria import Contest, separations
from jaxidl.excite.doubt import Doubt
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
NOTHING = 1e-2  # separation
STATEFUL = 50.0  # rate of rows where an explanation has a hidden state [Hz]


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
    if "rate" not in options and any(_stateful(e) for x in found.explanations for e in x.effects):
        options["rate"] = STATEFUL
    plan = Plan(know, inside, terms, sizes, found.noise, criterion="t", contest=contest, **options)
    timing = [Parameter(ALIGNMENT, j, "late", "s") for j in range(joints)]
    old = earlier(plan, found.signals)
    return Prepared(
        replace(plan, earlier=old, contest=separable(plan, old)), (*parameters, *timing), at
    )


def separable(plan: Plan, old: np.ndarray) -> Contest:
    """Return the plan's contest without the pairs that not even random motion begins to separate.

    They are the same on any motion, and would hide the others in the smallest separation. If none
    is left, all stay.
    """
    assert plan.contest is not None
    rng = np.random.default_rng(0)
    motions = [plan.motion(random_start(plan, rng))[:3] for _ in range(3)]
    run = jit_quickly(lambda q, qd, qdd: plan.gram(q, qd, qdd, plan.dt)[0])
    most = np.max([separations(run(*m) + old, plan.contest) for m in motions], axis=0)
    kept = tuple(p for p, x in zip(plan.contest.pairs, most, strict=True) if x > NOTHING)
    return plan.contest._replace(pairs=kept or plan.contest.pairs)


def _plausible(know: Known, terms: Terms, at: Drive, count: int) -> np.ndarray:
    """Return the coefficients of the first columns that add ``BESIDE`` of the torque."""
    run = jit_quickly(lambda drive: terms.columns(drive, know.body, know.rest, 1.0))
    return unit_of(np.asarray(run(at))[:count], np.asarray(at.predicted), BESIDE)


def _stateful(effect: Any) -> bool:
    inside = getattr(effect, "effect", effect)
    return type(inside).actuate is not Effect.actuate


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
