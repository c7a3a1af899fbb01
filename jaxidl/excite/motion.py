"""Motions that are linear in their coefficients and begin and end at rest at one posture.

A finite Fourier series (Swevers et al., IEEE T-RA 1997) or a clamped B-spline of degree five.
Position, speed and acceleration are those of rest at both ends whatever the coefficients, and a
smaller multiple of the coefficients stays within any limits that a larger one keeps.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.interpolate import BSpline
from scipy.linalg import null_space

from jaxidl.errors import ConfigurationError, one_of

KINDS = ("fourier", "spline")
DEGREE = 5
LEAST = 4  # fewest coefficients of a joint


class Basis(NamedTuple):
    """T instants of a joint's motion by its K coefficients."""

    q: Float[np.ndarray, "T K"]
    qd: Float[np.ndarray, "T K"]  # per second
    qdd: Float[np.ndarray, "T K"]  # per second squared


def basis(kind: str, seconds: float, top: float, times: Float[np.ndarray, " T"]) -> Basis:
    """Return the basis of a motion of ``seconds`` [s] at ``times`` (T,) [s].

    Args:
        kind: fourier or spline.
        seconds: length [s].
        top: highest frequency [Hz]: of the last harmonic, or half the number of the spline's
            pieces per second.
        times: from 0 to ``seconds``.

    Raises:
        ConfigurationError: for an unknown kind, or a motion too short for ``top``.
    """
    if kind not in KINDS:
        raise one_of("a kind of motion", kind, KINDS)
    pieces = round(seconds * top)
    if pieces < LEAST:
        raise ConfigurationError(
            f"seconds times top frequency of at least {LEAST}",
            f"{seconds:g} s times {top:g} Hz",
            "give a longer motion or a higher top frequency",
        )
    return (_fourier if kind == "fourier" else _spline)(seconds, pieces, times)


def _fourier(seconds: float, harmonics: int, times: np.ndarray) -> Basis:
    """Return sines and 1 − cosines, combined so that no coefficient moves the ends."""
    k = np.arange(1, harmonics + 1)
    omega = 2.0 * np.pi * k / seconds
    phase = times[:, None] * omega
    # amplitudes fall with the frequency, as speed limits require
    size = 1.0 / k
    sines = [f * size * omega**n for n, f in enumerate((np.sin(phase), np.cos(phase)))]
    sines.append(-np.sin(phase) * size * omega**2)
    cosines = [size * (1.0 - np.cos(phase)), np.sin(phase) * size * omega]
    cosines.append(np.cos(phase) * size * omega**2)
    slow, bent = null_space((size * k)[None]), null_space((size * k**2)[None])
    return Basis(
        *(np.concatenate([s @ slow, c @ bent], 1) for s, c in zip(sines, cosines, strict=True))
    )


def _spline(seconds: float, pieces: int, times: np.ndarray) -> Basis:
    """Return B-splines of degree five without the three at each end."""
    pieces = 2 * pieces
    inner = np.linspace(0.0, seconds, pieces + 1)
    knots = np.concatenate([[0.0] * DEGREE, inner, [seconds] * DEGREE])
    whole = BSpline(knots, np.eye(len(knots) - DEGREE - 1), DEGREE)
    at = np.clip(times, 0.0, seconds)
    return Basis(*(whole.derivative(n)(at)[:, 3:-3] if n else whole(at)[:, 3:-3] for n in range(3)))


def instants(seconds: float, rate: float) -> Float[np.ndarray, " T"]:
    """Return instants (T,) [s] from 0 to ``seconds`` at about ``rate`` [Hz], both ends included."""
    return np.linspace(0.0, seconds, max(round(seconds * rate), 2) + 1)
