"""Rows of a log that fits share: which are fitted, in which blocks, and what the model as it is believed makes of them."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jaxidl.effects import Effect
from jaxidl.gap.signals import Signals
from jaxidl.gap.terms import contribution

BLOCKS = 48
FURTHER = 1.2  # times the rest's highest torque, speed or acceleration: such an end of a log is not kept aside
STRETCH = 1.5  # see ``kept_rows`` [s]
LEAST_FLOOR = 0.003  # of the command's spread: no simulation is believed to be better


class Data(NamedTuple):
    """Rows that fits share: N of them on J joints, those of training in blocks."""

    base: Float[np.ndarray, "N J"]  # the balance of the model as it is believed
    slide: Float[np.ndarray, "N J"]  # its own dry friction of moving joints
    grip: Float[np.ndarray, "N J"]  # ... and of resting ones
    tau: Float[np.ndarray, "T K"]  # the command after its own actuators
    moving: Bool[np.ndarray, "N J"]
    resting: Bool[np.ndarray, "N J"]
    block: np.ndarray  # (N,) block number; −1 for rows kept aside
    peaks: tuple[np.ndarray, ...]  # (E, 2) of each joint: row and torque at which each rest of the training rows ended
    floor: Float[np.ndarray, " J"]  # of the noise
    command: Float[np.ndarray, " J"]  # spread of the commanded torque
    signals: Signals


def data_of(signals: Signals, effects: Sequence[Effect] = (), held_out: float = 0.3, found: Sequence[Effect] = ()) -> Data:
    """Rows of a log and what the model, a rigid body with effects, makes of them.

    Args:
        signals: the log, prepared for the model.
        effects: the model's own, those for which the signals were prepared: of them the encoders' are undone there.
        held_out: share of the rows that is kept aside.
        found: further effects, of the whole mechanism, of which nothing is undone yet.
    """
    rows, tau = signals.rows, signals.tau
    base, slide = signals.balance, np.zeros((len(rows), signals.q.shape[1]))
    grip = np.zeros_like(slide)
    for number, effect in enumerate((*effects, *found)):
        _, value, _, tau = contribution(effect, None, (), signals, tau, undone=number < len(effects))
        base, slide, grip = base + value.net, slide + value.slide, grip + value.grip
    train = kept_rows(signals, held_out)
    block = np.full(len(rows), -1)
    block[train] = np.arange(train.sum()) * BLOCKS // max(train.sum(), 1)
    spread = np.std(signals.tau[rows], axis=0)
    return Data(
        base,
        slide,
        grip,
        tau,
        signals.moving[rows],
        signals.resting[rows],
        block,
        tuple(_in_training(peaks, rows, block >= 0) for peaks in signals.peaks),
        np.maximum(signals.noise_floor, LEAST_FLOOR * spread),
        spread,
        signals,
    )


def kept_rows(signals: Signals, held_out: float) -> np.ndarray:
    """Which of the kept rows (N,) are fitted: all but the last share ``held_out``, or all but the last share of every stretch.

    What happens at the end of a log only, saturation in fast motion for one, could neither be found if that end were kept aside
    nor be shown if it were not. So where the end holds faster or harder motion than the rest, stretches of ``STRETCH`` seconds
    each give their own last part.
    """
    n = len(signals.rows)
    last = np.arange(n) >= round(n * (1.0 - held_out))
    if not last.any():
        return ~last
    sizes = [np.abs(x[signals.rows]) for x in (signals.tau, signals.qd, signals.qdd)]
    reach = lambda part: np.stack([np.quantile(x[part], 0.995, axis=0) for x in sizes])  # noqa: E731
    if np.all(reach(last) <= FURTHER * reach(~last)):
        return ~last
    duration = n * np.median(np.diff(signals.rows)) * signals.dt
    stretches = max(2, round(duration / STRETCH))
    return (np.arange(n) * stretches / n) % 1.0 < 1.0 - held_out


def instants_of(signals: Signals, rows: np.ndarray) -> Bool[np.ndarray, " T"]:
    """Which instants (T,) of the log lie among certain of the kept rows (N,)."""
    return np.interp(np.arange(len(signals.q)), signals.rows, rows) > 0.5


def _in_training(peaks: np.ndarray, rows: np.ndarray, training: np.ndarray) -> np.ndarray:
    """Instants as numbers of the kept rows next to them; those of the training part."""
    place = np.clip(np.searchsorted(rows, peaks[:, 0]), 0, len(rows) - 1)
    return np.column_stack([place, peaks[:, 1]])[training[place.astype(int)]]


def used(data: Data) -> np.ndarray:
    """Rows (N, J) that count: not those where a rest begins or ends."""
    return data.moving | data.resting


def only(data: Data, joints: tuple[int, ...]) -> Data:
    """The rows of some joints."""
    pick = list(joints)
    return data._replace(
        base=data.base[:, pick],
        slide=data.slide[:, pick],
        grip=data.grip[:, pick],
        peaks=tuple(data.peaks[j] for j in pick),
        moving=data.moving[:, pick],
        resting=data.resting[:, pick],
        floor=data.floor[pick],
        command=data.command[pick],
    )
