"""A diagnosis whose parameters were also fitted to trajectories, and the record of that."""

from dataclasses import replace
from typing import Any

import jax
import numpy as np

from jaxidl.errors import ConfigurationError
from jaxidl.gap.evidence.localise import localise
from jaxidl.gap.evidence.rows import rows_of
from jaxidl.gap.fit.refine import WINDOW, Refinement, refine
from jaxidl.gap.result.diagnosis import Diagnosis, Estimate, Finding, Side, plain_number
from jaxidl.replay.trajectory import MOMENTS
from jaxidl.systems.free import Bounds
from jaxidl.systems.plant import Plant


def refined(d: Diagnosis, window: float | None) -> Diagnosis:
    """Return the refined diagnosis; see :meth:`jaxidl.gap.result.diagnosis.Diagnosis.refined`."""
    signals = d.signals
    if signals is None:
        wanted = "a diagnosis with the log's signals"
        raise ConfigurationError(wanted, "one without", "make it with gap.diagnose")
    if window is None:
        window = max(WINDOW, MOMENTS * signals.dt)
    # findings are in the order of what they explain; a command passes them in that of the catalogue
    passed = d.ordered
    lacking = Plant(d.model.plant.body, (*d.model.plant.effects, *d.common))
    with jax.enable_x64(True):
        rows = rows_of(signals, lacking.effects, d.options["held_out"])
    moving = rows.used & signals.moving[signals.rows]
    strange = np.asarray(moving.any(1) & ~d.traces.counted.any(1))
    r = refine(
        lacking,
        [f.effect for f in passed],
        signals,
        [_bounds(f) for f in passed],
        held_out=d.options["held_out"],
        window=window,
        strange=strange,
    )
    at = {id(f): k for k, f in enumerate(passed)}
    for n in ("effects", "given", "refined", "stderr"):
        r = r._replace(**{n: tuple(getattr(r, n)[at[id(f)]] for f in d.findings)})
    d = replace(d, refinement=r)
    if not r.accepted or r.after is None or r.residual is None:
        return d
    findings = tuple(_finding(d, r, k) for k in range(len(d.findings)))
    relative = d.gap.relative(r.after.torque_rms)
    gap = d.gap._replace(after=Side(r.after.torque_rms, relative, r.after.rollout_rms))
    remaining = tuple(localise(rows.without(strange), r.residual, d.model.names))
    return replace(
        d,
        findings=findings,
        gap=gap,
        remaining=remaining,
        traces=d.traces._replace(after=r.residual),
    )


def _bounds(f: Finding) -> Bounds:
    """Return bounds of a finding's parameters, as wide as its values require.

    An effect that has others as parts may be beyond its own.
    """
    out = {}
    for name, (low, high) in f.bounds.items():
        value = np.asarray(f.parameters[name].value)
        out[name] = min(low, float(value.min())), max(high, float(value.max()))
    return {name: (low, high) for name, (low, high) in out.items() if low < high}


def record(d: Diagnosis) -> dict[str, Any] | None:
    """Return the content of ``refined`` in ``report.json``."""
    r = d.refinement
    assert r is not None
    return {
        "accepted": r.accepted,
        "reason": r.reason,
        "window": r.window,
        "windows": {"training": r.windows[0], "held_out": r.windows[1]},
        "effects": [
            {
                "effect": f.name,
                "joint": f.joint,
                "parameters": {
                    name: {
                        "unit": f.parameters[name].unit,
                        "before": plain_number(value),
                        "after": plain_number(r.refined[k][name]),
                        "stderr": plain_number(reported_stderr(d, k, name)),
                    }
                    for name, value in r.given[k].items()
                },
            }
            for k, f in enumerate(d.findings)
        ],
        "before": r.before._asdict() if r.before else None,
        "after": r.after._asdict() if r.after else None,
    }


def reported_stderr(d: Diagnosis, k: int, name: str) -> np.ndarray:
    """Return standard errors (n,) of a refined parameter of the k-th finding.

    They combine the scatter between windows and the change. A difference between torques and motion
    is due to filters and time steps, and the same in all windows. No time is known better than to a
    sampling interval.
    """
    r = d.refinement
    assert r is not None
    interval = 0.0 if d.signals is None else d.signals.dt
    least = interval / np.sqrt(12.0) if d.findings[k].parameters[name].unit == "s" else 0.0
    change = r.refined[k][name] - r.given[k][name]
    return np.sqrt(r.stderr[k][name] ** 2 + change**2 + least**2)


def _finding(d: Diagnosis, r: Refinement, k: int) -> Finding:
    """Return a refined finding; parameters without influence on motion keep their errors."""
    f = d.findings[k]
    parameters = dict(f.parameters)
    for name, value in r.refined[k].items():
        old = f.parameters[name]
        felt, new = r.stderr[k][name] > 0.0, reported_stderr(d, k, name)
        stderr = plain_number(np.where(felt, new, np.ravel(old.stderr)))
        parameters[name] = Estimate(plain_number(value), old.unit, stderr)
    return replace(f, effect=r.effects[k], parameters=parameters)
