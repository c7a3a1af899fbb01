"""A log prepared for comparison: smoothed, differentiated, compared, thinned out.

It is compared with the rigid body. One low-pass H (:mod:`jaxidl.logs.low_pass`) is used throughout.
Positions pass it before they are differentiated, commands and every torque that an effect predicts
pass it afterwards, so both sides of the comparison lose the same frequencies.
"""

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jaxidl.effects import Effect
from jaxidl.logs.encoders import lateness, true_motion, true_positions
from jaxidl.logs.log import Log
from jaxidl.logs.low_pass import (
    bands,
    by_run,
    choose_band,
    derivative,
    encoder_noise,
    half_later,
    low_pass,
    noise_torque,
)
from jaxidl.logs.rests import STILL, classify, withstood
from jaxidl.systems.tables import Tables, tables

ROWS_PER_HERTZ = 3.0  # rows kept per second, over the band
INSTANTS_PER_HERTZ = 8.0  # instants per second at which effects are simulated, at least, over it
# most rows of a long log: more take time, and neighbours are too similar to add much
MOST_ROWS = 8000
# the filter blurs this range around the begin and end of a rest [periods of the band's end]
REST_EDGE = 0.6
REST_SPEED = 0.01  # share of a joint's top speed below which friction is anywhere within its level
TRIM = 0.25  # at both ends of a run, for filters and hidden states to settle [s]
CALM = 0.3  # band of a command that is read less often, over the rate at which it is
TABLE_RATE = 40.0  # rate of the tables other than the torque [Hz]


