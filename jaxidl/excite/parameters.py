"""The parameters whose standard errors a motion is to make small, and which of them can be known.

Those are the amplitudes of effects, as the gap finder fits them. Not all inertial parameters show
in the torque, some only in sums with others: of columns that depend on earlier ones on any motion,
the earlier ones stand for the sums (base parameters, Gautier and Khalil 1990).
"""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxidl.backend import jit_quickly
from jaxidl.effects import CATALOGUE, Effect, Scale, searched
from jaxidl.excite.columns import Family, Rigid, added, driven, families
from jaxidl.excite.limits import Limits
from jaxidl.gap.evidence.additions import Drive
from jaxidl.gap.evidence.shape import Shape, shapes_of
from jaxidl.systems.free import unit_of
from jaxidl.systems.mjcf import Model

STATES = 400  # random ones that show which columns depend on others
DEPENDENT = 1e-6  # share of a column that earlier ones do not imitate
REST = 0.02  # share of the largest speed within which friction changes its sign


class Parameter(NamedTuple):
    """One amplitude of an effect."""

    effect: str
    joint: int | None
    name: str
    unit: str


class Terms(NamedTuple):
    """P columns: sums of what E effects add."""

    families: tuple[Rigid | Family, ...]
    mix: np.ndarray  # (P, E)

    def columns(self, drive: Drive, body: Any, rest: Any, dt: float) -> jax.Array:
        """Return the columns (P, T, J) along a motion."""
        parts = [added(f, drive, body, rest, dt) for f in self.families]
        if not parts:
            return jnp.zeros((0, *drive.q.shape))
        order = np.concatenate([np.array(f.places) for f in self.families])
        return jnp.tensordot(self.mix[:, order], jnp.concatenate(parts), 1)


class Known(NamedTuple):
    """The model as experiments are planned with it."""

    model: Model
    own: tuple[Rigid | Family, ...]  # the model's own effects
    rest: np.ndarray  # (J,) [m/s or rad/s]

    @property
    def body(self) -> Any:
        """The rigid body."""
        return self.model.plant.body

    def drive(self, q: Any, qd: Any, qdd: Any, dt: float) -> Drive:
        """Return what drives effects along a motion (T, J)."""
        return driven(self.body, self.own, q, qd, qdd, self.rest, dt)


def known(model: Model, limits: Limits) -> Known:
    """Return a model with its own effects, and the range of speeds in which friction turns."""
    own = tuple(
        f for e in model.plant.effects for f in families([e], len(model.names))
    )  # one after the other, as the plant has them
    return Known(model, own, REST * limits.speed)


def terms_of(effects: Sequence[Effect], mix: np.ndarray, joints: int) -> Terms:
    """Return columns that are sums of what effects add; ``mix`` is (P, E)."""
    return Terms(families(effects, joints), mix)


def scales(know: Known, limits: Limits, states: Drive, band: float, dt: float) -> list[Scale]:
    """Return the magnitudes on each joint that effects derive their starting values from."""
    torque = np.abs(np.asarray(states.predicted))
    effort = np.sqrt(np.mean(torque**2, 0))
    slope = np.abs(np.asarray(states.qdd))
    inertia = np.maximum(effort / np.sqrt(np.mean(slope**2, 0)), 1e-6)
    return [
        Scale(
            float(torque[:, j].max()),
            float(limits.speed[j]),
            float(limits.lower[j]),
            float(limits.upper[j]),
            float(inertia[j]),
            0.05 * float(effort[j]),
            band,
            dt,
            j,
            len(limits.names),
            tuple(limits.lower.tolist()),
            tuple(limits.upper.tolist()),
            float(know.rest[j]),
            float(effort[j]),
        )
        for j in range(len(limits.names))
    ]


def shapes(names: Iterable[str], every: Sequence[Scale]) -> list[Shape]:
    """Return one shape of each effect, joint and set of amplitudes."""
    found: dict[Any, Shape] = {}
    for name in names:
        cls = CATALOGUE[name]
        for scale in every[:1] if cls.whole else every:
            for shape in shapes_of(cls, scale):
                found.setdefault((name, shape.joint, shape.free), shape)
    return list(found.values())


def common() -> list[str]:
    """Return the names of the effects that conventional identification fits, simple ones first."""
    names = [n for n in searched() if CATALOGUE[n].common]
    return sorted(names, key=lambda n: (not CATALOGUE[n].friction, len(CATALOGUE[n].contains())))


def probed(
    shapes: Sequence[Shape], kinds: Sequence[str]
) -> tuple[list[Parameter], list[Effect], np.ndarray]:
    """Return the amplitudes (P) of shapes, an effect that probes each, and the probes' sizes."""
    labels: list[Parameter] = []
    effects: list[Effect] = []
    sizes = [np.zeros(0)]
    for shape in shapes:
        probes, size = shape.probes()
        effects += probes
        sizes.append(size)
        kind = kinds[shape.joint] if shape.joint is not None else kinds[-1]
        for name in shape.free:
            count = np.size(shape.values[name])
            unit = unit_of(shape.cls.parameters[name].unit, kind)
            labels += [
                Parameter(shape.cls.name, shape.joint, name if count == 1 else f"{name}[{k}]", unit)
                for k in range(count)
            ]
        if not shape.free:
            labels.append(Parameter(shape.cls.name, shape.joint, "share", "1"))
    return labels, effects, np.concatenate(sizes)


def states(know: Known, limits: Limits, seed: int = 0) -> Drive:
    """Return random states within the limits."""
    rng = np.random.default_rng(seed)
    q, qd, qdd = rng.uniform(-1.0, 1.0, (3, STATES, len(limits.names)))
    middle, half = 0.5 * (limits.upper + limits.lower), 0.5 * (limits.upper - limits.lower)
    motion = middle + half * q, limits.speed * qd, limits.acceleration * qdd
    return jit_quickly(know.drive, static_argnames="dt")(*motion, dt=1.0)


def independent(columns: np.ndarray, before: np.ndarray | None = None) -> np.ndarray:
    """Return which of P columns (P, N, J) neither earlier ones nor those ``before`` imitate."""
    flat = columns.reshape(len(columns), -1)
    first = np.zeros((0, flat.shape[1])) if before is None else before.reshape(len(before), -1)
    whole = np.concatenate([first, flat])
    size = np.linalg.norm(whole, axis=1)
    kept = np.zeros(len(whole), bool)
    basis = np.zeros((0, whole.shape[1]))
    for n in range(len(whole)):
        if size[n] <= 1e-12 * size.max(initial=1e-300):
            continue
        left = whole[n] / size[n]
        for _ in range(2):  # twice is enough (Kahan and Parlett)
            left = left - basis.T @ (basis @ left)
        if (rest := float(np.linalg.norm(left))) > DEPENDENT:
            kept[n] = True
            basis = np.concatenate([basis, left[None] / rest])
    return kept[len(first) :]
