"""The meaning of a column's title: quantity, joint and unit.

Titles are read one at a time; nothing is decided here.
"""

import re
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

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


class Title(NamedTuple):
    """The possible meaning of a title.

    ``joint`` is the index of the robot's joint that it names, ``number`` a number in the title.
    """

    kind: str
    words: tuple[str, ...]  # what sets it apart from other quantities; the same for all joints
    joint: int | None
    number: int | None
    unit: str | None  # as in the title

    @property
    def wish(self) -> bool:
        """Return whether it is a target rather than a measurement.

        A torque command can be used, a position command cannot.
        """
        return bool((WISHES - COMMANDS if self.kind == "tau" else WISHES).intersection(self.words))

    @property
    def rank(self) -> int:
        """Return how uncertain the reading is.

        0 is the quantity's own word, 1 has filler words, 2 has target words or other words.
        """
        left = [word for word in self.words if KIND_OF.get(word) != self.kind]
        return 0 if not left else 1 if SMALL_TALK.issuperset(left) else 2


def read_title(title: str, robot: Sequence[str] = (), kind: str | None = None) -> Title | None:
    """Return the meaning of a column's title, or None if it names no quantity that a log has.

    Args:
        title: of the column, such as ``q0``, ``actual_q_0 [deg]``, ``elbow/effort`` or ``time_ms``.
        robot: names of the robot's joints.
        kind: the quantity, if it is known; then any title is one of it.
    """
    if len(title) > 100:
        return None
    text, unit = _unit(title)
    if unit is None:
        text, unit = _spelled(text, tuple(robot), kind)
    joint, words = _joint(tokens(text), tuple(robot))
    numbers = [word for word in words if word.isdecimal()]
    rest = [word for word in words if not word.isdecimal()]
    if unit is None and len(rest) > 1 and words[-1] in LETTERS and "_" in text:
        plain = kind or _kind(rest[:-1])
        if plain and rest[-1] in UNITS[plain]:
            unit, rest = rest[-1], rest[:-1]
    found = kind or _kind(rest)
    if found is None or (len(numbers) > 1 - (joint is not None) and kind is None):
        return None
    number = int(numbers[-1][:6]) if numbers and joint is None else None
    return Title(found, tuple(rest), joint, number, unit)


def control_title(title: str, robot: Sequence[str] = ()) -> Title | None:
    """Return the meaning of a column's title if it is one of ``CONTROL``, else None.

    Such are ``tau_feedback0``, ``elbow/qdd_desired`` and ``target acceleration 1``; for the
    arguments see :func:`read_title`.
    """
    title = title.strip()
    read = next(
        (t for kind in KINDS if (t := read_title(title, robot, kind)) and t.unit is not None),
        read_title(title, robot, "q"),
    )
    if read is None:
        return None
    words = frozenset(
        SYNONYMS.get(word) or (KIND_OF[word] if KIND_OF.get(word) in KINDS else word)
        for word in read.words
        if word not in ("joint", "joints", "j", "jnt")
    )
    name = CONTROL_OF.get(words)
    return None if name is None else read._replace(kind=name, words=(name,))


def _unit(title: str) -> tuple[str, str | None]:
    """Return a title without the brackets that hold a unit, and the unit; ``q[0]`` has none."""
    for found in re.finditer(r"[\[(<]\s*([^\])>]*?)\s*[\])>]", title):
        if found[1] and not found[1].isdecimal():
            return title[: found.start()] + " " + title[found.end() :], found[1]
    return title, None


def _spelled(title: str, robot: tuple[str, ...], kind: str | None) -> tuple[str, str | None]:
    """Return a title without the word that is its unit, and the unit.

    Such words stand anywhere behind the first, as in ``position_deg_1`` and ``torque_1_mNm``. A
    velocity in ``deg`` is one in degrees per second. A word of a joint's name is no unit.
    """
    names = {word for name in robot for word in tokens(name)}
    for found in re.finditer(r"(?<=[^a-zA-Z])([a-zA-Z]+)([_ ]*(per)?[_ ]*s2?(?![a-z]))?", title):
        word = found[1].lower()
        if word in SPELLED and word not in names:
            left = title[: found.start()] + " " + title[found.end() :]
            which = kind or _kind([w for w in _joint(tokens(left), robot)[1] if not w.isdecimal()])
            known = {} if which is None else UNITS[which]
            for unit in (word, f"{word}/s", f"{word}/s^2"):
                if unit in known or (which and unit in STEPS):
                    return left, unit
    return title, None


