"""The findings of a diagnosis: effects with values, what each explains, and its probability.

An effect may follow another law than its own: friction in proportion to the load imitates friction
that grows with its square root. The residual shows it (:func:`bend`): the effect's own torque a,
bent to a·|a|, still explains a part of it.

Two large effects that cancel may stand for a small one: an offset and the weight of a link for
some dependence on position. So what speaks for an effect is what both do together, if that is less.
"""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.special import erf

from jaxidl.effects import CATALOGUE
from jaxidl.gap.choice import estimates
from jaxidl.gap.choice.find import Found
from jaxidl.gap.evidence.gram import Item, Key, columns_at
from jaxidl.gap.evidence.items import part
from jaxidl.gap.evidence.rows import rms
from jaxidl.gap.fit.held_out import aside, jackknife, worse_by
from jaxidl.gap.fit.library import residual
from jaxidl.gap.fit.score import Score, Solution
from jaxidl.gap.fit.values import Value, resampled
from jaxidl.gap.result.calibration import probability, signs
from jaxidl.gap.result.diagnosis import Estimate, Finding, plain_number
from jaxidl.systems.free import unit_of
from jaxidl.systems.mjcf import Model

MOST = 24  # rivals of an effect that are solved for


def findings(
    found: Found,
    known: Model,
    network: Sequence[tuple[float, float]],
    trust: Callable[[Value, int], float],
    usual: np.ndarray | None = None,
) -> tuple[Finding, ...]:
    """Return the findings, ordered by the share of the command that they explain.

    The ``network`` predicts a share of the residual of each of J joints, with a standard error.
    What is left of the confidence of an effect on a joint, given how the log reads, is the
    ``trust``. What a reference left unexplained, the ``usual`` residual (J,) [N or Nm], does not
    speak against a change.
    """
    rows, fitted, out = found.library.rows, found.fitted, []
    floor = rows.floor if usual is None else np.maximum(rows.floor, usual)
    draws = found.support.moves if found.score.anchor is None else []
    elsewhere = [(t.likely / (1.0 + t.likely), t.moves) for t in found.ties]
    command = rms(rows.command, rows.used)
    whole = rms(rows.gap, rows.used & ~rows.training[:, None])
    added = [rows.gap - residual(rows, found.solution, value.items) for value in fitted]
    shares = [rms(a, rows.used) / np.maximum(command, 1e-300) for a in added]
    aside_there = found.score.count[~found.score.training].sum(0) > 0
    where = [int(np.argmax(np.where(aside_there, s, 0.0))) for s in shares]
    bends = [
        bend(found, a[:, j], j) if other_law(value) else 0.0
        for value, a, j in zip(fitted, added, where, strict=True)
    ]
    for value, mine, added_shares, j in zip(fitted, added, shares, where, strict=True):
        name, joint = value.key
        cls, shape = CATALOGUE[name], value.items[0].shape
        others = [m for m in found.solution.members if m not in value.items]
        bare = found.score.solve(others)
        less = found.score.unshared(found.solution).solve(others)
        a, b = (aside(rows, s, j) for s in (found.solution, less))
        support = min(found.support.share[m.group] for m in value.items)
        share = float(added_shares[j])
        kind = known.kinds[joint if joint is not None else j]
        known_as = resampled(value, draws, elsewhere)
        parameters = {
            n: Estimate(plain_number(v), unit_of(cls.parameters[n].unit, kind), plain_number(e))
            for n, (v, e) in known_as.parameters.items()
        }
        gain, stderr = worse_by(rows, less, found.solution, j)
        instead, nearest = best_instead(found.score, value.items, others, bare, j)
        own = [t for t in found.ties if value.key in {g[:2] for g in t.found}]
        left = np.sqrt(np.maximum(a**2 - floor[j] ** 2, 0.0))
        keys, changed = [v.key for v in fitted], found.score.anchor is not None
        company = company_of(value.key, keys, len(known.names), changed)
        falls, lost, size = found.solution.value - instead, gain, share
        if (other := cancelling(mine, added, rows.used[:, j], j)) is not None:
            size = float(rms(mine + added[other], rows.used)[j] / max(command[j], 1e-300))
            both = [m for m in others if m not in fitted[other].items]
            neither = found.score.solve(both)
            falls = min(falls, found.solution.value - neither.value)
            lost = min(gain, worse_by(rows, neither, found.solution, j)[0])
        speaks = signs(
            margin=min([falls, *(t.falls for t in own)]),
            gain=lost,
            share=size,
            left=a / max(float(floor[j]), 1e-300),
            unexplained=float(left) / max(float(whole[j]), 1e-300),
            systematic=network[j][0],
            odds=shape.odds,
            common=cls.common,
            tied=max([0.0, *(t.likely for t in own)]),
            company=company,
            known=max(away(value)),
            bent=max(b for b, at in zip(bends, where, strict=True) if at == j),
        )
        one = Finding(
            name,
            joint,
            value.effect,
            cls.sentence + (f" ({known.names[joint]})" if joint is not None else ""),
            parameters,
            support * probability(speaks) * there(known_as) * trust(value, j),
            float(found.solution.value - bare.value),
            share,
            j,
            b,
            a,
            gain,
            stderr,
            {n: shape.bounds(n) for n in value.parameters},
            {"support": support, **speaks},
            nearest,
        )
        out.append(one)
    return tuple(sorted(out, key=lambda f: -f.share))


