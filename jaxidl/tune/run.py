"""The whole comparison: the law as it is, what descent finds, what random search of equal cost finds, on fresh seeds."""

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jaxtyping import Float
from scipy import stats

from jaxidl.files import write_bytes
from jaxidl.sweep.launch import progress_bar
from jaxidl.sweep.parts import Arrays, Parts
from jaxidl.sweep.provenance import PRECISION, provenance, revision
from jaxidl.tune.problem import FACTOR, ROUNDED, SHORT, SMOOTH, Problem
from jaxidl.tune.search import LONGEST, RATE, WEIGHT, Search, Trail, descend, judged, sample

WAYS = ("gradient", "random")


def tune(problem: Problem, search: Search, out: Path, *, bound: float | None = None, quiet: bool = False) -> dict[str, Any]:
    """Search twice, compare, and write ``tune.json`` into ``out``; finished points are kept there, and a second call continues.

    Args:
        problem: the plant and the law to tune.
        search: how much.
        out: folder.
        bound: of the mean applied feedback [N or Nm]; that of the law as it is unless given.

    Returns:
        What ``tune.json`` holds: the tuned numbers by name, the course of either search, and the comparison on fresh seeds.

    Raises:
        StoreError: if the folder cannot be written, or another process is at work in it.
    """
    fixed = {"smooth": SMOOTH, "rounded": ROUNDED, "short": SHORT, "factor": FACTOR}
    fixed |= {"weight": WEIGHT, "rate": RATE, "longest": LONGEST}
    identity = {"problem": problem.settings, "precision": PRECISION, "bound": bound}
    searched = {name: value for name, value in asdict(search).items() if name != "test_seeds"}
    total = 2 * search.points + 1
    with (
        jax.enable_x64(True),
        Parts(out / "points", identity | {"search": searched, "fixed": fixed}) as parts,
        progress_bar(quiet) as bar,
    ):
        task = bar.add_task("learning runs", total=total * search.seeds, count="")
        tick: Callable[[int], None] = lambda runs: bar.update(task, advance=runs * search.seeds)  # noqa: E731
        at = judged(problem, problem.start[None], search.train())
        limit = float(np.mean(at["effort"])) if bound is None else float(np.log(bound))
        trails = {"gradient": descend(problem, search, limit, parts, tick), "random": sample(problem, search, parts, tick)}
        found = {"as it is": problem.start} | {way: trail.logs[trail.best(limit)] for way, trail in trails.items()}
        fresh = {way: judged(problem, logs[None], search.test()) for way, logs in found.items()}
    result = {
        "problem": problem.settings,
        "search": asdict(search),
        "bound": float(np.exp(limit)),
        "numbers": {way: dict(zip(problem.names, np.exp(logs).tolist(), strict=True)) for way, logs in found.items()},
        "course": {way: course(trail, limit, search) for way, trail in trails.items()},
        "fresh": {way: {name: np.exp(column[0]).tolist() for name, column in runs.items()} for way, runs in fresh.items()},
        "compared": {f"{a} / {b}": compared(fresh[a], fresh[b]) for a, b in PAIRS},
        "over_bound": mean_ratio(fresh["gradient"]["effort"][0] - limit),
        **provenance(),
        "git_revision": revision(),
    }
    write_bytes(out / "tune.json", (json.dumps(result, indent=1) + "\n").encode())
    return result


PAIRS = (("gradient", "as it is"), ("random", "as it is"), ("gradient", "random"))


def course(trail: Trail, limit: float, search: Search) -> dict[str, Any]:
    """After each point of a search: learning runs so far, error and effort of the best point until then; seconds of it all."""
    each = search.seeds * (search.gradient_cost + 1 if len(trail.logs) == search.steps else 1)
    best = [trail.best(limit, n) for n in range(1, 1 + len(trail.logs))]
    error, effort = (np.exp(column.mean(1)[best]).tolist() for column in (trail.error, trail.effort))
    return {"runs": [each * (n + 1) for n in range(len(best))], "error": error, "effort": effort, "seconds": trail.seconds}


def compared(a: Arrays, b: Arrays) -> dict[str, Any]:
    """Ratios of error and effort over fresh seeds, run by run with the same draws."""
    return {name: mean_ratio((a[name] - b[name])[0]) for name in ("error", "effort")}


def mean_ratio(logs: Float[np.ndarray, " S"]) -> dict[str, Any]:
    """Geometric mean of ratios given as logarithms, its 95 % interval, how many are below 1; what is not finite left out."""
    known = logs[np.isfinite(logs)]
    half = stats.t.ppf(0.975, len(known) - 1) * known.std(ddof=1) / np.sqrt(len(known)) if len(known) > 1 else np.nan
    low, middle, high = (float(np.exp(known.mean() + side * half)) for side in (-1, 0, 1))
    return {"ratio": middle, "interval": [low, high], "seeds": len(known), "wins": int((known < 0).sum())}


def as_text(result: dict[str, Any]) -> str:
    """The comparison as a Markdown table, with what it means in a line."""
    lines = ["| compared on fresh seeds | position error | applied feedback | wins |", "| --- | --- | --- | --- |"]
    for pair, numbers in result["compared"].items():
        cells = [f"{n['ratio']:.2f} [{n['interval'][0]:.2f}, {n['interval'][1]:.2f}]" for n in numbers.values()]
        lines.append(f"| {pair} | {' | '.join(cells)} | {numbers['error']['wins']} of {numbers['error']['seeds']} |")
    return "\n".join([*lines, "", verdict(result)])


def verdict(result: dict[str, Any]) -> str:
    """Do the tuned gains beat the law as it is, and random search, within the bound?"""

    def said(pair: str) -> str:
        low, high = result["compared"][pair]["error"]["interval"]
        return "better than" if high < 1.0 else "worse than" if low > 1.0 else "not told apart from"

    keeps = "within the bound on feedback" if result["over_bound"]["interval"][0] <= 1.0 else "but above the bound on feedback"
    first, second = said("gradient / as it is"), said("gradient / random")
    return (
        f"Gains tuned by gradient are {first} the gains as they are, {keeps}, and {second} those of random search of equal cost."
    )