@lru_cache(4096)
def tokens(text: str) -> list[str]:
    """Return words and numbers of a title or a name, in lower case; camel case is split."""
    return re.findall(r"[a-z]+|[0-9]+", re.sub(r"([a-z])([A-Z])", r"\1 \2", text).lower())


def _kind(words: Sequence[str]) -> str | None:
    """Return the quantity that words name.

    None if they name none or several, or one that is not needed.
    """
    if OTHERS.intersection(words):
        return None
    # a single letter may be anything
    plain = all(word in KIND_OF or word in SMALL_TALK or word in WISHES for word in words)
    kinds = {
        KIND_OF[word]
        for word in words
        if word in KIND_OF and (plain or len(word) > 1 or word == "q")
    }
    if "stamp" in words and kinds & {"sec", "nanosec"}:
        kinds.discard("time")
    if len(kinds) > 1:
        kinds.discard(CURRENT)  # "current position"
    if len(kinds) > 1 and "time" in kinds:
        return None
    return kinds.pop() if len(kinds) == 1 else None


def _joint(words: list[str], robot: tuple[str, ...]) -> tuple[int | None, list[str]]:
    """Return the joint whose name occurs in the words, and the other words.

    It is the longest name if there are several.
    """
    best: tuple[int, int, int] | None = None  # length, joint, place
    for length, joint, spelled in _spellings(robot):
        if best is not None and length < best[0]:
            break
        for at in range(len(words) - length + 1):
            left = words[:at] + words[at + length :]
            # an axis called X is also a position, and A1 an acceleration
            told = not _quantity(spelled) or _kind([w for w in left if not w.isdecimal()])
            if words[at : at + length] == list(spelled) and left and told:
                if best is not None and best[1] != joint:
                    return None, words  # two joints: undecided
                best = length, joint, at
    return (
        (None, words) if best is None else (best[1], words[: best[2]] + words[best[2] + best[0] :])
    )


def _quantity(name: Sequence[str]) -> bool:
    """Return whether the words of a joint's name could be those of a quantity."""
    return all(word.isdecimal() or word in KIND_OF for word in name)


@lru_cache(16)
def _spellings(robot: tuple[str, ...]) -> list[tuple[int, int, tuple[str, ...]]]:
    """Return ways to write each joint's name, longest first.

    They are the whole name, and the name without "joint", unless another joint has that too.
    """
    ways: dict[tuple[str, ...], set[int]] = {}
    for j, name in enumerate(robot):
        whole = tuple(tokens(name))
        short = tuple(word for word in whole if word not in ("joint", "jnt"))
        for way in {whole, short}:
            if not all(map(str.isdecimal, way)):
                ways.setdefault(way, set()).add(j)
    return sorted(
        ((len(way), min(js), way) for way, js in ways.items() if len(js) == 1), reverse=True
    )


def joint_called(text: str, robot: Sequence[str]) -> int | None:
    """Return the index of the joint that a text names; None if there is none.

    The text may have "joint" in it or not.
    """
    if text in robot:
        return list(robot).index(text)
    return {way: j for _, j, way in _spellings(tuple(robot))}.get(tuple(tokens(text)))


def joints_called(texts: Sequence[str], robot: Sequence[str]) -> list[str]:
    """Return the names of the joints that texts name, ``elbow_joint`` for ``elbow``.

    What names no joint stays as it is.
    """
    places = [joint_called(text, robot) for text in texts]
    return [text if j is None else robot[j] for text, j in zip(texts, places, strict=True)]


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
