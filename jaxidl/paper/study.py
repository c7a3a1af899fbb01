"""The paper's simulation study as configurations: every number of the reference experiment, in one
place.
"""

from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from jaxidl.control import Doomed, FeedbackLaw, PdPolicy, Pid, PidGains
from jaxidl.effects import SensingNoise
from jaxidl.errors import ConfigurationError, one_of
from jaxidl.learning.execute import Task, execute
from jaxidl.learning.guard import Guard
from jaxidl.learning.iterate import Setting
from jaxidl.learning.schedule import Schedule
from jaxidl.learning.sources import TRAIN_ON
from jaxidl.models import ErrorModel, Training
from jaxidl.paper.effects import PaperFriction, paper_stiction
from jaxidl.paper.grid import CONTROLLERS
from jaxidl.systems import Plant, point_mass
from jaxidl.types import Scalar, State

GUARDS = {"off": None, "on": Guard()}
SCHEDULES = {"off": None, "on": Schedule()}
WIDTHS = ("friction_width", "stiction_width")


class Condition(NamedTuple):
    """The traced half of a configuration; scalars here, an axis more under ``vmap`` or
    ``lax.map``.
    """

    gain: Int[Array, ""] | int  # index into ``GAINS``
    noise: Scalar  # sensing noise scale σ [m]
    friction: Scalar  # friction level f [-]
    stiction: Scalar  # stiction level s [-]


