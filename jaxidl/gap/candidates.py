"""What may be missing: every effect of the catalogue on every joint, with where its fit begins."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxidl.effects import (
    CATALOGUE,
    AsymmetricFriction,
    CoupledFriction,
    Effect,
    InertiaError,
    LoadDependentFriction,
    Payload,
    PositionDependentFriction,
    QuadraticDrag,
    Scale,
    Stiction,
    StribeckFriction,
    TorqueRipple,
    TorqueSaturation,
    TorqueScale,
)
from jaxidl.gap.signals import Signals
from jaxidl.gap.terms import Free, as_effect

LEAST_WAVES = 2.0  # of a ripple, within the range of positions
SOFTEST = 3.0  # of a transmission: frequency of the motor against a link held still [Hz]
MOST_OF_LOAD = 0.6  # of the transmitted torque: what friction takes. With all of it friction would "explain" any command
BORDERS = (0.25, 0.5, 0.75)  # of the range of positions: below one of them alone a joint may stick
KNOTS = (6, 12, 24)  # of tables over position

ATOMS = ("viscous_friction", "coulomb_friction", "constant_offset", "quadratic_drag", "inertia_error", "torque_scale")
"""Effects of one parameter that others may imitate together."""

CONTAINS = {
    "asymmetric_friction": ("viscous_friction", "coulomb_friction", "constant_offset"),
    "stribeck_friction": ("coulomb_friction", "stiction"),
    "position_dependent_friction": ("viscous_friction", "coulomb_friction"),
    "coupled_friction": ("viscous_friction", "coulomb_friction"),
    "payload": ("inertia_error",),
    "joint_elasticity": ("actuator_lag", "actuator_delay"),
    "backlash": ("joint_elasticity",),
    "torque_ripple": ("constant_offset", "spring"),
    "spring": ("constant_offset",),
}
"""Effects that can imitate others, which are simpler: the simpler one is preferred unless the other is clearly better."""

ABSORBS = {
    ("stribeck_friction", "level"): "coulomb_friction",
    ("position_dependent_friction", "level"): "coulomb_friction",
    ("position_dependent_friction", "coefficient"): "viscous_friction",
    ("coupled_friction", "level"): "coulomb_friction",
    ("coupled_friction", "coefficient"): "viscous_friction",
    ("backlash", "stiffness"): "joint_elasticity",
}
"""What an effect with a certain free parameter makes superfluous on its joint, because it has it as a part."""

INSEPARABLE = {"inertia_error", "torque_scale", "payload"}
"""Without gravity and friction one and the same; with them still much alike."""

TIMING = ("actuator_lag", "actuator_delay", "sensor_delay", "joint_elasticity", "backlash")


@dataclass(frozen=True, eq=False)
class Candidate:
    """An effect that may be missing, before it is fitted. Compared by identity."""

    name: str
    joint: int | None
    variant: str
    guess: Effect
    free: Free
    loose: bool = False  # may one linear step go as far as it likes?
    within: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # bounds narrower than the catalogue's
    at_bounds: bool = False  # is it as good as any other if a parameter lies at a bound?
    tried: Mapping[str, float] = field(default_factory=dict)  # parameters of which a few values are tried: standard errors

    @property
    def key(self) -> tuple[str, int | None, str]:
        return self.name, self.joint, self.variant

    def parts(self) -> set[tuple[str, int | None]]:
        """What it makes superfluous: names and joints."""
        return {(part, self.joint) for name in self.free if (part := ABSORBS.get((self.name, name)))}

    @property
    def cost(self) -> float:
        """Complexity: of two equally good explanations the one of lower cost is the simpler."""
        values = sum(np.size(getattr(self.guess, name)) for name in self.free)
        return (
            min(values, 6)
            + len(self.tried)
            + (0.0 if CATALOGUE.get(self.name, Effect).linear else 0.5)
            + (self.name in TIMING) * 0.5
        )

    @property
    def spread(self) -> bool:
        """Does it reach beyond its joint although it is a one-joint effect?"""
        return "mass" in self.free and self.name == InertiaError.name

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bounds (P,) of its free parameters."""
        lower, upper = [], []
        for name in self.free:
            spec, size = self.guess.parameters[name], np.size(getattr(self.guess, name))
            low, high = self.within.get(name, (spec.lower, spec.upper))
            lower += [max(low, spec.lower)] * size
            upper += [min(high, spec.upper)] * size
        return np.array(lower), np.array(upper)


def scale_of(signals: Signals, joint: int, residual: float) -> Scale:
    """How large things are on one joint."""
    q, qd = signals.q[:, joint], signals.qd[:, joint]
    low, high = np.quantile(q, [0.002, 0.998])
    inertia = float(np.median(signals.tables.inertia[:, joint, joint]))
    torque, speed = np.abs(signals.tau[:, joint]).max(), np.quantile(np.abs(qd), 0.998)
    return Scale(float(torque), float(speed), float(low), float(high), inertia, residual, signals.band, signals.dt)


def candidates(signals: Signals, residual: np.ndarray, names: Sequence[str]) -> list[Candidate]:
    """All candidates for a log whose present residual has the root mean square ``residual`` (J,)."""
    joints = signals.q.shape[1]
    out: list[Candidate] = []
    for joint in range(joints):
        scale = scale_of(signals, joint, float(residual[joint]))
        if scale.speed <= 0.0:
            continue  # nothing is learned of a joint that never moves
        for name in names:
            out += _of_joint(CATALOGUE[name], joint, joints, scale, signals)
    if Payload.name in names:
        out += _payloads(signals)
    return out


