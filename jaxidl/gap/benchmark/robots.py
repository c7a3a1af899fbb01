"""Whole robots as cases: their logs, and the truth about them.

The truth includes the strength of each hidden effect.
"""

import json
import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from jaxidl.files import write_bytes
from jaxidl.gap.benchmark.arm_engine import ArmRun, Sensors, rates, run_arm
from jaxidl.gap.benchmark.arms import Arm, excitation, random_arm
from jaxidl.gap.benchmark.believed import Diverged, inverse_dynamics
from jaxidl.gap.benchmark.catalogue import make
from jaxidl.gap.benchmark.engine import has
from jaxidl.gap.benchmark.injected import Injected, Payload
from jaxidl.gap.benchmark.links import shifted
from jaxidl.gap.benchmark.parts import Part
from jaxidl.gap.benchmark.reference import Array
from jaxidl.gap.benchmark.transmission import JointElasticity
from jaxidl.gap.benchmark.whole import draw
from jaxidl.gap.benchmark.worth import Motion, acts, altered, columns, inertial, rms

RATES = (100.0, 125.0, 200.0, 250.0, 500.0, 1000.0)  # Hz
COARSE = 50.0  # Hz; rate of the motion on which effects are sized
# instants of a run for the links' regressor, and for the strength of a changed body
INSTANTS, DENSE = 300, 1500
# standard deviation and largest error of a joint's torque constant, by the robot's family
CONSTANTS = {"robot": (0.015, 0.029), "worn": (0.05, 0.15)}


@dataclass(frozen=True)
class Drawn:
    """A robot before it runs."""

    arm: Arm
    hidden: tuple[Part, ...]
    remainder: tuple[Part, ...]
    wanted: tuple[Array, Array, Array]  # reference at the control rate
    rate: float  # of the log [Hz]
    sensors: Sensors


@dataclass(frozen=True)
class Robot:
    """A whole robot as a case.

    The identity says nothing about what is hidden; ``number`` is that of the draw. The family is
    "robot" or "worn".
    """

    root: int
    number: int
    mechanism: str = "robot"
    family: str = "robot"
    severity: str | None = None

    @property
    def id(self) -> str:
        return f"robot-{zlib.crc32(f'{self.root} {self.family} {self.number}'.encode()):08x}"

    @property
    def log(self) -> str:
        """Name of the log's file."""
        return "log.npz" if self.number % 3 else "log.csv"

    def draw(self, attempt: int = 0) -> Drawn:
        """Draw arm, motion, sensors and hidden effects."""
        rng = np.random.default_rng(
            [self.root, zlib.crc32(f"{self.family} {self.number}".encode()), attempt]
        )
        arm = random_arm(rng)
        joints, rate, duration = (
            len(arm.masses),
            float(rng.choice(RATES)),
            float(rng.uniform(30, 60)),
        )
        if self.log == "log.csv":
            rate = min(rate, 250.0)  # a larger log is impractical as text
        motions = int(rng.integers(2**31))  # the same motion at any rate
        wanted = excitation(np.random.default_rng(motions), joints, duration, rate * rates(rate)[0])
        coarse = excitation(np.random.default_rng(motions), joints, duration, COARSE)
        need = inverse_dynamics(altered(arm.xml, []), *coarse)
        motion = Motion(np.arange(len(need)) / COARSE, *coarse, need)
        hidden, remainder = draw(rng, arm, motion, self.number % 3, self.family)
        scatter, most = CONSTANTS[self.family]
        known = {part.joint for part in hidden if part.effect == "torque_scale"}
        for j in range(joints):
            if j not in known:
                off = float(np.clip(rng.normal(0, scatter), -most, most))
                hidden.append(Part("torque_scale", j, {"scale": 1 + off}))
        quantum = np.asarray(2 * math.pi / 2.0 ** rng.integers(17, 22, joints), np.float64)
        noise = rms(need).max() * 0.02 + rms(need)
        sensors = Sensors(
            quantum,
            noise * np.exp(rng.uniform(np.log(0.002), np.log(0.02))),
            int(rng.integers(2**31)),
        )
        return Drawn(arm, tuple(hidden), tuple(remainder), wanted, rate, sensors)

    def measure(self) -> tuple[Drawn, ArmRun]:
        """Draw and run the robot.

        One that the controller loses is drawn again, since nobody would log it.

        Raises:
            Diverged: if ten draws are lost.
        """
        for attempt in range(10):
            drawn = self.draw(attempt)
            effects = [make(*part) for part in drawn.hidden + drawn.remainder]
            try:
                return drawn, run_arm(
                    drawn.arm.xml, effects, drawn.wanted, drawn.rate, drawn.sensors
                )
            except Diverged:
                continue
        raise Diverged(f"{self.id}: ten draws were lost")

    def write(self, folder: Path) -> Mapping[str, Any]:
        """Run the robot, write ``folder/model.xml`` and its log, and return the truth.

        The truth is to be stored elsewhere.

        Raises:
            Diverged: see :meth:`measure`.
        """
        drawn, run = self.measure()
        folder.mkdir(parents=True, exist_ok=True)
        write_log(folder / self.log, run.log())
        (folder / "model.xml").write_text(drawn.arm.xml)
        return truth(self, drawn, run)


