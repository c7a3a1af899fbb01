"""Measured data from an engine that shares nothing with the code under test.

It is MuJoCo in C, with ten steps per sample. A controller that relies on the model without the
hidden effects runs at the log's rate, reads a noisy and quantised encoder and holds its command
until the next sample. The log is what such a controller could write: instants, readings, commands.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jaxidl.gap.benchmark.believed import Controller, mujoco
from jaxidl.gap.benchmark.injected import Floats, Injected
from jaxidl.gap.benchmark.reference import Array
from jaxidl.gap.benchmark.rub import Level, rub
from jaxidl.gap.benchmark.transmission import JointElasticity

FINER = 10  # steps of the engine per sample


@dataclass(frozen=True)
class Run:
    """A run of T samples of J joints, in SI units.

    It holds what is logged, and what only the engine knows.
    """

    time: Array  # (T,)
    q: Array  # (T, J) encoder readings
    tau: Array  # (T, J) commands
    clean: Array  # (T, J) the readings without noise and quantisation
    wanted: Array  # (T, J) the reference

    def log(self) -> dict[str, Array]:
        """Return ``time``, ``q0``, …, ``tau0``, …, each (T,)."""
        joints = range(self.q.shape[1])
        columns = {f"q{j}": self.q[:, j] for j in joints} | {
            f"tau{j}": self.tau[:, j] for j in joints
        }
        return {"time": self.time, **columns}


def simulate(
    model_xml: str,
    hidden: Sequence[Injected],
    seed: int,
    duration: float = 24.0,
    rate: float = 500.0,
) -> dict[str, Array]:
    """Return the log of :func:`run`.

    Raises:
        Diverged: if the controller lost the mechanism.
    """
    return run(model_xml, hidden, seed, duration, rate).log()


def run(
    model_xml: str,
    hidden: Sequence[Injected],
    seed: int,
    duration: float = 24.0,
    rate: float = 500.0,
    motion: tuple[Array, Array, Array] | None = None,
    most: Array | None = None,
) -> Run:
    """Run the mechanism ``model_xml`` with the ``hidden`` effects for ``duration`` s.

    It is sampled at ``rate`` Hz. Motion and noise follow from ``seed`` alone, so effects can be
    compared on the same motion. A given ``motion``, positions, speeds and accelerations (T, J) at
    the rate, is followed instead; the seed is then that of the noise alone. Commands
    are cut at ``most`` (J,) [N or Nm], if given.

    Raises:
        Diverged: if the controller lost the mechanism.
    """
    control = Controller(model_xml, seed, duration, rate, motion, most)
    plant = _Plant(model_xml, hidden, 1 / (rate * FINER), control.wanted[0], control.ahead[0])
    readings, commands, clean = [], [], []
    for k in range(len(control.wanted)):
        clean.append(plant.read())
        reading, command = control(k, clean[-1])
        readings.append(reading)
        commands.append(command)
        plant.advance(command)
    return Run(
        np.arange(len(clean)) / rate,
        np.array(readings),
        np.array(commands),
        np.array(clean),
        control.wanted,
    )


class _Plant:
    """The true mechanism in motion; it starts at rest where the encoders read ``position`` (J,)."""

    def __init__(
        self,
        model_xml: str,
        hidden: Sequence[Injected],
        step: float,
        position: Array,
        command: Array,
    ):
        spec = mujoco.MjSpec.from_string(model_xml)
        for effect in hidden:
            effect.alter(spec)
        spec.option.timestep, spec.option.integrator = step, mujoco.mjtIntegrator.mjINT_EULER
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        joints = range(self.model.nv)
        self.late = [
            round(sum(e.encoder()[0] for e in hidden if e.joint == j) / step) for j in joints
        ]
        self.bias = [sum(e.encoder()[1] for e in hidden if e.joint == j) for j in joints]
        position = position - np.array(self.bias)
        for effect in hidden:
            position[effect.joint] -= effect.misread(float(position[effect.joint]))
        self.data.qpos[:] = position
        for effect in hidden:
            effect.start(step, float(position[effect.joint]), float(command[effect.joint]))
        self.step, self.count = step, 0
        self.motor = [(e.joint, e.actuate) for e in hidden if has(e, "actuate")]
        self.smooth = [(e.joint, e.torque, e.friction) for e in hidden if has(e, "torque")]
        self.rough = [(e.joint, e.dry) for e in hidden if has(e, "dry") and not e.loaded]
        self.loaded = [(e.joint, e.dry) for e in hidden if e.loaded]
        self.both = [e.passive for e in hidden if has(e, "passive")] if self.loaded else []
        self.spreads = [e.spread for e in hidden if has(e, "spread")]
        self.wrong = [(e.joint, e.misread) for e in hidden if has(e, "misread")]
        self.gears = [(e.joint, e.transmit) for e in hidden if isinstance(e, JointElasticity)]
        self.path: list[Floats] = [self.data.qpos.tolist()]

    def read(self) -> Floats:
        """Return what the encoders would read without noise."""
        sensors = enumerate(zip(self.late, self.bias, strict=True))
        readings = [self.path[max(0, self.count - late)][j] + bias for j, (late, bias) in sensors]
        for j, misread in self.wrong:
            readings[j] += misread(readings[j])
        return readings

    def advance(self, command: Floats) -> None:
        """Hold ``command`` for one sampling interval."""
        model, data, step = self.model, self.data, self.step
        first, second = mujoco.mj_step1, mujoco.mj_step2
        q, qd, applied, path = data.qpos, data.qvel, data.qfrc_applied, self.path
        for _ in range(FINER):
            first(model, data)
            t, position, speed = self.count * step, path[-1], qd.tolist()
            delivered = command.copy()
            for j, actuate in self.motor:
                delivered[j] = actuate(t, delivered[j])
            for spread in self.spreads:
                other, more = spread(delivered)
                delivered[other] += more
            force = delivered.copy()
            for j, transmit in self.gears:
                force[j] = transmit(position[j], speed[j], delivered[j])
            load = delivered.copy()
            for j, torque, friction in self.smooth:
                more = torque(t, position, speed, delivered[j])
                force[j] += more
                load[j] += more if friction else 0.0
            if self.rough or self.loaded:
                self._rub(position, speed, load, force)
            applied[:] = force
            second(model, data)
            self.count += 1
            path.append(q.tolist())

    def _rub(self, q: Floats, qd: Floats, load: Floats, force: Floats) -> None:
        """Add dry friction to ``force``; levels of several effects on one joint are added.

        ``load`` is what smooth friction leaves of the motors' torques; other dry friction and the
        rotors reduce the load before friction under load reads it.
        """
        levels: dict[int, Level] = {}

        def add(j: int, more: Level) -> None:
            forward, backward, rest = levels.get(j, (0.0, 0.0, 0.0))
            levels[j] = forward + more[0], backward + more[1], max(rest, more[2])

        for j, dry in self.rough:
            add(j, dry(q[j], qd[j], load[j]))
        for passive in self.both:
            for j, more in passive(qd).items():
                load[j] += more
        for j, (forward, backward, _) in levels.items():
            load[j] -= forward if qd[j] > 0 else -backward
        rotors, acceleration = self.model.dof_armature, self.data.qacc  # of the step before
        for j, dry in self.loaded:
            load[j] -= float(rotors[j] * acceleration[j])
            add(j, dry(q[j], qd[j], load[j]))
        net = [f - b for f, b in zip(force, self.data.qfrc_bias.tolist(), strict=True)]
        m = self.data.M.tolist()  # lower triangle, row after row
        friction = rub(levels, qd, net, [m] if len(m) == 1 else [m[:2], m[1:]], self.step)
        force[:] = [f + r for f, r in zip(force, friction, strict=True)]


def has(effect: Injected, hook: str) -> bool:
    """Return whether the effect does something in ``hook``."""
    return getattr(type(effect), hook) is not getattr(Injected, hook)
