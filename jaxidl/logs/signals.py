"""A log prepared for comparison: smoothed, differentiated, compared, thinned out.

It is compared with the rigid body. One zero-phase low-pass H (Butterworth, fourth order, forwards
and backwards) is used throughout. Positions pass it before they are differentiated (five-point
stencils), commands and every torque that an effect predicts pass it afterwards, so both sides of
the comparison lose the same frequencies. Its band is where the encoder's noise, twice
differentiated and multiplied by inertia, reaches ``NOISE_SHARE`` of the commanded torque.
"""

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage, signal

from jaxidl.effects import Effect, OnJoint
from jaxidl.logs.log import Log
from jaxidl.systems.tables import Tables, tables

NOISE_SHARE = 0.02  # noise torque over the command's spread at the end of the band
BAND = (4.0, 100.0)  # least and largest band [Hz]
HIGHEST_BAND = 0.2  # largest band over the sampling rate
ROWS_PER_HERTZ = 3.0  # rows kept per second, over the band
# most rows of a long log: more take time, and neighbours are too similar to add much
MOST_ROWS = 8000
# the filter blurs this range around the begin and end of a rest [periods of the band's end]
REST_EDGE = 0.6
REST_SPEED = 0.01  # share of a joint's top speed below which friction is anywhere within its level
TRIM = 0.25  # at both ends of a run, for filters and hidden states to settle [s]
TABLE_RATE = 40.0  # rate of the tables other than the torque [Hz]


class Signals(NamedTuple):
    """T instants of J joints at the log's rate, of which N rows are kept."""

    dt: float
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
    # for each joint: last instant and largest torque withstood of each rest [N or Nm]
    peaks: tuple[Float[np.ndarray, "E 2"], ...]

    body: Any  # the modelled rigid body
    notes: tuple[str, ...] = ()  # parts of the log that were not used, and why
    # instants at the end of each run whose true positions need later readings
    late: int = 0

    def smooth(self, x: np.ndarray) -> np.ndarray:
        """Return H applied to each run of ``x`` (T, ...)."""
        return _by_run(x, self.slices, lambda part: low_pass(part, self.band, self.dt))

    def command(self, x: np.ndarray) -> np.ndarray:
        """Return H applied to delivered torques (T, ...).

        A command is held, so that it acts half an interval later on average.
        """
        return self.smooth(
            _by_run(
                x, self.slices, lambda part: (part + np.concatenate([part[:1], part[:-1]])) / 2.0
            )
        )

    def differentiate(self, x: np.ndarray) -> np.ndarray:
        """Return the first derivative by time of each run of ``x`` (T, ...)."""
        return _by_run(x, self.slices, lambda part: derivative(part, self.dt))

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


