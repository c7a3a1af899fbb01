"""Rollout errors: how far a simulation departs from a log.

It starts from measured states and is driven by the measured torque.
"""

from functools import partial
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Array, Float

from jaxidl.backend import jit_quickly
from jaxidl.logs.signals import Signals
from jaxidl.systems import Plant
from jaxidl.types import Scalar, State

HORIZONS = (0.05, 0.1, 0.2, 0.5)  # [s]
WINDOWS = 64
# time before a window in which hidden states follow the measured motion [s]: by its end, a motor
# behind a spring must have stopped swinging from its unknown beginning
SETTLE = 0.5


class Windows(NamedTuple):
    """W windows of a log, of L instants each.

    They are the instants before the window begins, its beginning, and its S steps.
    """

    q: Float[Array | np.ndarray, "*W L J"]  # measured (smoothed) [m or rad]
    qd: Float[Array | np.ndarray, "*W L J"]
    tau: Float[Array | np.ndarray, "*W L J"]  # as logged [N or Nm]


def rollout_errors(
    plant: Plant, signals: Signals, aside: np.ndarray
) -> dict[str, Float[np.ndarray, " J"]]:
    """Return the root mean square position error (J,) [m or rad] after each horizon.

    It is taken over windows that begin where ``aside`` (T,) is true. Effects of the plant on the
    encoders must be undone in the ``signals`` (:meth:`jaxidl.logs.signals.Signals.behind`). A
    window starts from the measured (smoothed) state; hidden states are first driven by the measured
    motion. A window in which the simulation is not finite counts as an error of the joint's whole
    range.
    """
    lead, length = round(SETTLE / signals.dt), round(HORIZONS[-1] / signals.dt)
    starts = window_starts(signals, aside, lead, length)
    if not len(starts):
        return {str(h): np.full(signals.q.shape[1], np.nan) for h in HORIZONS}
    windows = windows_at(signals, starts, lead, length)
    positions = np.asarray(_simulate(plant, windows, lead, signals.dt))
    truth = windows.q[:, lead:]
    span = np.ptp(signals.q, axis=0)
    out = {}
    for horizon in HORIZONS:
        step = round(horizon / signals.dt)
        error = np.nan_to_num(
            positions[:, step - 1] - truth[:, step], nan=np.inf, posinf=np.inf, neginf=np.inf
        )
        out[str(horizon)] = np.sqrt(np.mean(np.minimum(np.abs(error), span) ** 2, axis=0))
    return out


def window_starts(signals: Signals, aside: np.ndarray, lead: int, length: int) -> np.ndarray:
    """Return first instants of at most ``WINDOWS`` windows, spread evenly.

    Each window lies within a run and begins where ``aside`` (T,) is true. None extends to the end
    of a run, where true positions behind late encoders are unknown.
    """
    possible: list[int] = []
    for run in signals.slices:
        first, end = run.start + lead, run.stop - signals.late - length - 1
        possible += range(first, max(first, end), max(1, length // 8))
    possible = [start for start in possible if aside[start]]
    if len(possible) > WINDOWS:
        possible = [possible[k] for k in np.linspace(0, len(possible) - 1, WINDOWS).astype(int)]
    return np.array(possible, int)


def windows_at(signals: Signals, starts: np.ndarray, lead: int, length: int) -> Windows:
    """Return windows (W, ...) of ``length`` steps that begin at ``starts`` (W,).

    They include the ``lead`` instants before each.
    """
    return Windows(
        *(
            np.stack([x[s - lead : s + length + 1] for s in starts])
            for x in (signals.q, signals.qd, signals.tau)
        )
    )


@partial(jit_quickly, static_argnames="lead")
def _simulate(plant: Any, windows: Windows, lead: int, dt: Scalar) -> Any:
    """Return positions (W, S, J) after each step of W rollouts."""
    return jax.vmap(lambda window: replay(plant, window, lead, dt))(windows)


def replay(plant: Plant, window: Windows, lead: int, dt: Scalar) -> Float[Array, "S J"]:
    """Return positions (S, J) [m or rad] after each step of one window's rollout.

    The plant is driven by the measured torque. It starts from the measured state; hidden states
    follow the measured motion of the ``lead`` instants before.
    """
    q, qd, tau = window

    def led(hidden: Any, now: Any) -> Any:
        position, velocity, command = now
        for number, effect in enumerate(plant.effects):
            command, memory = effect.actuate(hidden[number], position, velocity, command, dt)
            hidden = (*hidden[:number], memory, *hidden[number + 1 :])
        return hidden, None

    hidden, _ = jax.lax.scan(led, plant.start(q[0]), (q[:lead], qd[:lead], tau[:lead]))

    def free(carry: Any, command: Any) -> Any:
        state, hidden = carry
        state, hidden = plant.step(state, hidden, command, dt, implicit=True)
        return (state, hidden), state.q

    return jax.lax.scan(free, (State(q[lead], qd[lead]), hidden), tau[lead:-1])[1]
