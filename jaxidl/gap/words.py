"""A diagnosis in plain language."""

from collections.abc import Sequence

import numpy as np

from jaxidl.gap.diagnosis import Ambiguity, Estimate, Finding, Gap
from jaxidl.gap.experiments import experiment
from jaxidl.gap.localise import Place
from jaxidl.systems.mjcf import Model

FEW = 6  # effects that a summary names


def summarise(
    verdict: str,
    findings: Sequence[Finding],
    ambiguous: Sequence[Ambiguity],
    gap: Gap,
    unexplained: Sequence[int],
    remaining: Sequence[Place],
    model: Model,
) -> str:
    """A few sentences: the verdict, what was found, what it is worth, what is left."""
    sure, rest = [f for f in findings if f.sure], [f for f in findings if not f.sure]
    out = [_verdict(verdict, sure, [model.names[j] for j in unexplained])]
    if sure:
        out.append(
            "Missing, in the order of what it explains: " + "; ".join(f"{f.sentence}, {_numbers(f)}" for f in sure[:FEW]) + "."
        )
    if len(sure) > FEW:
        out.append(f"And {len(sure) - FEW} more: see the table.")
    if rest:
        out.append("Possible, but not certain: " + "; ".join(f"{f.sentence}" for f in rest[:FEW]) + ".")
    if findings:
        changes = [
            f"{name} {_percent(b)} before, {_percent(a)} after"
            for name, b, a in zip(model.names, gap.before.torque_relative, gap.after.torque_relative, strict=True)
            if np.isfinite(b)
        ]
        out.append("Torque error on the data kept aside, relative to the command: " + "; ".join(changes) + ".")
    for a in ambiguous:
        names = " or ".join(readable(name) + (f" on {model.names[j]}" if j is not None else "") for name, j in a.candidates)
        out.append(f"This log cannot tell between {names}. To separate them, {a.experiment}.")
    return " ".join(out)


def readable(name: str) -> str:
    """An effect's name for a person."""
    return name.replace("_", " ")


def number(estimate: Estimate) -> str:
    """A parameter with unit and standard error; of a table its range."""
    unit = "" if estimate.unit == "1" else f" {estimate.unit}"
    if isinstance(estimate.value, list):
        return f"{min(estimate.value):.4g} to {max(estimate.value):.4g}{unit}"
    return f"{estimate.value:.4g} ± {estimate.stderr:.2g}{unit}"


def _numbers(finding: Finding) -> str:
    return ", ".join(f"{readable(name)} {number(p)}" for name, p in finding.parameters.items())


def _verdict(verdict: str, sure: Sequence[Finding], unexplained: Sequence[str]) -> str:
    count = f"{len(sure)} effect{'s' * (len(sure) != 1)}"
    return {
        "named": f"The simulation lacks {count}.",
        "ambiguous": f"The simulation lacks {count or 'something'}, but this log does not fully determine which.",
        "nothing_missing": "Nothing is missing: no effect of the catalogue makes the model clearly better.",
        "unexplained": f"Something is left on {', '.join(unexplained)} that the catalogue does not explain"
        + (f", beside {count} that the simulation lacks for certain." if sure else "."),
    }[verdict]


def _percent(share: float) -> str:
    """Two digits, or all that stand before the point."""
    return f"{100 * share:.0f} %" if abs(share) >= 0.0995 else f"{100 * share:.2g} %"


__all__ = ["experiment", "number", "readable", "summarise"]
