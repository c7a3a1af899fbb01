"""The words that titles of columns are made of: quantities, units, and what stands beside them."""

import re

from numpy import pi

KINDS = ("q", "tau", "qd", "qdd")
CURRENT = "i"
WORDS = {
    "q": "q pos position positions angle angles theta x qpos",
    "tau": "tau torque torques effort efforts eff force u f trq moment",
    "qd": "qd dq qdot vel velocity velocities v qvel speed speeds",
    "qdd": "qdd ddq qddot acc accel acceleration accelerations a qacc",
    CURRENT: "i current currents curr amps",
    "time": "time t times timestamp timestamps stamp clock secs seconds",
    "run": "run runs trial episode lap runid",
    "sec": "sec secs",
    "nanosec": "nanosec nanosecs nsec nsecs",
}
KIND_OF = {word: kind for kind, words in WORDS.items() for word in words.split()}
SMALL_TALK = {
    "actual",
    "act",
    "measured",
    "meas",
    "msr",
    "sensed",
    "feedback",
    "fb",
    "present",
    "joint",
    "joints",
    "j",
    "jnt",
    "state",
    "states",
    "robot",
    "header",
    "ros",
    "field",
    "data",
    "elapsed",
}
COMMANDS = {"command", "commanded", "cmd"}
WISHES = COMMANDS | {
    "target",
    "targets",
    "desired",
    "des",
    "d",
    "reference",
    "ref",
    "setpoint",
    "goal",
}
OTHERS = {"error", "err", "limit", "max", "min", "std", "temperature", "temp", "external", "ext"}
UNITS: dict[str, dict[str, float]] = {
    "q": {
        "rad": 1,
        "m": 1,
        "mrad": 1e-3,
        "deg": pi / 180,
        "°": pi / 180,
        "degree": pi / 180,
        "degrees": pi / 180,
        "mm": 1e-3,
    }
    | {"rev": 2 * pi, "turn": 2 * pi, "turns": 2 * pi, "radian": 1, "radians": 1, "cm": 1e-2},
    "qd": {
        "rad/s": 1,
        "m/s": 1,
        "deg/s": pi / 180,
        "°/s": pi / 180,
        "dps": pi / 180,
        "rpm": pi / 30,
        "mm/s": 1e-3,
        "rev/s": 2 * pi,
    }
    | {"1/min": pi / 30, "rad s^-1": 1, "mrad/s": 1e-3},
    "qdd": {
        "rad/s^2": 1,
        "m/s^2": 1,
        "deg/s^2": pi / 180,
        "rad/s2": 1,
        "m/s2": 1,
        "deg/s2": pi / 180,
        "rad/s²": 1,
        "m/s²": 1,
    },
    "tau": {"nm": 1, "n": 1, "mnm": 1e-3, "ncm": 1e-2, "knm": 1e3, "kn": 1e3, "nmm": 1e-3},
    CURRENT: {"a": 1, "ma": 1e-3, "amp": 1, "amps": 1, "ampere": 1},
    "time": {
        "s": 1,
        "sec": 1,
        "secs": 1,
        "seconds": 1,
        "ms": 1e-3,
        "msec": 1e-3,
        "us": 1e-6,
        "µs": 1e-6,
        "usec": 1e-6,
        "ns": 1e-9,
    }
    | {"nsec": 1e-9, "min": 60},
    "sec": {"s": 1},
    "nanosec": {"ns": 1},
    "run": {},
}  # of a slide or a hinge, factor into SI units
# what a controller logs of an execution beside the motion, and of which kind it is
CONTROL = {
    "q_desired": "q",
    "qd_desired": "qd",
    "qdd_desired": "qdd",
    "tau_inverse_desired": "tau",
    "tau_feedback": "tau",
    "tau_feedback_applied": "tau",
    "tau_feedforward": "tau",
}
UNITS.update({name: UNITS[kind] for name, kind in CONTROL.items()})
SYNONYMS = {
    **dict.fromkeys(("des", "target", "targets", "ref", "reference", "setpoint"), "desired"),
    "ff": "feedforward",
    "fb": "feedback",
    "learner": "learning",
}
CONTROL_OF = {frozenset(name.split("_")): name for name in CONTROL} | {
    frozenset(words.split()): name
    for words, name in {
        "tau feedback learning": "tau_feedback",
        "feedback learning": "tau_feedback",
        "feedback applied": "tau_feedback_applied",
        "feedforward": "tau_feedforward",
    }.items()
}
LETTERS = {"m", "n", "a", "s"}  # units of one letter, understood at the end after an underscore
# what no factor turns into SI units
STEPS = {"counts", "ticks", "pulses", "percent"}
# units of several letters, understood anywhere behind the first word
SPELLED = STEPS | {
    unit
    for units in UNITS.values()
    for unit in units
    if len(unit) > 1 and unit.isalpha() and unit not in OTHERS and unit not in KIND_OF
}


def factor(kind: str, unit: str | None) -> float | None:
    """Return the factor that converts a column into SI units.

    It is 1 if the column has no unit, None if the unit is unknown.
    """
    if unit is None:
        return 1.0
    known, plain = UNITS[kind], " ".join(unit.strip().lower().replace("**", "^").split())
    for way in (plain, re.sub(r"[ .·*⋅]", "", plain)):
        if way in known:
            return float(known[way])
    return None
