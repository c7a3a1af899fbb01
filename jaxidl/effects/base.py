"""What an effect is: the one interface that simulation, learning and gap finding share.

A plant is a rigid body plus a tuple of effects. Each effect is one class whose fields are its
parameters; all of its methods are pure functions of one instant of one mechanism and default to
"does nothing". So the same object

* *simulates*: the plant takes its body through ``alter``, its command through ``actuate`` (which
  may keep a hidden state that ``start`` begins), adds ``torque``, brakes by up to ``dry``, obeys
  ``holds`` and reads its encoders through ``sense``;
* *is fitted*: it is a pytree, its numeric fields are leaves with bounds and units in
  ``parameters``, where ``linear`` is not true ``guesses`` says where to begin, and
  ``true_position`` undoes what it does to the encoders;
* *is searched for*: ``variants`` are the shapes that are tried, ``prior`` how likely it is,
  ``common`` whether every fit has it, ``contains`` what is not looked for beside it, ``friction``
  whether it must dissipate, ``seen`` which command it is judged by;
* *is named*: ``name`` is the catalogue's contract, ``sentence`` says it to a person, ``advice`` how
  to tell it from others;
* *is exported*: ``to_dict``/``from_dict`` for ``effects.json``, ``mjcf`` for the attribute that
MuJoCo has for it.
"""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, ClassVar

import jax
import jax.flatten_util
import jax.numpy as jnp
import numpy as np
from flax import struct
from jax.interpreters.partial_eval import dce_jaxpr

from jaxidl.effects.spec import Guess, Motor, Parameter, Scale, Variant
from jaxidl.types import History, JointMask, Joints


