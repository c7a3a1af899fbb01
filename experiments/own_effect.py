# %% [markdown]
# # An effect of your own
#
# A simulation lacks an eddy-current brake, which the package does not know. We write it down, put
# it into a plant, sweep over its strength, differentiate through it, and let the gap workflow find
# it in a log.
#
# `python experiments/own_effect.py FOLDER` takes about a minute, prints what each cell finds and
# writes `own_effect.png` and `.pdf`. The script is also a page of the documentation: run it cell by
# cell.

# %%
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

from jaxidl import gap
from jaxidl.effects import CoulombFriction, Effect, Parameter, SensingNoise, register, searched
from jaxidl.gap.benchmark.engine import simulate
from jaxidl.gap.benchmark.friction import CoulombFriction as RealFriction
from jaxidl.gap.benchmark.injected import Injected
from jaxidl.gap.benchmark.mechanisms import PENDULUM
from jaxidl.learning.execute import execute
from jaxidl.learning.iterate import learn, measure
from jaxidl.models import ErrorModel, Training
from jaxidl.paper.study import Condition, PaperStudy, draw_noise
from jaxidl.plot.style import house_style, save
from jaxidl.systems import Plant, point_mass
from jaxidl.types import Joints

jax.config.update("jax_enable_x64", True)
folder = Path(sys.argv[1] if len(sys.argv) == 2 else "out/own_effect")
folder.mkdir(parents=True, exist_ok=True)

# %% [markdown]
# ## Define it
#
# The fields are the parameters that are swept, differentiated and fitted. `torque` is computed for
# one instant and all joints. `guesses` gives starting values for a search: here several speeds,
# each with the strength that would explain the size of the torque that the model lacks.


# %%
@register
class EddyBrake(Effect):
    """−k·qd/(1 + (qd/v)²): in proportion to a low speed, largest at v, fading beyond."""

    k: Joints  # (J,) [N s/m or Nm s/rad]
    v: Joints  # (J,) [m/s or rad/s]

    name: ClassVar[str] = "eddy_brake"
    sentence: ClassVar[str] = "a brake that drags most at one speed and less beyond it"
    parameters: ClassVar = {
        "k": Parameter("N s/m", 0.0, 1e4, "the drag per speed of a slow joint"),
        "v": Parameter("m/s", 1e-3, 1e3, "the speed of the largest drag"),
    }

    def torque(self, q, qd, tau):
        return -self.k * qd / (1.0 + (qd / self.v) ** 2)

    @classmethod
    def guesses(cls, scale):
        return [
            {"k": 2.0 * scale.residual / v, "v": v}
            for v in scale.speed * np.array([0.05, 0.1, 0.2, 0.4, 0.8])
        ]


# %% [markdown]
# ## Add it to a plant
#
# The plant is the paper's point mass on two axes. Its model is right except for the brake. The mass
# moves by 1 m within a second at up to 5 m/s.

# %%
study = PaperStudy(
    modelled_mass=5.0, error_model=ErrorModel(layers=(24, 12, 1)), training=Training(epochs=40)
)
NOISE = 1e-6  # of the encoders [m]
setting = study.setting("pid", Condition(gain=1, noise=NOISE, friction=0.0, stiction=0.0))
STRENGTH, SPEED = 100.0, 2.0  # k [N s/m], v [m/s]


def braked(k, v):
    """The point mass with a brake of strength ``k`` and speed ``v`` on both axes, and noisy
    encoders.
    """
    brake = EddyBrake(k * jnp.ones(2), v * jnp.ones(2))
    return Plant(point_mass(study.true_mass), (brake, SensingNoise(jnp.asarray(NOISE))))


@jax.jit
def run_once(k, v):
    """One execution (T, J) on the braked plant, before anything is learned."""
    noise = jnp.asarray(draw_noise(1, 1, study.steps)[0])
    return execute(braked(k, v), setting.model, setting.law, setting.task, noise)


free, slowed = run_once(0.0, SPEED), run_once(STRENGTH, SPEED)
print(
    f"tracking error without the brake {1e3 * measure(free, setting.reference).q_error:.2f} mm, "
    f"with it {1e3 * measure(slowed, setting.reference).q_error:.2f} mm"
)

# %% [markdown]
# ## Sweep over it
#
# Whole learning runs (eight executions with small networks trained between them) are computed for
# every strength and seed, as one program. Without a brake there is nothing to learn but noise, and
# the error grows a little.

# %%
strengths, seeds, executions = jnp.linspace(0.0, 200.0, 5), (1, 2, 3), 8


def learning_run(k, noise, key):
    """Tracking error (K,) [m] of each of K executions."""
    options = {"source": "joint", "error_model": study.error_model, "training": study.training}
    return learn(setting.replace(plant=braked(k, SPEED)), noise, key, **options)[0].q_error


noise = jnp.stack([jnp.asarray(draw_noise(seed, executions, study.steps)) for seed in seeds])
over_seeds = jax.vmap(learning_run, in_axes=(None, 0, 0))
errors = jax.jit(jax.vmap(over_seeds, in_axes=(0, None, None)))(
    strengths, noise, jax.vmap(jax.random.key)(jnp.array(seeds))
)
for k, row in zip(strengths, jnp.median(errors, axis=1), strict=True):
    print(
        f"k = {k:5.0f} N s/m: tracking error {1e3 * row[0]:6.2f} mm at first, {1e3 * row[-1]:6.2f}"
        " mm after learning"
    )

