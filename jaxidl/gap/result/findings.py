"""The findings of a diagnosis: effects with values, what each explains, and its probability."""

from collections.abc import Sequence

import numpy as np
from scipy.special import erf

from jaxidl.effects import CATALOGUE
from jaxidl.gap.choice import estimates
from jaxidl.gap.choice.find import Found
from jaxidl.gap.choice.rivals import Tie
from jaxidl.gap.evidence.gram import Item, Key
from jaxidl.gap.evidence.items import part
from jaxidl.gap.evidence.rows import rms
from jaxidl.gap.fit.held_out import aside, worse_by
from jaxidl.gap.fit.library import residual
from jaxidl.gap.fit.score import Score, Solution
from jaxidl.gap.fit.values import Value, resampled
from jaxidl.gap.result.bent import bend, other_law
from jaxidl.gap.result.calibration import probability, signs
from jaxidl.gap.result.diagnosis import Estimate, Finding, plain_number
from jaxidl.gap.result.trust import Trust
from jaxidl.systems.free import unit_of
from jaxidl.systems.mjcf import Model

MOST = 24  # rivals of an effect that are solved for


def findings(
    found: Found,
    fitted: Sequence[Value],
    known: Model,
    network: Sequence[float],
    ties: Sequence[Tie],
    trust: Trust,
) -> tuple[Finding, ...]:
    """Return the findings, ordered by the share of the command that they explain.

    Args:
        found: the result of the search.
        fitted: its effects with their values.
        known: the model of J joints.
        network: (J,) share of the residual that a network predicts.
        ties: effects that explain the log as well as some of those found.
        trust: what is left of the confidence of an effect on a joint, given how the log reads.
    """
    rows, out = found.library.rows, []
    draws = found.support.moves if found.score.anchor is None else []
    elsewhere = [(t.likely / (1.0 + t.likely), t.moves) for t in found.ties]
    command, whole = (
        rms(rows.command, rows.used),
        rms(rows.gap, rows.used & ~rows.training[:, None]),
    )
    added = [rows.gap - residual(rows, found.solution, value.items) for value in fitted]
    shares = [rms(a, rows.used) / np.maximum(command, 1e-300) for a in added]
    aside_there = found.score.count[~found.score.training].sum(0) > 0
    where = [int(np.argmax(np.where(aside_there, s, 0.0))) for s in shares]
    bends = [
        bend(found, a[:, j], j) if other_law(value) else 0.0
        for value, a, j in zip(fitted, added, where, strict=True)
    ]
    for value, added_shares, j in zip(fitted, shares, where, strict=True):
        name, joint = value.key
        others = [m for m in found.solution.members if m not in value.items]
        bare = found.score.solve(others)
        bent = max(b for b, at in zip(bends, where, strict=True) if at == j)
        a, b = (aside(rows, s, j) for s in (found.solution, bare))
        support = min(found.support.share[m.group] for m in value.items)
        evidence, share = found.solution.value - bare.value, float(added_shares[j])
        kind = known.kinds[joint if joint is not None else j]
        cls = CATALOGUE[name]
        known_as = resampled(value, draws, elsewhere)
        parameters = {
            n: Estimate(plain_number(v), unit_of(cls.parameters[n].unit, kind), plain_number(e))
            for n, (v, e) in known_as.parameters.items()
        }
        bounds = {n: value.items[0].shape.bounds(n) for n in value.parameters}
        gain, stderr = worse_by(rows, bare, found.solution, j)
        instead, nearest = best_instead(found.score, value.items, others, bare, j)
        own = [t for t in ties if value.key in {g[:2] for g in t.found}]
        margin = min([found.solution.value - instead, *(t.falls for t in own)])
        left = float(a) / max(rows.floor[j], 1e-300)
        shape = value.items[0].shape
        open_ = np.sqrt(np.maximum(a**2 - rows.floor[j] ** 2, 0.0)) / max(float(whole[j]), 1e-300)
        kind_of = shape.odds, cls.common, max([0.0, *(t.likely for t in own)])
        alike = {joint for found_name, joint in (v.key for v in fitted) if found_name == name} - {
            joint
        }
        company = (
            len(alike) / (len(known.names) - 1)
            if joint is not None and len(known.names) > 1
            else 0.0
        )
        away = max(
            float(np.max(np.abs(v) / np.maximum(e, 1e-300))) for v, e in value.parameters.values()
        )
        speaks = signs(
            margin, gain, share, left, float(open_), network[j], *kind_of, company, away, bent
        )
        out.append(
            Finding(
                name,
                joint,
                value.effect,
                cls.sentence + (f" ({known.names[joint]})" if joint is not None else ""),
                parameters,
                support * probability(speaks) * there(known_as) * trust(value, j),
                float(evidence),
                share,
                j,
                float(b),
                float(a),
                gain,
                stderr,
                bounds,
                {"support": support, **speaks},
                nearest,
            )
        )
    return tuple(sorted(out, key=lambda f: -f.share))


def there(value: Value) -> float:
    """Return the probability that an effect's values are not zero.

    That of the best known one, or of all together; standard errors cover the choice of the set.
    """
    each = [np.max(np.abs(v) / np.maximum(e, 1e-300)) for v, e in value.parameters.values()]
    return 1.0 if value.share > 0.0 else float(erf(max([value.together, *each]) / np.sqrt(2.0)))


def best_instead(
    score: Score, own: Sequence[Item], others: Sequence[Item], bare: Solution, joint: int
) -> tuple[float, Key | None]:
    """Return the highest score with another effect in place of one that was found, or with none.

    Also return which effect that is.

    An effect that has it as a part is no rival, since it imitates it on any log. Effects are solved
    for in the order of what they promise, which mostly is too much, until none promises more than
    the best has reached.

    Args:
        score: of all items.
        own: the members that are the effect found.
        others: all other members.
        bare: their solution.
        joint: where the effect is largest; rivals are on that joint, too.
    """
    best, nearest = bare.value, None
    promise = estimates.promise(score, others)
    rivals = [
        i
        for i in score.items
        if id(i) in promise
        and i.key != own[0].key
        and joint in i.joints
        and not any(part(m, i) for m in own)
    ]
    for i in sorted(rivals, key=lambda i: -promise[id(i)])[:MOST]:
        if bare.value + promise[id(i)] <= best:
            break
        if (reached := score.solve([*others, i]).value) > best:
            best, nearest = reached, i.key
    return best, nearest
