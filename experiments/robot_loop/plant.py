"""The mechanism inside the robot: MuJoCo's C engine at ten steps a millisecond, with effects that
the controller does not know, encoders and brakes.
"""

from pathlib import Path
from typing import Any

import mujoco as _mujoco
import numpy as np

mujoco: Any = _mujoco  # its names are made when it is imported

DT, FINER = 1e-3, 10  # [s] of the controller; engine's steps in each
STOP = (0.9999, 0.9999, 0.001, 0.5, 2.0)  # impedance of dry friction: as stiff as MuJoCo allows
BRAKE = 2.0  # a brake holds so many times the joint's largest torque
REST = 1e-3  # [rad/s] below which a joint is at rest


class Plant:
    """A robot of J joints; at first its brakes are closed.

    Args:
        file: MJCF of the model that the controller has, too.
        hidden: what this robot has beyond it, by name; J numbers each: ``viscous`` [Nm s/rad],
            ``coulomb`` [Nm], ``load_friction`` (friction over the torque that other friction
            leaves), ``mass`` of the links [kg], ``ripple`` [Nm] and its ``period`` [rad];
            ``payload`` [kg] and ``payload_com`` [m] in the last link's frame; ``noise`` and
            ``count`` of the encoders [rad].
        home: position (J,) [rad] where it begins at rest.
        seed: of the encoders' noise.
    """

    def __init__(self, file: Path, hidden: dict[str, Any], home: list[float], seed: int):
        step = DT / FINER
        self.spec = mujoco.MjSpec.from_file(str(file))
        for joint, mass in zip(self.spec.joints, hidden["mass"], strict=True):
            link = joint.parent
            link.inertia = link.inertia * (1.0 + mass / link.mass)
            link.mass += mass
            joint.solref_friction, joint.solimp_friction = (2 * step, 1.0), STOP
        load = self.spec.joints[-1].parent.add_body(name="load", pos=hidden["payload_com"])
        load.mass, load.inertia = hidden["payload"], [1e-7 * hidden["payload"]] * 3
        load.explicitinertial, load.ipos = True, [0.0, 0.0, 0.0]
        self.spec.option.timestep = step
        self.spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
        self.model = self.spec.compile()
        self.data = mujoco.MjData(self.model)
        self.viscous = np.array(hidden["viscous"])
        self.model.dof_damping[:] = self.viscous
        self.data.qpos[:] = home
        names = ("coulomb", "load_friction", "ripple")
        self.coulomb, self.load, self.ripple = (np.array(hidden[name]) for name in names)
        self.wave = 2.0 * np.pi / np.array(hidden["period"])
        self.noise, self.count = hidden["noise"], hidden["count"]
        self.draws = np.random.default_rng(seed)
        self.limit = self.model.jnt_actfrcrange[:, 1].copy()
        self.braked = True

    @property
    def joints(self) -> int:
        return self.model.nv

    @property
    def at_rest(self) -> bool:
        return bool(np.abs(self.data.qvel).max() < REST)

    def read(self) -> np.ndarray:
        """Return what the encoders say (J,) [rad]."""
        noisy = self.data.qpos + self.noise * self.draws.standard_normal(self.joints)
        return self.count * np.round(noisy / self.count)

    def advance(self, command: np.ndarray) -> np.ndarray:
        """Hold ``command`` (J,) [Nm] for a millisecond; return the torque that acted.

        Closed brakes take the drives' torque away.
        """
        tau = np.zeros(self.joints) if self.braked else np.clip(command, -self.limit, self.limit)
        qd = self.data.qvel
        passed = tau - self.viscous * qd - self.coulomb * np.sign(qd)
        friction = self.coulomb + self.load * np.abs(passed)
        self.model.dof_frictionloss[:] = BRAKE * self.limit if self.braked else friction
        for _ in range(FINER):
            self.data.qfrc_applied[:] = tau + self.ripple * np.sin(self.wave * self.data.qpos)
            mujoco.mj_step(self.model, self.data)
        return tau
