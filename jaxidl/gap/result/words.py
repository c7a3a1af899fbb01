"""A diagnosis in plain language."""

from collections.abc import Sequence

import numpy as np

from jaxidl.gap.result.diagnosis import LIKELY, MUCH, Diagnosis, Estimate, Finding, Gap

FEW = 6  # most effects that a summary names
SPELLED = {"com": "centre of mass", "coulomb": "Coulomb", "stribeck": "Stribeck"}
LEAST = 5.0  # duration below which no log says much [s]
MOST = 1e4  # times the command: no command moves such a joint


def summarise(d: Diagnosis) -> str:
    """Return a few sentences: the verdict, the findings, the improvement, what is unexplained."""
    findings, gap, names = d.findings, d.gap, d.model.names
    reference = bool(d.options.get("reference"))  # findings are changes
    sure, rest = [f for f in findings if f.sure], [f for f in findings if not f.sure]
    unexplained = [names[j] for j in d.unexplained]
    said = large(gap, names), reference, bool(d.ambiguous)
    out = [d.doubt + headline(d.verdict, findings, unexplained, *said)]
    if sure:
        values = lambda f: ", ".join(f"{readable(n)} {number(p)}" for n, p in f.parameters.items())
        few = f" ({FEW} of {len(sure)})" if len(sure) > FEW else ""
        first = f", those that explain most first{few}" if len(sure) > 1 else ""
        what = "Changed" if reference else "Missing"
        what += " or, below zero, too much" if any(f.less for f in sure) and not reference else ""
        out.append(
            f"{what}{first}: " + "; ".join(f"{f.sentence}, {values(f)}" for f in sure[:FEW]) + "."
        )
    if rest:
        more = f", and {len(rest) - FEW} more" if len(rest) > FEW else ""
        out.append("Suspected: " + "; ".join(f.sentence for f in rest[:FEW]) + f"{more}.")
    known = [j for j, relative in enumerate(gap.before.torque_relative) if judged(relative)]
    if findings and known:
        error = lambda side, j: percent(side.torque_relative[j])
        changes = [f"{names[j]} {error(gap.before, j)} → {error(gap.after, j)}" for j in known]
        what = "Torque error on held-out data, relative to the command, before → after"
        out.append(f"{what}: {'; '.join(changes)}.")
    for a in d.ambiguous:
        place = lambda j: f" on {names[j]}" if j is not None else ""
        each = [readable(name) + place(j) for name, j in a.candidates]
        likelier = a.candidates[0] in {(f.name, f.joint) for f in sure}
        out.append(f"{undecided(each, likelier)} To separate them, {a.experiment}.")
    return " ".join(out)


def doubt_of(conventions: Sequence[str], stray: Sequence[str], duration: float) -> str:
    """Return what puts a whole diagnosis in doubt, as its first words; empty if nothing does.

    There are ``conventions`` that the log and the model seem not to share, ``stray`` joints that
    moved but are locked in the model, or too short a ``duration`` [s].
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
    """Return the errors that remain and are worth mentioning, with their joints, largest first."""
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

    Joints that are ``unexplained`` have a large residual; errors that are ``remaining`` are large,
    too, the largest first. With a ``reference`` log, findings are changes. What is suspected has
    ``others`` in its place, which are listed.
    """
    named, rest = [f for f in findings if f.sure], [f for f in findings if not f.sure]
    sure, suspected, less = len(named), len(rest), sum(f.less for f in named)
    likely = max((f.confidence for f in rest), default=0.0)
    effects = lambda number: f"{number} effect{'s' * (number != 1)}"
    largest = lambda errors: f"{'up to ' * (len(errors) > 1)}{errors[0]}"
    hardly = "can hardly be predicted from the state"
    lacks = " and ".join(
        [f"lacks {effects(sure - less)}"] * (sure > less or not less)
        + [f"has too much of {effects(less)}"] * (less > 0)
    )
    lacks = (
        f"{effects(sure)} {'have' if sure != 1 else 'has'} changed since the reference log"
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
            left += f" What remains besides, {largest(apart)}, {hardly}."
        return f"{left} {lacks}, named below." if sure else left
    if verdict == "nothing_missing":
        nothing = (
            "Nothing has changed since the reference log" if reference else "Nothing is missing"
        )
        better = f"{nothing}: no effect of the catalogue makes the model clearly better."
        if not remaining:
            return better
        return (
            f"{better} The error that remains, {listed(remaining)}, {hardly}: it is noise, or has a"
            " cause that this log does not show."
        )
    if verdict == "ambiguous":
        if not suspected:
            return f"{lacks}, but this log does not fully determine which."
        more = f"{suspected} {'more ' * (sure > 0)}effect{'s are' if suspected != 1 else ' is'}"
        unlikely = likely < LIKELY and not sure
        most = f", with a confidence of {'at most ' * (suspected > 1)}{percent(likely)}" * unlikely
        doubt = ", which this log cannot distinguish from others" * others
        other = f"{more} suspected{most}{doubt}"
        if sure:
            return f"{lacks}; {other}."
        if unlikely or not others:
            return f"Something may {'have changed' if reference else 'be missing'}: {other}."
        return f"Something {'has changed' if reference else 'is missing'}: {other}."
    few = "are" if suspected != 1 else "is"
    how = "suspected" if likely >= LIKELY else "possible, but more likely wrong than right"
    out = f"{lacks}." + f" {suspected} more {few} {how}." * bool(suspected)
    return f"{out} The error that remains, {largest(remaining)}, {hardly}." if remaining else out


def listed(names: Sequence[str]) -> str:
    """Return names as a list within a sentence."""
    parts = [", ".join(names[:-1]), names[-1]] if len(names) > 1 else names
    return " and ".join(parts) or "some joint"


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
        return f"({', '.join(map(plus_minus, estimate.value, errors))}){unit}"
    low, high = min(estimate.value), max(estimate.value)
    return f"{low:.4g} to {high:.4g}{unit}, each ± {np.mean(errors):.2g}"


def plus_minus(value: float, stderr: float) -> str:
    """Return a value and its standard error with two digits, the value with as many decimals."""
    if not np.isfinite(value):
        return "-"
    if not (np.isfinite(stderr) and stderr > 0.0):
        return f"{value:.4g}"
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
    if abs(share) >= 0.0995:
        return f"{100.0 * share:.0f} %"
    return f"{round(100.0 * share, 4):.2g} %".replace("-0 ", "0 ")


def squared(unit: str) -> str:
    """Return a unit with its exponents raised."""
    return unit.replace("^2", "²")
