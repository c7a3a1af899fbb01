"""A catalogue to which a test may add effects."""

from jaxidl.effects import CATALOGUE, catalogue

STATES = (CATALOGUE, catalogue._never, catalogue._aside)


def restored():
    """Restore the catalogue afterwards, because other tests count its effects."""
    before = [state.copy() for state in STATES]
    yield
    for state, old in zip(STATES, before, strict=True):
        state.clear()
        state.update(old)