# %% [markdown]
# ## Differentiate through it
#
# This is the derivative of the execution's tracking error with respect to both parameters, through
# all thousand steps.


# %%
def tracking_error(parameters):
    """Mean tracking error [m] of one execution at ``parameters`` (k, v)."""
    return measure(run_once(*parameters), setting.reference).q_error


here, nudges = jnp.array([STRENGTH, SPEED]), jnp.array([1e-2, 1e-4])
forward, reverse = (
    jax.jit(jax.jacfwd(tracking_error))(here),
    jax.jit(jax.jacrev(tracking_error))(here),
)
numeric = jnp.array(
    [
        (tracking_error(here + h) - tracking_error(here - h)) / (2.0 * h.sum())
        for h in jnp.diag(nudges)
    ]
)
for name, f, r, n in zip(("k", "v"), forward, reverse, numeric, strict=True):
    print(
        f"d(tracking error)/d{name}: forward {f:.9e}, reverse {r:.9e}, central differences {n:.9e}"
    )

# %% [markdown]
# ## Let the gap workflow find it
#
# The "real machine" is the benchmark's engine: plain MuJoCo at a step ten times finer than the
# log's, noisy and quantised encoders, and the brake written down a second time, in plain floats.
# Its bearing has dry friction, too. The model has neither.


# %%
@dataclass
class RealBrake(Injected):
    k: float
    v: float

    def torque(self, t, q, qd, delivered):
        return -self.k * qd[self.joint] / (1.0 + (qd[self.joint] / self.v) ** 2)


TRUE = {"k": 0.8, "v": 1.0}  # [Nm s/rad], [rad/s]; the log reaches 3.5 rad/s
RUB = 0.1  # dry friction of the bearing [Nm]
columns = simulate(PENDULUM, [RealBrake(0, **TRUE), RealFriction(0, RUB)], 7)
log = gap.from_arrays(columns["time"], columns["q0"][:, None], columns["tau0"][:, None])
(folder / "model.xml").write_text(PENDULUM)

before = gap.diagnose(
    log, folder / "model.xml", effects=[n for n in searched() if n != "eddy_brake"], rollouts=False
)
print(f"without the new effect: {before.summary}\n")
found = gap.diagnose(log, folder / "model.xml")
print(f"with it: {found.summary}")

# %% [markdown]
# ## See it


# %%
def drag(effects, speed):
    """Torque (S,) [Nm] that the effects ask of a pendulum's motor at a steady ``speed`` (S, 1)
    [rad/s].
    """
    rest = jnp.zeros(1)
    each = [
        jax.vmap(
            lambda qd, e=e: e.dry(rest, qd, rest, qd) * jnp.sign(qd) - e.torque(rest, qd, rest)
        )(speed)
        for e in effects
    ]
    return sum(each)[:, 0]


real = (
    EddyBrake(**{name: jnp.array([value]) for name, value in TRUE.items()}),
    CoulombFriction(jnp.array([RUB])),
)
with house_style():
    figure = plt.figure(figsize=(8.6, 2.9), layout="constrained")
    over_time, over_strength, over_speed = figure.subplots(1, 3)
    time = np.arange(study.steps) * study.dt
    for label, run, style in (("without brake", free, "--"), ("with brake", slowed, "-")):
        over_time.plot(time, run.q[:, 0], style, label=label)
    over_time.set(xlabel="time [s]", ylabel="position of axis 0 [m]", title="One execution")
    over_time.legend(loc="lower right")

    for label, which, style in (("before learning", 0, "s--"), ("after learning", -1, "o-")):
        values = 1e3 * np.asarray(errors[:, :, which])
        (line,) = over_strength.plot(strengths, np.median(values, axis=1), style, label=label)
        over_strength.fill_between(
            strengths, values.min(1), values.max(1), color=line.get_color(), alpha=0.2
        )
    tangent = 1e3 * (tracking_error(here) + forward[0] * (strengths - STRENGTH))
    over_strength.plot(strengths, tangent, "k:", label=f"derivative at k = {STRENGTH:g}")
    title = f"Learning: median, range of {len(seeds)} seeds"
    over_strength.set(
        xlabel="strength of the brake k [N s/m]",
        ylabel="tracking error [mm]",
        title=title,
        ylim=(-4, 105),
    )
    over_strength.legend(loc="upper left")

    seen, where = found.traces, found.traces.counted[:, 0]
    over_speed.plot(
        seen.qd[where, 0],
        seen.before[where, 0],
        ".",
        color="0.75",
        markersize=1.5,
        label="log minus model",
    )
    speed = jnp.linspace(-3.5, 3.5, 401)[:, None]
    for label, effects, style in (
        ("hidden", real, "-"),
        ("found", [f.effect for f in found.findings], "--"),
    ):
        over_speed.plot(speed[:, 0], drag(effects, speed), style, label=label)
    over_speed.set(
        xlabel="speed [rad/s]", ylabel="torque [Nm]", title="What the model lacks", ylim=(-0.7, 1.1)
    )
    over_speed.legend(loc="upper left", markerscale=5)
    save(figure, folder, "own_effect")