def prepare(
    log: Log, body: Any, effects: tuple[Effect, ...] = (), narrower: float = 1.0
) -> Signals:
    """Return the signals of a log with its modelled rigid body.

    Args:
        log: the measured log.
        body: the modelled rigid body.
        effects: the model's own effects, of which those on the encoders are undone; they must also
            be given to :func:`jaxidl.gap.rows.rows_of`.
        narrower: share of the usual band that is kept.
    """
    dt, slices = log.dt, tuple(log.segments())
    sigma = encoder_noise(log.q, slices)
    inertia = typical_inertia(true_positions(effects, log.q, slices, dt), body)
    reach = np.sqrt(inertia**2 @ sigma**2)  # encoder noise times inertia, per joint
    band = narrower * choose_band(reach, log.tau, dt)
    q = _by_run(log.q, slices, lambda part: low_pass(part, band, dt))
    smooth = lambda x: _by_run(x, slices, lambda part: low_pass(part, band, dt))
    slope = lambda x: _by_run(x, slices, lambda part: derivative(part, dt))
    qd, late_speed = _in_step(
        slope(q), None if log.qd is None else smooth(log.qd), slope, dt, "velocity"
    )
    qdd, late_push = _in_step(
        slope(qd), None if log.qdd is None else smooth(log.qdd), slope, dt, "acceleration"
    )
    q, qd, qdd = true_motion(effects, q, qd, qdd, slices, dt)
    stride = max(1, int(1.0 / dt / max(TABLE_RATE, 2.0 * band)))
    table = tables(body, q, qd, qdd, stride)
    speed_noise = sigma * np.sqrt(2.0 * dt * (2.0 * np.pi) ** 2 * band**3 / 3.0)
    rest_speed = np.maximum(4.0 * speed_noise, REST_SPEED * np.quantile(np.abs(qd), 0.99, axis=0))
    moving, resting, rests = classify(qd, rest_speed, max(2, round(REST_EDGE / band / dt)))
    step = max(1, int(1.0 / dt / (ROWS_PER_HERTZ * band)), math.ceil(log.samples / MOST_ROWS))
    edge = round(TRIM / dt)
    rows = [
        np.arange(
            s.start + min(edge, (s.stop - s.start) // 5),
            s.stop - min(edge, (s.stop - s.start) // 5),
            step,
        )
        for s in slices
    ]
    floor = noise_torque(reach, band, dt)
    rests[[s.stop - 1 for s in slices]] = False  # a rest does not continue in the next run
    peaks = tuple(
        withstood(
            rests[:, j],
            resting[:, j],
            log.tau[:, j] - table.torque[:, j],
            log.q[:, j],
            5.0 * sigma[j],
            edge,
        )
        for j in range(log.joints)
    )
    kept = np.unique(np.concatenate([*rows, *(p[:, 0].astype(int) for p in peaks)]))
    none = np.zeros((len(kept), log.joints))
    found = Signals(
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
        body,
    )
    return found._replace(
        balance=found.command(found.tau)[kept] - table.torque[kept],
        late=lateness(effects, q, dt),
        notes=(*late_speed, *late_push),
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


def true_positions(
    effects: Sequence[Effect], q: np.ndarray, slices: tuple[slice, ...], dt: float
) -> np.ndarray:
    """Return the positions (T, J) behind encoder readings ``q`` (T, J).

    What ``effects`` do to the encoders is undone, the last one first.
    """
    for effect in filter(on_encoders, reversed(effects)):
        undone = lambda part, e=effect: np.asarray(e.true_position(jnp.asarray(part), dt))
        q = _by_run(q, slices, undone)
    return q


def true_motion(
    effects: Sequence[Effect],
    q: np.ndarray,
    qd: np.ndarray,
    qdd: np.ndarray,
    slices: tuple[slice, ...],
    dt: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return positions, velocities and accelerations (T, J) behind measured ones.

    See :func:`true_positions`. It is applied after smoothing, as where an effect is fitted: a shift
    in time averages neighbouring samples, and on raw ones that would look like a quieter encoder.
    """
    if not any(map(on_encoders, effects)):
        return q, qd, qdd
    true = true_positions(effects, q, slices, dt)
    slope = lambda x: _by_run(x, slices, lambda part: derivative(part, dt))
    # a logged velocity is corrected, not derived anew: it is as late as the position
    speed = slope(true - q)
    return true, qd + speed, qdd + slope(speed)


def lateness(effects: Sequence[Effect], q: np.ndarray, dt: float) -> int:
    """Return how many instants at the end of a run need later readings for true positions.

    The run is like ``q`` (T, J). They are the instants at the end of half a steady motion that
    change when its other half is read too.
    """
    if not any(map(on_encoders, effects)):
        return 0
    half = len(q) // 2
    steady = np.linspace(0.0, 1.0, len(q))[:, None] + 0.0 * q
    whole, part = (
        true_positions(effects, x, (slice(None),), dt)[:half] for x in (steady, steady[:half])
    )
    told = np.all(np.abs(whole - part) < 1e-3 / len(q), axis=1)
    return half - int(np.argmin(told)) if not told.all() else 0


def on_encoders(effect: Effect) -> bool:
    """Return whether the effect changes the encoders' readings in a way that can be undone."""
    inner = effect.effect if isinstance(effect, OnJoint) else effect
    return type(inner).true_position is not Effect.true_position


@lru_cache(maxsize=16)
def _design(band: float, dt: float) -> Any:
    """Return H's second-order sections."""
    return signal.butter(4, band, fs=1.0 / dt, output="sos")


def low_pass(x: np.ndarray, band: float, dt: float) -> np.ndarray:
    """Return H applied to one run (T, ...)."""
    sections = _design(band, dt)
    return signal.sosfiltfilt(sections, x, axis=0, padlen=min(len(x) - 1, round(1.0 / band / dt)))


def derivative(x: np.ndarray, dt: float) -> np.ndarray:
    """Return the first derivative (T, ...) by a five-point stencil, a shorter one at the ends."""
    out = np.gradient(x, dt, axis=0, edge_order=2)
    out[2:-2] = (8.0 * (x[3:-1] - x[1:-3]) - (x[4:] - x[:-4])) / (12.0 * dt)
    return out


def encoder_noise(q: np.ndarray, slices: tuple[slice, ...]) -> np.ndarray:
    """Return the standard deviation (J,) [m or rad] of white noise on positions.

    It is computed from the content above 0.6 of the Nyquist frequency, where nothing moves.
    """
    sections = signal.butter(6, 0.6, "highpass", output="sos")
    high = np.concatenate([signal.sosfiltfilt(sections, q[s], axis=0)[20:-20] for s in slices])
    return np.sqrt(np.mean(high**2, axis=0) / 0.39)


def noise_torque(reach: np.ndarray, band: float, dt: float) -> np.ndarray:
    """Return the root mean square (J,) torque that encoder noise causes within the band.

    It is white noise differentiated twice.
    """
    return reach * np.sqrt(2.0 * dt * (2.0 * np.pi) ** 4 * band**5 / 5.0)


def choose_band(reach: np.ndarray, tau: np.ndarray, dt: float) -> float:
    """Return the band [Hz], the same for all joints."""
    spread = np.std(tau, axis=0)
    free = (reach > 0.0) & (spread > 0.0)
    widest = min(BAND[1], HIGHEST_BAND / dt)
    if not free.any():
        return widest
    unit = noise_torque(reach[free], 1.0, dt)
    return float(np.clip(np.min((NOISE_SHARE * spread[free] / unit) ** 0.4), BAND[0], widest))


def classify(
    qd: np.ndarray, rest_speed: np.ndarray, half: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return moving and resting instants (T, J), and whole rests with their blurred ends.

    The filter blurs the ends of a rest. A rest shorter than the filter, which reaches ``half``
    instants, is a reversal: neither motion nor rest.
    """
    slow = np.abs(qd) < rest_speed
    long = np.asarray(ndimage.binary_opening(slow, np.ones((3 * half + 1, 1))))
    resting = ndimage.binary_erosion(long, np.ones((2 * half + 1, 1)), border_value=1)
    moving = ~slow & ~np.asarray(ndimage.binary_dilation(long, np.ones((2 * half + 1, 1))), bool)
    return moving, resting, long


def withstood(
    rests: np.ndarray,
    resting: np.ndarray,
    torque: np.ndarray,
    q: np.ndarray,
    seen: float,
    edge: int,
) -> np.ndarray:
    """Return the last instant of each rest that ends within the log, and its largest torque.

    The instant is a ``resting`` one, the ``torque`` (T,) unfiltered; the result is (E, 2). A rest
    ends when its torque exceeds what holds it. Filtered, the peak would be cut off; and until the
    position ``q`` (T,) is seen to move, by more than ``seen`` [m or rad], the torque rises further.
    Pushed by a rising torque, a joint moves with the cube of time and needs half as long again for
    27/8 of the way, so that it broke away twice as long before it was seen as it takes from there.
    """
    labelled: Any = ndimage.label(rests)
    found = []
    for part in ndimage.find_objects(labelled[0]):
        still = part[0].start + np.flatnonzero(resting[part])
        if part[0].start > edge and part[0].stop < len(rests) - edge and len(still):
            away = np.abs(q[still[-1] :] - np.median(q[still[-50:]]))
            last = part[0].stop - still[-1]
            far = next(iter(np.flatnonzero(away > 27.0 / 8.0 * seen)), last)
            near = np.count_nonzero(away[:far] <= seen)  # noise crosses it before and after
            end = still[-1] + np.clip(3 * near - 2 * far, 1, last)
            found.append((still[-1], np.abs(torque[still[0] : end]).max()))
    return np.array(found, float).reshape(-1, 2)


def typical_inertia(q: np.ndarray, body: Any) -> np.ndarray:
    """Return the root mean square inertia matrix (J, J) over the positions (T, J) of a log."""
    few = q[np.linspace(0, len(q) - 1, 50).astype(int)]
    return np.sqrt(np.mean(tables(body, few, 0.0 * few, 0.0 * few).inertia ** 2, axis=0))


def _by_run(
    x: np.ndarray, slices: tuple[slice, ...], f: Callable[[np.ndarray], np.ndarray]
) -> np.ndarray:
    """Return ``f`` applied to each run of ``x`` (T, ...)."""
    return np.concatenate([f(x[s]) for s in slices])
