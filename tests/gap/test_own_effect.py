"""An effect of a user's own: how it is made known, and the example that defines, sweeps,
differentiates and finds one.
"""

import json
import runpy
import sys
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from flax import struct

from jaxidl import gap, report
from jaxidl.cli.plugins import load as load_plugin
from jaxidl.effects import (
    CATALOGUE,
    Effect,
    OnJoint,
    Parameter,
    Spring,
    from_dict,
    register,
    searchable,
    searched,
)
from jaxidl.errors import ConfigurationError, EffectError
from jaxidl.gap.benchmark.catalogue import make
from jaxidl.gap.benchmark.engine import simulate
from jaxidl.gap.benchmark.mechanisms import PENDULUM
from jaxidl.gap.evidence.projection import ALIGNMENT
from jaxidl.gap.result.verdict import plugins
from jaxidl.systems.export import write_patched
from jaxidl.systems.mjcf import read_model
from jaxidl.systems.tables import inverse_dynamics
from tests.helpers.paths import ROOT

SCRIPT = ROOT / "experiments" / "own_effect.py"
PLUGIN = """import jax
from jaxidl.effects import Effect, Parameter, register


@register
class PluggedMagnet(Effect):
    pull: jax.Array
    name = "plugged_magnet"
    sentence = "a magnet pulls in one direction"
    parameters = {"pull": Parameter("N", 0.0, 1e3, "the pull")}

    def torque(self, q, qd, tau):
        return self.pull + 0.0 * qd
"""


@pytest.fixture(scope="module")
def script(tmp_path_factory, clean_catalogue_of_file):
    """What the example's cells leave behind; its effect is known for the rest of this file."""
    folder, arguments = tmp_path_factory.mktemp("own"), sys.argv
    sys.argv = [str(SCRIPT), str(folder)]
    try:
        yield runpy.run_path(str(SCRIPT), run_name="__main__")
    finally:
        sys.argv = arguments


# the example


@pytest.mark.slow
def test_the_brake_spoils_tracking_and_learning_restores_it(script):
    first, last = np.moveaxis(np.asarray(script["errors"]), 2, 0)[[0, -1]]  # (strengths, seeds)
    assert np.all(np.diff(first, axis=0) > 0.0)  # the stronger, the worse
    assert np.all(last[1:] < 0.4 * first[1:])
    assert np.all(last[0] < 0.003)  # nothing to learn: only noise is added


@pytest.mark.slow
def test_derivatives_by_its_parameters_agree(script):
    forward, reverse, numeric = (
        np.asarray(script[name]) for name in ("forward", "reverse", "numeric")
    )
    assert np.all(forward > 0.0)  # a stronger brake, or one that fades later
    np.testing.assert_allclose(forward, reverse, rtol=1e-9)
    np.testing.assert_allclose(forward, numeric, rtol=1e-6)


@pytest.mark.slow
def test_without_it_others_stand_in_and_with_it_the_gap_is_smaller(script):
    before, found = script["before"], script["found"]
    # what the catalogue has that is most like it
    assert "sublinear_friction" in {f.name for f in before.findings}
    assert found.verdict == "named"
    assert {(f.name, f.joint) for f in found.findings} == {
        ("eddy_brake", 0),
        ("coulomb_friction", 0),
    }
    brake = next(f for f in found.findings if f.name == "eddy_brake")
    assert brake.sentence.startswith("a brake that drags most at one speed")
    assert {name: p.unit for name, p in brake.parameters.items()} == {"k": "Nm s/rad", "v": "rad/s"}
    for name, true in script["TRUE"].items():
        assert brake.parameters[name].value == pytest.approx(true, rel=0.03)
    assert found.gap.after.torque_rms[0] < 0.2 * found.gap.before.torque_rms[0]
    assert found.gap.after.torque_rms[0] < before.gap.after.torque_rms[0]
    assert (script["folder"] / "own_effect.png").stat().st_size > 20_000


@pytest.mark.slow
def test_what_was_found_is_written_and_read_again(script, tmp_path):
    found, cls = script["found"], script["EddyBrake"]
    assert "eddy brake" in report.save(found, tmp_path / "out").read_text(encoding="utf-8").lower()
    again = read_model(tmp_path / "out" / "model.xml")
    (brake,) = [
        e for e in again.plant.effects if isinstance(e, OnJoint) and isinstance(e.effect, cls)
    ]
    assert (
        brake.to_dict()
        == next(f.effect for f in found.findings if f.name == "eddy_brake").to_dict()
    )


