# %% [markdown]
# # Derivatives from end to end
#
# Executions, data and whole learning runs are differentiable, forward and in reverse, with respect
# to everything that is continuous: parameters of every effect, gains, filters, policies, masses,
# weights, and through the unrolled training steps the learning rate.

# %%
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt

from jaxidl import Condition, ErrorModel, PaperStudy, Training, draw_noise, learn
from jaxidl.paper.vary import varied

jax.config.update("jax_enable_x64", True)

# %% [markdown]
# ## A plant without jumps
#
# The paper's friction and stiction switch by comparisons, and the slopes of its networks jump at
# every kink of PReLU. A derivative is right for the branch that was taken, and does not see the
# jump. The effects and the networks therefore have a smooth form whose width you choose. Values
# converge to those of the sharp form as the width goes to zero; see [what derivatives mean where
# things jump](../explanation/derivatives.md).

# %%
smooth = PaperStudy(
    friction_width=0.02,
    stiction_width=0.05,
    error_model=ErrorModel(activation_width=0.5),
    training=Training(epochs=5),
)
NAMES = ("learner_gain", "alpha", "prior_mass", "learning_rate")


def final_error(numbers):
    """Log of the error after three executions, by learner's gain, filter, prior mass and rate."""
    study = varied(smooth, dict(zip(NAMES, numbers, strict=True)))
    setting = study.setting("pid", Condition(gain=0, noise=1e-4, friction=5.0, stiction=5.0))
    noise = jnp.asarray(draw_noise(seed=1, executions=3, steps=1000))
    how = {"source": "joint", "error_model": study.error_model, "training": study.training}
    metrics, _, _ = learn(setting, noise, jax.random.key(1), derivative="forward", **how)
    return jnp.log(metrics.q_error[-1])


# %% [markdown]
# ## Four derivatives through three executions and two trainings
#
# Here `derivative="forward"` prepares the run for `jax.jacfwd`. `derivative="reverse"` does so for
# `jax.grad`, with checkpoints that save memory. Neither changes a value beyond rounding.

# %%
here = jnp.array([500.0, 0.1, 0.5, 1e-3])
value, slope = jax.jit(lambda x: (final_error(x), jax.jacfwd(final_error)(x)))(here)
print(f"log of the final error: {value:.4f}")
for name, x, d in zip(NAMES, here, slope, strict=True):
    print(f"{name:>13} = {x:<6g} a change by 1 % changes the error by {d * x:+.3f} %")

# %% [markdown]
# ## Is it right, and how far does it reach?
#
# Compare the tangent with the learning runs themselves, for learning rates in a narrow and in a
# wider range around 0.001. One compiled program serves all of them.

# %%
many = jax.jit(jax.vmap(lambda rate: final_error(here.at[3].set(rate))))
figure, panels = plt.subplots(1, 2, figsize=(7, 2.8), layout="constrained")
for panel, width in zip(panels, (0.001, 0.02), strict=True):
    rates = jnp.linspace(1.0 - width, 1.0 + width, 11) * here[3]
    panel.plot(100 * (rates / here[3] - 1), many(rates), "o", markersize=4, label="learning runs")
    panel.plot(
        100 * (rates / here[3] - 1), value + slope[3] * (rates - here[3]), "k:", label="tangent"
    )
    panel.set(xlabel="change of the learning rate [%]")
panels[0].set_ylabel("log of the final error")
panels[0].legend()
plt.show()

# %% [markdown]
# The derivative is right, but the error bends within a fraction of a per cent: learning is a long
# chain of steps. Gradient descent needs a short and smooth run: the wider the rounding of kinks and
# the fewer the executions, the further a tangent reaches.

# %% [markdown]
# Where to go on: [what derivatives mean where things jump](../explanation/derivatives.md), and
# [tune gains by gradient](../howto/tune.md).
