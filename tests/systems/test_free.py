"""A plant's free parameters as one vector: values, names, units and bounds, in and out of compiled
functions.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxidl.effects import (
    ActuatorDelay,
    CoulombFriction,
    OnJoint,
    Payload,
    PositionDependentFriction,
    Spring,
    ViscousFriction,
)
from jaxidl.errors import ConfigurationError
from jaxidl.systems import Plant, PointMass
from jaxidl.systems.free import Free, pieces, unit_of

MASS = PointMass(jnp.array([1.0, 2.0]))
PLANT = Plant(
    MASS,
    (
        OnJoint(CoulombFriction(jnp.array([0.4])), 1, 2),
        ViscousFriction(jnp.array([1.0, 2.0])),
        OnJoint(ActuatorDelay(jnp.array([0.01]), steps=20), 0, 2),
    ),
)


def test_a_vector_sets_what_is_free_and_nothing_else():
    free = Free(PLANT, ((), ("coefficient",), ("delay",)))
    np.testing.assert_array_equal(free.vector, [1.0, 2.0, 0.01])
    other = free.set(jnp.array([3.0, 4.0, 0.02]))
    assert jax.tree.structure(other) == jax.tree.structure(PLANT)  # the delay's line, too
    np.testing.assert_array_equal(
        Free(other, (("level",), ("coefficient",), ("delay",))).vector, [0.4, 3.0, 4.0, 0.02]
    )
    assert [
        {n: v.tolist() for n, v in of.items()} for of in free.named(np.array([3.0, 4.0, 0.02]))
    ] == [
        {},
        {"coefficient": [3.0, 4.0]},
        {"delay": [0.02]},
    ]


def test_each_number_has_a_name_and_a_unit(two_link):
    free = Free(PLANT, (("level",), ("coefficient",), ("delay",)))
    assert free.names == [
        "coulomb_friction[1].level",
        "viscous_friction.coefficient[0]",
        "viscous_friction.coefficient[1]",
        "actuator_delay[0].delay",
    ]
    assert free.units == ["N", "N s/m", "N s/m", "s"]
    load = Payload(jnp.array(0.5), jnp.zeros(3))
    spring = OnJoint(Spring(jnp.array([2.0]), jnp.array([0.1])), 1, 2)
    free = Free(
        Plant(two_link.plant.body, (load, spring)), (("mass", "com"), ("stiffness", "rest"))
    )
    assert free.units == ["kg", "m", "m", "m", "Nm/rad", "rad"]
    assert len(free.names) == len(free.vector) == 6
    assert unit_of("1/N", "hinge") == "1/Nm"
    assert (unit_of("N", "slide"), unit_of("N", "hinge"), unit_of("length", "hinge")) == (
        "N",
        "Nm",
        "m",
    )


def test_bounds_are_those_given_and_no_wider_than_the_catalogues():
    free = Free(PLANT, ({"level": (0.1, 0.5)}, {"coefficient": (-9.0, 1e9)}, ("delay",)))
    lower, upper = free.bounds()
    specs = ViscousFriction.parameters["coefficient"], ActuatorDelay.parameters["delay"]
    np.testing.assert_array_equal(lower, [0.1, *(max(-9.0, specs[0].lower),) * 2, specs[1].lower])
    np.testing.assert_array_equal(upper, [0.5, *(specs[0].upper,) * 2, specs[1].upper])
    for wrong in ({"level": (0.5, 1.0)}, {"level": (0.4, 0.4)}):
        with pytest.raises(ConfigurationError, match=r"coulomb_friction\.level in .* widen them"):
            Free(PLANT, (wrong, (), ())).bounds()


def test_free_parameters_work_in_compiled_functions_and_have_derivatives():
    where = (("level",), ("coefficient",), ())

    @jax.jit
    def torque(plant, theta):
        plant = Free(plant, where).set(theta)
        return jnp.sum(
            plant.inverse_dynamics(jnp.zeros(2), jnp.array([1.0, -2.0]), jnp.zeros(2)) ** 2
        )

    theta = Free(PLANT, where).vector
    slope = jax.jit(jax.grad(torque, 1))(PLANT, theta)
    # joint 0: 1·b₀; joint 1: −2·b₁ − c
    np.testing.assert_allclose(slope, [2 * 4.4, 2 * 1.0, 2 * 4.4 * 2])
    np.testing.assert_allclose(
        jax.vmap(lambda t: torque(PLANT, t))(jnp.stack([theta, 0.0 * theta])), [1.0 + 4.4**2, 0.0]
    )


def test_tables_keep_their_shape():
    table = OnJoint(
        PositionDependentFriction(*(jnp.zeros((1, 5)),) * 2, jnp.array([-1.0]), jnp.array([1.0])),
        0,
        2,
    )
    free = Free(Plant(MASS, (table,)), (("level",),))
    changed = free.set(jnp.arange(5.0))
    np.testing.assert_array_equal(changed.effects[0].effect.level, np.arange(5.0)[None])
    assert free.names[3] == "position_dependent_friction[0].level[3]"
    assert [p.shape for p in pieces(np.arange(7.0), [(2, 3), (), (0,)])] == [(2, 3), (), (0,)]
