# %% [markdown]
# # A real drive, from log to model
#
# EMPS is a public benchmark: an electro-mechanical positioning system, one axis moved by a ball
# screw, measured at 1 kHz for 25 s (A. Janot, M. Gautier and M. Brunot, *Data Set and Reference
# Models of EMPS*, 2019). The model is a mass of 95.1 kg, which is the published one, and nothing
# else. What is missing?
#
# The record is not part of this package, since it has no data licence of its own. The benchmark's
# authors provide it (on [nonlinearbenchmark.org](https://www.nonlinearbenchmark.org)). Write it as
# CSV with the columns `time` [s], `q0` [m] and `tau0` [N], the drive's command times 35.15065 N/V,
# and set `JAXIDL_EMPS` to the file. Without the record this page shows an earlier result.

# %%
import os
from pathlib import Path

from IPython.display import Image

from jaxidl import gap, report

LOG = Path(os.environ.get("JAXIDL_EMPS", "../../../shared/data/emps/emps.csv"))
print("measured here and now" if LOG.is_file() else "no record here: what came out earlier")

# %% [markdown]
# ## The model
#
# The model is a slider with one mass, as MJCF. A URDF would do as well.

# %%
MODEL = """<mujoco model="emps">
  <worldbody>
    <body name="carriage">
      <joint name="slide" type="slide" axis="1 0 0"/>
      <inertial pos="0 0 0" mass="95.1089" diaginertia="1 1 1"/>
    </body>
  </worldbody>
</mujoco>
"""

# %% [markdown]
# ## The diagnosis
#
# The last 30 % of the record take no part in fitting and searching. The errors are computed there.

# %%
shown = Path("real_drive")
if LOG.is_file():
    shown = Path("out/real_drive")
    shown.mkdir(parents=True, exist_ok=True)
    (shown / "slider.xml").write_text(MODEL)
    found = gap.diagnose(LOG, shown / "slider.xml")
    (shown / "table.txt").write_text(report.table(found) + "\n")
    report.save(found, shown / "report")
print((shown / "table.txt").read_text())

# %% [markdown]
# The published identification of this drive has viscous friction of 203.5 Ns/m, dry friction of
# 20.4 N and a constant offset of -3.2 N, with a force error of about 4 %. Here the difference
# between the two directions comes out as viscous friction that is larger in one direction. This
# explains the part kept aside better than an offset does. Effects with less than 80 % are
# suspected, not named.
#
# ## Where model and log disagree
#
# The force that the model lacks, before and after, over velocity, position and acceleration:

# %%
Image(shown / "report" / "figures" / "where.png")

# %% [markdown]
# On the part of the record that was kept aside, before and after:

# %%
Image(shown / "report" / "figures" / "gap.png")

# %% [markdown]
# ## The corrected model
#
# Effects for which MuJoCo has an attribute are in the MJCF; the rest is in `effects.json` beside
# it. `gap.read_model` and `--model DIR/model.xml` read both.

# %%
print((shown / "report" / "model.xml").read_text())

# %%
for effect in gap.read_model(shown / "report" / "model.xml").plant.effects:
    said = effect.to_dict()
    print(said["effect"], {key: p["value"] for key, p in said["parameters"].items()})

# %% [markdown]
# Where to go on: [use the result on a robot](../howto/use_the_result.md), [the same log given to
# other programs](../explanation/real_machines.md).
