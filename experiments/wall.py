"""The arm of ``pushes.py`` in MuJoCo's C engine, where a wall may stand in its way."""

from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import mujoco as _mujoco
import numpy as np
from jax.experimental import io_callback
from robot_loop.plant import Plant as Robot

from jaxidl.arm.setup import ArmStudy
from jaxidl.learning.execute import execute
from jaxidl.systems.arm import FLANGE, JOINTS, flange
from jaxidl.types import Joints, State, Trajectory

mujoco: Any = _mujoco  # its names are made when it is imported

TOOL, WALL = 0.03, (0.01, 0.06, 0.06)  # radius of the tool; half sizes of the wall [m]
FASTEST = 0.3  # [m/s] at least, with which the tool meets the wall
BEFORE = 0.2  # [s] for which the tool may have been near the wall before it meets it
AWAY = np.array([0.0, 0.0, -5.0])  # [m] where no wall is in the way


class Engine:
    """A plant whose mechanism is in MuJoCo, with the study's hidden effects, and a wall."""

    def __init__(self, study: ArmStudy, noise: float, folder: Path):
        text = (files("jaxidl.systems") / "arm.xml").read_text()
        touch = 'contype="1" conaffinity="1" solref="0.004 1"'
        size = lambda *numbers: " ".join(map(str, numbers))
        wall = f'<body mocap="true"><geom type="box" size="{size(*WALL)}" {touch}/></body>'
        tool = f'<geom type="sphere" size="{TOOL}" pos="{size(*FLANGE)}" mass="0" {touch}/>'
        text = text.replace('<geom name="floor"', wall + '<geom name="floor"', 1)
        last = text.index("<geom", text.index('<body name="link7"'))
        file = folder / "arm_and_wall.xml"
        file.write_text(text[:last] + tool + text[last:])
        hidden = {**study.hidden._asdict(), "period": study.hidden.ripple_period}
        hidden |= {"noise": noise, "count": study.count}
        self.robot = Robot(file, hidden, list(study.home), 0)
        self.home, self.noise, self.quantum = np.array(study.home), noise, study.count
        self.steps, self.touched = 0, -1

    def begin(self, place: np.ndarray = AWAY, normal: np.ndarray = AWAY) -> None:
        """Put the arm at its start and the wall at ``place`` (3,), across ``normal`` (3,)."""
        data, model = self.robot.data, self.robot.model
        mujoco.mj_resetData(model, data)
        data.qpos[:], self.robot.braked = self.home, False
        self.steps, self.touched = 0, -1
        x = normal / np.linalg.norm(normal)
        y = np.cross(x, np.eye(3)[np.argmin(np.abs(x))])
        y /= np.linalg.norm(y)
        data.mocap_pos[0] = place
        mujoco.mju_mat2Quat(data.mocap_quat[0], np.column_stack([x, y, np.cross(x, y)]).ravel())

    def advance(self, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Hold the torque for a control step; return position and velocity after it."""
        self.robot.advance(np.asarray(tau))
        data = self.robot.data
        if data.ncon and self.touched < 0:
            self.touched = self.steps
        self.steps += 1
        return data.qpos.copy(), data.qvel.copy()

    def start(self, q: Joints) -> tuple[()]:
        """Return no hidden states: the engine has its own."""
        return ()

    def step(self, state: State, hidden: tuple[()], tau: Joints, dt: float) -> Any:
        """Return the state after a step; the state before is the engine's own."""
        shape = jax.ShapeDtypeStruct((JOINTS,), jnp.float64)
        return State(*io_callback(self.advance, (shape, shape), tau, ordered=True)), ()

    def sense(self, hidden: tuple[()], q: Joints, noise: Joints) -> Joints:
        """Return the encoder reading (J,)."""
        return self.quantum * jnp.round((q + self.noise * noise) / self.quantum)


def executions(
    study: ArmStudy, params: Any, engine: Engine, observed: Callable[[Trajectory], Any]
) -> Callable[[Any], tuple[Any, Any]]:
    """Return a function of a key to what is ``observed`` of one execution, and its path (T, J)."""
    setting = study.setting(jnp.asarray(engine.noise))
    feedforward = lambda state, qdd, _: study.error_model.torque(params, state, qdd)

    @jax.jit
    def once(key: Any) -> Any:
        noise = jax.random.normal(key, (study.steps, JOINTS))
        plant: Any = engine
        run = execute(plant, setting.model, setting.law, setting.task, noise, feedforward)
        return observed(run), run.q

    return once


def walls(path: np.ndarray, dt: float, number: int, seed: int) -> list[tuple[np.ndarray, ...]]:
    """Return places and normals (3,) of walls that a tool on its ``path`` (T, J) runs into.

    The tool meets each about a random step, at right angles, and nowhere before.
    """
    rng = np.random.default_rng([seed, 2])
    tool = flange(path)
    velocity = np.gradient(tool, dt, axis=0)
    fast = np.flatnonzero(np.linalg.norm(velocity, axis=1) > FASTEST)
    found = []
    while len(found) < number:
        k = rng.choice(fast)
        normal = velocity[k] / np.linalg.norm(velocity[k])
        place = tool[k] + (TOOL + WALL[0]) * normal
        near = np.linalg.norm(tool - place, axis=1) < TOOL + np.linalg.norm(WALL)
        if k - np.argmax(near) < BEFORE / dt:  # it is there for the first time
            found.append((place, normal))
    return found
