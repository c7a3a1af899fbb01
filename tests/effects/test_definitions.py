"""Every effect against its formula or a closed form.

What holds for all effects is in ``test_catalogue.py``.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxidl.effects as fx
from jaxidl.effects import OnJoint
from jaxidl.effects.varying import table_value
from jaxidl.systems import Plant, point_mass
from jaxidl.systems.mjcf import read_model
from jaxidl.systems.plant import friction_torque
from jaxidl.types import State
from tests.helpers.effects import DT, acceleration, one, run

# --- sensing
# --------------------------------------------------------------------------------------------------


def test_sensing_noise_is_bounded_and_scaled():
    draws = jnp.array([0.5, -3.0])
    np.testing.assert_allclose(
        fx.SensingNoise(jnp.array(0.1)).sense((), jnp.ones(2), draws), [1.05, 0.9]
    )


# --- friction
# --------------------------------------------------------------------------------------------------


def test_a_mass_with_dry_friction_slides_to_a_stop_and_stays_there():
    q, qd, _, _ = run([fx.CoulombFriction(one(3.0))], np.zeros(1000), qd=1.0)
    steps = int(2.0 / 3.0 / DT)  # v₀·m/c
    np.testing.assert_allclose(qd[: steps + 1], 1.0 - 1.5 * DT * np.arange(steps + 1), rtol=1e-9)
    assert np.abs(qd[steps + 1 :]).max() < 1e-15
    assert q[-1] == pytest.approx(1.0 / 3.0, abs=1e-6)  # v₀²·m/2c
    for push in (2.99, -2.99):
        q, qd, _, _ = run([fx.CoulombFriction(one(3.0))], np.full(1000, push), q=0.1)
        assert np.abs(qd).max() < 1e-15
        np.testing.assert_allclose(q, 0.1, atol=1e-15)
    assert acceleration(fx.CoulombFriction(one(3.0)), 5.0) == pytest.approx(1.0)
    assert acceleration(fx.CoulombFriction(one(3.0)), -5.0) == pytest.approx(-1.0)


def test_asymmetric_friction_differs_by_direction():
    effect = fx.AsymmetricFriction(one(3.0), one(1.0), one(0.5), one(0.2))
    for tau, qd, wanted in [
        (0, 2, -4),
        (0, -2, 1.4),
        (2.9, 0, 0),
        (3.2, 0, 0.2),
        (-0.9, 0, 0),
        (-1.2, 0, -0.2),
    ]:
        assert acceleration(effect, tau, qd=qd) == pytest.approx(wanted / 2.0, abs=1e-12)


def test_an_asymmetry_of_dry_friction_is_coulomb_friction_with_an_offset():
    tau = 6.0 * np.sin(np.linspace(0.0, 20.0, 1500))
    asymmetric = fx.AsymmetricFriction(one(3.0), one(1.0), one(0.0), one(0.0))
    both = fx.CoulombFriction(one(2.0)), fx.ConstantOffset(one(-1.0))
    np.testing.assert_allclose(run([asymmetric], tau)[0], run(both, tau)[0], atol=1e-12)


def test_stribeck_friction_follows_its_curve_and_holds_its_peak():
    effect = fx.StribeckFriction(one(1.0), one(2.0), one(0.1))
    for qd in (-0.5, -0.1, 0.02, 0.05, 0.3):
        level = 1.0 + 2.0 * np.exp(-((qd / 0.1) ** 2))
        assert acceleration(effect, 0.7, qd=qd) == pytest.approx((0.7 - level * np.sign(qd)) / 2.0)
    assert acceleration(effect, 2.99) == pytest.approx(0.0, abs=1e-12)
    assert acceleration(effect, 3.2) == pytest.approx(0.1)


def test_stiction_holds_up_to_breakaway_and_lets_go_altogether():
    effect = fx.Stiction(one(4.0), one(1e-3), one(0.5))
    for tau, wanted in [(3.99, 0), (-3.99, 0), (4.2, 0.1), (-4.2, -0.1)]:
        assert acceleration(effect, tau) == pytest.approx(wanted, abs=1e-12)
    assert acceleration(effect, 1.0, qd=2e-3) == pytest.approx(0.5)  # it moves
    assert acceleration(effect, 1.0, q=0.5) == pytest.approx(0.5)  # the border is strict
    assert not effect.holds(one(0.0), one(0.0), one(0.0))  # nothing of the paper's program
    _, qd, _, _ = run([effect, fx.CoulombFriction(one(2.0))], np.linspace(0.0, 8.0, 801))
    assert np.argmax(np.abs(qd) > 1e-12) == 602  # both together hold 6 N
    assert (np.diff(qd[640:]) / DT).min() > 1.9  # sliding: 2 N are left


def test_load_dependent_friction_takes_a_share_of_the_delivered_torque():
    effect = fx.LoadDependentFriction(one(0.2))
    for tau, qd, wanted in [(5, 1, 4), (-5, 1, -6), (5, -1, 6), (0.01, 0, 0.008)]:
        assert acceleration(effect, tau, qd=qd) == pytest.approx(wanted / 2.0)
    q, _, _, _ = run([fx.TorqueScale(one(0.5)), effect], np.full(500, 10.0))
    assert q[-1] == pytest.approx(4.0 / 2.0 * 0.5**2 / 2.0)


@pytest.mark.parametrize(("tau", "load"), [(10.0, 5.0), (-5.0, -10.0)])
def test_friction_under_load_reads_what_other_friction_leaves(tau, load):
    """3 Nm of viscous and 2 Nm of dry friction; a spring acts behind the gear."""
    other = (
        fx.ViscousFriction(one(3.0)),
        fx.Spring(one(4.0), one(0.0)),
        fx.CoulombFriction(one(2.0)),
    )
    plant = Plant(point_mass(2.0, 1), (*other, fx.LoadDependentFriction(one(0.2))))
    state = State(one(0.5), one(1.0))
    (qdd,) = plant.acceleration(state, one(tau), DT)
    assert qdd == pytest.approx((tau - 3.0 - 2.0 - 2.0 - 0.2 * abs(load)) / 2.0)
    # inverse dynamics reads the load without the friction that depends on it
    without = 2.0 * qdd + 2.0
    (needed,) = plant.inverse_dynamics(*state, one(qdd))
    assert needed == pytest.approx(without + 3.0 + 2.0 + 0.2 * abs(without))


HINGE = """<mujoco><worldbody><body><joint name="hinge" type="hinge" axis="0 0 1" armature="1.5"/>
<inertial pos="0 0 0" mass="1" diaginertia="0.5 0.5 0.5"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize("torque", [8.0, -8.0])
def test_what_accelerates_the_rotor_passes_no_gear(tmp_path, torque):
    """A rotor of 1.5 and 0.5 more, a link of 0.5 kg m^2, friction of 0.3 of the load."""
    (tmp_path / "hinge.xml").write_text(HINGE)
    body, share = read_model(tmp_path / "hinge.xml").plant.body, 0.3
    plant = Plant(body, (fx.InertiaError(one(0.5)), fx.LoadDependentFriction(one(share))))
    state = State(one(0.3), one(1.0))
    qdd = plant.acceleration(state, one(torque), DT).item()
    load = torque - 2.0 * qdd
    assert 2.5 * qdd == pytest.approx(torque - share * abs(load), rel=2e-3)
    assert plant.acceleration(State(one(0.3), one(0.0)), one(0.0), DT) == 0.0
    needed = plant.inverse_dynamics(*state, one(qdd)).item()
    assert needed == pytest.approx(2.5 * qdd + share * abs(0.5 * qdd))


