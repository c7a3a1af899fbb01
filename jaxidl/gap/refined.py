"""A diagnosis whose parameters were fitted to trajectories, too, and the record of that."""

from dataclasses import replace
from typing import Any

import jax
import numpy as np

from jaxidl.errors import ConfigurationError
from jaxidl.gap.data import data_of
from jaxidl.gap.diagnosis import Diagnosis, Estimate, Finding, Side
from jaxidl.gap.localise import localise
from jaxidl.gap.refine import Refinement, Values, refine
from jaxidl.gap.words import summarise


def refined(d: Diagnosis, window: float) -> Diagnosis:
    """See :meth:`jaxidl.gap.diagnosis.Diagnosis.refined`."""
    if d.signals is None:
        raise ConfigurationError("a diagnosis with the log's signals", "one without", "make it with gap.diagnose")
    found, bounds = [f.effect for f in d.findings], [f.bounds for f in d.findings]
    r = refine(d.model.plant, found, d.signals, bounds, held_out=d.options["held_out"], window=window)
    if not r.accepted or r.after is None or r.residual is None:
        return replace(d, refinement=r)
    findings = tuple(_finding(f, r, k) for k, f in enumerate(d.findings))
    command = np.array(d.gap.before.torque_rms) / np.maximum(d.gap.before.torque_relative, 1e-300)
    relative = np.array(r.after.torque_rms) / np.maximum(command, 1e-300)
    gap = d.gap._replace(after=Side(r.after.torque_rms, relative.tolist(), r.after.rollout_rms))
    with jax.enable_x64(True):
        data = data_of(d.signals, d.model.plant.effects, d.options["held_out"])
    remaining = tuple(localise(data, r.residual, d.model.names))
    return replace(
        d,
        findings=findings,
        gap=gap,
        remaining=remaining,
        traces=d.traces._replace(after=r.residual),
        summary=summarise(d.verdict, findings, d.ambiguous, gap, d.where, remaining, d.model),
        refinement=r,
    )


def record(d: Diagnosis) -> dict[str, Any] | None:
    """What ``report.json`` has under ``refined``."""
    r = d.refinement
    if r is None:
        return None
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
                        "before": _number(value),
                        "after": _number(r.refined[k][name]),
                        "stderr": _number(r.stderr[k][name]),
                    }
                    for name, value in r.given[k].items()
                },
            }
            for k, f in enumerate(d.findings)
        ],
        "before": r.before._asdict() if r.before else None,
        "after": r.after._asdict() if r.after else None,
    }


def _finding(f: Finding, r: Refinement, k: int) -> Finding:
    """A finding with its refined effect and parameters; those without influence on motion keep their standard errors."""
    parameters = dict(f.parameters)
    for name, value in r.refined[k].items():
        stderr = np.where(r.stderr[k][name] > 0.0, r.stderr[k][name], np.ravel(f.parameters[name].stderr))
        parameters[name] = Estimate(_number(value), f.parameters[name].unit, _number(stderr))
    return replace(f, effect=r.effects[k], parameters=parameters)


def _number(value: np.ndarray) -> float | list[float]:
    return float(value[0]) if len(value) == 1 else value.tolist()


__all__ = ["Values", "record", "refined"]
