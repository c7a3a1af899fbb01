"""The interface of an effect, shared by simulation, learning and gap finding.

A plant is a rigid body plus a tuple of effects. Each effect is one class whose fields are its
parameters; all of its methods are pure functions of one instant of one mechanism and default to
"does nothing". So the same object

* *simulates*: the plant passes its body through ``alter`` and its command through ``actuate``
  (which may keep a hidden state that ``start`` initialises), adds ``torque``, brakes by up to
  ``dry``, obeys ``holds`` and reads its encoders through ``sense``;
* *is fitted*: it is a pytree, its numeric fields are leaves with bounds and units in
  ``parameters``; where ``linear`` is false, ``guesses`` gives the starting values;
  ``true_position`` undoes what it does to the encoders;
* *is searched for*: ``variants`` are the shapes that are tried, ``prior`` is its probability,
  ``common`` says whether every fit has it, ``contains`` names the effects that are not looked for
  beside it, ``friction`` says whether it must dissipate, ``seen`` which command it is judged by;
* *is named*: ``name`` is its name in the catalogue, ``sentence`` describes it in words, ``advice``
  says how to tell it from others;
* *is exported*: ``to_dict``/``from_dict`` for ``effects.json``, ``mjcf`` for the corresponding
  attribute of MuJoCo.
"""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, ClassVar

import jax
import jax.flatten_util  # pyright: ignore[reportUnusedImport]
import jax.numpy as jnp
import numpy as np
from flax import struct
from jax.interpreters.partial_eval import dce_jaxpr

from jaxidl.effects.spec import Guess, Motor, Parameter, Scale, Variant
from jaxidl.types import History, JointMask, Joints, Scalar


