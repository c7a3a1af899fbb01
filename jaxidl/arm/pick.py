"""Pick and place: the arm lifts a tool at one place and sets it down at another, as compliant as it
can just be.
"""

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxidl.arm.setup import ArmStudy, Hidden, Load, learn_arm
from jaxidl.backend import MATMUL_PRECISION, compiler_options
from jaxidl.errors import ConfigurationError
from jaxidl.jobs.programs import Arrays, wait
from jaxidl.learning.execute import desired_trajectory, execute
from jaxidl.systems.arm import JOINTS, flange, reach

# of the flange when the tool stands on the table [m]
PICK, PLACE = np.array([0.50, -0.25, 0.12]), np.array([0.45, 0.30, 0.12])
ABOVE = np.array([0.0, 0.0, 0.2])  # [m]
NEAR = np.array([-0.4, 0.6, 0.0, 1.4, 0.0, -1.1, 0.0])  # a pose with the elbow up [rad]
RATES = tuple(float(2.0 ** (k / 2)) for k in range(13))  # of DOOMED, 1 to 64 [1/s]
LIFTED = 0.5  # of the way up: what counts as lifting
NOISE = 1e-5  # of the encoders [rad]
EVERY = 20  # steps between the stored instants


@dataclass(frozen=True)
class PickAndPlace:
    """The task: down to the tool, up, over, down, up again."""

    mass: float = 2.5  # of the tool [kg]
    seconds_each: float = 1.0
    executions: int = 3
    seeds: tuple[int, ...] = (1, 2, 3)

    def study(self, rate: float) -> ArmStudy:
        """Return the arm's study with this task and a DOOMED of this learning ``rate`` [1/s]."""
        start, pick, over, place = map(_pose, poses())
        held = Load(self.seconds_each, 4.0 * self.seconds_each, self.mass)
        return ArmStudy(
            hidden=Hidden(payload=0.0, payload_com=(0.0, 0.0, 0.12)),
            goals=(pick, start, over, place, over),
            home=start,
            seconds_each=self.seconds_each,
            carried=(held,),
            rate=rate,
        )


@cache
def poses() -> tuple[np.ndarray, ...]:
    """Return joint positions (7,) [rad] above the pick, at it, above the place, at it."""
    start = reach(PICK + ABOVE, NEAR)
    over = reach(PLACE + ABOVE, start)
    return start, reach(PICK, start), over, reach(PLACE, over)


def _pose(q: np.ndarray) -> tuple[float, ...]:
    return tuple(float(x) for x in q)


def lowest(found: Arrays) -> float:
    """Return the lowest rate that lifts the tool, of those that :func:`lifting_rates` tried.

    Raises:
        ConfigurationError: if none does.
    """
    enough = found["rates"][found["lifted"] >= LIFTED]
    if not len(enough):
        most = f"{found['rates'].max():g}"
        raise ConfigurationError(
            f"a tool that a rate of {most} lifts", "a heavier one", "take a lighter tool"
        )
    return float(enough.min())


def lifting_rates(task: PickAndPlace) -> Arrays:
    """Try learning ``rates`` (R,) of DOOMED without an error model.

    Returns how far up the way each has ``lifted`` (R,) the tool at the end of the lift [-].
    """
    study = task.study(1.0)
    end = round(2 * task.seconds_each / study.dt)

    def first(rate: Any) -> Any:
        setting, whole = study.setting(NOISE), study.law()
        law = whole.replace(rate=whole.rate * rate)
        draws = jax.random.normal(jax.random.key(0), (study.steps, JOINTS))
        return execute(setting.plant, setting.model, law, setting.task, draws).q

    q = wait(
        jax.jit(lambda rates: jax.lax.map(first, rates), compiler_options=compiler_options())(
            jnp.array(RATES)
        )
    )
    heights = flange(np.asarray(q[:, end - 1]))[:, 2]
    return {"rates": np.array(RATES), "lifted": (heights - PICK[2]) / ABOVE[2]}


def pick_and_place(task: PickAndPlace, rate: float, source: str, seed: int) -> Arrays:
    """Learn pick and place on data of one ``source``, with one ``seed``.

    There are ``task.executions`` executions, and a training between each two.

    Returns:
        Of K executions: ``feedback_mse`` (K,) [Nm^2], mean and largest ``path_error``,
        ``path_peak`` (K,) of the flange [m]; which of them are ``finite`` (K,); joint positions
        ``q`` (K, T, J) and the desired ones ``wanted`` (T, J) every ``EVERY``-th step [rad].
    """
    study = task.study(rate)

    @jax.jit
    def run(seed: Any) -> Any:
        with jax.default_matmul_precision(MATMUL_PRECISION):
            _, runs, finite = learn_arm(
                study, source, jnp.asarray(NOISE), jax.random.key(seed), task.executions
            )
            wanted = desired_trajectory(study.task()).q[::EVERY]
            return (
                runs.q[:, ::EVERY],
                jnp.mean(runs.tau_feedback_applied**2, (1, 2)),
                wanted,
                finite,
            )

    q, mse, wanted, finite = (np.asarray(x) for x in wait(run(seed)))
    off = np.linalg.norm(flange(q) - flange(wanted), axis=-1)
    sizes = {"feedback_mse": mse, "path_error": off.mean(1), "path_peak": off.max(1)}
    return sizes | {"finite": finite, "q": q, "wanted": wanted}


def identity(task: PickAndPlace, rate: float) -> dict[str, Any]:
    """Return all that determines a run at a ``rate`` besides source and seed."""
    of = {"arm": task.study(rate).to_dict(), "executions": task.executions, "noise": NOISE}
    return of | {"rates": RATES, "every": EVERY, "pick": PICK.tolist(), "place": PLACE.tolist()}


def quick(task: PickAndPlace) -> PickAndPlace:
    """Return the same task for a minute's work."""
    return replace(task, executions=2, seeds=task.seeds[:1])
