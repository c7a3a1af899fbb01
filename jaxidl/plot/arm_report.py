"""All figures of a run of ``jaxidl arm``, and its film."""

import io
import sys
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from jaxidl.arm.pick import EVERY, PICK, PLACE
from jaxidl.arm.run import ArmRun, headline_of
from jaxidl.files import write_bytes
from jaxidl.plot import arm, arm_tasks
from jaxidl.plot.style import house_style, save
from jaxidl.systems.render import NoRenderer, film

FILMED = "direct"  # data source of the pictures
PICTURES = 6  # pictures in the strip
SPEED = 0.8  # playback speed of the film


def write_arm_figures(run: ArmRun, result: dict[str, Any], out: Path) -> list[Path]:
    """Draw ``arm_*.png`` and ``.pdf`` into ``out``.

    ``arm_pick.gif`` is drawn too where MuJoCo can render.
    """
    paths: list[Path] = []
    with house_style():
        for name, figure in _figures(result).items():
            paths += save(figure, out, name)
        try:
            paths += (
                _films(run, result["pick"]["runs"][FILMED][0]["q"], out) if "pick" in result else []
            )
        except NoRenderer as error:
            print(f"jaxidl: no pictures of the arm: {error}", file=sys.stderr)
    return paths


def _figures(result: dict[str, Any]) -> dict[str, Figure]:
    """Return one or several figures for each experiment that was run."""
    figures: dict[str, Figure] = {}
    if "study" in result:
        data = result["study"]["data"]
        headline = headline_of(data)
        figures["arm_feedback"] = arm.feedback_by_execution(data)
        figures["arm_feedback_time"] = arm.feedback_over_time(headline)
        figures["arm_model_error"] = arm.model_error(headline)
    draw = {
        "pick": arm_tasks.pick_and_place,
        "limits": arm_tasks.with_and_without_load,
        "gap": arm_tasks.gap_on_the_arm,
    }
    return figures | {f"arm_{name}": draw[name](result[name]) for name in draw if name in result}


def _films(run: ArmRun, q: np.ndarray, out: Path) -> list[Path]:
    """Draw the first and the second execution of ``q`` (K, T, 7) as a strip and as a film.

    In the strip one is above the other, in the film they are side by side.
    """
    study = run.task.study(1.0)
    carried = np.asarray(study.carried_mass())[::EVERY, 0] > 0.0
    step = EVERY * study.dt
    at = np.round(np.linspace(0.0, q.shape[1] - 1, PICTURES)).astype(int)
    films = [film(poses[at], carried[at], PICK, PLACE) for poses in q[:2]]
    titles = ["execution 1", "execution 2, after one\niteration on direct data"]
    paths = save(arm_tasks.strip(films, (at * step).tolist(), titles), out, "arm_pick_strip")
    each = 4  # stored instants per picture
    sides = [film(poses[::each], carried[::each], PICK, PLACE, (280, 280)) for poses in q[:2]]
    pictures = [
        Image.fromarray(np.concatenate(pair, axis=1)).quantize(64)
        for pair in zip(*sides, strict=True)
    ]
    buffer = io.BytesIO()
    first, *rest = pictures
    first.save(
        buffer,
        "GIF",
        save_all=True,
        append_images=rest,
        duration=round(1e3 * each * step / SPEED),
        loop=0,
    )
    write_bytes(out / "arm_pick.gif", buffer.getvalue())
    return [*paths, out / "arm_pick.gif"]
