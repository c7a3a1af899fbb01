"""Changes of links: how large a change is plausible, and what depends on those that were found.

A load may be as heavy as the robot, but it is a compact body: about its own centre its inertia is
about that of its mass at a tenth of the robot's reach. So a light load does not stand for the
inertia of a rotor. A base that is not level changes the direction of all weight, also of links and
loads found: the torque is linear in the tilt and in the links' parameters, but not in both. So a
tilt is fitted with the links as they were found, and again once they have changed.
"""

from dataclasses import replace

import numpy as np

from jaxidl.effects import Effect
from jaxidl.effects.ten import moved
from jaxidl.gap.evidence.gram import Item
from jaxidl.gap.evidence.items import PARAMETER, items_of, rank
from jaxidl.gap.evidence.links import Links, alterations, change_of, links_of
from jaxidl.gap.evidence.rows import Rows
from jaxidl.gap.fit.score import Score, Solution
from jaxidl.systems.tables import leaning

KNOWN = 2.0  # standard errors from which a log determines a value


def plausible(i: Item, links: Links | None, alike: float) -> Item:
    """Return an item with its coefficients' prior, in which ``alike`` samples count as one."""
    if links is None or not changes_links(i):
        return i
    change = changes(i, links)
    load = change[:, -1]
    heavy = load[np.abs(load[:, 0]).argmax()]
    if heavy[0] != 0.0:  # a load, about the point at which one more kilogram of it would be
        change[:, -1] = [moved(ten, np.eye(3), -heavy[1:4] / heavy[0]) for ten in load]
    return replace(i, precision=alike * np.sum((change / links.plausible) ** 2, (1, 2)))


def changes_links(i: Item) -> bool:
    """Return whether the coefficients of an item are changes of links."""
    return i.shape is not None and i.shape.cls.alter is not Effect.alter and bool(i.shape.free)


def changes(i: Item, links: Links) -> np.ndarray:
    """Return the changes of the links (P, J + 1, 10) per unit of each coefficient."""
    return np.stack([change_of(i.shape.at(row), links) for row in np.eye(len(i.lower))])


def compact(m: Item, now: Solution, rows: Rows, score: Score, predicted: np.ndarray) -> Item | None:
    """Return a load of a set about its centre, with the prior on its inertia that its mass implies.

    None for any other effect. What the log does not determine of the centre is that of the frame.
    The mass counts with two standard errors: if a log does not determine it, any inertia may be. If
    it does, mass and centre imply the inertia, which then is no further degree of freedom.
    """
    links = links_of(rows.signals.body)
    if links is None or not changes_links(m) or not np.any(mass := changes(m, links)[:, -1, 0]):
        return None
    own = now.of(m)
    x, covariance = now.x[own], score.covariance(now)[own, own]
    known = np.abs(x) > KNOWN * np.sqrt(np.diagonal(covariance))
    settled = m.shape.at(np.where(known, x, 0.0)).settled()
    fixed = {n: np.asarray(getattr(settled, n), float) for n in m.shape.cls.fixed}
    shape = m.shape._replace(values={**m.shape.values, **fixed})
    (fresh,) = items_of([shape], rows, predicted)
    error = float(np.sqrt(mass @ covariance @ mass))
    heavy = float(abs(mass @ x))
    if heavy > KNOWN * error:
        free = [np.full(np.size(shape.values[n]), n not in shape.cls.implied) for n in shape.free]
        implied = rank(fresh.columns) - rank(fresh.columns[np.concatenate(free)])
        fresh = replace(fresh, odds=fresh.odds + PARAMETER * implied)
    return plausible(fresh, links.loaded(heavy + KNOWN * error), score.alike)


def turned(m: Item, now: Solution, rows: Rows, predicted: np.ndarray) -> Item | None:
    """Return a tilt of a set as it acts on the links of that set; None for any other effect."""
    signals, links = rows.signals, links_of(rows.signals.body)
    if links is None or not changes_links(m) or "tilt" not in dict(alterations(m.shape.effect())):
        return None
    change = sum(
        np.tensordot(now.x[now.of(o)], changes(o, links), 1)
        for o in now.members
        if changes_links(o)
    )
    more = leaning(signals.body, signals.q, np.asarray(change))
    tables = signals.tables._replace(by_tilt=signals.tables.by_tilt + more)
    there = rows._replace(signals=signals._replace(tables=tables))
    (fresh,) = items_of([m.shape], there, predicted)
    return fresh