@pytest.mark.slow
def test_it_is_not_named_where_plain_friction_is_hidden(script):
    columns = simulate(PENDULUM, [make("viscous_friction", 0, {"coefficient": 0.3})], 3)
    log = gap.from_arrays(columns["time"], columns["q0"][:, None], columns["tau0"][:, None])
    found = gap.diagnose(
        log,
        script["folder"] / "model.xml",
        effects=("eddy_brake", "viscous_friction"),
        rollouts=False,
    )
    assert [f.name for f in found.findings] == ["viscous_friction"]
    assert found.options["effects"] == ["eddy_brake", "viscous_friction"]


# making it known


def magnet(strength=1.0, **members):
    """A small effect of one parameter, defined anew with each call as a cell is that runs again."""

    class Magnet(Effect):
        pull: jax.Array

        name: ClassVar[str] = members.get("name", "magnet")
        sentence: ClassVar[str] = members.get("sentence", "a magnet pulls in one direction")
        parameters: ClassVar = members.get(
            "parameters", {"pull": Parameter("N", 0.0, 1e3, "the pull")}
        )
        whole: ClassVar[bool] = members.get("whole", False)

        def torque(self, q, qd, tau):
            return strength * self.pull + 0.0 * qd

        @classmethod
        def guesses(cls, scale):
            return members.get("guesses", [{"pull": scale.residual}])

    return Magnet


def test_a_registered_class_is_known_everywhere(clean_catalogue):
    built_in = list(CATALOGUE), searched()
    cls = magnet()
    assert register(cls) is cls
    assert list(CATALOGUE) == [*built_in[0], "magnet"]
    assert searched() == (*built_in[1], "magnet")
    for effect in (cls(jnp.array([1.5, 2.5])), OnJoint(cls(jnp.array([1.5])), 1, 2)):
        again = from_dict(json.loads(json.dumps(effect.to_dict())))
        assert again.to_dict() == effect.to_dict()
        assert jax.tree.structure(again) == jax.tree.structure(effect)


def test_a_class_that_is_defined_again_replaces_the_old_one(clean_catalogue):
    """The new class takes the old one's place, and no compiled program of the old one its."""
    old, new = register(magnet(1.0)), register(magnet(2.0))
    assert CATALOGUE["magnet"] is new
    one = jnp.ones(1)
    apply = jax.jit(lambda effect: effect.torque(one, one, one))
    assert [apply(old(one)).item(), apply(new(one)).item()] == [1.0, 2.0]
    assert jax.tree.structure(old(one)) != jax.tree.structure(new(one))
    register(new)
    register(magnet(name="electromagnet"))
    assert [name for name in CATALOGUE if "magnet" in name] == ["electromagnet"]


def test_what_shall_not_be_searched_is_searched_only_where_named(clean_catalogue, tmp_path):
    register(searched=False)(magnet())
    assert "magnet" not in searched()
    assert "magnet" in searchable()
    (tmp_path / "model.xml").write_text(PENDULUM)
    columns = simulate(PENDULUM, [make("constant_offset", 0, {"offset": 0.4})], 3)
    log = gap.from_arrays(columns["time"], columns["q0"][:, None], columns["tau0"][:, None])
    found = gap.diagnose(
        log, tmp_path / "model.xml", effects=("viscous_friction", "magnet"), rollouts=False
    )
    assert [f.name for f in found.findings] == ["magnet"]
    assert found.findings[0].parameters["pull"].value == pytest.approx(0.4, rel=0.02)
    register(CATALOGUE["magnet"])
    assert "magnet" in searched()
    register(Bare, searched=False)  # can be simulated and stored, no more
    assert "bare" in CATALOGUE
    assert "bare" not in searchable()
    with pytest.raises(EffectError, match="defaults of the static fields"):
        register(Bare)
    with pytest.raises(ConfigurationError, match="an effect to look for"):
        gap.diagnose(log, tmp_path / "model.xml", effects=("bare",))


