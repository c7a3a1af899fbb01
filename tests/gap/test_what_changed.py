"""Two logs of one simulated arm, and what it picked up between them."""

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d

from jaxidl import gap
from jaxidl.gap.benchmark.catalogue import make
from jaxidl.gap.benchmark.engine import simulate
from jaxidl.gap.benchmark.mechanisms import MECHANISMS, TWO_LINK
from jaxidl.systems.export import write_patched
from jaxidl.systems.mjcf import read_model

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


def test_a_spring_that_was_taken_away_is_named(tmp_path):
    model = tmp_path / "model.xml"
    model.write_text(TWO_LINK)
    spring = make("spring", 1, {"stiffness": 2.0, "rest": 0.3})
    old, new = measured([*ALWAYS, spring], 23), measured(ALWAYS, 24)
    found = gap.diagnose(new, model, reference=old, rollouts=False)
    (less,) = found.findings
    assert (less.name, less.joint, less.sure) == ("spring", 1, True)
    assert less.parameters["stiffness"].value == pytest.approx(-2.0, rel=0.05)
    assert less.parameters["rest"].value == pytest.approx(0.3, abs=0.05)
    written, _ = write_patched(read_model(model), found.added, tmp_path / "found")
    again = gap.diagnose(new, written, rollouts=False)
    assert again.verdict == "nothing_missing"
    np.testing.assert_allclose(again.gap.before.torque_rms, found.gap.after.torque_rms, rtol=0.1)


def test_what_the_reference_could_not_show_may_have_been_there(tmp_path):
    """More friction below 0.1 m/s, after a log that moved as slowly, and after one that did not."""
    model = tmp_path / "model.xml"
    model.write_text(MECHANISMS["slider"])
    rng, t = np.random.default_rng(25), 0.005 * np.arange(8000)

    def log(least, excess):
        """Strokes at steady speeds (m/s) from the least one on, there and back."""
        each = np.outer(rng.permutation(np.geomspace(least, 1.0, 40)), [1.0, -1.0])
        samples = np.repeat(rng.permutation(np.arange(61, 141, 2)), 2)
        speed = uniform_filter1d(np.repeat(each, samples), 15)
        q, qdd = np.cumsum(speed) * 0.005, np.gradient(speed, 0.005)
        level = 1.0 + excess * np.exp(-((speed / 0.1) ** 2))
        tau = 2.3 * qdd + level * np.tanh(speed / 1e-3) + 0.5 * speed
        noise = 1e-6 * rng.normal(size=q.shape), 0.01 * rng.normal(size=q.shape)
        return gap.from_arrays(t, (q + noise[0])[:, None], (tau + noise[1])[:, None])

    new, sure = log(0.02, 0.6), []
    for slowest in (0.02, 0.6):
        found = gap.diagnose(new, model, reference=log(slowest, 0.0), rollouts=False)
        (more,) = (f for f in found.findings if f.name == "stribeck_friction")
        sure.append(more.confidence)
        assert any("hardly tells" in note for note in found.notes) == (slowest > 0.1)
    assert sure[0] > sure[1]


def test_an_offset_beside_a_motor_constant_that_both_logs_have(tmp_path):
    """Without what arrives of the command, that constant would make it and the change vanish."""
    model = tmp_path / "model.xml"
    model.write_text(TWO_LINK)
    motor = make("torque_scale", 0, {"scale": 0.8})
    offset = make("constant_offset", 0, {"offset": 0.6})
    old, new = measured([*ALWAYS, motor], 27), measured([*ALWAYS, motor, offset], 28)
    found = gap.diagnose(new, model, reference=old, rollouts=False)
    assert {(f.name, f.joint) for f in found.findings if f.sure} == {("constant_offset", 0)}
    (more,) = (f for f in found.findings if f.sure)
    value, stderr = more.parameters["offset"].value, more.parameters["offset"].stderr
    assert abs(value - 0.6) < 3.0 * stderr
    assert stderr < 0.1
