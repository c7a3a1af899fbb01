"""A diagnosis whose parameters were also fitted to trajectories, and the record of that."""

from dataclasses import replace
from typing import Any

import jax
import numpy as np

from jaxidl.errors import ConfigurationError
from jaxidl.gap.evidence.localise import localise
from jaxidl.gap.fit.balance import balance
from jaxidl.gap.fit.refine import WINDOW, Refinement, refine
from jaxidl.gap.result.diagnosis import Diagnosis, Estimate, Finding, Side, plain_number
from jaxidl.gap.result.words import summarise
from jaxidl.replay.trajectory import MOMENTS
from jaxidl.systems.free import Bounds
from jaxidl.systems.plant import Plant


def refined(d: Diagnosis, window: float | None) -> Diagnosis:
    """Return the refined diagnosis; see :meth:`jaxidl.gap.result.diagnosis.Diagnosis.refined`."""
    signals = d.signals
    if signals is None:
        raise ConfigurationError(
            "a diagnosis with the log's signals", "one without", "make it with gap.diagnose"
        )
    if window is None:
        window = max(WINDOW, MOMENTS * signals.dt)
    # findings are in the order of what they explain; a command passes them in that of the catalogue
    passed = d.ordered
    r = refine(
        Plant(d.model.plant.body, (*d.model.plant.effects, *d.common)),
        [f.effect for f in passed],
        signals,
        [_bounds(f) for f in passed],
        held_out=d.options["held_out"],
        window=window,
    )
    at = {id(f): k for k, f in enumerate(passed)}
    back = [at[id(f)] for f in d.findings]
    r = r._replace(
        **{
            n: tuple(getattr(r, n)[k] for k in back)
            for n in ("effects", "given", "refined", "stderr")
        }
    )
    if not r.accepted or r.after is None or r.residual is None:
        return replace(d, refinement=r)
    d = replace(d, refinement=r)
    findings = tuple(_finding(d, r, k) for k in range(len(d.findings)))
    command = np.array(d.gap.before.torque_rms) / np.maximum(d.gap.before.torque_relative, 1e-300)
    relative = np.array(r.after.torque_rms) / np.maximum(command, 1e-300)
    gap = d.gap._replace(after=Side(r.after.torque_rms, relative.tolist(), r.after.rollout_rms))
    with jax.enable_x64(True):
        own = (*d.model.plant.effects, *d.common)
        rows, _ = balance(signals, own, (), d.options["held_out"])
    remaining = tuple(localise(rows, r.residual, d.model.names))
    return replace(
        d,
        findings=findings,
        gap=gap,
        remaining=remaining,
        traces=d.traces._replace(after=r.residual),
        summary=summarise(
            d.verdict,
            findings,
            d.ambiguous,
            gap,
            d.unexplained,
            d.model,
            bool(d.options.get("reference")),
            d.doubt,
        ),
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
    within = np.full_like(
        r.stderr[k][name],
        d.signals.dt / np.sqrt(12.0)
        if d.signals and d.findings[k].parameters[name].unit == "s"
        else 0.0,
    )
    return np.sqrt(
        r.stderr[k][name] ** 2 + (r.refined[k][name] - r.given[k][name]) ** 2 + within**2
    )


def _finding(d: Diagnosis, r: Refinement, k: int) -> Finding:
    """Return a finding with its refined effect and parameters.

    Parameters without influence on motion keep their standard errors.
    """
    f = d.findings[k]
    parameters = dict(f.parameters)
    for name, value in r.refined[k].items():
        stderr = np.where(
            r.stderr[k][name] > 0.0,
            reported_stderr(d, k, name),
            np.ravel(f.parameters[name].stderr),
        )
        parameters[name] = Estimate(
            plain_number(value), f.parameters[name].unit, plain_number(stderr)
        )
    return replace(f, effect=r.effects[k], parameters=parameters)
