"""Two logs of one simulated arm, and what it picked up between them."""

import numpy as np
import pytest

from jaxidl import gap
from jaxidl.gap.benchmark.catalogue import make
from jaxidl.gap.benchmark.engine import simulate
from jaxidl.gap.benchmark.mechanisms import TWO_LINK

pytestmark = pytest.mark.slow
ALWAYS = [
    make("viscous_friction", 0, {"coefficient": 0.4}),
    make("coulomb_friction", 1, {"level": 0.25}),
    make("inertia_error", 0, {"extra": 0.1, "kind": "mass"}),
]
MASS, COM = 0.4, [0.0, 0.0, -0.3]


def measured(effects, seed):
    columns = simulate(TWO_LINK, effects, seed)
    q, tau = (np.column_stack([columns[f"{name}{j}"] for j in range(2)]) for name in ("q", "tau"))
    return gap.from_arrays(columns["time"], q, tau)


def test_the_encoders_noise_in_the_loop_is_no_change(tmp_path):
    """A loaded arm's command has more of it, which looks like an elastic shoulder."""
    model = tmp_path / "model.xml"
    model.write_text(TWO_LINK)
    tool = make("payload", None, {"mass": MASS, "com": COM})
    old, new = measured(ALWAYS, 21), measured([*ALWAYS, tool], 22)
    found = gap.diagnose(new, model, reference=old, rollouts=False)
    (load,) = found.findings
    assert (load.name, load.sure) == ("payload", True)
    for name, truth, known in (("mass", MASS, 0.05 * MASS), ("com", COM, 0.02)):
        value, stderr = (np.array(getattr(load.parameters[name], x)) for x in ("value", "stderr"))
        assert (stderr < known).all()
        assert (np.abs(value - truth) < 2.0 * stderr).all()
