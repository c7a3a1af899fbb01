"""What is left of a confidence, given how the log reads.

A confidence is halved in a log of a few seconds, on a joint that seems to be misread, and of what a
factor common to all torques would replace: links, and effects that the model has already.
"""

from collections.abc import Callable, Sequence

from jaxidl.gap.choice.find import Found
from jaxidl.gap.evidence.conventions import conventions
from jaxidl.gap.evidence.proportion import proportion
from jaxidl.gap.evidence.shape import present
from jaxidl.gap.fit.values import Value
from jaxidl.gap.result.words import LEAST

DOUBTED = 0.5  # share of a finding's confidence that is left

Trust = Callable[[Value, int], float]  # share of an effect's confidence on a joint that is left


def trust_of(found: Found, names: Sequence[str]) -> tuple[list[str], Trust]:
    """Return sentences about how a log of joints called ``names`` reads, and the trust in it."""
    rows, solution = found.library.rows, found.solution
    said, misread = conventions(rows, names)
    x = [solution.x[solution.of(m)] for m in found.named]
    scaled, links = proportion(rows, found.named, x)
    brief, own = rows.signals.duration < LEAST, present(rows.effects) if links else {}

    def trust(value: Value, joint: int) -> float:
        factor = value.key in own or any(m.group in links for m in value.items)
        return DOUBTED if brief or misread[joint] or factor else 1.0

    return [*said, *scaled], trust
