"""The paper's robot experiments in simulation: every number of the arm study, in one place."""

from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxidl.arm.smoothing import zero_phase
from jaxidl.control import Doomed, Filtered, Sequence, lqr
from jaxidl.effects import (
    ActuatorDelay,
    CoulombFriction,
    Effect,
    EncoderQuantisation,
    InertiaError,
    LoadDependentFriction,
    Payload,
    SensingNoise,
    TorqueRipple,
    ViscousFriction,
)
from jaxidl.errors import one_of
from jaxidl.learning.execute import Task, desired_trajectory
from jaxidl.learning.guard import Guard
from jaxidl.learning.iterate import Setting, learn
from jaxidl.models import ErrorModel, Learner, Training
from jaxidl.systems import Plant
from jaxidl.systems.arm import JOINTS, arm, inertia, torque_limits
from jaxidl.types import Circumstances, Key, Scalar, State, Trajectory

ACCELERATIONS = ("causal", "zero_phase")
GRIP = 0.1  # [s]
Values = tuple[float, ...]

GOALS = (
    (0.6, 0.9, -0.3, 1.2, 0.4, -0.5, 0.5),
    (-0.4, 0.5, 0.4, 1.6, -0.5, -0.9, -0.6),
    (-0.8, 1.0, -0.2, 0.9, 0.6, -0.4, 0.8),
    (0.0, 0.7, 0.0, 1.4, 0.0, -0.7, 0.0),
)


class Hidden(NamedTuple):
    """What the true arm has and the modelled one has not; J = 7 values each."""

    viscous: Values = (4.0, 4.0, 2.5, 2.5, 1.2, 0.6, 0.4)  # [Nm s/rad]
    coulomb: Values = (2.0, 2.0, 1.2, 1.2, 0.6, 0.4, 0.3)  # [Nm]
    load_friction: Values = (0.04, 0.04, 0.04, 0.04, 0.03, 0.03, 0.03)  # friction over torque [-]
    # of each link, missing in the model [kg]
    mass: Values = (0.0, 0.3, -0.2, 0.25, 0.2, -0.15, 0.1)
    ripple: Values = (0.8, 0.8, 0.5, 0.5, 0.25, 0.15, 0.1)  # torque ripple [Nm]
    ripple_period: Values = (0.21, 0.23, 0.19, 0.22, 0.17, 0.2, 0.18)  # [rad]
    payload: float = 0.5  # [kg]
    payload_com: tuple[float, float, float] = (0.02, 0.0, 0.1)  # in the last link's frame [m]


class Load(NamedTuple):
    """A load that is picked up and set down; it takes ``GRIP`` to bear all its weight."""

    begin: float  # [s]
    end: float  # [s]
    mass: float  # [kg]


def carrying(plant: Plant, circumstances: Circumstances) -> Plant:
    """Return the arm with so much (1,) [kg] more on its flange."""
    more = lambda effect: (
        effect.replace(mass=effect.mass + circumstances[0])
        if isinstance(effect, Payload)
        else effect
    )
    return plant.replace(effects=tuple(map(more, plant.effects)))


