"""The numbers to tune: positive numbers of a feedback law, judged by learning runs on a plant."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Integer

from jaxidl.arm.setup import ArmStudy
from jaxidl.control import Doomed, FeedbackLaw, Pid, PidGains
from jaxidl.effects import EncoderQuantisation
from jaxidl.errors import ConfigurationError, one_of
from jaxidl.learning.iterate import Metrics, learn
from jaxidl.models import ErrorModel, Training
from jaxidl.paper.grid import CONTROLLERS, GAINS
from jaxidl.paper.study import Condition, PaperStudy
from jaxidl.systems.arm import JOINTS
from jaxidl.systems.free import pieces

MATMUL_PRECISION = "float32"  # as in sweeps
# of the plant that derivatives are taken on [m], [-]
SMOOTH = {"friction_width": 0.02, "stiction_width": 0.05}
ROUNDED = 0.5  # width of its networks' kinks [-]
# at most: what is unrolled longer is chaotic, and its derivative is of no use
SHORT = {"executions": 3, "epochs": 5}
FACTOR = 20.0  # a gain may become so many times larger or smaller
PLANTS = ("point_mass", "arm")
Logs = Float[Array, " P"]  # logarithms of the tuned numbers


class Outcome(NamedTuple):
    """What one learning run of K executions comes to; of several seeds with an axis more."""

    # mean log error over the executions after the first [log m or log rad]
    error: Float[Array, "..."]
    # log of the mean |applied feedback| over all executions [log N or log Nm]
    effort: Float[Array, "..."]
    finite: Bool[Array, "..."]


@dataclass(frozen=True, eq=False)
class Problem:
    """A plant with a law to tune. Host-side; :meth:`run` is pure.

    The numbers are the law's finite ones, in the order of its leaves, as logarithms: gains act by
    ratio.
    """

    settings: dict[str, Any]  # all that determines a run, ready for JSON
    law: Any  # where the search begins: a feedback law, or a tuple of numbers that make one
    # law, seed, smooth?, derivative
    learn: Callable[[Any, Integer[Array, ""], bool, str | None], Metrics]
    mode: str = "reverse"  # of derivatives: "forward" suits few numbers
    gradient_cost: int = 4  # learning runs that one gradient is worth, as measured

    @property
    def names(self) -> list[str]:
        """A name for each of the P numbers: applied.kp[0], smoothing, …"""
        out = []
        for path, leaf in self._free():
            name = jax.tree_util.keystr(path).lstrip(".")
            out += [name] if np.ndim(leaf) == 0 else [f"{name}[{j}]" for j in range(np.size(leaf))]
        return out

    def _free(self) -> list[tuple[Any, Any]]:
        return [
            (path, leaf)
            for path, leaf in jax.tree_util.tree_leaves_with_path(self.law)
            if np.isfinite(leaf).all()
        ]

    @property
    def start(self) -> Float[np.ndarray, " P"]:
        """The law's own numbers."""
        return np.log(np.concatenate([np.ravel(leaf) for _, leaf in self._free()]))

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Return lower and upper bounds (P,): a factor each way, and no filter's weight above 1."""
        upper = np.where(["smoothing" in name for name in self.names], 0.0, np.inf)
        return self.start - np.log(FACTOR), np.minimum(self.start + np.log(FACTOR), upper)

    def law_of(self, logs: Logs) -> Any:
        """Return the law with other numbers."""
        leaves, structure = jax.tree.flatten(self.law)
        own = iter(pieces(jnp.exp(logs), [np.shape(leaf) for _, leaf in self._free()]))
        return structure.unflatten(
            [next(own) if np.isfinite(leaf).all() else leaf for leaf in leaves]
        )

    def run(
        self,
        logs: Logs,
        seed: Integer[Array, ""],
        smooth: bool = False,
        derivative: str | None = None,
    ) -> Outcome:
        """Simulate one learning run.

        With ``smooth`` the short one, on the plant and with the networks that derivatives are taken
        on.
        """
        with jax.default_matmul_precision(MATMUL_PRECISION):
            metrics = self.learn(self.law_of(logs), seed, smooth, derivative)
        effort = jnp.log(jnp.mean(metrics.feedback_applied))
        return Outcome(jnp.mean(jnp.log(metrics.q_error[1:])), effort, metrics.finite.all())


