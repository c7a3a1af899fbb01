"""Robots for which nothing was tuned: published models, simulated with what they do not have.

``python experiments/strangers.py FOLDER --models DIR --work WORK [--seed 1]`` takes arms, legs and
a hand from the package example-robot-data (``pip download --no-deps example-robot-data``, unzipped
into DIR). Each is simulated in MuJoCo with other friction and rotor inertia on every joint than its
file has, some with a load, moved along sines by computed torque. Its log goes through
``jaxidl gap`` on the command line, with the file as it is. FOLDER gets strangers.json and
strangers.md; logs and reports stay in WORK, and an interrupted run continues.
"""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

import argparse
import json
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
from guard import keep

from jaxidl.jobs.provenance import revision


class Robot(NamedTuple):
    """A model's file, joints that are logged (all if none are named), rate [Hz] and load [kg]."""

    file: str
    joints: tuple[str, ...] = ()
    rate: int = 250
    load: float = 0.0


ROBOTS = {
    "Panda without its gripper": Robot(
        "panda_description/urdf/panda.urdf", tuple(f"panda_joint{j}" for j in range(1, 8))
    ),
    "UR3": Robot("ur_description/urdf/ur3_robot.urdf", rate=125),
    "UR5 with a load": Robot("ur_description/urdf/ur5_robot.urdf", rate=125, load=2.0),
    "UR10": Robot("ur_description/urdf/ur10_robot.urdf", rate=500),
    "Kinova j2s6s200": Robot("kinova_description/robots/kinova.urdf", rate=100),
    "xArm 7 with a load": Robot("xarm_description/urdf/xarm7.urdf", load=0.8),
    "Z1 without its gripper": Robot(
        "z1_description/urdf/z1.urdf", tuple(f"joint{j}" for j in range(1, 7)), 500
    ),
    "Talos, left arm": Robot(
        "talos_data/robots/talos_reduced.urdf",
        tuple(f"arm_left_{j}_joint" for j in range(1, 8)),
    ),
    "A1, twelve joints on a stand": Robot("a1_description/urdf/a1.urdf", rate=500),
    "SO-101": Robot("so_arm_description/urdf/so101.urdf", rate=200),
    "G1, left arm": Robot(
        "g1_description/urdf/g1_29dof_rev_1_0.urdf",
        tuple(
            f"left_{part}_joint"
            for part in (
                *("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow"),
                *("wrist_roll", "wrist_pitch", "wrist_yaw"),
            )
        ),
        500,
    ),
    "Baxter, right arm with a load": Robot(
        "baxter_description/urdf/baxter.urdf",
        tuple(f"right_{part}" for part in ("s0", "s1", "e0", "e1", "w0", "w1", "w2")),
        rate=100,
        load=1.5,
    ),
    "Alex, left arm": Robot(
        "alex_description/urdf/alex_nub_hands.urdf",
        tuple(
            f"Left{part}"
            for part in (
                *("ShoulderPitch", "ShoulderRoll", "ShoulderYaw", "ElbowPitch"),
                *("WristYaw", "WristRoll", "GripperYaw"),
            )
        ),
    ),
    "Romeo, left leg": Robot(
        "romeo_description/urdf/romeo.urdf",
        tuple(
            f"L{part}"
            for part in ("HipYaw", "HipRoll", "HipPitch", "KneePitch", "AnklePitch", "AnkleRoll")
        ),
        rate=100,
    ),
    "Allegro hand": Robot("allegro_hand_description/urdf/allegro_left_hand.urdf", rate=200),
    "Double pendulum": Robot("double_pendulum_description/urdf/double_pendulum.urdf"),
}
SECONDS, INSIDE = 40.0, 10  # length of a log [s]; simulation steps in a sample
BANDWIDTH, DAMPING = 3.0, 0.7  # of the controller [Hz], [1]
BITS, NOISE = 17, 0.004  # of an encoder's turn; of the torque's spread
WORTH, SURE = 0.03, 0.8  # share of a joint's command that an effect must add; confidence of a name
NAMES = {"viscous_friction": "viscous", "coulomb_friction": "dry", "inertia_error": "rotor"}


