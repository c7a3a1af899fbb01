"""A catalogue that a test may add to."""

from jaxidl.effects import CATALOGUE, catalogue

STATES = (CATALOGUE, catalogue._never, catalogue._aside)


def restored():
    """The catalogue is afterwards what it was before: other tests count it."""
    before = [state.copy() for state in STATES]
    yield
    for state, old in zip(STATES, before, strict=True):
        state.clear()
        state.update(old)