class Signals(NamedTuple):
    """T instants of J joints at the log's rate, of which N rows are kept."""

    dt: float  # between two instants [s]
    interval: float  # between two samples of the log [s]: instants may be fewer
    band: float  # [Hz]
    slices: tuple[slice, ...]  # the runs
    q: Float[np.ndarray, "T J"]
    qd: Float[np.ndarray, "T J"]
    qdd: Float[np.ndarray, "T J"]
    tau: Float[np.ndarray, "T J"]  # commands as logged
    tables: Tables  # tables of the modelled rigid body, T rows
    sigma: Float[np.ndarray, " J"]  # encoder noise, standard deviation [m or rad]
    # residual due to that noise alone, root mean square [N or Nm]
    noise_floor: Float[np.ndarray, " J"]
    rest_speed: Float[np.ndarray, " J"]  # a joint rests below this speed [m/s or rad/s]
    rows: np.ndarray  # (N,) instants kept
    # command − inverse dynamics in these rows: the residual of the rigid body [N or Nm]
    balance: Float[np.ndarray, "N J"]
    moving: Bool[np.ndarray, "T J"]
    # instants neither moving nor resting are next to a rest, where the filter blurs both
    resting: Bool[np.ndarray, "T J"]
    # for each joint its rests, as :func:`jaxidl.logs.rests.withstood` returns them
    peaks: tuple[Float[np.ndarray, "E 4"], ...]
    pushed: Bool[np.ndarray, "N J"]  # ways in which joints at rest are pushed: true forwards
    body: Any  # the modelled rigid body
    notes: tuple[str, ...] = ()  # parts of the log that were not used, and why
    # instants at the end of each run whose true positions need later readings
    late: int = 0
    # noise (J,) of the logged velocity and acceleration where those are used
    logged_noise: tuple[np.ndarray | None, np.ndarray | None] = (None, None)
    bands: Sequence[float] = ()  # of each joint's torque, within the band [Hz]; empty: the band

    @property
    def every(self) -> int:
        """Return after how many instants the band needs one."""
        return stride_for(self.dt, self.band)

    @property
    def duration(self) -> float:
        """Return the length of all runs [s]."""
        return len(self.q) * self.dt

    def smooth(self, x: np.ndarray) -> np.ndarray:
        """Return H applied to each run of ``x`` (T, ...)."""
        return by_run(x, self.slices, lambda part: low_pass(part, self.band, self.dt))

    def command(self, x: np.ndarray) -> np.ndarray:
        """Return H applied to delivered torques (T, ...).

        A command is held, so that it acts half an interval later on average.
        """
        return self.smooth(by_run(x, self.slices, half_later))

    def differentiate(self, x: np.ndarray) -> np.ndarray:
        """Return the first derivative by time of each run of ``x`` (T, ...)."""
        return by_run(x, self.slices, lambda part: derivative(part, self.dt))

    def read_again(self) -> "Signals":
        """Return the signals with noise as it is in them once more; it is always the same draw.

        Only ``q``, ``qd`` and ``qdd`` change.
        """
        draw = np.random.default_rng(0)
        white = lambda sigma: self.smooth(sigma * draw.standard_normal(self.q.shape))
        q = white(self.sigma)
        of_qd, of_qdd = self.logged_noise
        qd = self.differentiate(q) if of_qd is None else white(of_qd)
        qdd = self.differentiate(qd) if of_qdd is None else white(of_qdd)
        return self._replace(q=self.q + q, qd=self.qd + qd, qdd=self.qdd + qdd)

    def thinned(self) -> "Signals":
        """Return the signals at no more instants than the band needs, T of them again.

        The kept rows are among these. A command is held for longer, and on average it is the same.
        """
        every = self.every
        if every == 1:
            return self
        each = [np.arange(s.start, s.stop, every) for s in self.slices]
        edges, at = np.cumsum([0, *map(len, each)]).tolist(), np.concatenate(each)
        quiet = by_run(
            self.tau, self.slices, lambda x: low_pass(x, CALM / every / self.dt, self.dt)
        )
        # the middle of a longer interval is later, by half a sample more if they are even in number
        middle = quiet if every % 2 else by_run(quiet, self.slices, half_later)
        last = np.repeat([s.stop - 1 for s in self.slices], [len(x) for x in each])
        quieter = lambda noise: None if noise is None else noise / np.sqrt(every)
        place = lambda instants: np.searchsorted(at, instants)
        return self._replace(
            dt=every * self.dt,
            slices=tuple(slice(a, b) for a, b in pairwise(edges)),
            q=self.q[at],
            qd=self.qd[at],
            qdd=self.qdd[at],
            tau=middle[np.minimum(at + every // 2, last)],
            tables=Tables(*(x[at] for x in self.tables)),
            sigma=self.sigma / np.sqrt(every),
            rows=place(self.rows),
            moving=self.moving[at],
            resting=self.resting[at],
            peaks=tuple(np.column_stack([place(p[:, 0]), p[:, 1:]]) for p in self.peaks),
            late=-(-self.late // every),
            logged_noise=tuple(map(quieter, self.logged_noise)),
        )

    def behind(self, effects: Sequence[Effect]) -> "Signals":
        """Return the signals with the true motion behind the encoder readings.

        ``effects`` act on the encoders. This motion is what a rollout starts from and is compared
        with. Only ``q``, ``qd``, ``qdd`` and ``late`` change; what was computed along the measured
        motion stays unchanged.
        """
        q, qd, qdd = true_motion(effects, self.q, self.qd, self.qdd, self.slices, self.dt)
        return self._replace(
            q=q, qd=qd, qdd=qdd, late=self.late + lateness(effects, self.q, self.dt)
        )


def prepare(log: Log, body: Any, effects: tuple[Effect, ...] = ()) -> Signals:
    """Return the signals of a log with its modelled rigid body.

    Args:
        log: the measured log.
        body: the modelled rigid body.
        effects: the model's own effects, of which those on the encoders are undone; they must also
            be given to :func:`jaxidl.gap.evidence.rows.rows_of`.
    """
    dt, slices = log.dt, tuple(log.segments())
    sigma = encoder_noise(log.q, slices)
    inertia = typical_inertia(true_positions(effects, log.q, slices, dt), body)
    reach = np.sqrt(inertia**2 @ sigma**2)  # encoder noise times inertia, per joint
    band = choose_band(reach, log.q, log.tau, slices, dt)
    q = by_run(log.q, slices, lambda part: low_pass(part, band, dt))
    smooth = lambda x: by_run(x, slices, lambda part: low_pass(part, band, dt))
    slope = lambda x: by_run(x, slices, lambda part: derivative(part, dt))
    speed, push = (None if x is None else smooth(x) for x in (log.qd, log.qdd))
    qd, late_speed = _in_step(slope(q), speed, slope, dt, "velocity")
    qdd, late_push = _in_step(slope(qd), push, slope, dt, "acceleration")
    heard = (
        None if log.qd is None or qd is not speed else encoder_noise(log.qd, slices),
        None if log.qdd is None or qdd is not push else encoder_noise(log.qdd, slices),
    )
    q, qd, qdd = true_motion(effects, q, qd, qdd, slices, dt)
    stride = max(1, int(1.0 / dt / max(TABLE_RATE, 2.0 * band)))
    table = tables(body, q, qd, qdd, stride)
    speed_noise = np.maximum(sigma, STILL) * np.sqrt(2.0 * dt * (2.0 * np.pi) ** 2 * band**3 / 3.0)
    rest_speed = np.maximum(4.0 * speed_noise, REST_SPEED * np.quantile(np.abs(qd), 0.99, axis=0))
    moving, resting, rests = classify(qd, rest_speed, max(2, round(REST_EDGE / band / dt)))
    every = stride_for(dt, band)  # rows are among the instants that :meth:`Signals.thinned` keeps
    step = max(1, int(1.0 / dt / (ROWS_PER_HERTZ * band)), math.ceil(log.samples / MOST_ROWS))
    step, edge = every * math.ceil(step / every), round(TRIM / dt)
    rows = []
    for s in slices:
        skipped = min(edge, (s.stop - s.start) // 5)
        rows.append(np.arange(s.start + skipped // every * every, s.stop - skipped, step))
    floor = noise_torque(reach, band, dt)
    rests[[s.stop - 1 for s in slices]] = False  # a rest does not continue in the next run
    heard_torque = encoder_noise(log.tau, slices)
    # a joint at rest has no acceleration; filtered, it would have that of the next motion
    own = np.diagonal(table.inertia, axis1=1, axis2=2) * qdd
    peaks = tuple(
        withstood(
            rests[:, j],
            resting[:, j],
            (log.tau - table.torque + own)[:, j],
            log.q[:, j],
            np.sign(qd[:, j]) * (np.abs(qd[:, j]) >= rest_speed[j]),
            5.0 * sigma[j],
            edge,
            heard_torque[j],
        )
        for j in range(log.joints)
    )
    for j, each in enumerate(peaks if every > 1 else ()):
        begin = np.array([s.start for s in slices])
        run = begin[np.searchsorted(begin, each[:, 0], side="right") - 1]
        each[:, 0] -= (each[:, 0] - run) % every
        resting[each[:, 0].astype(int), j] = True
        moving[each[:, 0].astype(int), j] = False
    kept = np.unique(np.concatenate([*rows, *(p[:, 0].astype(int) for p in peaks)]))
    none = np.zeros((len(kept), log.joints))
    found = Signals(
        dt,
        dt,
        band,
        slices,
        q,
        qd,
        qdd,
        log.tau,
        table,
        sigma,
        floor,
        rest_speed,
        kept,
        none,
        moving,
        resting,
        peaks,
        none > 0.0,
        body,
    )
    balance = found.command(found.tau)[kept] - table.torque[kept]
    pushed = balance > 0.0
    for j, each in enumerate(peaks):
        pushed[np.searchsorted(kept, each[:, 0]), j] = each[:, 2] > 0.0
    return found._replace(
        balance=balance,
        pushed=pushed,
        late=lateness(effects, q, dt),
        notes=(*late_speed, *late_push),
        logged_noise=heard,
        bands=bands(log.q, log.tau, slices, dt, band).tolist(),
    )


def _in_step(
    derived: np.ndarray,
    logged: np.ndarray | None,
    slope: Callable[[np.ndarray], np.ndarray],
    dt: float,
    what: str,
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return the logged derivative (T, J) where it is in step with the positions, and a note.

    Elsewhere return the ``derived`` one; the note says so. Robots filter the velocity that they
    report. If it is late by more than half a sample, that would be taken for friction and inertia.
    """
    if logged is None:
        return derived, ()
    change, off = slope(derived), logged - derived
    late = -np.sum(off * change, 0) / np.maximum(np.sum(change**2, 0), 1e-300)  # (J,) [s]
    worst = float(late[np.argmax(np.abs(late))])
    if abs(worst) <= 0.5 * dt:
        return logged, ()
    way = "late" if worst > 0.0 else "early"
    return derived, (
        (
            f"the logged {what} is up to {abs(worst) * 1e3:.3g} ms {way} against the position:"
            " derived from positions instead"
        ),
    )


def stride_for(dt: float, band: float) -> int:
    """Return after how many samples, ``dt`` [s] apart, a ``band`` [Hz] needs one."""
    return max(1, int(1.0 / dt / (INSTANTS_PER_HERTZ * band)))


def typical_inertia(q: np.ndarray, body: Any) -> np.ndarray:
    """Return the root mean square inertia matrix (J, J) over the positions (T, J) of a log."""
    few = q[np.linspace(0, len(q) - 1, 50).astype(int)]
    return np.sqrt(np.mean(tables(body, few, 0.0 * few, 0.0 * few).inertia ** 2, axis=0))