class Shell(Effect):
    """More mass and a first moment on each joint's body: an effect of a user's that only alters the
    rigid body.
    """

    more: jax.Array

    name: ClassVar[str] = "shell"
    sentence: ClassVar[str] = "a shell around each link that the model does not have"
    parameters: ClassVar = {"more": Parameter("kg", 0.0, 10.0, "the mass of the shell")}
    linear: ClassVar[bool] = True

    def alter(self, body):
        return body.add_mass(self.more).add_inertia(0.1 * self.more)


class Rail(Effect):
    """A damper with a name of its own, that knows where MuJoCo has dampers."""

    drag: jax.Array

    name: ClassVar[str] = "rail"
    sentence: ClassVar[str] = "a rail that drags along"
    parameters: ClassVar = {"drag": Parameter("N s/m", 0.0, 10.0, "torque per speed")}
    linear: ClassVar[bool] = True

    def torque(self, q, qd, tau):
        return -self.drag * qd

    def write_mjcf(self, numbers):
        numbers.damping += np.asarray(self.drag)
        return "joint/damping"


@pytest.mark.slow
def test_effects_of_a_users_own_go_into_mjcf_as_those_of_the_package_do(clean_catalogue, tmp_path):
    for cls in (Shell, Rail):
        register(cls)
    (tmp_path / "model.xml").write_text(PENDULUM)
    model = read_model(tmp_path / "model.xml")
    added = [OnJoint(Shell(jnp.array([0.3])), 0, 1), OnJoint(Rail(jnp.array([0.2])), 0, 1)]
    path, record = write_patched(model, added, tmp_path / "new")
    entries = json.loads(record.read_text())["effects"]
    assert [(e["in_mjcf"], e["mjcf"]) for e in entries] == [
        (True, "joint/armature, body/inertial"),
        (True, "joint/damping"),
    ]
    again = read_model(path).plant
    state = jnp.array([[0.3], [0.7], [1.1]])
    plants = (again, model.plant.replace(effects=(*model.plant.effects, *added)))
    np.testing.assert_allclose(*(plant.inverse_dynamics(*state) for plant in plants), rtol=1e-9)


class Bare(Effect):
    """A static field without a default: the search would not know what to set."""

    pull: jax.Array
    turns: int = struct.field(pytree_node=False)

    name: ClassVar[str] = "bare"
    sentence: ClassVar[str] = "a magnet without turns"
    parameters: ClassVar = {"pull": Parameter("N", 0.0, 1e3, "the pull")}


class Wide(Effect):
    """A traced field that is no parameter: it would be swept and stored under no name."""

    pull: jax.Array
    reach: jax.Array

    name: ClassVar[str] = "wide"
    sentence: ClassVar[str] = "a magnet with a reach"
    parameters: ClassVar = {"pull": Parameter("N", 0.0, 1e3, "the pull")}


REFUSED = {
    "no effect": (lambda: dict, "a subclass of jaxidl.effects.Effect"),
    "an instance": (
        lambda: Spring(jnp.ones(1), jnp.ones(1)),
        "a subclass of jaxidl.effects.Effect",
    ),
    "no name": (lambda: magnet(name=""), "a name of .*Magnet, one word; got ''"),
    "two words": (lambda: magnet(name="a magnet"), "a name of .*Magnet, one word"),
    "no sentence": (lambda: magnet(sentence=" "), "a sentence of .*Magnet"),
    "no parameters": (lambda: magnet(parameters={}), "got parameters none and traced fields pull"),
    "another parameter": (
        lambda: magnet(parameters={"push": Parameter("N", 0.0, 1.0, "a push")}),
        "got parameters push and",
    ),
    "a list": (lambda: magnet(parameters=["pull"]), "got parameters none and traced fields pull"),
    "no Parameter": (
        lambda: magnet(parameters={"pull": "N"}),
        "a Parameter of .*Magnet for each traced field",
    ),
    "a field too many": (
        lambda: Wide,
        "got parameters pull and traced fields pull, reach; .* static",
    ),
    "a taken name": (
        lambda: magnet(name="spring"),
        r"got 'spring' of jaxidl\.effects\.position\.Spring; choose another name",
    ),
    "a reserved name": (lambda: magnet(name=ALIGNMENT), "got 'alignment' of the gap workflow"),
    "static field": (lambda: Bare, "defaults of the static fields of bare; got none of turns"),
    "guess by another name": (
        lambda: magnet(guesses=[{"push": 1.0}]),
        "guesses of magnet .*; got push = 1.0",
    ),
    "infinite guess": (
        lambda: magnet(guesses=[{"pull": np.inf}]),
        "guesses of magnet .*; got pull = inf",
    ),
}


