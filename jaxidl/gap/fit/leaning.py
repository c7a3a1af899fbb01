"""A base that is not level changes the direction of all weight, also of links and loads found.

The torque is linear in the tilt and in the links' parameters, but not in both. So a tilt is fitted
with the links as they were found, and again once they have changed.
"""

import numpy as np

from jaxidl.gap.evidence.gram import Item
from jaxidl.gap.evidence.items import items_of
from jaxidl.gap.evidence.links import links_of
from jaxidl.gap.evidence.reach import alterations
from jaxidl.gap.evidence.rows import Rows
from jaxidl.gap.fit.prior import changes, changes_links
from jaxidl.gap.fit.score import Solution
from jaxidl.systems.tables import leaning


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
