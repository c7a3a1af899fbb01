"""What a user should know about a log beside its diagnosis."""

import numpy as np

from jaxidl.gap.evidence.recurrence import without_pauses
from jaxidl.gap.evidence.rows import Rows, rms
from jaxidl.systems.flange import ends, named_flange
from jaxidl.systems.mjcf import Model
from jaxidl.systems.mujoco_body import MujocoBody

# times the command: no model whose log is in the right units is wrong by so much
ABSURD = 10.0
BRIEF = 10.0  # [s]


def notes_of(rows: Rows, known: Model) -> list[str]:
    """Return sentences about what the log or the model seems to lack."""
    notes = []
    if np.count_nonzero(np.diff(~rows.training)) > 2 * len(rows.signals.slices) - 1:
        notes.append(
            "several parts of the log are held out: its end contains motion that the rest does not"
        )
    still = [known.names[j] for j in range(len(known.names)) if not rows.used[:, j].any()]
    if still:
        notes.append(f"{', '.join(still)} hardly moved: no friction can be found there")
    passive = [known.names[j] for j in range(len(known.names)) if rows.spread[j] == 0.0]
    if passive:
        notes.append(f"{', '.join(passive)}: no torque was commanded there")
    error, spread = rms(rows.gap, rows.used), np.where(rows.spread > 0.0, rows.spread, np.inf)
    absurd = [known.names[j] for j in np.flatnonzero(error > ABSURD * spread)]
    if absurd:
        notes.append(
            f"{', '.join(absurd)}: the model's torque error is more than {ABSURD:g} times the"
            " spread of the command; check the units of positions and torques, and the model's"
            " masses"
        )
    body = known.plant.body
    if isinstance(body, MujocoBody) and ends(body.source) > 1 and named_flange(body.source) is None:
        notes.append(
            f"the robot has several ends: a load is looked for on {body.carrier}; to look"
            " elsewhere, add --flange BODY"
        )
    duration = rows.signals.duration
    if duration < BRIEF:
        notes.append(
            f"the log has only {duration:.3g} s: values and confidences need {BRIEF:g} s or more of"
            " varied motion"
        )
    if rows.returns:
        cycle, whole = rows.returns[0], without_pauses(rows.signals)[-1] + 1
        notes.append(
            f"a motion of {cycle * rows.signals.dt:.3g} s, without its pauses, is there"
            f" {round(whole / cycle)} times: that averages noise, but tells no more about what is"
            " missing; record other postures and speeds"
        )
    work = rows.command * rows.signals.qd[rows.signals.rows] * rows.used
    if work.sum() < -0.3 * np.abs(work).sum():
        notes.append("in total the torques brake the motion: check their sign")
    return notes
