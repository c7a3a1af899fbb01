"""Made-up results of the study."""

import json
from types import SimpleNamespace

import numpy as np

from jaxidl.jobs.points import points
from jaxidl.jobs.results import assemble
from jaxidl.paper.grid import Grid
from jaxidl.paper.runs import META, settings_of
from jaxidl.paper.study import PaperStudy

GRID = Grid(noise=(1e-4, 8e-4), friction=(5.0,), stiction=(5.0,), epochs=(20,), seeds=(1, 2, 3))


def results(error_of=lambda label, k: 1.0, finite_of=lambda label, k: True, grid=GRID):
    """Results in which run ``label`` has the error ``error_of(label, k)`` in execution k.

    All other numbers are 1.
    """
    rows = range(grid.executions)
    runs = {}
    for at in points(grid.dims()):
        label = SimpleNamespace(**dict(at))
        errors = np.array([error_of(label, k) for k in rows], float)
        runs[at] = dict.fromkeys(("feedback_applied", "qdd_error", "torque"), np.ones(len(rows)))
        runs[at] |= {"q_error": errors, "finite": np.array([finite_of(label, k) for k in rows])}
    data = assemble(grid.dims(), META, runs).assign_coords(iteration=np.arange(grid.executions))
    return data.assign_attrs(identity=json.dumps({"study": settings_of(PaperStudy())}))


def as_in_the_paper(label, k):
    """Errors as the paper reports them: joint falls fastest, direct falls but jumps where noise is
    high, and indirect stays where it is with low-gain PID.
    """
    first = 1.0 if label.gain == "low" else 0.1
    rate = {"indirect": 0.05, "direct": 0.15, "joint": 0.3}[label.source]
    if (label.controller, label.gain, label.source) == ("pid", "low", "indirect"):
        return 1.0 + (0.05 + 0.001 * label.seed) * (k > 5) + 0.001 * (k % 2)
    jump = 3.0 if label.source == "direct" and label.noise > 5e-4 else 1.05
    return first * np.exp(-rate * min(k, 9)) * jump ** ((-1) ** k) * (1 + 0.01 * label.seed)