@pytest.mark.parametrize(
    ("effect", "speed"),
    [
        (fx.QuadraticDrag(one(3.0)), lambda t: 1.5 / (1.0 + 1.5 * 3.0 / 2.0 * t)),
        (fx.ViscousFriction(one(3.0)), lambda t: 1.5 * np.exp(-1.5 * t)),
    ],
    ids=lambda x: getattr(x, "name", ""),
)
def test_a_free_mass_is_slowed_as_the_closed_form_says_in_first_order(effect, speed):
    errors = [
        abs(run([effect], np.zeros(n), qd=1.5, dt=1.0 / n)[1][-1] - speed(1.0))
        for n in (100, 200, 400)
    ]
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 1.0, atol=0.05)


def test_friction_over_position_is_that_of_its_table_and_constant_beyond():
    table = jnp.array([[1.0, 3.0, 2.0]]), jnp.array([[0.5, 0.0, 1.0]]), one(0.0), one(2.0)
    for q, level, viscous in [(-1, 1, 0.5), (0.5, 2, 0.25), (1, 3, 0), (1.5, 2.5, 0.5), (9, 2, 1)]:
        wanted = -(level + 2.0 * viscous) / 2.0
        assert acceleration(
            fx.PositionDependentFriction(*table), 0.0, q=q, qd=2.0
        ) == pytest.approx(wanted)
        coupled = fx.CoupledFriction(
            table[0][0], table[1][0], jnp.array(0.0), jnp.array(2.0), joint=1, other=0
        )
        got = Plant(point_mass(2.0), (coupled,)).acceleration(
            State(jnp.array([q, 7.0]), jnp.array([2.0, 2.0])), jnp.zeros(2), DT
        )
        np.testing.assert_allclose(got, [0.0, wanted])


def test_a_table_over_position_is_numpys_interpolation():
    rng = np.random.default_rng(4)
    lower, upper, step = -1.3, 2.1, 1e-6
    for knots in (1, 2, 12):
        table, at = rng.normal(size=knots), np.linspace(lower, upper, knots)
        value = lambda q, table=table: table_value(jnp.asarray(table), lower, upper, q)
        q = np.append(rng.uniform(-3.0, 3.0, 200), at)
        np.testing.assert_allclose(jax.vmap(value)(q), np.interp(q, at, table), atol=1e-12)
        ends = [np.interp(q[:200] + by, at, table) for by in (-step, step)]
        slope = (ends[1] - ends[0]) / (2.0 * step)
        np.testing.assert_allclose(jax.vmap(jax.grad(value))(q[:200]), slope, atol=1e-6)


