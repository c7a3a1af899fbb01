"""Write into FOLDER all that the first execution needs: ``python prepare.py FOLDER``.

The model (arm.xml), the robot's own file (robot.json: what is hidden, which only the robot reads),
the task's goals and limits for controller.c (task.h), gains.yaml and options for `jaxidl learn`,
and in FOLDER/0 the controller before any learning: rigid body and feedback.
"""

import argparse
import json
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import jax
import numpy as np

from jaxidl.arm.setup import ArmStudy
from jaxidl.backend import choose_devices
from jaxidl.files import write_bytes
from jaxidl.learning.execute import desired_trajectory
from jaxidl.robot.c import Controller, generate
from jaxidl.systems.arm import arm, compiled, torque_limits

FASTER = 2.0  # times the fastest desired speed is the limit of a joint's speed
NOISE = 1e-5  # [rad] of the encoders

TASK = """/* task.h: goals and limits of the task, written by prepare.py. */
#ifndef TASK_H
#define TASK_H

#define STEPS {steps} /* control steps of an execution */
#define STEPS_EACH {each} /* for each goal */

static const double goal[{goals}][{joints}] = {{ /* [rad] */
{goal}}};
static const double gain[2] = {gain}; /* of the policy [1/s^2, 1/s] */
static const double home[{joints}] = {home}; /* where it begins, at rest [rad] */
static const double lowest[{joints}] = {lowest}; /* [rad] */
static const double highest[{joints}] = {highest};
static const double speed_limit[{joints}] = {speed}; /* [rad/s] */
static const double drive_limit[{joints}] = {drive}; /* [Nm] */

#endif
"""


def row(values: np.ndarray | tuple[float, ...]) -> str:
    return "{" + ", ".join(f"{x:.17g}" for x in np.asarray(values)) + "}"


def task_header(study: ArmStudy) -> str:
    """Return task.h."""
    task = study.task()
    low, high = compiled().jnt_range.T
    fastest = np.abs(np.asarray(desired_trajectory(task).qd)).max(0)
    return TASK.format(
        steps=study.steps,
        each=round(study.seconds_each / study.dt),
        goals=len(study.goals),
        joints=len(low),
        goal="".join(f"    {row(goal)},\n" for goal in study.goals),
        gain=row(np.asarray(task.policy.gains)[0]),
        home=row(study.home),
        lowest=row(low),
        highest=row(high),
        speed=row(np.round(FASTER * fastest.max() * np.ones_like(fastest), 1)),
        drive=row(torque_limits()),
    )


def robot_file(study: ArmStudy) -> dict[str, object]:
    """Return robot.json."""
    h = study.hidden
    hidden = {
        "viscous": h.viscous,
        "coulomb": h.coulomb,
        "load_friction": h.load_friction,
        "mass": h.mass,
        "ripple": h.ripple,
        "period": h.ripple_period,
        "payload": h.payload,
        "payload_com": h.payload_com,
        "noise": NOISE,
        "count": study.count,
    }
    return {"model": "arm.xml", "home": study.home, "hidden": hidden}


def prepare(folder: Path, study: ArmStudy) -> None:
    """Write all files."""
    task, law = study.task(), study.law()
    own = Controller.of(task, arm().plant, law, arm().names)
    code = generate(own, "arm", "the arm of jaxidl, before any learning")
    gains = {
        "law": "doomed",
        "rate": np.asarray(law.rate).tolist(),
        "learner_gain": np.asarray(law.learner_gain).tolist(),
        "smoothing": float(law.smoothing),
        "gradient_smoothing": float(law.gradient_smoothing),
    }
    limits = " ".join(f"{x:g}" for x in torque_limits())
    options = (
        f"--torque-limit {limits} --feedforward-limit {study.feedforward_limit:g}"
        f" --smoothing {float(law.smoothing):g}\n"
    )
    content = {
        "arm.xml": (files("jaxidl.systems") / "arm.xml").read_text(),
        "robot.json": json.dumps(robot_file(study), indent=1) + "\n",
        "task.h": task_header(study),
        "gains.yaml": json.dumps(gains, indent=1) + "\n",  # JSON is YAML
        "learn.options": options,
        "0/arm.h": code.header,
        "0/arm.c": code.source,
    }
    for name, text in content.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        write_bytes(folder / name, text.encode())


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seconds-each", type=float, help="for each of the four goals")
    given = parser.parse_args()
    study = ArmStudy()
    if given.seconds_each:
        study = replace(study, seconds_each=given.seconds_each)
    choose_devices(None)
    with jax.enable_x64(True):
        prepare(given.folder, study)


if __name__ == "__main__":
    main()
