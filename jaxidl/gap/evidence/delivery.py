"""What actuators let through of a joint's command.

Effects of a motor can make an error small by making the command small. What is said of them is
therefore relative to the share that they let through: of the command's variance or of that of a
small additional command, whichever is least (:func:`jaxidl.gap.fit.library.pushed`).
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from jaxtyping import Float

from jaxidl.gap.evidence.rows import Rows

if TYPE_CHECKING:
    from jaxidl.gap.evidence.gram import Item

LEAST = 1e-9  # least share


class Delivery(NamedTuple):
    """The share of joint j's command that arrives, by the A scaled coefficients of its actuators.

    Of each of W commands it is ``one - 2 x @ mean + x @ square @ x``.
    """

    joint: int
    places: np.ndarray  # (A,) of the coefficients in a set or a score
    one: Float[np.ndarray, " W"]
    mean: Float[np.ndarray, "W A"]
    square: Float[np.ndarray, "W A A"]
    # share of samples at which no additional command passes, for each unit of a coefficient
    deaf: Float[np.ndarray, " A"]
    variance: float  # of the command [noise^2]

    def among(self, at: np.ndarray, total: int) -> "Delivery | None":
        """Return that of a set of columns ``at`` (P,) of ``total``; None if none acts here."""
        place = np.full(total, -1)
        place[at] = np.arange(len(at))
        on = np.flatnonzero(place[self.places] >= 0)
        if not len(on):
            return None
        return self._replace(
            places=place[self.places[on]],
            mean=self.mean[:, on],
            square=self.square[:, on[:, None], on],
            deaf=self.deaf[on],
        )

    def share(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the least share at a set's coefficients ``x`` (P,), and its slope (A,)."""
        x = x[self.places]
        moved = self.square @ x
        shares = self.one + (moved - 2 * self.mean) @ x
        least = int(np.argmin(shares))
        return max(float(shares[least]), LEAST), 2 * (moved[least] - self.mean[least])

    def heard(self, x: np.ndarray) -> float:
        """Return the share of samples that contain information about the command."""
        return min(max(1.0 - float(np.abs(x[self.places]) @ self.deaf), 0.0), 1.0)


def delivery(
    rows: Rows,
    j: int,
    noise: float,
    acting: Sequence["Item"],
    places: np.ndarray,
    scale: np.ndarray,
) -> Delivery:
    """Return the share of joint j's command that arrives behind effects with A coefficients.

    Torques are in units of ``noise`` [N or Nm]. The coefficients are at ``places`` (A,) of a score,
    and ``scale`` (A,) of the score's coefficients are one.
    """
    mask = rows.training & rows.used[:, j]
    n, none = max(int(mask.sum()), 1), np.zeros((0, int(mask.sum())))
    of = lambda x, i: x[..., mask, i.joints.index(j)]
    joined = lambda parts: np.concatenate([none, *parts]) / scale[:, None]
    c, x = rows.command[mask, j] / noise, joined(of(i.columns, i) / noise for i in acting)
    c, x = c - c.sum() / n, x - x.sum(1, keepdims=True) / n
    variance = float(c @ c / n)
    one, mean, square = [variance], [x @ c / n], [x @ x.T / n]
    one, mean, square = ([part[0] / max(variance, 1e-300)] for part in (one, mean, square))
    ways = next((of(i.push[0], i) for i in acting if i.push), none)
    for number, way in enumerate(ways):
        held = joined(
            of(i.push[1][number], i) if i.push else np.zeros((len(i.lower), mask.sum()))
            for i in acting
        )
        power = float(way @ way) or np.inf
        one, mean = [*one, 1.0], [*mean, held @ way / power]
        square.append(held @ held.T / power)
    deaf = [
        np.zeros(len(i.lower)) if i.deaf is None else i.deaf[:, i.joints.index(j)] for i in acting
    ]
    return Delivery(
        j,
        places,
        np.array(one),
        np.stack(mean),
        np.stack(square),
        np.concatenate([np.zeros(0), *deaf]) / scale,
        variance,
    )
