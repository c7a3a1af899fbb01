"""An example of every effect, a mass that they act on, and an effect of a user's own."""

from functools import partial
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

import jaxidl.effects as fx
from jaxidl.effects import Effect, OnJoint, Parameter
from jaxidl.paper.effects import PaperFriction
from jaxidl.systems import Plant, point_mass
from jaxidl.types import State

one = lambda x: jnp.array([float(x)])
pair = lambda a, b: jnp.array([a, b])
ENDS = {"lower": 0.0, "upper": 0.9}
EXAMPLES: dict[str, Effect] = {
    e.name: e
    for e in (
        fx.ViscousFriction(pair(2.0, 3.0)),
        fx.CoulombFriction(pair(1.5, 0.7)),
        fx.AsymmetricFriction(pair(1.5, 0.7), pair(0.9, 1.1), pair(2.0, 3.0), pair(1.0, 4.0)),
        fx.StribeckFriction(pair(1.0, 0.8), pair(0.9, 0.5), pair(0.3, 0.2)),
        fx.Stiction(pair(1.5, 1.2), pair(1e-3, 2e-3), pair(5.0, 6.0)),
        fx.QuadraticDrag(pair(2.0, 3.0)),
        fx.PositionDependentFriction(
            jnp.array([[1.0, 0.5, 0.8, 1.2], [0.4, 0.9, 0.7, 0.6]]),
            jnp.array([[2.0, 1.0, 3.0, 2.5], [1.0, 2.0, 1.5, 2.2]]),
            *(pair(x, x) for x in ENDS.values()),
        ),
        fx.LoadDependentFriction(pair(0.2, 0.1)),
        fx.DirectionalLoadFriction(pair(0.2, 0.1), pair(0.05, 0.15)),
        fx.SublinearFriction(pair(2.0, 1.0), pair(1.5, 2.1)),
        fx.ThermalFriction(pair(1.0, 2.0), pair(2.0, 1.5), pair(1.3, 0.7)),
        fx.CoupledJointFriction(jnp.array(1.5), jnp.array(0.7), jnp.array(0.3), difference=True),
        fx.CoupledFriction(
            jnp.array([0.7, 0.5, 0.8, 1.2]),
            jnp.array([2.0, 1.0, 3.0, 2.5]),
            *map(jnp.array, ENDS.values()),
        ),
        fx.InertiaError(pair(1.0, -0.5), pair(0.4, 0.3)),
        fx.ComError(jnp.array([[0.2, 0.1, -0.3], [0.1, 0.0, 0.2]])),
        fx.InertiaTensorError(
            jnp.array([[0.2, 0.1, 0.3, 0.02, 0.0, -0.01], [0.1, 0.1, 0.2, 0.0, 0.03, 0.01]])
        ),
        fx.Payload(
            jnp.array(0.7),
            jnp.array([0.1, 0.0, -0.2]),
            jnp.array([0.02, 0.0, 0.1]),
            0.01 * jnp.arange(6.0),
        ),
        fx.BaseTilt(pair(0.05, -0.03)),
        fx.ConstantOffset(pair(1.0, -2.0)),
        fx.Spring(pair(8.0, 5.0), pair(0.2, -0.1)),
        fx.TorqueRipple(pair(0.5, 0.8), pair(1.0, -0.6), pair(0.13, 0.2)),
        fx.TorqueScale(pair(0.8, 1.1)),
        fx.TorqueCurve(pair(0.04, 0.02)),
        fx.MotorCoupling(jnp.array(0.3)),
        fx.TorqueSaturation(pair(2.0, 3.5)),
        fx.ActuatorLag(pair(0.01, 0.02)),
        fx.ActuatorDelay(pair(0.0043, 0.0077), steps=12),
        fx.JointElasticity(pair(4e3, 2e3), pair(3.0, 2.0), pair(0.6, 0.4)),
        fx.Backlash(pair(2e-3, 1e-3), pair(4e3, 3e3), pair(20.0, 15.0), pair(0.6, 0.4)),
        fx.PreslidingFriction(pair(2.0, 1.5), pair(0.05, 0.08)),
        fx.PositionBias(pair(0.03, -0.02)),
        fx.SensorDelay(pair(0.0043, 0.0077), steps=12),
        PaperFriction(jnp.array(3.0)),
        fx.SensingNoise(jnp.array(1e-3)),
        fx.EncoderQuantisation(pair(1e-3, 2e-3)),
    )
}
MASS, DT = jnp.array([2.0, 2.5]), 1e-3  # [kg], [s]
# not an effect of one joint
BOTH_AXES = {name for name, e in EXAMPLES.items() if not e.alone() or name == "paper_friction"}
# what a point mass cannot show: see ``systems/test_links.py``
TURNING = ("com_error", "inertia_tensor_error", "base_tilt")


def first_axis(effect: Effect) -> Effect:
    """The example on a mechanism of one axis."""
    names = [k for k in effect.parameters if k != "com"]
    return effect.replace(**{k: jnp.atleast_1d(jnp.asarray(getattr(effect, k)))[:1] for k in names})


ALONE = {name: first_axis(effect) for name, effect in EXAMPLES.items() if name not in BOTH_AXES}
SINGLE = ALONE | {"payload": EXAMPLES["payload"]}
WRAPPED = {f"{name} on joint 1": OnJoint(effect, 1, 2) for name, effect in ALONE.items()}


def run(effects, tau, q=0.0, qd=0.0, mass=2.0, dt=DT):
    """Positions, speeds and encoder readings (T + 1,), and hidden states, of a mass on one axis
    under commands ``tau`` (T,).
    """
    plant, start = Plant(point_mass(mass, 1), tuple(effects)), State(one(q), one(qd))
    ((q, qd), hidden), reading = _along(plant, start, jnp.asarray(tau, float), dt)
    return np.asarray(q[:, 0]), np.asarray(qd[:, 0]), np.asarray(reading[:, 0]), hidden


@partial(jax.jit, static_argnames="dt")
def _along(plant, start, tau, dt):
    def step(carry, push):
        (state, hidden), before = plant.step(*carry, push, dt), carry
        return (state, hidden), (before, plant.sense(before[1], before[0].q, jnp.zeros(1)))

    last, (before, reading) = jax.lax.scan(step, (start, plant.start(start.q)), tau[:, None])
    every = jax.tree.map(lambda x, y: jnp.concatenate([x, y[None]]), before, last)
    return every, jnp.concatenate([reading, plant.sense(last[1], last[0].q, jnp.zeros(1))[None]])


def acceleration(effect, tau, q=0.0, qd=0.0, mass=2.0):
    """The acceleration of a mass on one axis over one step."""
    return float(
        Plant(point_mass(mass, 1), (effect,)).acceleration(State(one(q), one(qd)), one(tau), DT)[0]
    )


class Worm(Effect):
    """Friction that is a share of the delivered torque.

    It is linear in its parameter and reads the torque.
    """

    share: jax.Array

    name: ClassVar[str] = "worm"
    sentence: ClassVar[str] = "a worm gear rubs under load"
    parameters: ClassVar = {"share": Parameter("1", 0.0, 0.9, "share of the torque that is lost")}
    linear: ClassVar[bool] = True

    def torque(self, q, qd, tau):
        return -self.share * tau * jnp.tanh(qd / 1e-3) * jnp.sign(tau)
