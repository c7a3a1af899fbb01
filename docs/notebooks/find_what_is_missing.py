# %% [markdown]
# # Find what a simulation is missing
#
# You have a model of a robot and a log of its motion, and the two disagree. Which physical effect
# is missing? We hide two effects in a pendulum and let `jaxidl.gap` look for them. On the command
# line the same diagnosis is `jaxidl gap LOG --model MODEL`.

# %%
from pathlib import Path

import matplotlib.pyplot as plt

from jaxidl import gap, report
from jaxidl.gap.benchmark.catalogue import make
from jaxidl.gap.benchmark.engine import simulate
from jaxidl.gap.benchmark.mechanisms import PENDULUM

folder = Path("out/find_what_is_missing")
folder.mkdir(parents=True, exist_ok=True)

# %% [markdown]
# ## A log with something hidden in it
#
# The log comes from an engine that shares nothing with the code that looks for effects: MuJoCo in
# C, ten steps per sample, with a noisy and quantised encoder. The pendulum's bearing has dry
# friction of 0.3 Nm, and its motor is 16 ms late.

# %%
hidden = [
    make("coulomb_friction", 0, {"level": 0.3}),
    make("actuator_delay", 0, {"delay": 0.016}),
]
columns = simulate(PENDULUM, hidden, seed=7)
log = gap.from_arrays(columns["time"], columns["q0"][:, None], columns["tau0"][:, None])
(folder / "model.xml").write_text(PENDULUM)  # what we believe: no friction, no delay

figure, (above, below) = plt.subplots(2, sharex=True, figsize=(6, 3), layout="constrained")
above.plot(log.time, log.q[:, 0])
above.set_ylabel("position [rad]")
below.plot(log.time, log.tau[:, 0])
below.set(xlabel="time [s]", ylabel="torque [Nm]")
plt.show()
# %% [markdown]
# ## Diagnose it

# %%
found = gap.diagnose(log, folder / "model.xml")
print(report.table(found))

# %% [markdown]
# The dry friction is found with its size. The delay of the motor is found, too. This log does not
# contain the frequencies at which a dead time and a lag differ. So the delay is in parentheses, and
# the last line explains why. A tool that always names something would be worse than none.
#
# The last 30 % of the log took no part in fitting or searching. All errors "after" are computed
# there. *Conventional* is the error of an ordinary identification that fits friction, inertia and
# offset on every joint.
#
# ## See where model and log disagree
#
# Orange: the torque that the model lacks. Blue: the torque that is still missing with the effects
# that were found. The step at zero velocity is the dry friction.

# %%
report.plot_where(found)

# %% [markdown]
# ## Use what was found
#
# `found.plant` is the corrected plant. Use it like any other for simulation, control and learning.
# `report.save` writes a page, the figures, `report.json`, and the corrected model as MJCF.

# %%
for finding in found.findings:
    print(f"{finding.name} (confidence {finding.confidence:.0%}):")
    for name, number in finding.parameters.items():
        print(f"    {name} = {number.value:.3g} ± {number.stderr:.2g} {number.unit}")

page = report.save(found, folder / "report")
print(sorted(path.name for path in page.parent.iterdir()))

# %% [markdown]
# A second diagnosis with the corrected model finds nothing more:

# %%
again = gap.diagnose(log, folder / "report" / "model.xml", rollouts=False)
print(again.summary)

# %% [markdown]
# Where to go on:
#
# - [Diagnose a log of your own](../howto/diagnose.md): files, columns, motor currents, ROS bags.
# - [A real drive](real_drive.py), and [what changed between two logs](what_changed.py).
# - [How it decides](../explanation/gap.md), and [how often it is
#   right](../explanation/gap_benchmark.md).