class Effect(struct.PyTreeNode):
    """Base of every effect in the catalogue. Fields named in ``parameters`` are traced, the others
    are static.
    """

    name: ClassVar[str] = ""
    """The catalogue's name, one word with underscores."""
    sentence: ClassVar[str] = ""
    """The effect in plain words."""
    parameters: ClassVar[Mapping[str, Parameter]] = {}
    """Bounds, units and meaning of the traced fields, in their order."""
    linear: ClassVar[bool] = False
    """Is what it adds (torque, level of dry friction, inertia) linear in the parameters?"""
    whole: ClassVar[bool] = False
    """Does it belong to the whole mechanism rather than to a joint?"""
    mjcf: ClassVar[Mapping[str, str]] = {}
    """MJCF attribute of each parameter that has one; empty: the effect goes into
    ``effects.json``.
    """
    prior: ClassVar[float] = 0.05
    """Probability that a real geared joint has it and a nominal model lacks it; one half at most,
    or superfluous effects pay.
    """
    common: ClassVar[bool] = False
    """Does conventional identification fit it on every joint?"""
    friction: ClassVar[bool] = False
    """Must it dissipate, together with all other friction of its joint?"""
    changes: ClassVar[float] = 0.02
    """Probability that it is another one in a second log of the same machine."""
    neutral: ClassVar[float] = 0.0
    """Value of its one parameter with which an effect without amplitudes does nothing; infinite:
    none.
    """
    fixed: ClassVar[tuple[str, ...]] = ()
    """Parameters that a fit leaves where a variant has them: the ends of a table, say."""
    internal: ClassVar[tuple[str, ...]] = ()
    """Parameters that no report shows: those that ``settled`` puts into others."""
    advice: ClassVar[str] = (
        "repeat the motion slowly and fast, over the whole range, with rests, and once with a known"
        " load"
    )
    """The motion or load that would separate it from what looks alike."""

    # the class; nobody need set it
    kind: type | None = struct.field(pytree_node=False, default=None, kw_only=True, repr=False)

    def __post_init__(self) -> None:
        # To JAX two dataclasses with as many fields are the same structure, and jit may run the
        # program of one for the other; the class itself and not its name, which a cell that is run
        # again gives to another class
        object.__setattr__(self, "kind", type(self))

    def alter(self, body: Any) -> Any:
        """The rigid body that the mechanism really has, given the one it is said to have."""
        return body

    def start(self, q: Joints) -> Any:
        """Hidden state of the effect at rest at ``q`` (J,): a pytree, empty for effects without
        memory.
        """
        return ()

    def actuate(
        self, memory: Any, q: Joints, qd: Joints, tau: Joints, dt: float
    ) -> tuple[Joints, Any]:
        """Delivered torque (J,) for the command ``tau`` (J,) over one step ``dt`` [s], and the new
        hidden state.
        """
        return tau, memory

    def torque(self, q: Joints, qd: Joints, tau: Joints) -> Joints:
        """Joint torque (J,) [N or Nm] that the effect adds to the delivered torque ``tau`` (J,)."""
        return jnp.zeros_like(qd)

    def dry(self, q: Joints, qd: Joints, tau: Joints, direction: Joints) -> Joints:
        """Level (J,) >= 0 [N or Nm] of dry friction: the largest torque with which the effect
        opposes motion, or keeps from it.

        ``direction`` (J,) is the velocity that the joint would have without dry friction [m/s or
        rad/s]; where ``qd`` is zero its sign is that of the impending motion.
        """
        return jnp.zeros_like(qd)

    def holds(self, q: Joints, qd: Joints, tau: Joints) -> JointMask | Joints:
        """Which joints (J,) the effect keeps from accelerating under the delivered torque ``tau``
        (J,), or to which share [-].
        """
        return jnp.zeros(qd.shape, bool)

    def sense(self, memory: Any, q: Joints, noise: Joints) -> Joints:
        """What the encoders read (J,) at true position ``q`` (J,), given standard-normal draws
        ``noise`` (J,).
        """
        return q

    def true_position(self, q: History, dt: float) -> History:
        """True positions (T, J) behind noise-free encoder readings ``q`` (T, J) sampled every
        ``dt`` [s]: ``sense`` undone.
        """
        return q

    def seen(self, logged: History, predicted: History) -> History:
        """Command (T, J) that a fit passes through ``actuate``: of the ``logged`` one and that
        ``predicted`` for the motion.
        """
        return logged

    def settled(self) -> "Effect":
        """Return the same effect with its parameters as a person reads them; those of a fit may be
        others, say moments.
        """
        return self

    def reads_torque(self, joints: int = 1) -> bool:
        """Does what it adds on a mechanism of ``joints`` joints depend on the delivered torque?
        Found out from its methods.
        """

        def added(q: Joints, qd: Joints, tau: Joints) -> Any:
            return self.torque(q, qd, tau), self.dry(q, qd, tau, qd), self.holds(q, qd, tau)

        jaxpr = jax.make_jaxpr(added)(*(jnp.zeros(joints),) * 3).jaxpr
        return dce_jaxpr(jaxpr, [True] * len(jaxpr.outvars))[1][2]

    @classmethod
    def guesses(cls, scale: Scale) -> list[Guess]:
        """Where a fit on one joint begins: one or several sets of starting values, measured with
        the log's ``scale``.
        """
        if cls.linear:
            return [dict.fromkeys(cls.parameters, 0.0)]
        return [
            {key: float(np.sqrt(max(p.lower, 1e-6) * p.upper)) for key, p in cls.parameters.items()}
        ]

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        """Return the starting shapes in which a search tries the effect; ``scale`` is of its joint,
        or of joint 0 if ``whole``.

        By default those of ``guesses``, whose parameters are amplitudes if the effect is
        ``linear``.
        """
        return [
            Variant(guess, tuple(cls.parameters) if cls.linear else ())
            for guess in cls.guesses(scale)
        ]

    @classmethod
    def contains(cls, free: tuple[str, ...] = ()) -> tuple[str, ...]:
        """Return names of effects that it has as a part on its joint if the parameters ``free``
        are: not looked for beside it.

        ``name.parameter`` is an effect so far as only that parameter of it is free.
        """
        return ()

    @classmethod
    def alone(cls) -> bool:
        """Do its fields hold the values of one joint each, so that :class:`OnJoint` can put it on
        one?
        """
        return not cls.whole and all(f.name != "joint" for f in fields(cls))

    @classmethod
    def rigid(cls) -> bool:
        """Is all that it does to make another rigid body?"""
        rest = ("start", "actuate", "torque", "dry", "holds", "sense")
        return cls.alter is not Effect.alter and all(
            getattr(cls, name) is getattr(Effect, name) for name in rest
        )

    def write_mjcf(self, numbers: Any) -> str | None:
        """Add the effect to the attributes of a MuJoCo model, ``numbers``, and return which these
        are.

        None, with nothing changed, if MuJoCo has none for it or they cannot hold it: then it goes
        into ``effects.json``. See :class:`jaxidl.systems.attributes.Numbers`. What only alters the
        rigid body is written without further ado.
        """
        return numbers.alter(self) if self.rigid() else None

    @classmethod
    def read_mjcf(cls, numbers: Any) -> "Effect | None":
        """Return what one joint of a MuJoCo model has of this effect, given its attributes
        ``numbers``; None if nothing.
        """
        return None

    def mjcf_motor(self, motor: Motor, joint: int = 0) -> Motor | None:
        """Return MuJoCo's ``motor`` of a joint with the effect behind it; None if it then is none
        that MuJoCo has.
        """
        return motor if type(self).actuate is Effect.actuate else None

    def check(self) -> "Effect":
        """Return self, or raise :class:`EffectError` naming the parameter that is out of bounds or
        NaN.
        """
        for key, spec in self.parameters.items():
            spec.check(f"{self.name}.{key}", getattr(self, key))
        return self

    def to_dict(self) -> dict[str, Any]:
        """Name, parameters with units and static fields, ready for JSON."""
        values = {
            k: {"value": _plain(getattr(self, k)), "unit": p.unit}
            for k, p in self.parameters.items()
        }
        options = {
            f.name: getattr(self, f.name)
            for f in fields(self)
            if f.name not in (*self.parameters, "kind")
        }
        return {
            "effect": self.name,
            "sentence": self.sentence,
            "parameters": values,
            "options": options,
        }


def _plain(value: Any) -> Any:
    """A number or list of numbers that JSON has: infinity, which it has not, as the text "inf"."""
    return jax.tree.map(
        lambda x: x if np.isfinite(x) else str(x), np.asarray(value, float).tolist()
    )
