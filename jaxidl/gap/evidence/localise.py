"""The regimes in which a residual occurs: its energy by joint and regime, in sentences."""

from typing import NamedTuple

import numpy as np
from scipy import signal

from jaxidl.gap.evidence.rows import Rows, rms

# a regime stands out if its share of the energy is this many times its share of the time
EXCESS = 1.5
LEAST = 0.08  # and its share is at least this much of the joint's energy
MOST = 4  # most places reported for each joint


class Place(NamedTuple):
    """A regime of a joint, and its share of the joint's residual energy."""

    joint: int
    regime: str
    share: float  # share of the joint's residual energy
    time: float  # share of the counted samples; a rest is one sample
    sentence: str


def localise(data: Rows, residual: np.ndarray, names: tuple[str, ...]) -> list[Place]:
    """Return the regimes of each joint that stand out, the most striking first.

    Joints are in the order of their relative residual.
    """
    size = (rms(residual, data.used) / np.maximum(data.spread, 1e-12)).tolist()
    places = []
    for j in np.argsort(size)[::-1].tolist():
        energy = residual[:, j] ** 2 * data.used[:, j]
        found = []
        for regime, mask, words in _regimes(data, j):
            share = float(energy[mask].sum() / max(energy.sum(), 1e-300))
            time = float(np.sum(mask & data.used[:, j]) / max(np.sum(data.used[:, j]), 1))
            if share > LEAST and share > EXCESS * time and time > 0.0:
                sentence = (
                    f"{names[j]}: {share:.0%} of the residual's energy lies {words}, which is"
                    f" {time:.0%} of the samples that count"
                )
                found.append(Place(j, regime, share, time, sentence))
        found.sort(key=lambda p: p.share * np.log(p.share / p.time), reverse=True)
        how_large = f", {size[j]:.1%} of the command's spread," * bool(data.spread[j] > 0.0)
        everywhere = f"{names[j]}: the residual{how_large} is spread evenly over all regimes"
        places += found[:MOST] or [Place(j, "everywhere", 1.0, 1.0, everywhere)]
        places += _direction(data, residual, j, names[j])
    return places


def _regimes(data: Rows, j: int) -> list[tuple[str, np.ndarray, str]]:
    """Return name, rows and description of each regime."""
    signals, rows = data.signals, data.signals.rows
    resting = signals.resting[rows]
    q, qd, qdd, tau = (x[rows, j] for x in (signals.q, signals.qd, signals.qdd, signals.tau))
    speed, load, push = np.abs(qd), np.abs(tau), np.abs(qdd)
    (low, high), (left, right) = np.quantile(speed, [0.25, 0.75]), np.quantile(q, [1 / 3, 2 / 3])
    hard, heavy = np.quantile(push, 0.75), np.quantile(load, 0.75)
    reach = max(1, round(0.05 / data.step))
    events = np.diff(np.sign(qd), prepend=np.sign(qd[0])) != 0
    turn = np.convolve(events, np.ones(2 * reach + 1), "same") > 0
    quarters = np.arange(len(rows)) * 4 // len(rows)
    return [
        ("standstill", resting[:, j], "where the joint is at rest"),
        ("reversal", turn & ~resting[:, j], "within 50 ms of a reversal"),
        ("low speed", speed < low, f"below a speed of {low:.3g}"),
        ("high speed", speed > high, f"above a speed of {high:.3g}"),
        ("positive direction", qd > signals.rest_speed[j], "in motion forwards"),
        ("negative direction", qd < -signals.rest_speed[j], "in motion backwards"),
        ("low position", q < left, f"at positions below {left:.3g}"),
        (
            "middle position",
            (q >= left) & (q <= right),
            f"at positions between {left:.3g} and {right:.3g}",
        ),
        ("high position", q > right, f"at positions above {right:.3g}"),
        ("high acceleration", push > hard, f"above an acceleration of {hard:.3g}"),
        ("high load", load > heavy, f"above a torque of {heavy:.3g}"),
        *(
            (f"quarter {k + 1}", quarters == k, f"in the {which} quarter of the log")
            for k, which in enumerate(("first", "second", "third", "last"))
        ),
    ]


def _direction(data: Rows, residual: np.ndarray, j: int, name: str) -> list[Place]:
    """Return places of a residual that follows the direction or is constant; its frequencies."""
    counted = data.used[:, j]
    rows = data.signals.rows
    qd, r = data.signals.qd[rows, j][counted], residual[counted, j]
    if len(r) < 64:
        return []
    energy = np.mean(r**2)
    dry = np.mean(r * np.sign(qd)) ** 2 / max(energy, 1e-300)
    mean = np.mean(r) ** 2 / max(energy, 1e-300)
    way = "against" if np.mean(r * np.sign(qd)) > 0 else "along"
    f, power = signal.welch(
        np.where(counted, residual[:, j], 0.0), 1.0 / data.step, nperseg=min(256, len(rows))
    )
    top = f[np.searchsorted(np.cumsum(power), 0.8 * power.sum())]
    said = [
        ("direction", float(dry), f"{dry:.0%} of it is a constant torque {way} the motion"),
        ("offset", float(mean), f"{mean:.0%} of it is one constant torque"),
        ("frequency", 0.8, f"80% of it lies below {top:.2g} Hz"),
    ]
    return [Place(j, what, share, 1.0, f"{name}: {s}") for what, share, s in said if share > 0.25]
