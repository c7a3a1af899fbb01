"""Where the method ends, as the paper discusses: the same motion with and without a load. And the
remedy: telling the network.
"""

from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxidl.arm.setup import GOALS, ArmStudy, Load, learn_arm
from jaxidl.backend import MATMUL_PRECISION
from jaxidl.jobs.programs import Arrays, wait

NOISE = 1e-5  # of the encoders [rad]


@dataclass(frozen=True)
class Ambiguity:
    """Two laps through the same goals, the first one with a load."""

    mass: float = 2.5  # [kg]
    executions: int = 6
    seeds: tuple[int, ...] = (1, 2, 3)
    source: str = "joint"

    def study(self, informed: bool) -> ArmStudy:
        """Return the arm's study with this task; with ``informed`` the load is a network input."""
        base = ArmStudy()
        lap = len(GOALS) * base.seconds_each
        model = (
            replace(base.error_model, circumstance_scales=(self.mass,))
            if informed
            else base.error_model
        )
        return replace(
            base,
            goals=GOALS * 2,
            carried=(Load(0.0, lap, self.mass),),
            error_model=model,
            feedforward_limit=40.0,
        )


def two_laps(task: Ambiguity, informed: bool, seed: int) -> Arrays:
    """Learn on two laps, with one ``seed``.

    Returns:
        ``feedback_mse`` (K, 2) of K executions, with the load and without it [Nm^2], and which of
        them are ``finite`` (K,).
    """
    study = task.study(informed)

    @jax.jit
    def run(seed: Any) -> Any:
        with jax.default_matmul_precision(MATMUL_PRECISION):
            _, runs, finite = learn_arm(
                study, task.source, jnp.asarray(NOISE), jax.random.key(seed), task.executions
            )
            laps = runs.tau_feedback_applied.reshape(task.executions, 2, -1, runs.q.shape[-1])
            return jnp.mean(laps**2, (2, 3)), finite

    mse, finite = wait(run(seed))
    return {"feedback_mse": np.asarray(mse), "finite": np.asarray(finite)}


def identity(task: Ambiguity) -> dict[str, Any]:
    """Return all that determines a run besides the seed and whether the load is an input."""
    return {
        "arm": task.study(True).to_dict(),
        "source": task.source,
        "executions": task.executions,
        "noise": NOISE,
    }


def quick(task: Ambiguity) -> Ambiguity:
    """Return the same task for a minute's work."""
    return replace(task, executions=3, seeds=task.seeds[:1])