class Effect(struct.PyTreeNode):
    """Base of every effect in the catalogue.

    Fields named in ``parameters`` are traced, the others are static.
    """

    name: ClassVar[str] = ""
    """The catalogue's name, one word with underscores."""
    sentence: ClassVar[str] = ""
    """The effect in plain words."""
    parameters: ClassVar[Mapping[str, Parameter]] = {}
    """Bounds, units and meaning of the traced fields, in their order."""
    linear: ClassVar[bool] = False
    """True if what it adds (torque, level of dry friction, inertia) is linear in the parameters."""
    jumps: ClassVar[bool] = False
    """True if a little noise in the motion may change what it adds by much."""
    whole: ClassVar[bool] = False
    """True if it belongs to the whole mechanism rather than to one joint."""
    mjcf: ClassVar[Mapping[str, str]] = {}
    """MJCF attribute of each parameter that has one; empty: the effect goes to ``effects.json``."""
    prior: ClassVar[float] = 0.05
    """Probability that a real geared joint has it and a nominal model lacks it.

    At most one half, otherwise superfluous effects would be rewarded.
    """
    common: ClassVar[bool] = False
    """True if conventional identification fits it on every joint."""
    friction: ClassVar[bool] = False
    """True if it must dissipate, together with all other friction of its joint."""
    changes: ClassVar[float] = 0.02
    """Probability that it differs in a second log of the same machine."""
    neutral: ClassVar[float] = 0.0
    """Value of its only parameter at which an effect without amplitudes does nothing.

    Infinite: there is none.
    """
    fixed: ClassVar[tuple[str, ...]] = ()
    """Parameters that a fit leaves at a variant's values, such as the ends of a table."""
    internal: ClassVar[tuple[str, ...]] = ()
    """Parameters that no report shows, because ``settled`` converts them into others."""
    implied: ClassVar[tuple[str, ...]] = ()
    """Amplitudes whose likely values follow from the others: no further degrees of freedom."""
    advice: ClassVar[str] = (
        "repeat the motion slowly and fast, over the whole range, with rests, and once with a known"
        " load"
    )
    """The motion or load that would tell it apart from similar effects."""

    # the class, set automatically
    kind: type | None = struct.field(pytree_node=False, default=None, kw_only=True, repr=False)

    def __post_init__(self) -> None:
        # to JAX two dataclasses with equally many fields have the same structure, and jit may run
        # the program of one for the other; the class itself rather than its name, because a
        # notebook cell that is run again gives the same name to another class
        object.__setattr__(self, "kind", type(self))

    def alter(self, body: Any) -> Any:
        """Return the mechanism's true rigid body, given the modelled one."""
        return body

    def start(self, q: Joints) -> Any:
        """Return the effect's hidden state at rest at ``q`` (J,).

        It is a pytree, empty for effects without memory.
        """
        return ()

    def actuate(
        self, memory: Any, q: Joints, qd: Joints, tau: Joints, dt: Scalar
    ) -> tuple[Joints, Any]:
        """Return the delivered torque (J,) and the new hidden state after one step ``dt`` [s].

        ``tau`` (J,) is the command. Programs serve logs of any rate: ``dt`` is a traced number, on
        which no branch in Python may depend.
        """
        return tau, memory

    def torque(self, q: Joints, qd: Joints, tau: Joints) -> Joints:
        """Return the torque (J,) [N or Nm] that it adds to the delivered torque ``tau`` (J,)."""
        return jnp.zeros_like(qd)

    def dry(self, q: Joints, qd: Joints, tau: Joints, direction: Joints) -> Joints:
        """Return the level (J,) >= 0 [N or Nm] of dry friction.

        It is the largest torque with which the effect opposes motion or prevents it. ``tau`` (J,)
        is the torque that passes the gear: what the rotor and friction that needs no load leave of
        the delivered one (:mod:`jaxidl.effects.load`). ``direction`` (J,) is the velocity that the
        joint would have without dry friction [m/s or rad/s]; where ``qd`` is zero its sign is that
        of the impending motion.
        """
        return jnp.zeros_like(qd)

    def grips(self) -> bool:
        """Return whether it has dry friction; a plant without it is simulated in less time."""
        return type(self).dry is not Effect.dry

    def holds(self, q: Joints, qd: Joints, tau: Joints) -> JointMask | Joints:
        """Return which joints (J,) the effect keeps from accelerating, or to which share [-].

        ``tau`` (J,) is the delivered torque.
        """
        return jnp.zeros(qd.shape, bool)

    def sense(self, memory: Any, q: Joints, noise: Joints) -> Joints:
        """Return what the encoders read (J,) at the true position ``q`` (J,).

        ``noise`` (J,) are standard-normal draws.
        """
        return q

    def true_position(self, q: History, dt: Scalar) -> History:
        """Return the true positions (T, J) behind noise-free encoder readings ``q`` (T, J).

        They are sampled every ``dt`` [s]. This is the inverse of ``sense``.
        """
        return q

    def seen(self, logged: History, predicted: History) -> History:
        """Return the command (T, J) that a fit passes through ``actuate``.

        It is chosen from the ``logged`` one and the one ``predicted`` for the motion.
        """
        return logged

    def settled(self) -> "Effect":
        """Return the same effect with its parameters in the form that a report shows.

        A fit may use other parameters, such as moments.
        """
        return self

    def reads_torque(self, joints: int = 1) -> bool:
        """Return whether what it adds depends on the delivered torque.

        The answer, for a mechanism of ``joints`` joints, is derived from its methods.
        """

        def added(q: Joints, qd: Joints, tau: Joints) -> Any:
            return self.torque(q, qd, tau), self.dry(q, qd, tau, qd), self.holds(q, qd, tau)

        jaxpr = jax.make_jaxpr(added)(*(jnp.zeros(joints),) * 3).jaxpr
        return dce_jaxpr(jaxpr, [True] * len(jaxpr.outvars))[1][2]

    def plus(self, other: "Effect") -> "Effect | None":
        """Return this effect and another of its class as one; None unless they are ``linear``."""
        total = {name: getattr(self, name) + getattr(other, name) for name in self.parameters}
        return self.replace(**total) if self.linear else None

    @classmethod
    def guesses(cls, scale: Scale) -> list[Guess]:
        """Return one or several sets of starting values for a fit on one joint.

        ``scale`` gives the magnitudes of the log.
        """
        if cls.linear:
            return [dict.fromkeys(cls.parameters, 0.0)]
        return [
            {key: float(np.sqrt(max(p.lower, 1e-6) * p.upper)) for key, p in cls.parameters.items()}
        ]

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        """Return the starting shapes in which a search tries the effect.

        ``scale`` is that of its joint, or of joint 0 if ``whole``. By default they are those of
        ``guesses``, whose parameters are amplitudes if the effect is ``linear``.
        """
        return [
            Variant(guess, tuple(cls.parameters) if cls.linear else ())
            for guess in cls.guesses(scale)
        ]

    @classmethod
    def contains(cls, free: tuple[str, ...] = ()) -> tuple[str, ...]:
        """Return the names of effects on its joint that it includes.

        They are those included if the parameters ``free`` are free, and are not looked for beside
        it. ``name.parameter`` is an effect to the extent that only that parameter of it is free.
        """
        return ()

    @classmethod
    def alone(cls) -> bool:
        """Return whether its fields hold the values of one joint each.

        If so, :class:`OnJoint` can put it on a single joint.
        """
        return not cls.whole and all(f.name != "joint" for f in fields(cls))

    @classmethod
    def actuates(cls) -> bool:
        """Return whether it changes what the motor delivers.

        An encoder's effect may use ``actuate``, too, to remember the motion.
        """
        encoder = cls.true_position is not Effect.true_position
        return cls.actuate is not Effect.actuate and not encoder

    @classmethod
    def rigid(cls) -> bool:
        """Return whether all that it does is to alter the rigid body."""
        rest = ("start", "actuate", "torque", "dry", "holds", "sense")
        return cls.alter is not Effect.alter and all(
            getattr(cls, name) is getattr(Effect, name) for name in rest
        )

    def write_mjcf(self, numbers: Any) -> str | None:
        """Add the effect to the attributes ``numbers`` of a MuJoCo model and return their names.

        None, with nothing changed, if MuJoCo has no attribute for it or the attributes cannot hold
        it: then it goes into ``effects.json``. See :class:`jaxidl.systems.attributes.Numbers`. An
        effect that only alters the rigid body is always written.
        """
        return numbers.alter(self) if self.rigid() else None

    @classmethod
    def read_mjcf(cls, numbers: Any) -> "Effect | None":
        """Return the part of this effect that one joint of a MuJoCo model has; None if none.

        ``numbers`` are the joint's attributes.
        """
        return None

    def mjcf_motor(self, motor: Motor, joint: int = 0) -> Motor | None:
        """Return MuJoCo's ``motor`` of a joint with the effect behind it.

        None if MuJoCo has no such motor.
        """
        return motor if type(self).actuate is Effect.actuate else None

    def check(self) -> "Effect":
        """Return self if all parameters are within their bounds.

        Raises:
            EffectError: if a parameter, which is named, is out of bounds or NaN.
        """
        for key, spec in self.parameters.items():
            spec.check(f"{self.name}.{key}", getattr(self, key))
        return self

    def to_dict(self) -> dict[str, Any]:
        """Return name, parameters with units, and static fields, ready for JSON."""
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
    """Return a number or list of numbers as JSON has it.

    JSON has no infinity, which becomes the text "inf".
    """
    return jax.tree.map(
        lambda x: x if np.isfinite(x) else str(x), np.asarray(value, float).tolist()
    )
