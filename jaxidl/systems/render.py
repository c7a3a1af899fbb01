"""Pictures of the arm at work, by MuJoCo's renderer."""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

import os
import subprocess
import sys
import tempfile
from importlib.resources import files
from pathlib import Path

import mujoco
import numpy as np
from jaxtyping import Bool, Float, UInt8

from jaxidl.errors import JaxidlError

TABLE = 0.004  # height of the table top [m]


class NoRenderer(JaxidlError):
    """This machine cannot render."""


def scene(pick: Float[np.ndarray, "3"], place: Float[np.ndarray, "3"]) -> mujoco.MjModel:
    """Return the arm with three tools: one on its flange and two on the table.

    The one on the flange is ``held``; the others are under ``pick`` (3,) and ``place`` (3,) [m].
    """
    spec = mujoco.MjSpec.from_string((files("jaxidl.systems") / "arm.xml").read_text())
    cylinder, box = mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_BOX
    spec.worldbody.add_geom(
        type=box,
        size=[0.22, 0.45, TABLE / 2],
        pos=[0.5, 0.02, TABLE / 2],
        rgba=[0.75, 0.68, 0.6, 1],
    )
    last = spec.body("link7")
    for name, body, at, down in (
        ("held", last, np.array([0.0, 0.0, 0.06]), 1.0),
        ("at_pick", spec.worldbody, pick, -1.0),
        ("at_place", spec.worldbody, place, -1.0),
    ):
        body.add_geom(
            name=f"{name}_grip",
            type=cylinder,
            size=[0.025, 0.05, 0],
            pos=at + np.array([0, 0, 0.05 * down]),
        )
        body.add_geom(
            name=f"{name}_head",
            type=box,
            size=[0.075, 0.022, 0.022],
            pos=at + np.array([0.02, 0, 0.085 * down]),
        )
    return spec.compile()


def film(
    q: Float[np.ndarray, "N 7"],
    held: Bool[np.ndarray, " N"],
    pick: Float[np.ndarray, "3"],
    place: Float[np.ndarray, "3"],
    size: tuple[int, int] = (360, 360),
) -> UInt8[np.ndarray, "N H W 3"]:
    """Return pictures (N, H, W, 3) of the arm at joint positions ``q`` (N, 7) [rad].

    The tool is on the flange where ``held`` (N,). A separate process renders them: the graphics
    that MuJoCo uses are fixed when it is imported, and drivers may crash.

    Raises:
        NoRenderer: where MuJoCo finds no graphics, not even in software.
    """
    # EGL needs no screen
    environment = os.environ if sys.platform != "linux" else {"MUJOCO_GL": "egl"} | os.environ
    with tempfile.TemporaryDirectory() as name:
        given, made = Path(name) / "given.npz", Path(name) / "made.npy"
        np.savez(given, q=q, held=held, pick=pick, place=place, size=size)
        words = [sys.executable, "-m", "jaxidl.systems.render", str(given), str(made)]
        said = subprocess.run(words, env=environment, capture_output=True, text=True, check=False)
        if made.is_file():
            return np.load(made)
    reason = (said.stderr.strip().splitlines() or ["no message"])[-1]
    raise NoRenderer(
        "a renderer for the pictures",
        reason[:200],
        "install software rendering (Mesa) or set MUJOCO_GL",
    )


def _render(
    q: np.ndarray, held: np.ndarray, pick: np.ndarray, place: np.ndarray, size: tuple[int, int]
) -> np.ndarray:
    model = scene(pick, place)
    data, camera = mujoco.MjData(model), mujoco.MjvCamera()
    camera.lookat, camera.distance, camera.azimuth, camera.elevation = (
        [0.25, 0.0, 0.35],
        1.75,
        125.0,
        -18.0,
    )
    renderer = mujoco.Renderer(model, *size)
    released = np.maximum.accumulate(held) & ~held
    pictures = []
    for pose, now, over in zip(q, held, released, strict=True):
        for name, seen in (("held", now), ("at_pick", not now and not over), ("at_place", over)):
            for part in ("grip", "head"):
                model.geom(f"{name}_{part}").rgba[:] = [0.1, 0.35, 0.6, float(seen)]
        data.qpos[:] = pose
        mujoco.mj_forward(model, data)
        renderer.update_scene(data, camera)
        pictures.append(renderer.render())
    return np.stack(pictures)


if __name__ == "__main__":
    with np.load(sys.argv[1]) as job:
        done = _render(
            job["q"], job["held"], job["pick"], job["place"], tuple(job["size"].tolist())
        )
    np.save(sys.argv[2], done)
    os._exit(0)  # some drivers fail when they are shut down
