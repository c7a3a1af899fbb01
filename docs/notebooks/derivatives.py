# %% [markdown]
# # Derivatives from end to end
#
# Executions, data and whole learning runs are differentiable, forward and in reverse, by whatever
# is continuous: parameters of every effect, gains, filters, policies, masses, weights, and through
# the unrolled training steps the learning rate.

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
# The paper's friction and stiction switch by comparisons, and its networks' slopes jump at every
# kink of PReLU. A derivative is right for the branch taken and blind to the jump. So the effects
# have a smooth form whose width is yours, and so have the networks; each converges to the sharp
# form as the width goes to zero. For what that means see [what derivatives mean where things
# jump](../explanation/derivatives.md).

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
# `derivative="reverse"` is the same for `jax.grad`, with checkpoints that save memory. Neither
# changes a value but for rounding.

# %%
here = jnp.array([500.0, 0.1, 0.5, 1e-3])
value, slope = jax.jit(lambda x: (final_error(x), jax.jacfwd(final_error)(x)))(here)
print(f"log of the final error: {value:.4f}")
for name, x, d in zip(NAMES, here, slope, strict=True):
    print(f"{name:>13} = {x:<6g} a change by 1 % changes the error by {d * x:+.3f} %")

# %% [markdown]
# ## Is it true?
#
# Compare the tangent with the learning runs themselves, for learner's gains around 500 N/m. One
# compiled program serves all of them.

# %%
gains = jnp.linspace(0.98, 1.02, 21) * here[0]
runs = jax.jit(jax.vmap(lambda g: final_error(here.at[0].set(g))))(gains)

plt.figure(figsize=(6, 3), layout="constrained")
plt.plot(gains, runs, "o", markersize=4, label="learning runs")
plt.plot(gains, value + slope[0] * (gains - here[0]), "k:", label="tangent")
plt.xlabel("learner's gain [N/m]")
plt.ylabel("log of the final error")
plt.legend()
plt.show()

# %% [markdown]
# Where to go on: [what derivatives mean where things jump](../explanation/derivatives.md), and
# [tune gains by gradient](../howto/tune.md).
