"""Gradient descent on learning runs, and random search that may cost as much.

Both look for the numbers of a law with the lowest tracking error after learning whose feedback
effort stays within a bound: the compliance that should not be given up. Both are judged by
the same runs on the true plant with the paper's networks; gradients are taken on its smooth form
(:data:`jaxidl.tune.problem.SMOOTH`) and a shorter run, where they predict the effect of a change: a
learning run of four executions with ten epochs between them is chaotic, and its derivatives are of
size 1e4 to 1e10.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Integer

from jaxidl.errors import ConfigurationError
from jaxidl.jobs import Pieces
from jaxidl.jobs.programs import Arrays, mapped, wait
from jaxidl.models.training import adam
from jaxidl.tune.problem import Outcome, Problem

WEIGHT = 30.0  # of the squared log excess over the bound in what is descended
RATE = 0.12  # of Adam, in log units a step
LONGEST = 1.0  # norm that one seed's gradient counts with at most: learning runs have cliffs
BATCH = 8  # points of random search in a piece


@dataclass(frozen=True)
class Search:
    """How much is searched; what it costs is counted in learning runs."""

    steps: int = 30  # of gradient descent
    runs: int = 4  # learning runs that judge a point
    test_runs: int = 20  # fresh ones that compare what was found
    root: int = 1  # of all their seeds

    def __post_init__(self) -> None:
        for name, least in (("steps", 1), ("runs", 1), ("test_runs", 2), ("root", 0)):
            if getattr(self, name) < least:
                raise ConfigurationError(
                    f"{name} >= {least}", str(getattr(self, name)), "correct it"
                )

    def points(self, problem: Problem) -> int:
        """Return how many points of random search cost as much as the descent.

        Each step of the descent is one gradient and one judgement.
        """
        return self.steps * (problem.gradient_cost + 1)

    def train(self) -> Integer[np.ndarray, " S"]:
        """Return seeds below 2^30 that points are judged by."""
        return np.random.default_rng([self.root, 0]).integers(
            2**30, size=self.runs, dtype=np.uint32
        )

    def test(self) -> Integer[np.ndarray, " S"]:
        """Return seeds from 2^30 on that compare the gains found."""
        return np.random.default_rng([self.root, 1]).integers(
            2**30, 2**31, size=self.test_runs, dtype=np.uint32
        )


@dataclass
class Trail:
    """Points (N, P) as logarithms, with error and effort of each seed (N, S), in the order in which
    they were tried.
    """

    logs: Float[np.ndarray, "N P"]
    error: Float[np.ndarray, "N S"]
    effort: Float[np.ndarray, "N S"]
    seconds: float = 0.0  # that all of it took, compiling included

    def best(self, bound: float, upto: int | None = None) -> int:
        """Return the point of lowest mean error within ``bound`` (log), or the nearest to it."""
        error, over = self.error[:upto].mean(1), np.maximum(self.effort[:upto].mean(1) - bound, 0.0)
        return int(np.lexsort((error, over))[0])


def descend(
    problem: Problem, search: Search, bound: float, parts: Pieces, tick: Callable[[int], None]
) -> Trail:
    """Descend by projected Adam on error + WEIGHT · max(0, effort − limit)².

    Both are logarithms, of the smooth form.

    Its limit is as far from its effort at the beginning as ``bound`` is from the true plant's.
    """
    logs, seeds, limit = problem.start, search.train(), np.inf
    low, high = problem.bounds()
    optimiser = adam(RATE)
    state = optimiser.init(jnp.asarray(logs))
    rows: list[Arrays] = []
    for number in range(search.steps):
        name = f"gradient-{number:03d}"
        piece = parts.load(name)
        if piece is None:
            began = time.monotonic()
            slopes, smooth = map(np.asarray, wait(gradients(problem)(logs, seeds, limit)))
            piece = {
                "logs": logs,
                "slopes": slopes,
                "smooth": smooth,
                **judged(problem, logs[None], seeds),
            }
            piece["seconds"] = np.array(time.monotonic() - began)
            parts.save(name, piece)
        if number == 0:
            limit = float(np.mean(piece["smooth"]) + bound - np.mean(piece["effort"]))
        tick(problem.gradient_cost + 1)
        rows.append(piece)
        updates, state = optimiser.update(jnp.asarray(direction(piece["slopes"])), state)
        logs = np.clip(piece["logs"] + np.asarray(updates), low, high)
    return _trail(np.stack([row["logs"] for row in rows]), rows)


def _trail(logs: Float[np.ndarray, "N P"], rows: list[Arrays]) -> Trail:
    joined = (np.concatenate([row[name] for row in rows]) for name in ("error", "effort"))
    return Trail(logs, *joined, seconds=round(float(sum(row["seconds"] for row in rows)), 1))


def direction(slopes: Float[np.ndarray, "S P"]) -> Float[np.ndarray, " P"]:
    """Return the mean over seeds of gradients no longer than LONGEST.

    A gradient that is not finite counts as zero.
    """
    slopes = np.where(np.isfinite(slopes).all(1, keepdims=True), slopes, 0.0)
    norm = np.linalg.norm(slopes, axis=1, keepdims=True)
    return np.mean(slopes * np.minimum(1.0, LONGEST / np.maximum(norm, 1e-12)), axis=0)


def sample(problem: Problem, search: Search, parts: Pieces, tick: Callable[[int], None]) -> Trail:
    """Search at random: the law as it is, then points drawn evenly between the bounds."""
    low, high = problem.bounds()
    draws = np.random.default_rng(search.root).uniform(
        low, high, (search.points(problem), len(low))
    )
    draws[0] = problem.start
    rows: list[Arrays] = []
    for begin in range(0, len(draws), BATCH):
        name, points = f"random-{begin:05d}", draws[begin : begin + BATCH]
        piece = parts.load(name)
        if piece is None:
            began = time.monotonic()
            piece = judged(problem, points, search.train())
            piece["seconds"] = np.array(time.monotonic() - began)
            parts.save(name, piece)
        tick(len(points))
        rows.append(piece)
    return _trail(draws, rows)


def as_it_is(problem: Problem, search: Search, parts: Pieces) -> Arrays:
    """Judge the law as it is; the result is kept, since it sets the bound."""
    piece = parts.load("start")
    if piece is None:
        piece = judged(problem, problem.start[None], search.train())
        parts.save("start", piece)
    return piece


def judged(
    problem: Problem, points: Float[np.ndarray, "N P"], seeds: Integer[np.ndarray, " S"]
) -> Arrays:
    """Return error and effort (N, S) on the true plant; infinite for runs that diverged."""
    shape = (len(points), len(seeds))
    pairs = np.repeat(points, len(seeds), axis=0), np.tile(seeds, len(points))
    found: Outcome = jax.tree.map(np.asarray, wait(values(problem)(*pairs)))
    error, effort = (
        np.where(found.finite, x, np.inf).reshape(shape) for x in (found.error, found.effort)
    )
    return {"error": error, "effort": effort}


@cache
def values(problem: Problem) -> Callable[..., Any]:
    """Return a compiled function: points (N, P) and seeds (N,) -> outcomes (N,)."""
    return _spread(lambda logs, seed: problem.run(logs, seed))


@cache
def gradients(problem: Problem) -> Callable[..., Any]:
    """Return a compiled function of one point (P,), seeds (S,) and a limit.

    It returns gradients (S, P) of each seed's penalised error, and its effort (S,).
    """

    def penalised(logs: Any, seed: Any, limit: Any) -> Any:
        out = problem.run(logs, seed, True, problem.mode)
        return out.error + WEIGHT * jnp.maximum(out.effort - limit, 0.0) ** 2, out.effort

    each = _spread((jax.jacfwd if problem.mode == "forward" else jax.grad)(penalised, has_aux=True))
    return lambda logs, seeds, limit: each(
        np.tile(logs, (len(seeds), 1)), seeds, np.full(len(seeds), limit)
    )


def _spread(one: Callable[..., Any]) -> Callable[..., Any]:
    """``one`` mapped over the rows of its arguments, shared out over all devices; padded to a
    multiple of them.
    """
    devices = len(jax.devices())
    program = mapped(lambda row: one(*row), devices)

    def call(*rows: Any) -> Any:
        count = len(rows[0])
        padded = tuple(
            np.concatenate([row, np.repeat(row[-1:], -count % devices, axis=0)]) for row in rows
        )
        return jax.tree.map(lambda leaf: leaf[:count], program(padded))

    return call
