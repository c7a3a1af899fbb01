"""An effect of the catalogue on one joint only."""

from collections.abc import Iterable
from typing import Any

import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Array, Float, Int

from jaxidl.effects.base import Effect
from jaxidl.effects.spec import Motor, Variant
from jaxidl.errors import EffectError
from jaxidl.types import History, JointMask, Joints, Scalar

Own = Float[Array, "1"]  # of the one joint


class _Part:
    """The body as seen by one joint: inertia added to it goes to that joint."""

    def __init__(self, body: Any, joint: int | Int[Array, ""], like: Joints):
        self.body, self.joint, self.like = body, joint, like

    def _spread(self, extra: Own | Scalar) -> Joints:
        return jnp.zeros_like(self.like).at[self.joint].set(jnp.reshape(jnp.asarray(extra), ()))

    def add_inertia(self, extra: Own) -> "_Part":
        return _Part(self.body.add_inertia(self._spread(extra)), self.joint, self.like)

    def add_link(self, extra: Float[Array, "1 10"]) -> "_Part":
        spread = jnp.zeros((self.like.shape[0], 10)).at[self.joint].set(extra[0])
        return _Part(self.body.add_link(spread), self.joint, self.like)

    def add_mass(self, extra: Own | Scalar) -> "_Part":
        return _Part(self.body.add_mass(self._spread(extra)), self.joint, self.like)

    def add_moment(self, extra: Float[Array, "1 3"]) -> "_Part":
        spread = jnp.zeros((self.like.shape[0], 3)).at[self.joint].set(extra[0])
        return _Part(self.body.add_moment(spread), self.joint, self.like)


class OnJoint(Effect):
    """``effect`` on joint ``joint`` of ``joints``, and nothing on the others.

    The parameters of ``effect`` are those of a mechanism of one joint.
    """

    effect: Effect
    # traced where one program is used for all joints
    joint: int | Int[Array, ""] = struct.field(pytree_node=False)
    joints: int = struct.field(pytree_node=False)

    def _of(self, values: Joints) -> Own:
        return values[self.joint][None]

    def _put(self, values: Array, own: Array) -> Array:
        return values.at[self.joint].set(own[0])

    def alter(self, body: Any) -> Any:
        if type(self.effect).alter is Effect.alter:
            return body
        return self.effect.alter(_Part(body, self.joint, jnp.zeros(self.joints))).body

    def start(self, q: Joints) -> Any:
        return self.effect.start(self._of(q))

    def actuate(
        self, memory: Any, q: Joints, qd: Joints, tau: Joints, dt: Scalar
    ) -> tuple[Joints, Any]:
        delivered, memory = self.effect.actuate(
            memory, self._of(q), self._of(qd), self._of(tau), dt
        )
        return self._put(tau, delivered), memory

    def torque(self, q: Joints, qd: Joints, tau: Joints) -> Joints:
        if type(self.effect).torque is Effect.torque:
            return jnp.zeros_like(qd)
        return self._put(
            jnp.zeros_like(qd), self.effect.torque(self._of(q), self._of(qd), self._of(tau))
        )

    def dry(self, q: Joints, qd: Joints, tau: Joints, direction: Joints) -> Joints:
        if not self.grips():
            return jnp.zeros_like(qd)
        own = self.effect.dry(self._of(q), self._of(qd), self._of(tau), self._of(direction))
        return self._put(jnp.zeros_like(qd), own)

    def grips(self) -> bool:
        return self.effect.grips()

    def holds(self, q: Joints, qd: Joints, tau: Joints) -> JointMask | Joints:
        own = self.effect.holds(self._of(q), self._of(qd), self._of(tau))
        return self._put(jnp.zeros(qd.shape, own.dtype), own)

    def sense(self, memory: Any, q: Joints, noise: Joints) -> Joints:
        return self._put(q, self.effect.sense(memory, self._of(q), self._of(noise)))

    def true_position(self, q: History, dt: Scalar) -> History:
        if type(self.effect).true_position is Effect.true_position:
            return q
        return q.at[:, self.joint].set(self.effect.true_position(q[:, self.joint, None], dt)[:, 0])

    def seen(self, logged: History, predicted: History) -> History:
        seen = self.effect.seen(logged[:, self.joint, None], predicted[:, self.joint, None])
        return predicted.at[:, self.joint].set(seen[:, 0])

    def settled(self) -> "OnJoint":
        return self.replace(effect=self.effect.settled())

    def reads_torque(self, joints: int = 1) -> bool:
        return self.effect.reads_torque()

    def write_mjcf(self, numbers: Any) -> str | None:
        return (
            numbers.alter(self)
            if self.effect.rigid()
            else self.effect.write_mjcf(numbers.own(self.joint))
        )

    def mjcf_motor(self, motor: Motor, joint: int = 0) -> Motor | None:
        return self.effect.mjcf_motor(motor) if joint == self.joint else motor

    def check(self) -> "OnJoint":
        if not 0 <= self.joint < self.joints:
            expected = f"{self.effect.name} on one of {self.joints} joints, numbered from 0"
            raise EffectError(expected, f"joint {self.joint}", "correct the joint's number")
        self.effect.check()
        return self

    def to_dict(self) -> dict[str, Any]:
        """Return the effect's own record with the joint's number.

        Parameters of one joint are plain numbers.
        """
        record = self.effect.to_dict()
        for entry in record["parameters"].values():
            if isinstance(entry["value"], list) and len(entry["value"]) == 1:
                entry["value"] = entry["value"][0]
        return record | {"joint": self.joint, "joints": self.joints}


def placed(cls: type[Effect], variant: Variant, joint: int, joints: int) -> Effect:
    """Return the effect of a ``variant`` on joint ``joint`` of ``joints``.

    An effect that names its joints itself, or belongs to the whole mechanism, is not wrapped.
    """
    alone = cls.alone()

    def value(name: str) -> Array:
        given = jnp.asarray(np.asarray(variant.values.get(name, 0.0), float))
        return given[None] if alone and given.ndim == 0 else given

    effect = cls(**{name: value(name) for name in cls.parameters}, **variant.options)
    return OnJoint(effect, joint, joints) if alone else effect


def added_to(own: Iterable[Effect], change: Effect) -> Effect:
    """Return an effect together with what ``own`` has of it already, on the same joint.

    A change may be less than nothing, such as friction below the model's; what remains may not. An
    effect that cannot be one with another of its kind is returned as it is.
    """
    place, alone = getattr(change, "joint", None), getattr(change, "effect", change)
    whole = alone
    for other in own:
        same = type(inner := getattr(other, "effect", other)) is type(alone)
        if same and getattr(other, "joint", None) == place:
            whole = whole.plus(inner) or whole
    if whole is alone:
        return change
    return change.replace(effect=whole) if isinstance(change, OnJoint) else whole
