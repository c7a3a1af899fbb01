"""Effects are recovered from clean data.

Linear ones by least squares, the others by Gauss-Newton from their guesses.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree
from scipy.optimize import least_squares

from jaxidl.effects import Parameter, Scale
from jaxidl.systems import Plant, PointMass
from jaxidl.types import State
from tests.helpers.effects import EXAMPLES, MASS, SINGLE, TURNING
from tests.helpers.numeric import quick

DT, STEPS = 2e-3, 2000
REST = 1e-12  # m/s: slower is the rounding of standstill
HERTZ = np.array([0.35, 0.8, 1.7, 3.1, 6.3, 11.0, 19.0])
FIXED = {  # what sets the shape, or what a point mass cannot show
    "stiction": ("speed", "below"),
    "position_dependent_friction": ("lower", "upper"),
    "coupled_friction": ("lower", "upper"),
    "coupled_joint_friction": ("speed",),
    "payload": ("com", "moment", "inertia"),
}


@quick
def record(effect, axes):
    """The motion (T, J) of a point mass with the effect under a torque of many tones."""
    joints = axes.shape[0]
    plant, rest = (
        Plant(PointMass(MASS[:joints]), (effect,)),
        State(jnp.full(joints, 0.1), jnp.zeros(joints)),
    )
    t, signs = (
        DT * jnp.arange(STEPS)[:, None, None],
        (-1.0) ** jnp.arange(len(HERTZ))[None, None, :],
    )
    hertz = HERTZ[None, None, :] * (1.0 + 0.13 * jnp.arange(joints)[None, :, None])
    # cosines: it does not drift away
    tau = jnp.sum(6.0 * signs * jnp.cos(2.0 * jnp.pi * hertz * t) / (1.0 + 0.1 * hertz), -1)
    noise = jax.random.normal(jax.random.key(0), tau.shape)

    def step(carry, now):
        (q, qd), hidden = carry
        after, hidden = plant.step(State(q, qd), hidden, now[0], DT)
        reading = plant.sense(hidden, after.q, now[1])
        return (after, hidden), {
            "q": q,
            "qd": qd,
            "next_q": after.q,
            "next_qd": after.qd,
            "reading": reading,
        }

    log = jax.lax.scan(step, (rest, plant.start(rest.q)), (tau, noise))[1]
    qdd = (log["next_qd"] - log["qd"]) / DT
    missing = jax.vmap(plant.body.inverse_dynamics)(log["q"], log["qd"], qdd) - tau
    return log | {"tau": tau, "noise": noise, "qdd": qdd, "missing": missing}


def regressor(effect, q, qd, tau, body, qdd):
    """Derivative of the torque (J,) that the effect adds at one instant by its flattened parameters
    (P,): (J, P).
    """
    flat, unravel = ravel_pytree(effect)

    def added(parameters):
        now = unravel(parameters)
        total = now.torque(q, qd, tau) - now.dry(q, qd, tau, qd) * jnp.sign(qd)
        return total - now.alter(body).inverse_dynamics(q, qd, qdd)

    return jax.jacfwd(added)(flat)


LINEAR = {
    name: effect for name, effect in EXAMPLES.items() if type(effect).linear and name not in TURNING
}


@pytest.mark.parametrize("effect", LINEAR.values(), ids=LINEAR.keys())
def test_least_squares_finds_a_linear_effect(effect):
    log, body = record(effect, MASS), PointMass(MASS)
    rows = jax.vmap(lambda *now: regressor(effect, *now[:3], body, now[3]))(
        *(log[k] for k in ("q", "qd", "tau", "qdd"))
    )
    sliding = np.asarray((log["qd"] * log["next_qd"] > 0.0) & (jnp.abs(log["next_qd"]) > REST))
    assert 0.8 < sliding.mean() <= 1.0
    missing = np.asarray(log["missing"])[sliding]
    true, rebuild = ravel_pytree(effect)
    np.testing.assert_allclose((rows @ true)[sliding], missing, rtol=1e-6, atol=1e-9)
    found = np.linalg.lstsq(rows[sliding], missing, rcond=1e-10)[0]
    if effect.name == "inertia_error":  # a point's mass and an axis' inertia are the same thing
        found, true = (rebuild(x).extra + rebuild(x).mass for x in (found, true))
    np.testing.assert_allclose(found, true, rtol=1e-6)


def unexplained(effect, log):
    """Accelerations and readings (T, 2 J) that the effect does not explain.

    Dry friction is known only of joints that slide or break away.
    """
    body = effect.alter(PointMass(MASS[: log["q"].shape[1]]))

    def step(memory, now):
        q, qd, tau = now["q"], now["qd"], now["tau"]
        tau, memory = effect.actuate(memory, q, qd, tau, DT)
        direction = jnp.where(jnp.abs(qd) < REST, now["next_qd"], qd)
        added = effect.torque(q, qd, tau) - effect.dry(q, qd, tau, direction) * jnp.sign(direction)
        left = body.forward_dynamics(q, qd, tau + added) - now["qdd"]
        reading = effect.sense(memory, now["next_q"], now["noise"]) - now["reading"]
        sliding = (direction * now["next_qd"] > 0.0) & (jnp.abs(now["next_qd"]) > REST)
        return memory, jnp.concatenate([jnp.where(sliding, left, 0.0), reading])

    return jax.lax.scan(step, effect.start(log["q"][0]), log)[1]


BESIDE = ("sublinear_friction",)  # alone, its level is cut where it is negative
CURVED = {
    name: SINGLE.get(name, e)
    for name, e in EXAMPLES.items()
    if not type(e).linear and name not in (*TURNING, *BESIDE)
}


@pytest.mark.parametrize("effect", CURVED.values(), ids=CURVED.keys())
def test_gauss_newton_finds_a_nonlinear_effect(effect):
    joints = 1 if effect.name in SINGLE else 2
    log = record(effect, MASS[:joints])
    q, qd, tau, missing = (np.asarray(log[key])[:, -1] for key in ("q", "qd", "tau", "missing"))
    scale = Scale(
        *map(
            float,
            (abs(tau).max(), abs(qd).max(), q.min(), q.max(), MASS[0], missing.std(), 50.0, DT),
        )
    )
    free = [key for key in effect.parameters if key not in FIXED.get(effect.name, ())]
    true, rebuild = ravel_pytree({key: getattr(effect, key) for key in free})
    of_x = lambda x: jnp.ravel(unexplained(effect.replace(**rebuild(x)), log))
    residual, slopes = quick(of_x), quick(jax.jacfwd(of_x))

    def spread(values):
        shaped = {
            key: jnp.broadcast_to(values[key], jnp.shape(getattr(effect, key))) for key in free
        }
        return np.asarray(ravel_pytree(shaped)[0])

    limits = effect.parameters | {
        "motor_inertia": Parameter("kg", 1e-3, 0.8 * scale.inertia, "the rest is the link's")
    }
    bounds = (
        spread({k: p.lower for k, p in limits.items()}),
        spread({k: p.upper for k, p in limits.items()}),
    )
    assert np.abs(residual(true)).max() < 1e-7
    fits = []
    for guess in effect.guesses(scale):
        fits.append(
            least_squares(
                residual, spread(guess), jac=slopes, bounds=bounds, x_scale="jac", max_nfev=60
            )
        )
        if fits[-1].cost < 1e-12:
            break
    np.testing.assert_allclose(min(fits, key=lambda fit: fit.cost).x, true, rtol=0.01)