def stripped(path: Path, joints: tuple[str, ...]) -> mujoco.MjSpec:
    """Return a URDF's links and joints, without geometry; joints that are not logged are welded."""
    root = ET.parse(path).getroot()
    for link in root.iter("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            link.remove(shape)
    for joint in root.iter("joint"):
        mimic = joint.find("mimic")
        if mimic is not None:
            joint.remove(mimic)
        if mimic is not None or (joints and joint.get("name") not in joints):
            joint.set("type", "fixed")
    spec = mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"))
    spec.compiler.balanceinertia, spec.compiler.fusestatic = True, False
    spec.compiler.boundmass, spec.compiler.boundinertia = 1e-9, 1e-12
    return spec


def simulated(robot: Robot, path: Path, folder: Path, seed: int) -> None:
    """Write log.csv of a robot, and truth.json: what its file lacks, and what that is worth."""
    spec, rng = stripped(path, robot.joints), np.random.default_rng(seed)
    spec.option.timestep = 1.0 / robot.rate / INSIDE
    known = spec.copy().compile()
    own = {"viscous": known.dof_damping.copy(), "dry": known.dof_frictionloss.copy()}
    own["rotor"] = known.dof_armature.copy()
    known.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    known.dof_damping[:] = 0.0
    n, data = known.nv, mujoco.MjData(known)
    lower, upper = np.where(known.jnt_limited, known.jnt_range.T, [[-2.5], [2.5]])
    middle, reach = (lower + upper) / 2, np.minimum((upper - lower) * 0.35, 1.3)

    def needed(q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
        data.qpos[:], data.qvel[:], data.qacc[:] = q, qd, qdd
        mujoco.mj_inverse(known, data)
        return data.qfrc_inverse.copy()

    weights, inertias, full = [], [], np.zeros((n, n))
    for _ in range(200):
        weights.append(needed(middle + reach * rng.uniform(-1, 1, n), *np.zeros((2, n))))
        mujoco.mj_fullM(known, data, full)
        inertias.append(np.diag(full).copy())
    weight, inertia = np.sqrt(np.mean(np.square(weights), 0)), np.mean(inertias, 0)
    size = np.maximum(weight, 0.04 * weight.max())
    true = {
        "viscous": 0.12 * size * rng.uniform(0.5, 1.5, n),
        "dry": 0.1 * size * rng.uniform(0.5, 1.5, n),
        "rotor": 0.3 * inertia * rng.uniform(0.5, 1.5, n),
    }
    for k, joint in enumerate(spec.joints):
        joint.damping, joint.frictionloss = np.array([true["viscous"][k], 0, 0]), true["dry"][k]
        joint.armature, joint.limited = true["rotor"][k], False
        # as close to dry friction as MuJoCo's soft one comes
        joint.solref_friction, joint.solimp_friction = [0.002, 1], [0.995, 0.9999, 1e-3, 0.5, 2]
    if robot.load:
        held = spec.bodies[known.jnt_bodyid[-1]].add_body(name="load")
        held.ipos = [0.02, 0.01, 0.06]
        held.explicitinertial, held.mass, held.inertia = True, robot.load, [1e-3 * robot.load] * 3
    model = spec.compile()
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    rate, phase = 2 * np.pi * rng.uniform(0.05, 0.45, (n, 5)), rng.uniform(0, 2 * np.pi, (n, 5))
    high = reach[:, None] / np.sqrt(5) / (1 + rate / 2)
    robot_, stiff = mujoco.MjData(model), 2 * np.pi * BANDWIDTH
    q, tau, truly, step = [], [], [], 2 * np.pi / 2**BITS
    for i in range(round(SECONDS * robot.rate)):
        at = rate * (i / robot.rate) + phase
        wanted = (
            middle + (high * np.sin(at)).sum(1),
            (high * rate * np.cos(at)).sum(1),
            -(high * rate**2 * np.sin(at)).sum(1),
        )
        if i == 0:
            robot_.qpos[:], robot_.qvel[:] = wanted[:2]
        seen = np.round(robot_.qpos / step) * step
        push = stiff**2 * (wanted[0] - seen) + 2 * DAMPING * stiff * (wanted[1] - robot_.qvel)
        command = needed(seen, wanted[1], wanted[2] + push) + true["rotor"] * (wanted[2] + push)
        command += 0.8 * true["dry"] * np.tanh(wanted[1] / 0.02)
        robot_.qfrc_applied[:] = command
        q.append(seen)
        tau.append(command)
        truly.append((robot_.qvel.copy(), wanted[2]))
        for _ in range(INSIDE):
            mujoco.mj_step(model, robot_)
    speed, spread = np.array([v for v, _ in truly]), np.std(tau, 0)
    adds = {"viscous": speed, "dry": np.sign(speed), "rotor": np.array([a for _, a in truly])}
    lacks = {kind: true[kind] - own[kind] for kind in true}
    truth = {
        "lacks": lacks,
        "worth": {k: np.sqrt(np.mean(adds[k] ** 2, 0)) * abs(lacks[k]) / spread for k in lacks},
        "load": robot.load,
    }
    names = [joint.name for joint in spec.joints]
    head = [f"{name}_{what}" for what in ("position", "effort") for name in names]
    noisy = np.array(tau) + NOISE * spread * rng.normal(size=(len(tau), n))
    table = np.column_stack([np.arange(len(tau)) / robot.rate, q, noisy])
    folder.mkdir(parents=True, exist_ok=True)
    plain = json.dumps(truth, default=lambda x: x.tolist())
    np.savetxt(
        folder / "log.csv", table, "%.8g", ",", header=",".join(["time", *head]), comments=""
    )
    (folder / "truth.json").write_text(plain)


def right(truth: dict[str, Any], effect: dict[str, Any]) -> tuple[str, int | None] | None:
    """Return which hidden effect a finding is, or None."""
    name, values = effect["effect"], list(effect["parameters"])
    if values in (["coefficient"], ["level"], ["extra"]) and NAMES.get(name) in truth["lacks"]:
        return NAMES[name], effect["joint"]
    return ("load", None) if name == "payload" and truth["load"] else None


def judged(folder: Path) -> dict[str, Any]:
    """Return what a report says, compared with the truth."""
    truth, report = (
        json.loads((folder / f).read_text()) for f in ("truth.json", "gap/report.json")
    )
    flat = lambda table: {(kind, j): x for kind, row in table.items() for j, x in enumerate(row)}
    hidden = flat(truth["lacks"]) | {("load", None): truth["load"]}
    named, wrong, off = set(), [], []
    for e in report["effects"]:
        if e["confidence"] < SURE:
            continue
        key = right(truth, e)
        if key is None:
            wrong.append(f"{e['effect']} {'' if e['joint'] is None else e['joint']}".strip())
            continue
        named.add(key)
        own, wanted = e["parameters"], hidden[key]
        value = own.get("mass", next(iter(own.values())))["value"]
        off.append(abs(value - wanted) / abs(wanted))
    worth = {key for key, share in flat(truth["worth"]).items() if share >= WORTH}
    worth |= {("load", None)} if truth["load"] else set()
    after, usual = (
        report["gap"]["after"]["torque_relative"],
        report["envelope"]["torque_relative"],
    )
    return {
        "named": len(named) + len(wrong),
        "wrong": wrong,
        "hidden": len(worth),
        "found": len(worth & named),
        "off": float(np.median(off)),
        "after": float(np.mean(after)),
        "conventional": float(np.mean(usual)),
        "verdict": report["verdict"],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--models", type=Path, required=True)
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    rows = {}
    for number, (name, robot) in enumerate(ROBOTS.items()):
        place = given.work / f"{given.seed}-{name.replace(' ', '_').replace(',', '')}"
        path = next(given.models.rglob(robot.file))
        if not (place / "truth.json").is_file():
            simulated(robot, path, place, 100 * given.seed + number)
        if not (place / "seconds.json").is_file():
            began, log = time.monotonic(), str(place / "log.csv")
            command = [sys.executable, "-m", "jaxidl", "gap", log, "--model", str(path)]
            subprocess.run([*command, "--out", str(place / "gap")], check=True, capture_output=True)
            (place / "seconds.json").write_text(json.dumps(time.monotonic() - began))
        seconds = json.loads((place / "seconds.json").read_text())
        rows[name] = judged(place) | {"seconds": seconds}
        print(name, rows[name], flush=True)
    lines = [
        "| robot | named | wrong | found, of those worth 3 % | median error | held-out error |"
        " conventional | time |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for name, r in rows.items():
        lines.append(
            f"| {name} | {r['named']} | {', '.join(r['wrong']).replace('_', ' ') or 'none'} |"
            f" {r['found']} of {r['hidden']} | {r['off']:.1%} | {r['after']:.2%} |"
            f" {r['conventional']:.2%} | {r['seconds']:.0f} s |"
        )
    about = {"git_revision": revision(), "seed": given.seed, "robots": rows}
    keep(given.folder, "strangers", about, "\n".join(lines))


if __name__ == "__main__":
    main()
