"""Whole robots in motion: MuJoCo in C at a finer step than the controller's.

The controller is at least as fast as the log. It works as :mod:`.engine` for one or two joints,
with three differences: dry friction of many joints at once is MuJoCo's own constraint, its levels
set anew at every step; the controller runs at its own rate, faster than a slow log; and what each
hidden effect does to each joint is recorded at every logged instant, so that its strength is known.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from jaxidl.gap.benchmark.believed import Diverged, inertia, inverse_dynamics, mujoco
from jaxidl.gap.benchmark.engine import has
from jaxidl.gap.benchmark.injected import Injected
from jaxidl.gap.benchmark.reference import Array
from jaxidl.gap.benchmark.transmission import JointElasticity

SLOWEST, FINEST = 500, 2000  # Hz; least rates of the controller and of the engine
# rad/s, 1, Hz; joint controllers
NATURAL, FASTEST, DAMPING, DERIVATIVE = 2 * math.pi * 4.0, 2 * math.pi * 12.0, 0.8, 60.0
# rad; a controller is made stiffer until the required torque deflects it no further
SAG = 0.05
ASTRAY = 0.4  # rad; a joint further than this from its reference is lost
STOP = (0.9999, 0.9999, 0.001, 0.5, 2.0)  # impedance of dry friction: as stiff as MuJoCo allows


@dataclass(frozen=True)
class Sensors:
    """The sensors between the robot and its log.

    Attributes:
        quantum: of the encoders (J,) [rad].
        torque_noise: white noise of the logged torques (J,) [Nm].
        seed: of the noise.
    """

    quantum: Array
    torque_noise: Array
    seed: int


@dataclass(frozen=True)
class ArmRun:
    """A run of T logged samples of J joints; SI units."""

    time: Array  # (T,)
    q: Array  # (T, J) encoder readings
    tau: Array  # (T, J) logged torques
    clean: Array  # (T, J) true positions
    speed: Array  # (T, J) true speeds
    command: Array  # (T, J) torques without noise
    # for each hidden effect, (T, J): the torque that it adds to the motor's command
    acts: list[Array]

    def log(self) -> dict[str, Array]:
        """Return ``time``, ``q0``, …, ``tau0``, …, each (T,)."""
        joints = range(self.q.shape[1])
        return {
            "time": self.time,
            **{f"q{j}": self.q[:, j] for j in joints},
            **{f"tau{j}": self.tau[:, j] for j in joints},
        }


def rates(rate: float) -> tuple[int, int]:
    """Return how many times the controller runs per sample of a log at ``rate`` [Hz].

    Also return the number of steps for each run of the controller.
    """
    often = math.ceil(SLOWEST / rate)
    return often, max(2, math.ceil(FINEST / (rate * often)))


def run_arm(
    xml: str,
    hidden: Sequence[Injected],
    wanted: tuple[Array, Array, Array],
    rate: float,
    sensors: Sensors,
) -> ArmRun:
    """Let the arm ``xml`` with the ``hidden`` effects follow ``wanted``.

    The latter are positions, speeds and accelerations (T', J).

    Args:
        xml: the believed model.
        hidden: effects that the true arm has in addition.
        wanted: the reference at the controller's rate [rad, rad/s, rad/s²].
        sensors: between robot and log.
        rate: of the log [Hz]; the reference has ``rates(rate)[0]`` samples for each of the log's.

    Raises:
        Diverged: if a joint is too far from its reference.
    """
    often, finer = rates(rate)
    control = often * rate
    believed = mujoco.MjModel.from_xml_string(xml)
    q_wanted, qd_wanted, qdd_wanted = wanted
    ahead = inverse_dynamics(believed, q_wanted, qd_wanted, qdd_wanted)
    plant = _Arm(xml, hidden, 1 / (control * finer), q_wanted[0], ahead[0])
    inertias = plant.inertia()
    gain = np.clip(
        np.sqrt((ahead**2).mean(axis=0)) / SAG, inertias * NATURAL**2, inertias * FASTEST**2
    )
    damp = 2 * DAMPING * gain / NATURAL
    share = -math.expm1(-2 * math.pi * DERIVATIVE / control)
    noise = np.random.default_rng(sensors.seed)
    before, speed = None, np.zeros_like(gain)
    rows: list[tuple[Array, ...]] = []
    acts: list[Array] = []
    for k in range(len(q_wanted)):
        true = plant.position()
        reading = sensors.quantum * np.round(
            (plant.read() + 0.2 * sensors.quantum * noise.standard_normal(len(gain)))
            / sensors.quantum
        )
        off = q_wanted[k] - reading
        if not (np.abs(off) < ASTRAY).all():
            raise Diverged(f"a joint is {np.abs(off).max():.3g} rad off after {k / control:.2f} s")
        speed += share * ((0.0 if before is None else (reading - before) * control) - speed)
        before = reading
        command = ahead[k] + gain * off + damp * (qd_wanted[k] - speed)
        logged = k % often == 0
        if logged:
            rows.append((reading, true, plant.speed(), command))
        noted = plant.advance(command.tolist(), finer, logged)
        if logged:
            acts.append(noted)
    q, clean, qd, command = (np.array(column) for column in zip(*rows, strict=True))
    tau = command + sensors.torque_noise * np.random.default_rng([sensors.seed, 1]).standard_normal(
        command.shape
    )
    time = np.arange(len(q)) / rate
    return ArmRun(time, q, tau, clean, qd, command, list(np.array(acts).transpose(1, 0, 2)))


class _Arm:
    """The true arm; it starts at rest where the encoders read ``position`` (J,)."""

    def __init__(
        self, xml: str, hidden: Sequence[Injected], step: float, position: Array, command: Array
    ):
        spec = mujoco.MjSpec.from_string(xml)
        for effect in hidden:
            effect.alter(spec)
        spec.option.timestep, spec.option.integrator = step, mujoco.mjtIntegrator.mjINT_EULER
        for joint in spec.joints:
            joint.solref_friction, joint.solimp_friction = (2 * step, 1.0), STOP
        self.model: Any = spec.compile()
        self.data: Any = mujoco.MjData(self.model)
        self.step, self.count, self.hidden = step, 0, list(hidden)
        joints = range(self.model.nv)
        self.bias = np.array([sum(e.encoder()[1] for e in hidden if e.joint == j) for j in joints])
        self.late = [
            round(sum(e.encoder()[0] for e in hidden if e.joint == j) / step) for j in joints
        ]
        position = position - self.bias
        for effect in hidden:
            position[effect.joint] -= effect.misread(float(position[effect.joint]))
        self.data.qpos[:] = position
        for effect in hidden:
            effect.start(step, float(position[effect.joint]), float(command[effect.joint]))
        number = list(enumerate(hidden))
        self.motor = [(n, e.joint, e.actuate) for n, e in number if has(e, "actuate")]
        self.smooth = [(n, e.joint, e.torque, e.friction) for n, e in number if has(e, "torque")]
        self.rough = [(n, e.joint, e.dry) for n, e in number if has(e, "dry") and not e.loaded]
        self.loaded = [(n, e.joint, e.dry) for n, e in number if e.loaded]
        self.gears = [(n, e.joint, e.transmit) for n, e in number if isinstance(e, JointElasticity)]
        self.spreads = [(n, e.spread) for n, e in number if has(e, "spread")]
        self.wrong = [(e.joint, e.misread) for e in hidden if has(e, "misread")]
        self.both = [(n, e.passive) for n, e in number if has(e, "passive")]
        self.path = [self.data.qpos.copy()] if any(self.late) else []

    def inertia(self) -> Array:
        """Return the inertia (J,) that each joint sees at its position."""
        return np.diag(inertia(self.model, self.data.qpos.copy())).copy()

    def position(self) -> Array:
        return self.data.qpos.copy()

    def speed(self) -> Array:
        return self.data.qvel.copy()

    def read(self) -> Array:
        """Return what perfect encoders would read (J,)."""
        true = self.data.qpos
        if self.path:
            true = np.array(
                [self.path[max(0, self.count - late)][j] for j, late in enumerate(self.late)]
            )
        reading = true + self.bias
        for j, misread in self.wrong:
            reading[j] += misread(float(true[j]))
        return reading

    def advance(self, command: list[float], steps: int, note: bool) -> Array:
        """Hold ``command`` (J,) for ``steps`` steps.

        If ``note``, return what each effect did at the first step, (E, J).
        """
        model, data, rest = self.model, self.data, range(len(command))
        noted = np.zeros((len(self.hidden), len(command)))
        for k in range(steps):
            t, q, qd = self.count * self.step, data.qpos.tolist(), data.qvel.tolist()
            noting = noted if note and k == 0 else None
            delivered = command.copy()
            for n, j, actuate in self.motor:
                out = actuate(t, delivered[j])
                if noting is not None:
                    noting[n, j] += out - delivered[j]
                delivered[j] = out
            for n, spread in self.spreads:
                other, more = spread(delivered)
                delivered[other] += more
                if noting is not None:
                    noting[n, other] += more
            force = delivered.copy()
            for n, j, transmit in self.gears:
                force[j] = transmit(q[j], qd[j], delivered[j])
                if noting is not None:
                    noting[n, j] += force[j] - delivered[j]
            load = delivered.copy()
            for n, j, torque, friction in self.smooth:
                more = torque(t, q, qd, delivered[j])
                force[j] += more
                load[j] += more if friction else 0.0
                if noting is not None:
                    noting[n, j] += more
            if self.loaded or noting is not None:
                for n, passive in self.both:
                    for j, more in passive(qd).items():
                        load[j] += more
                        if noting is not None:
                            noting[n, j] += more
            if self.rough or self.loaded:
                self._rub(q, qd, load, noting, rest)
            data.qfrc_applied[:] = force
            mujoco.mj_step(model, data)
            self.count += 1
            if self.path:
                self.path.append(data.qpos.copy())
        return noted

    def _rub(
        self,
        q: list[float],
        qd: list[float],
        load: list[float],
        noting: Array | None,
        joints: range,
    ) -> None:
        """Set the levels of dry friction for this step.

        Levels of several effects on one joint are added. ``load`` is what other friction leaves of
        the motors' torques; dry friction that needs no load and the rotors reduce it further.
        """
        sliding, bears = [0.0] * len(q), [0.0] * len(q)
        before = (self.model.dof_armature * self.data.qacc).tolist()  # at the step before
        for group, rotors in ((self.rough, [0.0] * len(q)), (self.loaded, before)):
            each = zip(load, sliding, qd, rotors, strict=True)
            left = [x - math.copysign(s, v) - r for x, s, v, r in each]
            for n, j, dry in group:
                forward, backward, rest = dry(q[j], qd[j], left[j])
                level = forward if qd[j] > 0 else backward
                sliding[j] += level
                bears[j] = max(bears[j], rest)
                if noting is not None and abs(qd[j]) > 1e-3:
                    noting[n, j] -= math.copysign(level, qd[j])
        still = 1e-5  # rad/s
        self.model.dof_frictionloss[:] = [
            max(sliding[j], bears[j]) if abs(qd[j]) < still else sliding[j] for j in joints
        ]
