"""The rows of a log that fits share.

They hold the model's residual, and say which rows are fitted, in which blocks.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jaxidl.effects import Effect
from jaxidl.gap.evidence.additions import additions
from jaxidl.gap.evidence.behind import NOTHING, Behind
from jaxidl.gap.evidence.drift import slower, weighted, weights_of
from jaxidl.gap.evidence.friction import before_gears
from jaxidl.gap.evidence.samples import returns
from jaxidl.logs.low_pass import at_instants, band_limited
from jaxidl.logs.signals import Signals
from jaxidl.systems.free import inner

# training blocks; samples of real machines are correlated, blocks hardly are
BLOCKS = 16
ASIDE = 6  # blocks of the held-out rows
# an end of a log with this many times the rest's range, peak torque, speed or acceleration is not
# held out
FURTHER = 1.25
STRETCH = 1.5  # see ``kept_rows`` [s]
# errors below this multiple of the noise are equal: a changed inertia changes the noise
NOISE_MARGIN = 1.2
LEAST_FLOOR = 0.003  # share of the command's spread: no simulation is assumed to be better
AGREES = 3.0  # rests that agree differ by at most this many times the error of motion


class Rows(NamedTuple):
    """N rows of J joints; a rest is its last instant, with the torque that broke it away."""

    gap: Float[np.ndarray, "N J"]  # command minus the predicted one [N or Nm]
    command: Float[np.ndarray, "N J"]  # filtered [N or Nm]
    used: Bool[np.ndarray, "N J"]
    block: np.ndarray  # (N,) number of the block; held-out blocks count down from -1
    floor: Float[np.ndarray, " J"]  # noise floor [N or Nm]
    spread: Float[np.ndarray, " J"]  # spread of the command [N or Nm]
    tau: Float[np.ndarray, "T J"]  # the command after the model's own actuators [N or Nm]
    friction: Float[np.ndarray, "N J"]  # torque that the model's own friction needs [N or Nm]
    unloaded: Float[np.ndarray, "T J"]  # torque that passes no gear [N or Nm]
    signals: Signals
    effects: tuple[Effect, ...] = ()  # the model's own
    # (J,) by how much later torques are assumed to be logged [s]
    shift: float | np.ndarray = 0.0
    # after how many instants, pauses aside, the motion is there again
    returns: tuple[int, ...] = ()
    # (J, K) weights of slow components of each joint's torque: see :mod:`jaxidl.gap.evidence.drift`
    slow: np.ndarray | None = None
    behind: Behind = NOTHING  # links and friction of the model and of what was found
    # (N,) moments that are left out: see :mod:`jaxidl.gap.evidence.moments`
    strange: np.ndarray = np.zeros(0, bool)

    def without(self, strange: np.ndarray) -> "Rows":
        """Return the rows with ``strange`` ones (N,) left out."""
        return self._replace(used=self.used & ~strange[:, None], strange=strange)

    def added(self, effects: Sequence[Effect], predicted: np.ndarray) -> Float[np.ndarray, "G N J"]:
        """Return what effects of one structure add to a ``predicted`` command (T, J) [N or Nm]."""
        added, _ = additions(
            effects,
            self.signals,
            self.tau,
            predicted,
            unloaded=self.unloaded,
            behind=self.behind,
        )
        return added

    def shifted(self, shift: float | np.ndarray) -> "Rows":
        """Return the rows as if torques had been logged ``shift`` (J,) [s] later."""
        s = self.signals
        t, each = np.arange(len(s.q)) * s.dt, np.broadcast_to(shift, s.q.shape[1:])

        def moved(x: np.ndarray) -> np.ndarray:
            out = np.empty_like(x)
            for r in s.slices:
                for j, late in enumerate(each):
                    out[r, j] = at_instants(x[r, j], t[r], t[r] - late)
            return out

        tau = moved(self.tau)
        command = s.command(tau)[s.rows]
        return self._replace(
            gap=self.gap + command - self.command,
            command=command,
            tau=tau,
            signals=s._replace(tau=moved(s.tau)),
            shift=self.shift + each,
        )

    def evened(self, left: np.ndarray) -> "Rows":
        """Return the rows with training blocks of similar time and residual energy.

        The energy is that of ``left`` (N, J). What happens in one moment of a log, such as a limit
        that is reached once, is then in several blocks and can be predicted.
        """
        square = left**2 * self.used * self.training[:, None]
        share = square / np.maximum(square.sum(0), 1e-300)
        density = 1.0 / self.training.sum() + share.max(1) / max(share.max(1).sum(), 1e-300)
        at = np.cumsum(np.where(self.training, density, 0.0))
        first = at[self.training][0]
        number = np.minimum(BLOCKS * (at - first) / (at[-1] - first), BLOCKS - 1).astype(int)
        return self._replace(block=np.where(self.training, number, self.block))

    def drifting(self, left: np.ndarray) -> "Rows":
        """Return the rows in which drift, as in a residual ``left`` (N, J), counts little."""
        use = self.used & self.training[:, None]
        each = [weights_of(left[on, j], self.step * on.sum()) for j, on in enumerate(use.T)]
        return self._replace(slow=np.stack(each))

    def sure(self) -> "Rows":
        """Return the rows without rests after which the joint went the other way."""
        used = self.used.copy()
        for j, peaks in enumerate(self.signals.peaks):
            used[np.searchsorted(self.signals.rows, peaks[peaks[:, 3] > 0.0, 0]), j] = False
        return self._replace(used=used)

    def agreeing(self, left: np.ndarray, friction: np.ndarray) -> "Rows":
        """Return the rows without rests that nothing agrees with.

        When a joint broke away is not always seen, and which torque it withstood depends on the
        model's weight: one such torque among thousands of rows would decide what is named. So a
        rest counts only if sliding or another rest of the joint shows as much friction, by the
        residual ``left`` (N, J) of all common effects, fitted to the others, and their ``friction``
        (N, J). No witness is one after which the joint went the other way, or whose friction would
        push: there the joint did not break away.
        """
        s, used = self.signals, self.used.copy()
        rest = used & ~s.moving[s.rows]
        usual = AGREES * rms(left, used & ~rest)
        for j, peaks in enumerate(s.peaks):
            if len(peaks) and usual[j] > 0.0:
                at = np.searchsorted(s.rows, peaks[:, 0])
                more = left[at, j] * peaks[:, 2]  # friction than in sliding
                pushes = more + friction[at, j] * peaks[:, 2] < 0.0
                apart = np.abs(more[:, None] - more)
                apart[:, (peaks[:, 3] > 0.0) | pushes | ~used[at, j]] = np.inf
                apart[np.diag_indices(len(at))] = np.abs(more)  # from sliding
                used[at, j] &= apart.min(1) < usual[j]
        return self._replace(used=used)

    def steady(self, x: np.ndarray, joint: int) -> np.ndarray:
        """Return torques (..., N) of a joint in its own band, with less weight on slow components.

        Those of held-out rows, which are a shorter time, are fewer.
        """
        if self.slow is None:
            return x
        out, use = self.heard(np.array(x, float), joint), self.used[:, joint]
        here, there = use & self.training, use & ~self.training
        out[..., here] = weighted(out[..., here], self.slow[joint])
        shorter = there.sum() / max(here.sum(), 1)
        out[..., there] = weighted(out[..., there], slower(self.slow[joint], shorter))
        return out

    def heard(self, x: np.ndarray, joint: int) -> np.ndarray:
        """Return torques (..., N) of a joint in the band in which its command stands out of noise.

        Those that broke a rest are not filtered.
        """
        s = self.signals
        if not s.bands or s.bands[joint] >= s.band:
            return x
        moving = self.used[:, joint] & s.moving[s.rows, joint]
        for part in (moving & self.training, moving & ~self.training):
            if part.any():
                x[..., part] = band_limited(x[..., part], 1.0 / self.step, s.bands[joint])
        return x

    def whole(self) -> "Rows":
        """Return the rows with none held out."""
        return self._replace(block=np.where(self.training, self.block, BLOCKS - 1 - self.block))

    def when(self, rows: Sequence[int]) -> tuple[float, str]:
        """Return the time since the run of some rows began [s], and words for that run."""
        s = self.signals
        at = s.rows[list(rows)]
        run = next(n for n, part in enumerate(s.slices) if at[0] < part.stop)
        where = f" of run {run + 1}" if len(s.slices) > 1 else ""
        return float(at.mean() - s.slices[run].start) * s.dt, where

    @property
    def step(self) -> float:
        """Return the time between two rows [s]."""
        return float(np.median(np.diff(self.signals.rows))) * self.signals.dt

    @property
    def training(self) -> np.ndarray:
        """Return which rows (N,) are fitted."""
        return self.block >= 0


def rows_of(signals: Signals, effects: Sequence[Effect] = (), held_out: float = 0.3) -> Rows:
    """Return the rows of a log with the model's residual there.

    Args:
        signals: the log, prepared for the model: what its effects do to the encoders is undone
            there.
        effects: the model's own effects, in addition to its rigid body.
        held_out: share of the rows that is held out.
    """
    rows, tau, gap = signals.rows, signals.tau, signals.balance.copy()
    used = signals.moving[rows].copy()
    for j, peaks in enumerate(signals.peaks):
        at = np.searchsorted(rows, peaks[:, 0])
        gap[at, j], used[at, j] = peaks[:, 1], True
    friction, unloaded = np.zeros_like(gap), before_gears(effects, signals, tau)
    for effect in effects:
        added, tau = additions([effect], signals, tau, tau, undone=True, unloaded=unloaded)
        gap = gap - added[0]
        friction += added[0] if inner(effect).friction else 0.0
    command = signals.command(tau)[rows]
    train = kept_rows(signals, held_out)
    block = np.zeros(len(rows), int)
    block[train] = np.arange(train.sum()) * BLOCKS // max(train.sum(), 1)
    block[~train] = -1 - np.arange((~train).sum()) * ASIDE // max((~train).sum(), 1)
    spread = np.std(signals.tau[rows], axis=0)
    return Rows(
        gap,
        command,
        used,
        block,
        np.maximum(NOISE_MARGIN * signals.noise_floor, LEAST_FLOOR * spread),
        spread,
        tau,
        friction,
        unloaded,
        signals,
        tuple(effects),
        returns=returns(signals),
        behind=Behind(effects, signals.body),
        strange=np.zeros(len(rows), bool),
    )


def kept_rows(signals: Signals, held_out: float) -> np.ndarray:
    """Return which of the kept rows (N,) are fitted.

    They are all but the last share ``held_out`` of every run. Something that happens only at the
    end of a log, such as saturation in fast motion, could neither be found if that end were held
    out nor be verified if it were not. So where the ends contain wider, faster or harder motion
    than the rest, stretches of ``STRETCH`` seconds each have their own last part held out.
    """
    rows = signals.rows
    counts = [int(np.sum((rows >= r.start) & (rows < r.stop))) for r in signals.slices]
    place = np.concatenate([np.linspace(0.0, 1.0, count, endpoint=False) for count in counts])
    last = place >= 1.0 - held_out
    if not last.any():
        return ~last
    command = signals.balance + signals.tables.torque[rows]
    middle = np.mean(np.quantile(signals.q[rows[~last]], (0.005, 0.995), axis=0), axis=0)
    motion = (signals.q - middle, signals.qd, signals.qdd)
    sizes = [np.abs(command), *(np.abs(x[rows]) for x in motion)]
    reach = lambda part: np.stack([np.quantile(x[part], 0.995, axis=0) for x in sizes])
    if np.all(reach(last) <= FURTHER * reach(~last)):
        return ~last
    duration = len(rows) * np.median(np.diff(rows)) * signals.dt
    stretches = max(2, round(duration / STRETCH))
    return (np.arange(len(rows)) * stretches / len(rows)) % 1.0 < 1.0 - held_out


def instants_of(signals: Signals, rows: np.ndarray) -> Bool[np.ndarray, " T"]:
    """Return which instants (T,) of the log lie among some of the kept rows (N,)."""
    return np.interp(np.arange(len(signals.q)), signals.rows, rows) > 0.5


def rms(x: np.ndarray, use: np.ndarray) -> np.ndarray:
    """Return the root mean square (J,) of ``x`` (N, J) where ``use`` (N, J) is true."""
    return np.sqrt(np.sum(x**2 * use, 0) / np.maximum(use.sum(0), 1))
