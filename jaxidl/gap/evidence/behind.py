"""What acts behind the encoders: links and friction, of the model and of what was found.

They are where the joints truly are. So an error of an encoder changes not only the torque of the
model's own body, but also that of links, rotors and loads that were found, and friction.
"""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float

from jaxidl.effects import Effect
from jaxidl.gap.evidence.friction import friction_along
from jaxidl.gap.evidence.links import alterations, change_of, links_of, narrowed
from jaxidl.logs.signals import Signals
from jaxidl.systems.free import inner
from jaxidl.systems.tables import heavier, inverse_dynamics


class Behind:
    """Effects of links and friction behind the encoders of ``body``; of a point mass, friction."""

    def __init__(self, effects: Sequence[Effect] = (), body: Any = None):
        self.effects, self.body = tuple(effects), body
        # the log seen last, and the torque (N, J) that body and links need in its motion
        self._of, self._before = None, np.zeros(0)

    @cached_property
    def links(self) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """Additional rotors (J,), links (J + 1, 10) and angles of the base (2,) [rad], if any."""
        altering = [e for e in self.effects if type(inner(e)).alter is not Effect.alter]
        links = links_of(self.body)
        if not altering or links is None:
            return None
        rotors, angles = np.zeros(len(links.unit)), np.zeros(2)
        for name, extra in (made for e in altering for made in alterations(e)):
            if name == "add_inertia":
                rotors += extra
            elif name == "tilt":
                angles += extra
        return rotors, np.sum([change_of(e, links) for e in altering], 0), angles

    def moved(
        self, shift: Float[np.ndarray, "T J"], signals: Signals, load: Float[np.ndarray, "T J"]
    ) -> Float[np.ndarray, "N J"]:
        """Return the change of the inverse dynamics and of friction due to a position error.

        True positions differ from the measured ones by ``shift``; the ``load`` is the same.
        """
        off, at = np.flatnonzero(np.any(shift, axis=0)), signals.rows
        speed, acceleration = np.zeros_like(shift), np.zeros_like(shift)
        speed[:, off] = signals.differentiate(shift[:, off])
        acceleration[:, off] = signals.differentiate(speed[:, off])
        there = (signals.q + shift, signals.qd + speed, signals.qdd + acceleration)
        # friction of joints on which no effect feels it is the same
        reached = [(e, np.arange(shift.shape[1])[narrowed([e])[0]]) for e in self.effects]
        turned = [(e, on) for e, on in reached if np.isin(off, on).any()]
        moved = self._torque(signals, *(x[at] for x in there))
        if turned:
            felt = np.unique(np.concatenate([on for _, on in turned]))
            truly = signals._replace(q=there[0], qd=there[1])
            before, after = (
                friction_along([e for e, _ in turned], s, signals.tau, load)
                for s in (signals, truly)
            )
            change = np.where(signals.resting, 0.0, before - after)[:, felt]
            moved[:, felt] += signals.smooth(change)[at] * ~signals.resting[at][:, felt]
        return moved

    def _torque(
        self, signals: Signals, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray
    ) -> np.ndarray:
        """Return how much more torque (N, J) the links need in this motion than in the log's."""
        if self.links is None:
            return inverse_dynamics(signals.body, q, qd, qdd) - self._measured(signals)
        rotors, links, angles = self.links
        after = heavier(signals.body, q, qd, qdd, links, angles)
        return after - self._measured(signals) + rotors * (qdd - signals.qdd[signals.rows])

    def _measured(self, signals: Signals) -> np.ndarray:
        """Return the torque (N, J) that body and links need in the log's own motion."""
        at, table = signals.rows, signals.tables
        if self.links is None:
            return table.torque[at]
        if self._of is not signals:
            _, links, angles = self.links
            self._of, self._before = signals, table.torque[at] + table.by_tilt[at] @ angles
            self._before += np.einsum("tijp,jp->ti", table.by_link[at], links[:-1])
            self._before += table.by_payload[at] @ links[-1]
        return self._before


NOTHING = Behind()