def point_mass_problem(
    controller: str = "pid",
    executions: int = 4,
    epochs: int = 10,
    noise: float = 5e-4,
    source: str = "joint",
) -> Problem:
    """Return the paper's plant (friction 5, stiction 5) with its low gains to tune.

    One gain of each kind for either axis.

    Raises:
        ConfigurationError: for an unknown controller.
    """
    if controller not in CONTROLLERS:
        raise one_of("controller", controller, CONTROLLERS)
    sharp = PaperStudy(training=Training(epochs=epochs))
    short = Training(epochs=min(epochs, SHORT["epochs"]))
    blurred = replace(
        sharp, error_model=ErrorModel(activation_width=ROUNDED), training=short, **SMOOTH
    )
    condition = Condition(GAINS.index("low"), noise, 5.0, 5.0)
    each = lambda value: jnp.full(2, float(value))
    with jax.enable_x64(True):  # whatever the caller has
        law: FeedbackLaw = Doomed(each(0.01), each(0.5), 0.1, 0.9)
        if controller == "pid":
            applied, learner = (
                PidGains(*map(each, gains)) for gains in (sharp.pid_gains[0], sharp.pid_learner)
            )
            law = Pid(applied, learner, 0.1)

    def run(law: FeedbackLaw, seed: Array, smooth: bool, derivative: str | None) -> Metrics:
        study = blurred if smooth else sharp
        key = jax.random.key(seed)
        count = min(executions, SHORT["executions"]) if smooth else executions
        draws = jax.random.normal(jax.random.fold_in(key, 1_000_000), (count, study.steps, 2))
        setting = study.setting(controller, condition).replace(law=law)
        how: dict[str, Any] = {
            "error_model": study.error_model,
            "training": study.training,
            "derivative": derivative,
        }
        return learn(setting, draws, key, source=source, **how)[0]

    sizes = {"executions": executions, "epochs": epochs, "noise": noise, "source": source}
    return Problem(
        {"plant": "point_mass", "controller": controller, **sizes, "study": sharp.to_dict()},
        law,
        run,
    )


class ArmGains(NamedTuple):
    """What is tuned on the arm: DOOMED's numbers for all joints together."""

    rate: float = 1.0  # times the study's
    learner_gain: float = 1.0  # times the study's
    smoothing: float = 0.1


def arm_problem(
    executions: int = 3, epochs: int = 8, noise: float = 1e-5, source: str = "joint"
) -> Problem:
    """Return the seven-joint arm under DOOMED: one motion of 0.8 s.

    Derivatives are taken in forward mode (reverse mode through its rigid body takes XLA many
    minutes to compile), and without the encoders' counts, through which a loop has no derivative.
    """
    study = ArmStudy(
        seconds_each=0.8, goals=ArmStudy().goals[:1], training=Training(epochs=epochs, batch=256)
    )
    law = study.law()
    short = Training(epochs=min(epochs, SHORT["epochs"]), batch=256)
    rounded = replace(study.error_model, activation_width=ROUNDED)

    def run(gains: ArmGains, seed: Array, smooth: bool, derivative: str | None) -> Metrics:
        own = {"rate": law.rate * gains.rate, "learner_gain": law.learner_gain * gains.learner_gain}
        setting = study.setting(noise).replace(law=law.replace(**own, smoothing=gains.smoothing))
        key, count = (
            jax.random.key(seed),
            min(executions, SHORT["executions"]) if smooth else executions,
        )
        draws = jax.random.normal(jax.random.fold_in(key, 1_000_000), (count, study.steps, JOINTS))
        how: dict[str, Any] = {"error_model": study.error_model, "training": study.training}
        if smooth:
            how = {"error_model": rounded, "training": short}
            plant = setting.plant
            without = tuple(
                effect for effect in plant.effects if not isinstance(effect, EncoderQuantisation)
            )
            setting = setting.replace(plant=plant.replace(effects=without))
        return learn(
            setting,
            draws,
            key,
            source=source,
            train_on="sensed_state",
            derivative=derivative,
            **how,
        )[0]

    sizes = {"executions": executions, "epochs": epochs, "noise": noise, "source": source}
    settings = {
        "plant": "arm",
        "controller": "doomed",
        **sizes,
        "study": study.to_dict(),
        "smooth": "without counts",
    }
    return Problem(
        settings, ArmGains(smoothing=study.smoothing), run, mode="forward", gradient_cost=12
    )


def problem(plant: str, controller: str | None = None, **sizes: Any) -> Problem:
    """Return the problem of that name.

    Raises:
        ConfigurationError: for an unknown plant, or a controller that it has not.
    """
    if plant not in PLANTS:
        raise one_of("plant", plant, PLANTS)
    if plant == "point_mass":
        return point_mass_problem(controller or "pid", **sizes)
    if controller not in (None, "doomed"):
        raise ConfigurationError("doomed on the arm", repr(controller), "leave --controller out")
    return arm_problem(**sizes)