@dataclass(frozen=True)
class PaperStudy:
    """What all configurations of the study share. Host-side and hashable: a static argument of
    jitted programs.

    Within a program those numbers that set no shape may be traced: :mod:`jaxidl.paper.vary`.
    """

    true_mass: Scalar = 5.0  # per axis [kg]
    modelled_mass: Scalar = 0.5  # per axis [kg]
    target: tuple[Scalar, Scalar] = (1.0, 1.0)  # [m]
    policy_gains: tuple[Scalar, Scalar] = (100.0, 10.0)  # [1/s^2, 1/s]
    torque_limit: Scalar = 5000.0  # [N]
    dt: float = 0.001  # [s]
    steps: int = 1000
    # low, high
    pid_gains: tuple[tuple[Scalar, Scalar, Scalar], ...] = ((25.0, 2.5, 0.005), (500.0, 50.0, 0.01))
    pid_learner: tuple[Scalar, Scalar, Scalar] = (500.0, 50.0, 0.01)
    doomed_rates: tuple[Scalar, ...] = (0.01, 0.2)  # low, high
    doomed_learner: Scalar = 0.5
    smoothing: Scalar = 0.1  # filter of the learning feedback
    train_on: str = "true_state"
    friction_width: float = 0.0  # of the friction's borders [m]; 0: sharp
    stiction_width: float = 0.0  # of the stiction's, as a share of each [-]; 0: sharp
    kept: int = 0  # earlier executions whose data are learned from, too, beside the last one's
    guard: str = "off"  # of the learned torques; "on" is not the paper's
    schedule: str = "off"  # of the applied gains; "on" is not the paper's
    error_model: ErrorModel = field(default_factory=ErrorModel)
    training: Training = field(default_factory=Training)  # its epochs are an axis of the grid

    def __post_init__(self) -> None:
        if self.train_on not in TRAIN_ON:
            raise one_of("train_on", self.train_on, TRAIN_ON)
        for name, known in (("guard", GUARDS), ("schedule", SCHEDULES)):
            if getattr(self, name) not in known:
                raise one_of(name, getattr(self, name), known)
        for name in ("true_mass", "dt", "torque_limit"):
            _check(name, getattr(self, name), above=0.0)
        for name in (
            "modelled_mass",
            "policy_gains",
            "pid_gains",
            "pid_learner",
            "doomed_rates",
            "doomed_learner",
            "kept",
            *WIDTHS,
        ):
            _check(name, getattr(self, name), least=0.0)
        _check("smoothing", self.smoothing, above=0.0, most=1.0)
        for coordinate in self.target:
            _check("target", coordinate, least=-1e6, most=1e6)
        if not 2 <= self.steps <= 10**6:
            raise ConfigurationError(
                "2 to 1000000 control steps", str(self.steps), "change the length of the execution"
            )

    def to_dict(self) -> dict[str, Any]:
        """Return all numbers, nested, ready for JSON; with a condition they determine a result."""
        numbers = asdict(self)
        for name in ("guard", "schedule"):
            if numbers[name] == "off":  # as in results from before there was one
                del numbers[name]
        return numbers

    def task(self) -> Task:
        rest = State(jnp.zeros(2), jnp.zeros(2))
        policy = PdPolicy(jnp.asarray(self.target), *map(jnp.asarray, self.policy_gains))
        return Task(rest, policy, jnp.asarray(self.torque_limit), dt=self.dt, steps=self.steps)

    def plant(self, condition: Condition) -> Plant:
        """Return the true system under one condition."""
        friction = PaperFriction(condition.friction, self.friction_width)
        stiction = paper_stiction(condition.stiction, self.stiction_width)
        return Plant(
            point_mass(self.true_mass), (friction, stiction, SensingNoise(condition.noise))
        )

    def law(self, controller: str, gain: Int[Array, ""] | int) -> FeedbackLaw:
        """Return the feedback law ``controller`` with the ``gain``-th of its gain settings."""
        if controller == "pid":
            applied = PidGains(*jnp.asarray(self.pid_gains)[gain])
            return Pid(applied, PidGains(*self.pid_learner), self.smoothing)
        if controller == "doomed":
            return Doomed(jnp.asarray(self.doomed_rates)[gain], self.doomed_learner, self.smoothing)
        raise one_of("controller", controller, CONTROLLERS)

    def reference(self) -> Float[Array, "T J"]:
        """Return the (T, J) positions [m] of the ideal loop: true mass, no friction or noise."""
        task, body = self.task(), point_mass(self.true_mass)
        silent = Doomed(0.0, 0.0, self.smoothing)
        return execute(Plant(body), body, silent, task, jnp.zeros((task.steps, 2))).q

    def setting(self, controller: str, condition: Condition) -> Setting:
        """Return all that :func:`jaxidl.learning.iterate.learn` needs of one configuration."""
        return Setting(
            plant=self.plant(condition),
            model=point_mass(self.modelled_mass),
            law=self.law(controller, condition.gain),
            task=self.task(),
            reference=self.reference(),
        )


def _check(
    name: str, value: Any, *, above: float = -np.inf, least: float = -np.inf, most: float = np.inf
) -> None:
    """Refuse a number out of its bounds, in tuples each; one that is traced, an axis of an
    ablation, has been checked before.
    """
    if isinstance(value, tuple):
        for part in value:
            _check(name, part, above=above, least=least, most=most)
    elif isinstance(value, int | float | np.number) and not (
        np.isfinite(value) and above < value <= most and value >= least
    ):
        lower = f"{name} > {above:g}" if above > -np.inf else f"{name} >= {least:g}"
        raise ConfigurationError(
            lower + (f" and <= {most:g}" if most < np.inf else ""), str(value), "correct it"
        )


def draw_noise(
    seed: int, executions: int, steps: int, joints: int = 2
) -> Float[np.ndarray, "K T J"]:
    """Draw the (K, T, J) standard-normal noise of a run seed: the reference program's stream.

    Iteration k draws from NumPy's legacy generator seeded with seed + 100·k, whatever the data
    source, so all sources of a run see the same noise. Seeds 100 apart therefore share draws; the
    study uses 1 to 10.
    """
    draws = [
        np.random.RandomState(seed + 100 * k).standard_normal((steps, joints))
        for k in range(executions)
    ]
    return np.stack(draws)