def away(value: Value) -> list[float]:
    """Return by how many standard errors each parameter of an effect differs from zero, at most."""
    each = value.parameters.values()
    return [float(np.max(np.abs(v) / np.maximum(e, 1e-300))) for v, e in each]


def there(value: Value) -> float:
    """Return the probability that an effect's values are not zero.

    That of the best known one, or of all together; standard errors cover the choice of the set.
    """
    known = max([value.together, *away(value)])
    return 1.0 if value.share > 0.0 else float(erf(known / np.sqrt(2.0)))


def best_instead(
    score: Score, own: Sequence[Item], others: Sequence[Item], bare: Solution, joint: int
) -> tuple[float, Key | None]:
    """Return the highest score with another effect in place of one that was found, or with none.

    Also return which effect that is. One that has the effect found as a part is no rival, since it
    imitates it on any log. Effects are solved for in the order of what they promise, which mostly
    is too much, until none promises more than the best has reached. ``own`` are the members that
    are the effect found, ``others`` all other members, and ``bare`` is their solution. Rivals are
    on the ``joint`` where the effect is largest.
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


def company_of(key: Key, found: Sequence[Key], joints: int, changed: bool) -> float:
    """Return the share of the other ``joints`` on which the same was ``found``.

    It says nothing of what has ``changed`` since another log: one joint may change alone. Nor does
    it of effects of the whole mechanism, which have none.
    """
    if key[1] is None or changed:
        return float(key[1] is not None)
    return sum(k[0] == key[0] and k != key for k in found) / max(joints - 1, 1)


def cancelling(
    mine: np.ndarray, added: Sequence[np.ndarray], used: np.ndarray, joint: int
) -> int | None:
    """Return which torque of ``added`` (N, J) leaves least of an effect's own; None if no one does.

    Of N instants those ``used`` (N,) count, on one ``joint``; the effect's own torque, ``mine``, is
    one of those added.
    """
    size = lambda torque: float(np.linalg.norm(torque[used, joint]))
    left = [size(mine) if o is mine else size(mine + o) for o in added]
    best = int(np.argmin(left))
    return best if left[best] < size(mine) else None


def other_law(value: Value) -> bool:
    """Return whether an effect may stand for one with another law.

    Common effects are taken as what they are on any robot; a shape that was fitted bends itself.
    """
    cls = value.items[0].shape.cls
    return cls.linear and not cls.common


def bend(found: Found, added: np.ndarray, joint: int) -> float:
    """Return the size of the bend of an effect, which ``added`` (N,) [N or Nm], relative to it.

    It is fitted to the residual beside all members, and less by two standard errors.
    """
    rows = found.library.rows
    use = rows.used[:, joint]
    own, block = added[use], rows.block[use]
    left = residual(rows, found.solution)[use, joint]
    size = np.sqrt(np.mean(own**2)) if use.any() else 0.0
    if not size > 0.0:
        return 0.0
    basis = np.stack([own, *columns_at(found.solution.members, joint, len(use))[:, use]])
    basis = (basis / np.maximum(np.linalg.norm(basis, axis=1, keepdims=True), 1e-300)).T
    more = own * np.abs(own) / size**2
    more = more - basis @ np.linalg.lstsq(basis, more, rcond=1e-9)[0]
    width = np.sqrt(np.mean(more**2))
    if width < 1e-6:
        return 0.0
    parts = [block == b for b in np.unique(block)]
    wanted, square = (np.array([more[p] @ x[p] for p in parts]) for x in (left, more))
    without = (wanted.sum() - wanted) / np.maximum(square.sum() - square, 1e-300)
    slope = max(abs(wanted.sum() / square.sum()) - 2.0 * float(jackknife(without)), 0.0)
    return float(slope * width / size)
