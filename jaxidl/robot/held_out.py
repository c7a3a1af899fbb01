"""The error of a learned torque on data that it was not trained on.

Rows a few milliseconds apart are nearly equal, and targets are filtered: every fifth row held out,
as the training's own validation does, show no overfitting. So whole stretches of the execution are
held out.
"""

import numpy as np

from jaxidl.models import ErrorModel, Params
from jaxidl.types import Dataset

BLOCKS, HELD = 10, (2, 5, 8)  # an execution in ten stretches; which of them are held out
MARGIN = 0.01  # share of an execution beside them that is not trained on either


def held_out_rows(data: Dataset, steps: int) -> tuple[Dataset, Dataset]:
    """Return rows to train on, and rows held out, of one execution of ``steps`` control steps.

    Rows of several sources, one after the other, are held out for the same stretches.
    """
    count = len(data.x)
    sources = max(1, round(count / steps))
    time = np.concatenate([np.arange(n) for n in _lengths(count, steps, sources)])
    stretch = np.minimum(time * BLOCKS // steps, BLOCKS - 1)
    held = np.isin(stretch, HELD)
    edge = max(1, round(MARGIN * steps))
    near = np.isin(np.clip((time + edge) * BLOCKS // steps, 0, BLOCKS - 1), HELD)
    near |= np.isin(np.clip((time - edge) * BLOCKS // steps, 0, BLOCKS - 1), HELD)
    pick = lambda where: Dataset(data.x[np.flatnonzero(where)], data.y[np.flatnonzero(where)])
    return pick(~near & ~held), pick(held)


def _lengths(count: int, steps: int, sources: int) -> list[int]:
    """Return the number of rows of each source; those after the first may lack the last step."""
    first = min(count, steps)
    rest = count - first
    return [first, *([rest // (sources - 1)] * (sources - 1) if sources > 1 else [])]


def left_by(model: ErrorModel, params: Params, data: Dataset) -> np.ndarray:
    """Return what is left of the targets (N, J) [N or Nm] of ``data``."""
    inputs = model.scale_inputs(data.x).astype(np.float32).T
    return np.asarray(data.y) - model.torque_scale * np.asarray(model.apply(params, inputs)).T


def rms(values: object) -> list[float]:
    """Return the root mean square (J,) over the rows of ``values`` (N, J)."""
    return np.sqrt(np.mean(np.asarray(values, float) ** 2, axis=0)).tolist()
