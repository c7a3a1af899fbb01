"""What a user should know about a log beside its diagnosis: notes, each one sentence.

* What the log or the model seems to lack (:func:`notes_of`).
* Whether what remains drifts, or swings at one frequency of its own (:func:`swings`): then it has a
  cause in time, not in the state.
* Whether the log's parts differ (:func:`differing`): a load was picked up half-way, or somebody
  guided the robot. What was found is fitted anew to the part before an instant and to that after it
  (Chow 1960). The parts differ if that leaves less than half of some joint's mean square error, and
  if it makes the log more likely than the additional parameters explain.
"""

from collections.abc import Sequence

import numpy as np
from scipy.fft import dct

from jaxidl.gap.choice.find import Found
from jaxidl.gap.evidence.drift import slowest
from jaxidl.gap.evidence.items import PARAMETER
from jaxidl.gap.evidence.rows import Rows, rms
from jaxidl.gap.evidence.samples import without_pauses
from jaxidl.gap.fit.score import RIDGE
from jaxidl.gap.result.diagnosis import MUCH
from jaxidl.systems.flange import ends, named_flange
from jaxidl.systems.mjcf import Model
from jaxidl.systems.mujoco_body import MujocoBody

# times the command: no model whose log is in the right units is wrong by so much
ABSURD = 10.0
BRIEF = 10.0  # [s]
MOST = 0.5  # share of the residual's energy that makes a swing or a drift worth mentioning
FINER = 16  # frequencies per one over the log's duration
SHORTEST = 3  # blocks of either part
LESS = 0.5  # of the mean square error
CLEAR = 20.0  # log likelihood


def notes_of(rows: Rows, known: Model) -> list[str]:
    """Return sentences about what the log or the model seems to lack."""
    notes, names, body = list[str](), np.array(known.names), known.plant.body
    which = lambda joints: ", ".join(names[joints])
    if np.count_nonzero(np.diff(~rows.training)) > 2 * len(rows.signals.slices) - 1:
        notes.append(
            "several parts of the log are held out: its end contains motion that the rest does not"
        )
    if still := which(~rows.used.any(0)):
        notes.append(f"{still} hardly moved: no friction can be found there")
    if passive := which(rows.spread == 0.0):
        notes.append(f"{passive}: no torque was commanded there")
    spread = np.where(rows.spread > 0.0, rows.spread, np.inf)
    if absurd := which(rms(rows.gap, rows.used) > ABSURD * spread):
        notes.append(
            f"{absurd}: the model's torque error is more than {ABSURD:g} times the"
            " spread of the command; check the units of positions and torques, and the model's"
            " masses"
        )
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


def swings(rows: Rows, left: np.ndarray, names: Sequence[str]) -> list[str]:
    """Return a sentence for each joint whose residual (N, J) [N or Nm] is mostly swing or drift.

    Only what is large counts. A frequency that the motion has, too, is none of its own; a slow
    motion hides drift.
    """
    signals = rows.signals
    at = signals.rows * signals.dt
    even = np.arange(at[0], at[-1], rows.step)
    lines = lambda x: _lines(np.interp(even, at, x))
    frequency = np.fft.rfftfreq(FINER * len(even), even[1] - even[0])
    size, said = rms(left, rows.used), list[str]()
    for j in np.flatnonzero(size > np.maximum(MUCH * rows.spread, 2.0 * rows.floor)).tolist():
        use, position = rows.used[:, j], signals.q[signals.rows, j]
        share = lines(np.where(use, left[:, j], 0.0))
        peak = int(np.argmax(share))
        own = lines(position)[peak] < 0.5 * share[peak]
        if share[peak] > MOST and own and frequency[peak] * even[-1] > 3.0:
            said.append(
                f"{names[j]}: {share[peak]:.0%} of what remains swings at {frequency[peak]:.3g} Hz,"
                " which the motion does not: a vibration or a torque from outside"
            )
        drift, moves = (_drift(x[use], rows.step * use.sum()) for x in (left[:, j], position))
        if drift > MOST and moves < 0.5 * drift and rows.spread[j] > 0.0:
            said.append(
                f"{names[j]}: {drift:.0%} of what remains is slow drift,"
                f" {size[j] / rows.spread[j]:.0%} of the command: let the machine warm up, or check"
                " the zero of its torque sensor"
            )
    return said


def _drift(x: np.ndarray, seconds: float) -> float:
    """Return the share of the energy of ``x`` (N,) about its mean in slow components."""
    x = x - x.mean()
    slow = np.asarray(dct(x, norm="ortho"))[: slowest(seconds) + 1]
    return float(np.sum(slow**2) / max(float(x @ x), 1e-300))


def _lines(x: np.ndarray) -> np.ndarray:
    """Return the share of the energy of ``x`` (N,) that a sine of each frequency explains."""
    x = x - x.mean()
    power = np.abs(np.fft.rfft(x, FINER * len(x))) ** 2
    return 2.0 * power / max(len(x) * float(x @ x), 1e-300)


def differing(found: Found, names: Sequence[str]) -> list[str]:
    """Return a sentence if the parts of a log of joints called ``names`` differ; else nothing.

    Changes since another log are not asked about.
    """
    rows, score, members = found.library.rows, found.score, found.solution.members
    if score.anchor is not None:
        return []
    at, count = score.indices(members), score.count[score.training].sum(0)
    blocks, floor = len(score.weights), np.maximum(score.floor * count, 1e-300)

    def error(part: slice) -> np.ndarray:
        """Return the sum of squares (J,) that the best coefficients leave of some blocks."""
        gram, right, own = score.normal_equations(at, part)
        steady = gram.sum(0) + np.diag(RIDGE * np.diagonal(gram.sum(0)) + 1e-9 + score.prior[at])
        x = np.linalg.solve(steady, right.sum(0)) if len(at) else np.zeros(0)
        return np.maximum(score.errors(own, x, part).sum(0), 0.0)

    whole, splits = error(slice(blocks)), range(SHORTEST, blocks - SHORTEST + 1)
    apart = np.stack([error(slice(k)) + error(slice(k, blocks)) for k in splits])
    gain = 0.5 * np.log(np.maximum(whole, floor) / np.maximum(apart, floor)) @ score.effective
    k = int(np.argmax(gain))
    unit = score.noise / np.sqrt(np.maximum(count, 1.0)) / np.maximum(rows.spread, 1e-300)
    usual, left = np.sqrt(whole) * unit, np.sqrt(apart[k]) * unit
    shows = (apart[k] < LESS * whole) & (usual > MUCH)
    if gain[k] < CLEAR + PARAMETER * len(at) or not shows.any():
        return []
    j = int(np.argmax(np.where(shows, usual - left, -1.0)))
    since, run = rows.when([int(np.argmax(rows.block >= splits[k]))])
    return [
        f"the log differs before and after about {since:.0f} s{run}: fitted to either part alone,"
        f" what was found leaves {left[j]:.0%} of {names[j]}'s torque instead of {usual[j]:.0%}, as"
        " if a load had been picked up, friction had changed or someone had guided the robot;"
        " diagnose the parts one by one, or one with the other as --reference"
    ]
