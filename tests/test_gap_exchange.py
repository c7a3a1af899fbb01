"""Members in each other's place."""

import jax
import numpy as np
import pytest

from jaxidl.gap.benchmark.catalogue import make
from jaxidl.gap.benchmark.engine import run
from jaxidl.gap.benchmark.mechanisms import MECHANISMS
from jaxidl.gap.candidates import candidates
from jaxidl.gap.data import data_of
from jaxidl.gap.exchange import revise
from jaxidl.gap.log import read
from jaxidl.gap.rank import Ranking
from jaxidl.gap.signals import prepare
from jaxidl.systems.mjcf import read_model


@pytest.fixture
def ranking(tmp_path):
    """Of a slider on whose way viscous friction goes up and down."""
    friction = {"level": 6.0, "variation": 0.9, "period": 0.4, "phase": 0.5, "kind": "viscous"}
    log, model = tmp_path / "log.npz", tmp_path / "model.xml"
    np.savez(log, **run(MECHANISMS["slider"], [make("position_dependent_friction", 0, friction)], 5).log())
    model.write_text(MECHANISMS["slider"])
    with jax.enable_x64(True):
        known = read_model(model)
        data = data_of(prepare(read(log, joints=1), known.plant.body, ()), (), 0.3)
        residual = np.sqrt(np.mean(data.base**2, axis=0))
        yield Ranking(data, candidates(data.signals, residual, ("position_dependent_friction",)), 0.05)


def test_revision_puts_a_better_variant_in_a_members_place_and_then_rests(ranking):
    variants = {c.variant: c for c in ranking.pool}
    ranking.replace((), (ranking.column(variants["level 6 over 0"]),))  # a table of dry friction, as if that had looked right
    wrong = ranking.fit.rms(0)
    assert revise(ranking)
    (member,) = ranking.members
    assert member.candidate.variant.startswith("coefficient")
    assert ranking.fit.rms(0) < 0.5 * wrong
    assert not revise(ranking)
