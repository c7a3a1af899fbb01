"""A diagnosis in plain language."""

from collections.abc import Sequence

import numpy as np

from jaxidl.gap.result.diagnosis import LIKELY, MUCH, Ambiguity, Estimate, Finding, Gap
from jaxidl.systems.mjcf import Model

FEW = 6  # most effects that a summary names
SPELLED = {"com": "centre of mass", "coulomb": "Coulomb", "stribeck": "Stribeck"}
LEAST = 5.0  # duration below which no log says much [s]
MOST = 1e4  # times the command: no command moves such a joint


def summarise(
    verdict: str,
    findings: Sequence[Finding],
    ambiguous: Sequence[Ambiguity],
    gap: Gap,
    unexplained: Sequence[int],
    model: Model,
    reference: bool = False,
    doubt: str = "",
) -> str:
    """Return a few sentences: the verdict, the findings, the improvement, what is unexplained.

    Args:
        reference: the log was compared with an earlier one, so findings are changes.
        doubt: what puts all of this in doubt; see :func:`doubt_of`.
    """
    sure, rest = [f for f in findings if f.sure], [f for f in findings if not f.sure]
    out = [
        doubt
        + headline(
            verdict,
            findings,
            [model.names[j] for j in unexplained],
            large(gap, model.names),
            reference,
            bool(ambiguous),
        )
    ]
    if sure:
        first = (
            ", those that explain most"
            f" first{f' ({FEW} of {len(sure)})' if len(sure) > FEW else ''}"
        )
        listed = "; ".join(f"{f.sentence}, {_numbers(f)}" for f in sure[:FEW])
        what = "Changed" if reference else "Missing"
        what += " or, below zero, too much" if any(f.less for f in sure) and not reference else ""
        out.append(f"{what}{first if len(sure) > 1 else ''}: {listed}.")
    if rest:
        more = f", and {len(rest) - FEW} more" if len(rest) > FEW else ""
        out.append("Suspected: " + "; ".join(f.sentence for f in rest[:FEW]) + f"{more}.")
    known = [j for j, relative in enumerate(gap.before.torque_relative) if judged(relative)]
    if findings and known:
        changes = [
            f"{model.names[j]} {percent(gap.before.torque_relative[j])} →"
            f" {percent(gap.after.torque_relative[j])}"
            for j in known
        ]
        out.append(
            "Torque error on held-out data, relative to the command, before → after: "
            + "; ".join(changes)
            + "."
        )
    for a in ambiguous:
        names = [
            readable(name) + (f" on {model.names[j]}" if j is not None else "")
            for name, j in a.candidates
        ]
        likelier = a.candidates[0] in {(f.name, f.joint) for f in sure}
        out.append(f"{undecided(names, likelier)} To separate them, {a.experiment}.")
    return " ".join(out)


def doubt_of(conventions: Sequence[str], stray: Sequence[str], duration: float) -> str:
    """Return what puts a whole diagnosis in doubt, as its first words; empty if nothing does.

    Args:
        conventions: sentences on conventions that the log and the model seem not to share.
        stray: names of joints that are locked in the model, but moved.
        duration: of the log [s].
    """
    several = len(stray) != 1
    locked = (
        f"{listed(stray)} moved, but {'are' if several else 'is'} locked in the model (no torque"
        " was logged or chosen there); if what moved is heavy, what follows is wrong"
    )
    signs = (
        "the log's columns, signs, zeros, units, clocks or gravity seem not to be the model's (see"
        " the first notes); what follows may be wrong"
    )
    brief = f"the log has only {duration:.2g} s, too little to trust what follows"
    said = [signs] * bool(conventions) + [locked] * bool(stray) + [brief] * (duration < LEAST)
    return f"First of all, {', and '.join(said)}. " if said else ""


def undecided(names: Sequence[str], likelier: bool) -> str:
    """Return a sentence on effects that explain a log alike; ``likelier``: the first is named."""
    both = f"This log cannot distinguish {' and '.join(names)}"
    return f"{both}; {names[0]} is named because it is likelier." if likelier else f"{both}."


def large(gap: Gap, names: Sequence[str]) -> list[str]:
    """Return the errors that remain and are worth mentioning, each with its joint.

    The largest comes first.
    """
    every = zip(gap.after.torque_relative, names, strict=True)
    worth = sorted((left for left in every if judged(left[0]) and left[0] > MUCH), reverse=True)
    return [f"{percent(relative)} of the command on {name}" for relative, name in worth]