@dataclass(frozen=True)
class ArmStudy:
    """What all runs on the arm share. Host-side and hashable: a static argument of jitted
    programs.
    """

    hidden: Hidden = field(default_factory=Hidden)
    goals: tuple[Values, ...] = GOALS  # joint goals one after the other [rad]
    home: Values = GOALS[-1]  # where it begins, at rest [rad]
    seconds_each: float = 0.8  # for each goal
    carried: tuple[Load, ...] = ()  # loads beside the hidden payload
    effort: float = 0.0016  # LQR's cost of acceleration: gains of about 25 1/s^2 and 7 1/s
    # DOOMED: its offset grows by rate · M_jj · acceleration error a second [1/s]
    rate: float = 60.0
    smoothing: float = 0.1  # of the learning feedback
    velocity_band: float = 80.0  # [Hz]
    acceleration_band: float = 30.0  # [Hz]
    feedforward_limit: float = 20.0  # of the error model [Nm]
    count: float = 1e-5  # of the encoders [rad]
    delay: float = 1e-3  # of the actuators [s]
    dt: float = 1e-3  # [s]
    acceleration: str = "causal"  # of the indirect data, see ACCELERATIONS
    guard: bool = False  # of the learned torques; the paper has none
    error_model: ErrorModel = field(
        default_factory=lambda: ErrorModel(
            joints=JOINTS,
            layers=(200, 100, 50, 1),
            position_scale=1.0,
            velocity_scale=1.0,
            acceleration_scale=10.0,
            torque_scale=10.0,
        )
    )
    training: Training = field(default_factory=lambda: Training(epochs=30, batch=256))

    def __post_init__(self) -> None:
        if self.acceleration not in ACCELERATIONS:
            raise one_of("acceleration", self.acceleration, ACCELERATIONS)

    def to_dict(self) -> dict[str, Any]:
        """Return all numbers, nested, ready for JSON."""
        numbers = asdict(self) | {"hidden": self.hidden._asdict()}
        if not self.guard:  # as in results from before there was one
            del numbers["guard"]
        return numbers

    @property
    def steps(self) -> int:
        """T, control steps of one execution."""
        return len(self.goals) * round(self.seconds_each / self.dt)

    def effects(self, noise: Scalar) -> tuple[Effect, ...]:
        """Return the effects hidden in the true arm; encoder noise has scale ``noise`` [rad]."""
        h = self.hidden
        v = lambda values: jnp.asarray(values, jnp.result_type(float))
        return (
            InertiaError(jnp.zeros(JOINTS), v(h.mass)),
            Payload(v(h.payload), v(h.payload_com)),
            ViscousFriction(v(h.viscous)),
            CoulombFriction(v(h.coulomb)),
            LoadDependentFriction(v(h.load_friction)),
            TorqueRipple(v(h.ripple), jnp.zeros(JOINTS), v(h.ripple_period)),
            ActuatorDelay(jnp.full(JOINTS, self.delay), steps=2),
            SensingNoise(v(noise)),
            EncoderQuantisation(v(self.count)),
        )

    def carried_mass(self) -> Float[Array, "T 1"]:
        """Return what is carried at each step (T, 1) [kg]."""
        t = jnp.arange(self.steps)[:, None] * self.dt
        shares = [
            m * jnp.clip((t - on) / GRIP, 0.0, 1.0) * jnp.clip((off - t) / GRIP, 0.0, 1.0)
            for on, off, m in self.carried
        ]
        return sum(shares, jnp.zeros_like(t))

    def task(self) -> Task:
        """Return the goals as a sequence of kinematic LQR policies."""
        each = round(self.seconds_each / self.dt)
        goals = jnp.asarray(self.goals)
        gains = lqr(goals[0], self.dt, effort=self.effort).gains
        return Task(
            start=State(jnp.asarray(self.home), jnp.zeros(JOINTS)),
            policy=Sequence(goals, jnp.arange(len(self.goals)) * each, gains),
            torque_limit=jnp.asarray(torque_limits()),
            feedforward_limit=self.feedforward_limit,
            estimator=Filtered(self.velocity_band, self.acceleration_band),
            circumstances=self.carried_mass() if self.carried else None,
            world=carrying if self.carried else None,
            dt=self.dt,
            steps=self.steps,
        )

    def law(self) -> Doomed:
        """Return DOOMED with the diagonal of the modelled inertia as the scale of each joint."""
        scale = jnp.asarray(np.mean([inertia(np.array(goal)) for goal in self.goals], axis=0))
        return Doomed(self.rate * self.dt * scale, scale, self.smoothing, gradient_smoothing=1.0)

    def setting(self, noise: Scalar) -> Setting:
        """Return everything that :func:`jaxidl.learning.iterate.learn` needs."""
        model, task = arm().plant.body, self.task()
        return Setting(
            Plant(model, self.effects(noise)), model, self.law(), task, desired_trajectory(task).q
        )


class LearnedArm(NamedTuple):
    """What K executions with the trainings between them leave."""

    learner: Learner  # of the last execution
    runs: Trajectory  # (K, T, J)
    finite: Bool[Array, " K"]  # stayed everything finite, the training before included?


def learn_arm(study: ArmStudy, source: str, noise: Scalar, key: Key, executions: int) -> LearnedArm:
    """Run K executions with trainings between them.

    ``key`` decides draws, weights and batches. Each execution begins where the encoders cannot tell
    it from the task's start.
    """
    setting, task = study.setting(noise), study.task()
    draws, starts = jax.random.split(jax.random.fold_in(key, 1_000_000))
    off = jnp.clip(jax.random.normal(starts, (executions, JOINTS)), -1.0, 1.0) * noise
    refine = partial(zero_phase, model=setting.model, task=task, band=study.acceleration_band)
    metrics, learner, runs = learn(
        setting,
        jax.random.normal(draws, (executions, study.steps, JOINTS)),
        key,
        source=source,
        error_model=study.error_model,
        training=study.training,
        train_on="sensed_state",
        record=True,
        starts=task.start.q[None] + off,
        refine=refine if study.acceleration == "zero_phase" else lambda run: run,
        guard=Guard() if study.guard else None,
    )
    assert runs is not None
    return LearnedArm(learner, runs, metrics.finite)


def feedback_mse(runs: Trajectory) -> Float[Array, " K"]:
    """Return the mean squared applied feedback (K,) [Nm^2] of each execution.

    Over steps and joints: the paper's Fig. 3.
    """
    return jnp.mean(runs.tau_feedback_applied**2, axis=(-2, -1))
