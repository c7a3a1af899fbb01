"""The whole comparison on fresh seeds: the original law, the result of gradient descent, and the
result of random search of about equal cost.
"""

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jaxtyping import Float

from jaxidl.backend import PRECISION
from jaxidl.files import as_json, markdown, write_bytes
from jaxidl.jobs import Pieces, geometric
from jaxidl.jobs.pieces import Arrays
from jaxidl.jobs.progress import Bar
from jaxidl.jobs.provenance import provenance, revision
from jaxidl.tune.problem import FACTOR, ROUNDED, SHORT, SMOOTH, Problem
from jaxidl.tune.search import (
    LONGEST,
    RATE,
    WEIGHT,
    Search,
    Trail,
    as_it_is,
    descend,
    judged,
    sample,
)


def tune(
    problem: Problem, search: Search, out: Path, *, bound: float | None = None, quiet: bool = False
) -> dict[str, Any]:
    """Search in two ways, compare, and write ``tune.json`` into ``out``.

    Finished points are kept there, and a second call continues.

    Args:
        problem: the plant and the law to tune.
        search: how much.
        out: folder.
        bound: of the mean applied feedback [N or Nm]; that of the law as it is unless given.

    Returns:
        What ``tune.json`` holds: the tuned numbers by name, the course of either search, and the
        comparison on fresh seeds.

    Raises:
        StoreError: if the folder cannot be written, or another process is at work in it.
    """
    fixed = {"smooth": SMOOTH, "rounded": ROUNDED, "short": SHORT, "factor": FACTOR}
    fixed |= {
        "weight": WEIGHT,
        "rate": RATE,
        "longest": LONGEST,
        "mode": problem.mode,
        "start": problem.start.tolist(),
    }
    fixed |= {"gradient_cost": problem.gradient_cost}
    identity = {"problem": problem.settings, "precision": PRECISION, "bound": bound}
    searched = {name: value for name, value in asdict(search).items() if name != "test_runs"}
    total = 2 * search.points(problem) + 1
    with (
        jax.enable_x64(True),
        Pieces(out / "points", identity | {"search": searched, "fixed": fixed}) as parts,
        Bar("learning runs", total * search.runs, quiet=quiet) as bar,
    ):
        tick: Callable[[int], None] = lambda runs: bar.advance(runs * search.runs)
        at = as_it_is(problem, search, parts)
        tick(1)
        limit = float(np.mean(at["effort"])) if bound is None else float(np.log(bound))
        trails = {
            "gradient": descend(problem, search, limit, parts, tick),
            "random": sample(problem, search, parts, tick),
        }
        found = {"as it is": problem.start} | {
            way: trail.logs[trail.best(limit)] for way, trail in trails.items()
        }
        fresh = {way: judged(problem, logs[None], search.test()) for way, logs in found.items()}
    costs = {"gradient": search.runs * (problem.gradient_cost + 1), "random": search.runs}
    result = {
        "problem": problem.settings,
        "search": asdict(search),
        "bound": float(np.exp(limit)),
        "numbers": {
            way: dict(zip(problem.names, np.exp(logs).tolist(), strict=True))
            for way, logs in found.items()
        },
        "course": {way: course(trail, limit, costs[way]) for way, trail in trails.items()},
        "fresh": {
            way: {name: np.exp(column[0]).tolist() for name, column in runs.items()}
            for way, runs in fresh.items()
        },
        "compared": {f"{a} / {b}": compared(fresh[a], fresh[b]) for a, b in PAIRS},
        "over_bound": mean_ratio(fresh["gradient"]["effort"][0] - limit),
        **provenance(),
        "precision": PRECISION,
        "git_revision": revision(),
    }
    write_bytes(out / "tune.json", (as_json(result) + "\n").encode())
    return result


PAIRS = (("gradient", "as it is"), ("random", "as it is"), ("gradient", "random"))


def course(trail: Trail, limit: float, each: int) -> dict[str, Any]:
    """Return error and effort of the best point after each point of a search.

    With learning runs so far, and the seconds of it all.

    Each point costs ``each`` learning runs.
    """
    best = [trail.best(limit, n) for n in range(1, 1 + len(trail.logs))]
    error, effort = (
        np.exp(column.mean(1)[best]).tolist() for column in (trail.error, trail.effort)
    )
    return {
        "runs": [each * (n + 1) for n in range(len(best))],
        "error": error,
        "effort": effort,
        "seconds": trail.seconds,
    }


def compared(a: Arrays, b: Arrays) -> dict[str, Any]:
    """Return ratios of error and effort over fresh seeds, run by run with the same draws."""
    with np.errstate(invalid="ignore"):  # where both diverged
        return {name: mean_ratio((a[name] - b[name])[0]) for name in ("error", "effort")}


def mean_ratio(logs: Float[np.ndarray, " S"]) -> dict[str, Any]:
    """Return the geometric mean of ratios given as logarithms, with its 95 % interval.

    And how many are below 1, and how many have no finite numerator.

    What is not finite is left out of mean and interval; None where fewer than two are left.
    """
    known = geometric(np.exp(logs[np.isfinite(logs)]))
    found: dict[str, Any] = {"ratio": None, "interval": None, "seeds": len(logs)}
    found |= {"wins": int((logs < 0).sum()), "not_finite": int((~(logs < np.inf)).sum())}
    if known is not None and known.interval is not None:
        found |= {"ratio": known.value, "interval": list(known.interval)}
    return found


def as_text(result: dict[str, Any]) -> str:
    """Return the comparison as a Markdown table, with a line on what it means."""
    rows = []
    for pair, numbers in result["compared"].items():
        cells = [_cell(number) for number in numbers.values()]
        error = numbers["error"]
        rows.append((pair, *cells, f"{error['wins']} of {error['seeds']}", error["not_finite"]))
    seconds = {way: course["seconds"] for way, course in result["course"].items()}
    cost = (
        f"Descent took {seconds['gradient']:.0f} s, random search {seconds['random']:.0f} s,"
        " compiling included."
    )
    heads = ("compared on fresh seeds", "position error", "applied feedback", "wins", "not finite")
    return "\n".join([markdown(heads, rows), "", verdict(result), cost])


def _cell(number: dict[str, Any]) -> str:
    if number["interval"] is None:
        return "-"
    return f"{number['ratio']:.2f} [{number['interval'][0]:.2f}, {number['interval'][1]:.2f}]"


def verdict(result: dict[str, Any]) -> str:
    """Do the tuned gains beat the law as it is, and random search, within the bound? If a run
    diverges they beat nothing.
    """

    def said(pair: str) -> str:
        error = result["compared"][pair]["error"]
        low, high = error["interval"] or (0.0, np.inf)
        better, worse = high < 1.0 and not error["not_finite"], low > 1.0
        return "better than" if better else "worse than" if worse else "not distinguishable from"

    over = result["over_bound"]["ratio"]
    keeps = (
        "within the bound on feedback"
        if over is not None and over <= 1.0
        else "but above the bound on feedback"
    )
    first, second = said("gradient / as it is"), said("gradient / random")
    return (
        f"Gains tuned by gradient are {first} the gains as they are, {keeps}, and {second} those of"
        " random search."
    )