def headline(
    verdict: str,
    findings: Sequence[Finding],
    unexplained: Sequence[str],
    remaining: Sequence[str],
    reference: bool = False,
    others: bool = True,
) -> str:
    """Return the verdict in one or two sentences.

    Args:
        verdict: named, nothing_missing, ambiguous or unexplained.
        findings: effects that are named, and those that are only suspected.
        unexplained: names of the joints with a large residual.
        remaining: large errors that remain, the largest first.
        reference: the log was compared with an earlier one.
        others: what is suspected has alternatives, which are listed.
    """
    named, rest = [f for f in findings if f.sure], [f for f in findings if not f.sure]
    sure, suspected, less = len(named), len(rest), sum(f.less for f in named)
    likely = max((f.confidence for f in rest), default=0.0)
    several = sure != 1
    effects = lambda number: f"{number} effect{'s' * (number != 1)}"
    lacks = " and ".join(
        [f"lacks {effects(sure - less)}"] * (sure > less or not less)
        + [f"has too much of {effects(less)}"] * (less > 0)
    )
    lacks = (
        f"{effects(sure)} {'have' if several else 'has'} changed since the reference log"
        if reference
        else f"The simulation {lacks}"
    )
    if verdict == "unexplained":
        left = (
            f"Part of the residual on {listed(unexplained)} stays unexplained: this log confirms no"
            " effect of the catalogue that removes it."
        )
        apart = [r for r in remaining if not r.endswith(tuple(f" on {n}" for n in unexplained))]
        if apart:
            most = f"{'up to ' * (len(apart) > 1)}{apart[0]}"
            left += f" What remains besides, {most}, can hardly be predicted from the state."
        return f"{left} {lacks}, named below." if sure else left
    if verdict == "nothing_missing":
        nothing = (
            "Nothing has changed since the reference log" if reference else "Nothing is missing"
        )
        better = f"{nothing}: no effect of the catalogue makes the model clearly better."
        return better + (
            f" The error that remains, {listed(remaining)}, can hardly be predicted from the state:"
            " it is noise, or has a cause that this log does not show."
            if remaining
            else ""
        )
    if verdict == "ambiguous":
        if not suspected:
            return f"{lacks}, but this log does not fully determine which."
        more = f"{suspected} {'more ' if sure else ''}effect{'s are' if suspected != 1 else ' is'}"
        hardly = likely < LIKELY and not sure
        most = f", with a confidence of {'at most ' * (suspected > 1)}{percent(likely)}" * hardly
        other = f"{more} suspected{most}" + (
            ", which this log cannot distinguish from others" if others else ""
        )
        if sure:
            return f"{lacks}; {other}."
        if hardly or not others:
            return f"Something may {'have changed' if reference else 'be missing'}: {other}."
        return f"Something {'has changed' if reference else 'is missing'}: {other}."
    few = "are" if suspected != 1 else "is"
    possible = (
        f" {suspected} more {few} suspected."
        if likely >= LIKELY
        else f" {suspected} more {few} possible, but more likely wrong than right."
    )
    most = f"{'up to ' * (len(remaining) > 1)}{remaining[0]}" if remaining else ""
    left = f" The error that remains, {most}, can hardly be predicted from the state."
    return f"{lacks}." + possible * bool(suspected) + left * bool(remaining)


def listed(names: Sequence[str]) -> str:
    """Return names as a list within a sentence."""
    return (
        " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
        or "some joint"
    )


def judged(relative: float) -> bool:
    """Return whether a torque error relative to the command is a meaningful number."""
    return bool(abs(relative) < MOST)


def readable(name: str) -> str:
    """Return an effect's name in readable form."""
    return " ".join(SPELLED.get(word, word) for word in name.split("_"))


def number(estimate: Estimate) -> str:
    """Return a parameter with unit and standard error.

    Up to three numbers are given each; of a longer table its range and mean error.
    """
    unit = "" if estimate.unit == "1" else f" {squared(estimate.unit)}"
    if not isinstance(estimate.value, list):
        return f"{plus_minus(estimate.value, float(np.mean(estimate.stderr)))}{unit}"
    errors = np.broadcast_to(np.array(estimate.stderr, float), len(estimate.value)).tolist()
    if len(estimate.value) <= 3:
        return (
            "("
            + ", ".join(plus_minus(v, e) for v, e in zip(estimate.value, errors, strict=True))
            + f"){unit}"
        )
    return (
        f"{_digits(min(estimate.value))} to {_digits(max(estimate.value))}{unit}, each ±"
        f" {np.mean(errors):.2g}"
    )


def plus_minus(value: float, stderr: float) -> str:
    """Return a value and its standard error.

    The error has two digits, the value as many decimals.
    """
    if not np.isfinite(value):
        return "-"
    if not (np.isfinite(stderr) and stderr > 0.0):
        return _digits(value)
    if not 1e-4 < max(abs(value), stderr) < 1e5:
        return f"{value:.3g} ± {stderr:.2g}"
    decimals = int(np.clip(1 - np.floor(np.log10(float(f"{stderr:.1e}"))), 0, 5))
    return f"{round(value, decimals) + 0.0:.{decimals}f} ± {stderr:.{decimals}f}"


def percent(share: float) -> str:
    """Return a share as a percentage with two significant digits.

    More digits appear if there are more before the point; a dash stands for a share without
    meaning.
    """
    if not judged(share):
        return "-"
    return (
        f"{100.0 * share:.0f} %"
        if abs(share) >= 0.0995
        else f"{round(100.0 * share, 4):.2g} %".replace("-0 ", "0 ")
    )


def squared(unit: str) -> str:
    """Return a unit with its exponents raised."""
    return unit.replace("^2", "²")


def _digits(value: float) -> str:
    return f"{value:.4g}"


def _numbers(finding: Finding) -> str:
    return ", ".join(f"{readable(name)} {number(p)}" for name, p in finding.parameters.items())
