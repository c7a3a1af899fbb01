"""The low-pass H of a log, derivatives, and the band that noise allows.

H is a zero-phase Butterworth of fourth order, forwards and backwards. Its band ends where the
encoder's noise, twice differentiated and multiplied by inertia, reaches ``NOISE_SHARE`` of the
commanded torque, and not much beyond where no command stands out of its own noise. That noise is
the encoder's, too, through the controller: in a longer band it would be taken for delays. So the
torques of each joint are compared within a band of its own, which ends not much beyond where its
own command stands out (:func:`bands`).
"""

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from scipy import signal
from scipy.fft import dct, idct
from scipy.interpolate import make_interp_spline

NOISE_SHARE = 0.02  # noise torque over the command's spread at the end of the band
BAND = (4.0, 100.0)  # least and largest band [Hz]
HIGHEST_BAND = 0.2  # largest band over the sampling rate
STANDS_OUT = 4.0  # power of a command over that of its noise
BEYOND = 1.5  # largest band over the frequency up to which the command stands out


@lru_cache(maxsize=16)
def _design(band: float, dt: float) -> Any:
    """Return H's second-order sections."""
    return signal.butter(4, band, fs=1.0 / dt, output="sos")


def low_pass(x: np.ndarray, band: float, dt: float) -> np.ndarray:
    """Return H applied to one run (T, ...)."""
    sections = _design(band, dt)
    return signal.sosfiltfilt(sections, x, axis=0, padlen=min(len(x) - 1, round(1.0 / band / dt)))


def band_limited(x: np.ndarray, rate: float, band: float) -> np.ndarray:
    """Return samples (..., N) without what is above a band [Hz], as fast as by H.

    By cosines, since samples may be missing; the others are ``rate`` per second.
    """
    frequency = np.arange(x.shape[-1]) * rate / (2.0 * max(x.shape[-1], 1))
    waves = np.asarray(dct(x, norm="ortho")) / (1.0 + (frequency / band) ** 8)
    return np.asarray(idct(waves, norm="ortho"))


def derivative(x: np.ndarray, dt: float) -> np.ndarray:
    """Return the first derivative (T, ...) by a five-point stencil, a shorter one at the ends."""
    out = np.gradient(x, dt, axis=0, edge_order=2)
    out[2:-2] = (8.0 * (x[3:-1] - x[1:-3]) - (x[4:] - x[:-4])) / (12.0 * dt)
    return out


def at_instants(x: np.ndarray, at: np.ndarray, to: np.ndarray) -> np.ndarray:
    """Return one run (T, ...), sampled at the instants ``at`` (T,), at others ``to`` (N,).

    By cubic splines: of a motion of 3 Hz that is logged at 100 Hz, straight lines would take 0.4 %.
    """
    spline = make_interp_spline(at, x, k=min(3, len(at) - 1), check_finite=False)
    return spline(np.clip(to, at[0], at[-1]))


def half_later(x: np.ndarray) -> np.ndarray:
    """Return one run (T, ...) half a sample later, by cubics through the four samples around."""
    before, now = np.concatenate([x[:1], x[:-1]]), x
    first, last = np.concatenate([x[:1], before[:-1]]), np.concatenate([x[1:], x[-1:]])
    return (9.0 * (before + now) - (first + last)) / 16.0


def by_run(
    x: np.ndarray, slices: tuple[slice, ...], f: Callable[[np.ndarray], np.ndarray]
) -> np.ndarray:
    """Return ``f`` applied to each run of ``x`` (T, ...)."""
    return np.concatenate([f(x[s]) for s in slices])


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


def heard_to(x: np.ndarray, slices: tuple[slice, ...], dt: float) -> float:
    """Return up to which frequency [Hz] some joint's command ``x`` (T, J) stands out of its noise.

    Its noise is what is left above 0.6 of the Nyquist frequency: of the sensor, or of the encoder
    through the controller.
    """
    run = max((x[s] for s in slices), key=len)
    length = min(4096, max(len(run) // 8, min(len(run), 16)))
    frequency, power = signal.welch(run, 1.0 / dt, nperseg=length, axis=0)
    noise = np.median(power[frequency > 0.6 * frequency[-1]], axis=0)
    above = np.any(power > STANDS_OUT * noise, axis=1)
    return float(frequency[above].max(initial=0.0))


def bands(
    q: np.ndarray, tau: np.ndarray, slices: tuple[slice, ...], dt: float, band: float
) -> np.ndarray:
    """Return up to which frequency (J,) [Hz] the torques of each joint are compared.

    It is not much beyond where its own command (T, J) stands out of its noise, or without a drive
    its positions (T, J), within the ``band`` of all joints.
    """
    shown = np.where(np.std(tau, axis=0) > 0.0, tau, q)
    heard = [heard_to(shown[:, [j]], slices, dt) for j in range(tau.shape[1])]
    return np.clip(BEYOND * np.array(heard), min(BAND[0], band), band)


def choose_band(
    reach: np.ndarray, q: np.ndarray, tau: np.ndarray, slices: tuple[slice, ...], dt: float
) -> float:
    """Return the band [Hz], the same for all joints.

    Args:
        reach: (J,) encoder noise times inertia.
        q: positions (T, J), which tell where the motion of a joint without a drive ends.
        tau: commands (T, J).
        slices: the runs.
        dt: sampling interval [s].
    """
    spread = np.std(tau, axis=0)
    free = (reach > 0.0) & (spread > 0.0)
    heard = heard_to(np.where(spread > 0.0, tau, q), slices, dt)
    widest = min(BAND[1], HIGHEST_BAND / dt, max(BAND[0], BEYOND * heard))
    if not free.any():
        return widest
    unit = noise_torque(reach[free], 1.0, dt)
    return float(np.clip(np.min((NOISE_SHARE * spread[free] / unit) ** 0.4), BAND[0], widest))
