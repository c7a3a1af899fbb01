"""The gap workflow on the arm: a log of the true one, the modelled one, and what is found of what
is hidden.
"""

import io
from collections.abc import Callable
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxidl.arm.setup import GOALS, ArmStudy, Hidden
from jaxidl.effects import CATALOGUE, Effect, Payload
from jaxidl.files import write_bytes
from jaxidl.gap.evidence.additions import additions
from jaxidl.gap.evidence.rows import rms, rows_of
from jaxidl.gap.evidence.shape import build
from jaxidl.gap.result.diagnosis import Diagnosis
from jaxidl.gap.workflow import diagnose
from jaxidl.learning.execute import desired_trajectory
from jaxidl.logs.log import read
from jaxidl.logs.signals import prepare
from jaxidl.systems.arm import JOINTS, compiled
from jaxidl.systems.mjcf import read_model

if TYPE_CHECKING:
    from jaxidl.gap.benchmark.injected import Injected


@dataclass(frozen=True)
class Logged:
    """How the true arm is made to move for the log: from goal to goal, drawn about those of the
    study.
    """

    goals: int = 36
    seconds_each: float = 0.9
    spread: float = 0.8  # of the goals [rad]
    noise: float = 1e-5  # of the encoders [rad]
    seed: int = 1

    def study(self) -> ArmStudy:
        """Return the arm's study with these goals."""
        rng = np.random.default_rng(self.seed)
        low, high = 0.8 * compiled().jnt_range.T
        middle = np.mean(GOALS, axis=0)
        drawn = np.clip(
            middle + self.spread * rng.uniform(-1.0, 1.0, (self.goals, JOINTS)), low, high
        )
        goals = tuple(tuple(float(x) for x in goal) for goal in drawn)
        return ArmStudy(goals=goals, home=tuple(middle.tolist()), seconds_each=self.seconds_each)


def record(logged: Logged) -> dict[str, np.ndarray]:
    """Record what a robot would log.

    ``time`` (T,) [s], encoder readings ``q`` (T, 7) [rad] and commands ``tau`` (T, 7) [Nm].

    The true arm moves in MuJoCo's C engine at half the log's interval, with the benchmark's
    effects: nothing of what is to find them. It follows the study's desired motion under stiff
    controllers.
    """
    from jaxidl.gap.benchmark.arm_engine import Sensors, run_arm  # in a checkout only

    study = logged.study()
    with jax.enable_x64(True):
        wanted = desired_trajectory(study.task())
    q, qd = np.asarray(wanted.q), np.asarray(wanted.qd)
    sensors = Sensors(np.full(JOINTS, logged.noise), np.zeros(JOINTS), logged.seed)
    xml = (files("jaxidl.systems") / "arm.xml").read_text()
    run = run_arm(
        xml, injected(study), (q, qd, np.gradient(qd, study.dt, axis=0)), 1.0 / study.dt, sensors
    )
    return {"time": run.time, "q": run.q, "tau": run.tau}


def injected(study: ArmStudy) -> "list[Injected]":
    """Return the arm's hidden effects as the benchmark has them."""
    from jaxidl.gap.benchmark.catalogue import make  # in a checkout only

    h, made = study.hidden, []
    for j in range(JOINTS):
        ripple = {"amplitude": h.ripple[j], "period": h.ripple_period[j], "phase": 0.0}
        made += [
            make("inertia_error", j, {"extra": 0.0, "mass": h.mass[j]}),
            make("viscous_friction", j, {"coefficient": h.viscous[j]}),
            make("coulomb_friction", j, {"level": h.coulomb[j]}),
            make("load_dependent_friction", j, {"coefficient": h.load_friction[j]}),
            make("torque_ripple", j, ripple),
            make("actuator_delay", j, {"delay": study.delay}),
        ]
    return [*made, make("payload", None, {"mass": h.payload, "com": list(h.payload_com)})]


def truth(hidden: Hidden, delay: float = 1e-3) -> dict[tuple[str, int | None], float]:
    """Return what is to be found: effect and joint, and its size in the effect's unit."""
    found: dict[tuple[str, int | None], float] = {}
    for name, values in (
        ("viscous_friction", hidden.viscous),
        ("coulomb_friction", hidden.coulomb),
        ("load_dependent_friction", hidden.load_friction),
        ("torque_ripple", hidden.ripple),
        ("inertia_error", hidden.mass),
    ):
        found |= {(name, j): value for j, value in enumerate(values) if value}
    return (
        found
        | {("payload", None): hidden.payload}
        | {("actuator_delay", j): delay for j in range(JOINTS)}
    )


def visible(
    rows: dict[tuple[str, int | None], float], logged: Logged, log: Path, model: Path
) -> dict[Any, float]:
    """Return how large the torque of each hidden effect is along the log.

    In noise floors of the joint that shows it most.

    What makes less than ``TOO_SMALL`` of them (:mod:`jaxidl.arm.found`) is nothing that this log
    can tell beside all else.
    """
    with jax.enable_x64(True):
        known = read_model(model)
        signals = prepare(read(log, joints=JOINTS), known.plant.body)
        seen, hidden = rows_of(signals), logged.study().hidden
        found = {}
        for (name, joint), size in rows.items():
            cls = CATALOGUE[name]
            if joint is None:
                effect: Effect = Payload(jnp.asarray(size), jnp.asarray(hidden.payload_com))
            else:
                first = "mass" if name == "inertia_error" else next(iter(cls.parameters))
                values = dict.fromkeys(cls.parameters, 0.0) | {first: size}
                values |= {"period": hidden.ripple_period[joint]} if name == "torque_ripple" else {}
                effect = build(
                    cls, joint, JOINTS, values, {"steps": 4} if name == "actuator_delay" else {}
                )
            (added,), _ = additions([effect], signals, signals.tau, signals.tau)
            found[name, joint] = float(np.max(rms(added, seen.used) / seen.floor))
    return found


def find(
    logged: Logged,
    folder: Path,
    keep: Callable[[Diagnosis, Path], object] = lambda found, folder: None,
    watch: Any = lambda what, share: None,
) -> dict[str, Any]:
    """Log the true arm, let the workflow compare it with the modelled one, keeping log and model in
    ``folder``.

    ``keep`` writes the report into a folder: :func:`jaxidl.report.save`.

    Returns:
        The report (see ``report.json`` of `jaxidl gap`) with ``truth``: rows of effect, joint,
        size, and how ``visible`` it is.
    """
    columns = record(logged)
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **columns)
    write_bytes(folder / "log.npz", buffer.getvalue())
    write_bytes(folder / "model.xml", (files("jaxidl.systems") / "arm.xml").read_bytes())
    found = diagnose(folder / "log.npz", folder / "model.xml", watch=watch)
    keep(found, folder / "report")
    study = logged.study()
    rows = truth(study.hidden, study.delay)
    seen = visible(rows, logged, folder / "log.npz", folder / "model.xml")
    table = [
        {"effect": key[0], "joint": key[1], "size": size, "visible": seen[key]}
        for key, size in rows.items()
    ]
    return found.to_dict() | {"truth": table}
