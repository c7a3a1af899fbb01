"""A learned controller as text of one C99 file and its header.

The program does in every control step what :func:`jaxidl.learning.execute.execute` does: rigid body
and effects within the torque limit, the networks' torque within its limits and faded by the guard,
and feedback from the estimated motion. Nothing is allocated, no loop depends on the data, and the
only state is a structure that the caller owns.
"""

import re
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxidl.control import Estimator, FeedbackLaw
from jaxidl.errors import ConfigurationError
from jaxidl.learning.execute import Task
from jaxidl.learning.guard import Region
from jaxidl.models import ErrorModel, Params
from jaxidl.robot.c import body, effects, feedback, networks, program
from jaxidl.robot.c.header import header as header_of
from jaxidl.robot.c.text import commented, helpers, number, table
from jaxidl.systems import Plant, RigidBody
from jaxidl.types import Joints, Scalar

_KEYWORDS = frozenset(
    "auto break case char const continue default do double else enum extern float for goto if"  # noqa: SIM905
    " inline int long register restrict return short signed sizeof static struct switch typedef"
    " union unsigned void volatile while class delete new template this".split()
)


class Code(NamedTuple):
    """The two files' texts."""

    header: str
    source: str


@dataclass(frozen=True, eq=False)
class Controller:
    """What is written as C: all that an execution computes but the policy and the plant.

    J joints.
    """

    model: RigidBody | Plant  # the modelled rigid body, or a corrected model with its effects
    law: FeedbackLaw | None  # None: the robot has feedback of its own
    estimator: Estimator
    joints: tuple[str, ...]  # names (J,)
    dt: float  # control step [s]
    torque_limit: Joints | Scalar  # of each of feedback, rigid body and networks [N or Nm]
    feedforward_limit: Joints | Scalar  # of the networks [N or Nm]
    error_model: ErrorModel | None = None
    params: Params | None = None  # its weights; None: nothing was learned
    region: Region | None = None  # of the guard, if there is one

    @classmethod
    def of(
        cls,
        task: Task,
        model: RigidBody | Plant,
        law: FeedbackLaw | None,
        joints: tuple[str, ...],
        error_model: ErrorModel | None = None,
        params: Params | None = None,
        region: Region | None = None,
    ) -> "Controller":
        """Return the controller of a task's executions: limits, estimator and step are its own."""
        return cls(
            model,
            law,
            task.estimator,
            joints,
            task.dt,
            task.torque_limit,
            task.feedforward_limit,
            error_model,
            params,
            region,
        )

    def __post_init__(self) -> None:
        count = len(self.joints)
        if not count:
            raise ConfigurationError("at least one joint", "none", "name the joints")
        if self.error_model is not None and self.error_model.joints != count:
            raise ConfigurationError(
                f"an error model of {count} joints",
                f"{self.error_model.joints}",
                "train one for this robot",
            )
        if (self.error_model is None) != (self.params is None):
            raise ConfigurationError(
                "an error model and its weights, or neither", "one of them", "give both"
            )
        if not 0.0 < self.dt < np.inf:
            raise ConfigurationError("dt > 0 (s)", str(self.dt), "correct the time step")
        for name in ("torque_limit", "feedforward_limit"):
            if not np.all(np.asarray(getattr(self, name)) >= 0.0):  # NaN fails too
                raise ConfigurationError(
                    f"{name} >= 0", str(np.asarray(getattr(self, name)).tolist()), "correct it"
                )

    @property
    def single(self) -> bool | None:
        """Whether the networks are computed in single precision; None: there are none."""
        leaves = jax.tree.leaves(self.params)
        return bool(leaves[0].dtype == jnp.float32) if leaves else None


def generate(controller: Controller, name: str, source: str) -> Code:
    """Return a controller as C99.

    Args:
        controller: what to write.
        name: prefix of all that the header declares, and of both files' names.
        source: the model and revision that the numbers come from, a line or several; both files
            begin with it.

    Raises:
        ConfigurationError: for a name that C does not allow, or for a part of the controller that
            has no C: a body, an effect, a feedback law or an estimator. It says which.
    """
    if not re.fullmatch(r"[a-zA-Z][a-zA-Z0-9_]{0,40}", name) or name in _KEYWORDS:
        raise ConfigurationError(
            "a name of letters, digits and underscores that begins with a letter and is no word of"
            " C",
            repr(name),
            "choose another --name",
        )
    with jax.enable_x64(True):
        return _generate(controller, name, source)


def _generate(own: Controller, name: str, source: str) -> Code:
    joints = len(own.joints)
    given = own.model.effects if isinstance(own.model, Plant) else ()
    bare = own.model.body if isinstance(own.model, Plant) else own.model
    _check_joints(bare, joints)
    for effect in given:
        bare = effect.alter(bare)
    estimator, law = feedback.estimator(own.estimator, own.dt), feedback.law(own.law, joints)
    added = effects.effects(given, np.asarray(bare.armature))
    model = own.error_model
    circumstances = len(model.circumstance_scales) if model else 0
    limits = table("torque_limit", feedback.each(own.torque_limit, joints), "[Nm or N]")
    learned = ""
    if model is not None:
        learned = networks.learned(model, own.params, own.region)
        bound = feedback.each(own.feedforward_limit, joints)
        limits += table("learned_limit", bound, "of the networks' torque [Nm or N]")
    sections = [
        ("Limits, estimator and feedback law", limits + estimator.tables + law.tables),
        ("Rigid body", body.rigid_body(bare)),
        ("Effects of the corrected model", added),
        ("Networks", learned),
        (
            "A control step",
            program.step(
                name,
                has_effects=bool(added),
                has_networks=bool(learned),
                circumstances=circumstances,
                region=own.region,
                estimate=estimator.code[0],
                act=law.code[0],
                observe=law.code[1],
            ),
        ),
    ]
    text = "\n".join(f"{program.rule(title)}\n{part}" for title, part in sections if part)
    about = "\n".join(f" * {commented(line)}" for line in source.splitlines())
    names = ", ".join(map(commented, own.joints))
    memory = (*estimator.memory, *law.memory)
    times = number(own.dt), number(estimator.lag)
    header = header_of(name, about, names, joints, *times, circumstances, memory)
    opening = program.opening(name, about, own.single)
    return Code(header, f"{opening}\n{helpers(text)}\n{text}")


def _check_joints(bare: RigidBody, joints: int) -> None:
    zero = jax.ShapeDtypeStruct((joints,), jnp.zeros(0).dtype)
    try:
        shape = jax.eval_shape(bare.inverse_dynamics, zero, zero, zero).shape
    except (TypeError, ValueError, IndexError):
        shape = None
    if shape != (joints,):
        raise ConfigurationError(
            f"a rigid body of {joints} joints", "another number", "name the joints of this body"
        )