def robots(root: int, count: int, family: str = "robot") -> list[Robot]:
    """Return the first ``count`` robots of a root; a larger count does not change them."""
    return [Robot(root, number, family=family) for number in range(count)]


def write_log(path: Path, log: Mapping[str, Array]) -> None:
    """Write the columns of a log as CSV or NPZ, by the name of the file."""
    if path.suffix == ".npz":
        np.savez(path, **log)  # pyright: ignore[reportArgumentType]
        return
    form = ["%.8g" if name.startswith("tau") else "%.8f" for name in log]
    np.savetxt(
        path,
        np.column_stack(list(log.values())),
        fmt=form,
        delimiter=",",
        header=",".join(log),
        comments="",
    )


def truth(case: Robot, drawn: Drawn, run: ArmRun) -> dict[str, Any]:
    """Return what is hidden, the strength of each effect, and the errors of links, as JSON.

    ``worth`` (J,) is the RMS of the effect's torque over the RMS of the joint's command.
    ``inertial`` holds the Gram matrix of the links' regressor, lower triangle row by row, in shares
    of each joint's command, and the true ``error`` of each parameter.
    """
    qdd = np.gradient(run.speed, run.time, axis=0)
    motion = Motion(run.time, run.clean, run.speed, qdd, run.command)
    command, xml = rms(run.command), drawn.arm.xml
    parts = drawn.hidden + drawn.remainder
    effects = [make(*part) for part in parts]
    few, many = (np.linspace(0, len(qdd) - 1, count).astype(int) for count in (INSTANTS, DENSE))
    thin = Motion(*(x[many] for x in motion))
    records = []
    for part, effect, noted in zip(parts, effects, run.acts, strict=True):
        worth = rms(_torque(effect, noted, xml, motion, thin)) / command
        records.append(
            {
                "effect": part.effect,
                "joint": part.joint,
                "parameters": dict(part.parameters),
                "worth": _short(worth),
            }
        )
    bodies = [
        e
        for e in effects
        if has(e, "alter") and not has(e, "passive") and not isinstance(e, JointElasticity)
    ]
    names, table = columns(xml, Motion(*(x[few] for x in motion)))
    flat = (table / command[:, None]).reshape(-1, len(names))
    gram = flat.T @ flat / len(few)
    error = (inertial(altered(xml, bodies)) - inertial(altered(xml, []))).ravel()
    believed = inertial(altered(xml, []))
    _about_origin(
        records, believed, inertial(altered(xml, [e for e in bodies if not isinstance(e, Payload)]))
    )
    return {
        "mechanism": case.mechanism,
        "family": case.family,
        "severity": None,
        "root": case.root,
        "joints": len(command),
        "rate": drawn.rate,
        "command": _short(command),
        "hidden": records[: len(drawn.hidden)],
        "remainder": records[len(drawn.hidden) :],
        "inertial": {
            "names": names,
            "believed": _short(believed.ravel(), 9),
            "error": _short(error, 9),
            "gram": _short(gram[np.tril_indices(len(names))], 12),
        },
    }


def _about_origin(records: list[dict[str, Any]], believed: Array, true: Array) -> None:
    """Express first moments and tensors about the bodies' origins.

    They are changes in addition to that in proportion to the mass, and tensors also in addition to
    that in proportion to the shift, and so linear: the mass error, the shift and the change of
    inertia of one link together are fully contained in them.
    """
    for record in records:
        if record["effect"] in ("com_error", "inertia_tensor_error"):
            before, after = believed[record["joint"]], true[record["joint"]]
            besides = after - before * (after[0] / before[0])
            name, columns = (
                ("moment", slice(1, 4))
                if record["effect"] == "com_error"
                else ("tensor", slice(4, 10))
            )
            besides[4:10] -= shifted(before) @ besides[1:4]
            record["parameters"][name] = _short(besides[columns])


def _torque(effect: Injected, noted: Array, xml: str, motion: Motion, thin: Motion) -> Array:
    """Return the torque of an effect (T, J).

    It is as recorded by the engine, or at fewer instants by inverse dynamics.
    """
    if isinstance(effect, JointElasticity):
        rotor = np.zeros_like(noted)
        rotor[:, effect.joint] = effect.motor_inertia * motion.qdd[:, effect.joint]
        return noted + rotor
    changes = (
        (has(effect, "alter") and not has(effect, "passive"))
        or has(effect, "encoder")
        or has(effect, "misread")
    )
    return acts(effect, xml, thin) if changes else noted


def _short(values: Array, digits: int = 5) -> list[float]:
    return [float(f"{value:.{digits}g}") for value in values]


def store(path: Path, record: Mapping[str, Any]) -> None:
    """Write a robot's truth as JSON."""
    write_bytes(path, json.dumps(record, allow_nan=False).encode())
