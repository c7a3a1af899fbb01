"""A diagnosis in plain language."""

from collections.abc import Sequence

from jaxidl.gap.diagnosis import Ambiguity, Estimate, Finding, Gap
from jaxidl.gap.localise import Place
from jaxidl.systems.mjcf import Model


def summarise(
    verdict: str,
    findings: Sequence[Finding],
    ambiguous: Sequence[Ambiguity],
    gap: Gap,
    where: Sequence[Place],
    remaining: Sequence[Place],
    model: Model,
) -> str:
    """A few sentences: the verdict, what was found, what it is worth, what is left."""
    out = [_verdict(verdict, findings)]
    out += [f"{f.sentence[0].upper()}{f.sentence[1:]}: {_numbers(f)}." for f in findings]
    if findings:
        changes = [
            f"{name}: {_percent(b)} before, {_percent(a)} after"
            for name, b, a in zip(model.names, gap.before.torque_relative, gap.after.torque_relative, strict=True)
        ]
        out.append("Torque error on the data kept aside, relative to the command: " + "; ".join(changes) + ".")
    for a in ambiguous:
        names = " or ".join(readable(name) + (f" on joint {j}" if j is not None else "") for name, j in a.candidates)
        out.append(f"This log cannot tell between {names}. To separate them, {a.experiment}.")
    if verdict == "unexplained" and remaining:
        out.append(f"What is left is systematic. {remaining[0].sentence[0].upper()}{remaining[0].sentence[1:]}.")
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


def _verdict(verdict: str, findings: Sequence[Finding]) -> str:
    count = f"{len(findings)} effect{'s' * (len(findings) != 1)} missing"
    return {
        "named": f"The simulation has {count}.",
        "ambiguous": f"The simulation has {count}, but this log does not fully determine which.",
        "nothing_missing": "Nothing is missing: no effect of the catalogue makes the model clearly better.",
        "unexplained": "Something is missing that the catalogue does not explain" + (f", beside {count}." if findings else "."),
    }[verdict]


def _percent(share: float) -> str:
    """Two digits, or all that stand before the point."""
    return f"{100 * share:.0f} %" if abs(share) >= 0.0995 else f"{100 * share:.2g} %"