def _of_joint(cls: type[Effect], joint: int, joints: int, scale: Scale, signals: Signals) -> list[Candidate]:
    if cls.whole:
        return []
    if cls in (PositionDependentFriction, CoupledFriction):
        return _tables_of(cls, joint, joints, signals)
    if cls is InertiaError:
        return _inertia(joint, signals)
    if cls is AsymmetricFriction:
        kinds: dict[str, Free] = {"dry": ("positive", "negative"), "viscous": ("viscous_positive", "viscous_negative")}
        kinds["both"] = (*kinds["dry"], *kinds["viscous"])
        return [Candidate(cls.name, joint, kind, as_effect(cls, {}), free) for kind, free in kinds.items()]
    if cls is Stiction:
        return _stictions(joint, scale)
    found = []
    for number, guess in enumerate(cls.guesses(scale)):
        free, loose = tuple(cls.parameters), cls.name == "spring"
        within = _within(cls, guess, scale, float(signals.rest_speed[joint]))
        start = as_effect(cls, guess, **_options(cls, signals))
        found.append(Candidate(cls.name, joint, str(number), start, free, loose, within))
    return found


def _within(cls: type[Effect], guess: Mapping[str, Any], scale: Scale, rest: float) -> dict[str, tuple[float, float]]:
    """Bounds beyond which an effect is another one, or trivial.

    A soft transmission with nearly all inertia on the motor's side passes hardly any torque on: a small residual that explains
    nothing. An excess of friction only where nothing is seen to move is stiction. A motor that always delivers the same is no
    motor.
    """
    if "motor_inertia" in guess:
        inertia = float(guess["motor_inertia"])
        soft = (2.0 * np.pi * SOFTEST) ** 2 * inertia
        return {"motor_inertia": (inertia / 2.5, min(2.5 * inertia, 0.8 * scale.inertia)), "stiffness": (soft, np.inf)}
    if cls is TorqueRipple:  # of a single wave along the way nobody knows that it is one
        return {"period": (0.0, (scale.upper - scale.lower) / LEAST_WAVES)}
    if cls is TorqueScale:
        return {"scale": (0.4, 2.5)}
    if cls is QuadraticDrag:
        return {"coefficient": (0.0, np.inf)}
    if cls is LoadDependentFriction:
        return {"coefficient": (0.0, MOST_OF_LOAD)}
    if cls is TorqueSaturation:
        return {"limit": (0.1 * scale.torque, np.inf)}
    return {"speed": (3.0 * rest, np.inf)} if cls is StribeckFriction else {}


def _options(cls: type[Effect], signals: Signals) -> dict[str, Any]:
    """Lines of dead time are long enough for 80 ms, and no longer: they cost time."""
    return {"steps": max(4, int(0.08 / signals.dt))} if "steps" in cls.__dataclass_fields__ else {}


def _stictions(joint: int, scale: Scale) -> list[Candidate]:
    """Everywhere, and below one of a few positions only."""
    guess, width = Stiction.guesses(scale)[0], scale.upper - scale.lower
    found = [Candidate(Stiction.name, joint, "", as_effect(Stiction, guess), ("breakaway",))]
    for share in BORDERS:
        start = as_effect(Stiction, {**guess, "below": scale.lower + share * width})
        tried = {"below": width / (len(BORDERS) + 1) / np.sqrt(12.0)}
        found.append(Candidate(Stiction.name, joint, f"below {share}", start, ("breakaway",), tried=tried))
    return found


def _inertia(joint: int, signals: Signals) -> list[Candidate]:
    """Rotor inertia, and the body's mass where that is not the same thing."""
    kinds = {"rotor": ("extra",)}
    rotor, body = signals.qdd[signals.rows, joint], signals.tables.by_mass[signals.rows, :, joint]
    own = body[:, joint]
    share = (own @ rotor) ** 2 / max((own @ own) * (rotor @ rotor), 1e-300)
    if share < 0.9999 or np.abs(np.delete(body, joint, 1)).max(initial=0.0) > 1e-6 * np.abs(own).max(initial=0.0):
        kinds["body"] = ("mass",)
    guess = as_effect(InertiaError, {})
    return [Candidate(InertiaError.name, joint, kind, guess, free) for kind, free in kinds.items()]


def _tables_of(cls: type[Effect], joint: int, joints: int, signals: Signals) -> list[Candidate]:
    """Dry and viscous tables over the joint's own or another one's position."""
    found = []
    others = [joint] if cls is PositionDependentFriction else [other for other in range(joints) if other != joint]
    for other in others:
        low, high = np.quantile(signals.q[:, other], [0.002, 0.998])
        if not high > low:
            continue
        for knots in KNOTS:
            values = {"level": np.zeros(knots), "coefficient": np.zeros(knots), "lower": low, "upper": high}
            if cls is PositionDependentFriction:
                own: dict[str, Any] = {key: jnp.asarray(value[None]) for key, value in values.items()}
                guess: Effect = PositionDependentFriction(**own)
            else:
                shared: dict[str, Any] = {key: jnp.asarray(value) for key, value in values.items()}
                guess = CoupledFriction(**shared, joint=joint, other=other)
            for free in ("level", "coefficient"):
                found.append(Candidate(cls.name, joint, f"{free} {knots} over {other}", guess, (free,), loose=True))
    return found


def _payloads(signals: Signals) -> list[Candidate]:
    if not np.abs(signals.tables.by_load).max() > 0.0:
        return []
    guess = Payload(jnp.asarray(0.1), jnp.zeros(3))
    return [Candidate(Payload.name, None, "", guess, ("mass", "com"), loose=True)]


__all__ = ["ATOMS", "CONTAINS", "TIMING", "Candidate", "candidates", "scale_of"]
