# %% [markdown]
# # A sweep of your own
#
# `jaxidl.jobs.sweep` runs any pure JAX function at every point of labelled axes, side by side on
# all cores, accelerators or a cluster. It continues where it was stopped, and takes more values
# later. The function below computes how far a point mass is off its path, for a feedback gain, a
# friction and a seed. It is in the script `experiments/own_sweep.py`:
#
# ```{literalinclude} ../../experiments/own_sweep.py
# :language: python
# :lines: 8-
# ```

# %%
import sys
from pathlib import Path

sys.path.insert(0, str(Path("../../experiments").resolve()))

import matplotlib.pyplot as plt
from own_sweep import AXES, STEPS, run_one

from jaxidl.jobs import Variable, sweep

# %% [markdown]
# ## Run it
#
# These are sixty executions. The result is an `xarray.Dataset` with the names of the axes.

# %%
out = Path("out/own_sweep.nc")
out.unlink(missing_ok=True)
how = {
    "settings": {"steps": STEPS},
    "variables": {
        "error": Variable((), "m", "mean position error"),
        "feedback": Variable(("step",), "N", "mean feedback"),
    },
    "quiet": True,
}
data = sweep(run_one, AXES, out, **how)
data["error"].mean("seed").to_pandas()

# %% [markdown]
# ## More values later
#
# The same call with more values on an axis computes only the new ones; the others are read from the
# file. A file with other `settings` is refused.

# %%
more = {**AXES, "gain": (*AXES["gain"], 1600.0)}
data = sweep(run_one, more, out, **how)

plt.figure(figsize=(6, 3.2), layout="constrained")
for friction in data.friction.values:
    error = data["error"].sel(friction=friction)
    plt.plot(data.gain, 1e3 * error.mean("seed"), "o-", label=f"{friction:g}")
plt.xscale("log")
plt.yscale("log")
plt.xlabel("feedback gain [N/m]")
plt.ylabel("mean position error [mm]")
plt.legend(title="friction [N s/m]")
plt.show()
# %% [markdown]
# The file records where its numbers come from:

# %%
for key, value in data.attrs.items():
    if key in ("versions", "device", "precision", "created"):
        print(f"{key}: {value}")

# %% [markdown]
# Where to go on: [sweeps of your own](../howto/sweep.md) in more detail, [several GPUs and
# clusters](../howto/machines.md).