BRAKES = [
    fx.ViscousFriction(one(2.0)),
    fx.QuadraticDrag(one(2.0)),
    fx.CoulombFriction(one(1.5)),
    fx.AsymmetricFriction(one(1.5), one(0.7), one(1.0), one(2.0)),
    fx.StribeckFriction(one(1.0), one(2.0), one(0.1)),
    fx.Stiction(one(1.5), one(0.05), one(0.5)),
    fx.PositionDependentFriction(
        jnp.array([[1.0, 3.0]]), jnp.array([[2.0, 0.5]]), one(0.0), one(1.0)
    ),
    fx.LoadDependentFriction(one(0.4)),
]


@pytest.mark.parametrize("effect", BRAKES, ids=lambda e: e.name)
def test_friction_never_adds_energy(effect):
    rng = np.random.default_rng(1)
    q, qd, tau = (jnp.asarray(rng.normal(size=(400, 1)) * size) for size in (1.0, 0.02, 6.0))
    after = jax.vmap(
        lambda plant, *s: s[1] + 5e-3 * plant.acceleration(State(*s[:2]), s[2], 5e-3),
        (None, 0, 0, 0),
    )
    free, braked = Plant(point_mass(2.0, 1)), Plant(point_mass(2.0, 1), (effect,))
    assert jnp.all(jnp.abs(after(braked, q, qd, 0.0 * tau)) <= jnp.abs(qd) + 1e-15)
    # dry alone: it makes speed less and never turns it round
    if type(effect).torque is fx.Effect.torque:
        assert jnp.all(
            jnp.abs(after(braked, q, qd, tau)) <= jnp.abs(after(free, q, qd, tau)) + 1e-15
        )
        assert jnp.all(after(braked, q, qd, tau) * after(free, q, qd, tau) >= -1e-15)


@pytest.mark.parametrize("joints", [1, 2, 3, 5])
def test_coupled_joints_brake_by_complementarity(joints):
    """Each joint's friction stays within its level, equals it where the joint moves, and takes
    energy.
    """
    rng = np.random.default_rng(joints)
    root = rng.normal(size=(200, joints, joints))
    mobility = root @ root.transpose(0, 2, 1) + 0.5 * np.eye(joints)
    push, level = 3.0 * rng.normal(size=(200, joints)), rng.uniform(0.0, 2.0, (200, joints))
    grip = np.asarray(jax.jit(jax.vmap(friction_torque))(push, mobility, level))
    left = push - np.einsum("nij,nj->ni", mobility, grip)
    assert (np.abs(grip) <= level).all()
    own = np.diagonal(mobility, axis1=1, axis2=2)
    assert np.abs(grip - np.clip(grip + left / own, -level, level)).max() < 1e-3
    energy = lambda v: np.einsum("ni,nij,nj->n", v, np.linalg.inv(mobility), v)
    assert (energy(left) <= energy(push) * (1.0 + 1e-12)).all()


# --- position, body
# --------------------------------------------------------------------------------------------------


def test_a_spring_swings_at_its_frequency_about_its_rest():
    q, _, _, _ = run([fx.Spring(one(50.0), one(0.3))], np.zeros(25133), q=0.4, dt=1e-4)
    t = 1e-4 * np.arange(25134)
    np.testing.assert_allclose(q, 0.3 + 0.1 * np.cos(5.0 * t), atol=5e-4)
    turns = t[1:][np.diff(np.sign(q - 0.3)) != 0]
    assert np.diff(turns).mean() == pytest.approx(np.pi / 5.0, rel=1e-3)


def test_ripple_repeats_and_has_no_mean():
    effect, q = fx.TorqueRipple(one(3.0), one(4.0), one(0.2)), jnp.arange(0.0, 0.2, 1e-3)[:, None]
    torque = jax.vmap(lambda q: effect.torque(q, 0.0 * q, 0.0 * q))
    np.testing.assert_allclose(torque(q), torque(q + 0.6), atol=1e-12)
    assert abs(torque(q).mean()) < 1e-12
    assert torque(q).max() == pytest.approx(5.0, rel=1e-3)
    np.testing.assert_allclose(effect.torque(one(0.05), one(0.0), one(0.0)), 3.0)


def test_wrong_inertia_a_payload_and_an_offset_change_the_acceleration():
    assert acceleration(fx.InertiaError(one(1.0), one(0.5)), 7.0) == pytest.approx(2.0)
    assert acceleration(
        fx.Payload(jnp.array(1.5), jnp.array([0.1, 0.2, 0.3])), 7.0
    ) == pytest.approx(2.0)
    assert acceleration(fx.ConstantOffset(one(-3.0)), 7.0) == pytest.approx(2.0)
    two = Plant(point_mass(2.0), (OnJoint(fx.InertiaError(one(1.0), one(0.5)), 1, 2),))
    np.testing.assert_allclose(
        two.acceleration(State(jnp.zeros(2), jnp.zeros(2)), jnp.full(2, 7.0), DT), [3.5, 2.0]
    )