@pytest.mark.parametrize(("make_class", "message"), REFUSED.values(), ids=REFUSED.keys())
def test_refusals_are_one_clear_line_and_change_nothing(clean_catalogue, make_class, message):
    before = dict(CATALOGUE)
    with pytest.raises(EffectError, match=message) as caught:
        register(make_class())
    assert str(caught.value).startswith("expected ")
    assert "\n" not in str(caught.value)
    assert before == CATALOGUE


def test_effects_of_the_package_stay_as_they_are(clean_catalogue):
    names = list(CATALOGUE), searched()
    for cls in list(CATALOGUE.values()):
        assert register(cls) is cls
    assert (list(CATALOGUE), searched()) == names


def test_the_record_of_an_effect_that_is_not_registered_says_what_to_do():
    with pytest.raises(EffectError, match="'magnet'; correct the name, or load the module"):
        from_dict(magnet()(jnp.ones(1)).to_dict())


# on the command line


@pytest.mark.parametrize("text", ["", "from jaxidl.effects import CoulombFriction\n"])
def test_a_plugin_without_an_effect_is_refused(clean_catalogue, tmp_path, text):
    plugin = tmp_path / "nothing.py"
    plugin.write_text(text)
    with pytest.raises(ConfigurationError, match=r"register above its class"):
        load_plugin(str(plugin))


def test_the_reports_command_loads_the_users_effects(clean_catalogue, tmp_path):
    plugin = tmp_path / "my_magnet.py"
    plugin.write_text(PLUGIN)
    load_plugin(str(plugin))
    load_plugin(str(plugin))  # again, as a notebook would
    assert plugins(["plugged_magnet", "coulomb_friction"]) == f" --plugin {plugin}"
    assert plugins(["coulomb_friction"]) == ""


ARM = """<mujoco><worldbody><body>
  <joint name="base" axis="0 0 1"/><inertial pos="0 0 0" mass="60" diaginertia="2 2 2"/>
  <body><joint name="shoulder" axis="0 1 0"/>
    <inertial pos="0 0 0.4" mass="40" diaginertia="3 3 0.5"/></body>
</body></worldbody></mujoco>"""


@pytest.mark.slow
def test_a_balancer_is_no_lighter_link(tmp_path, clean_catalogue):
    """It has no inertia, which both joints would show; where it is not looked for, a note says that
    it looks like one.
    """
    model_file, time = tmp_path / "arm.xml", 4e-3 * np.arange(7500)
    model_file.write_text(ARM)
    load_plugin(str(ROOT / "experiments" / "balancer.py"))
    model = read_model(model_file)
    at, size = np.array([[0.9, 1.7], [1.3, 2.1]]), np.array([[0.7, 0.4], [0.5, 0.6]])
    q, qd, qdd = (
        np.real(np.sum(size * (1j * at) ** k * np.exp(1j * (at * time[:, None, None] + size)), 2))
        for k in range(3)
    )
    friction = 20.0 * qd + 15.0 * np.tanh(qd / 0.01)
    tau = inverse_dynamics(model.plant.body, q, qd, qdd) + friction
    tau[:, 1] += 90.0 * np.sin(q[:, 1])
    noise = np.random.default_rng(3).standard_normal((2, *q.shape))
    log = gap.from_arrays(time, q + 1e-5 * noise[0], tau + noise[1])
    names = ["viscous_friction", "coulomb_friction", "inertia_error", "com_error", "payload"]
    lighter = gap.diagnose(log, model, effects=names, rollouts=False)
    (said,) = (note for note in lighter.notes if "a balancer" in note)
    assert said.startswith(f"{model.names[1]} carries ")
    found = gap.diagnose(log, model, effects=[*names, "balancer"], rollouts=False)
    assert not any("a balancer" in note for note in found.notes)
    sure = {(f.name, f.joint): f for f in found.findings if f.sure}
    assert ("balancer", 1) in sure
    assert not {name for name, _ in sure} & {"inertia_error", "com_error"}
    balancer = sure["balancer", 1].parameters
    assert balancer["sine"].value == pytest.approx(-90.0, abs=3.0)
    assert balancer["cosine"].value == pytest.approx(0.0, abs=3.0)
    assert balancer["sine"].unit == "Nm"
