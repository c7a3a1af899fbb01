"""The meaning of a column's title: quantity, joint and unit.

Titles are read one at a time; nothing is decided here.
"""

import re
from collections.abc import Sequence
from typing import NamedTuple

from jaxidl.logs.joint_names import spellings, tokens
from jaxidl.logs.words import (
    COMMANDS,
    CONTROL_OF,
    CURRENT,
    KIND_OF,
    KINDS,
    LETTERS,
    OTHERS,
    SMALL_TALK,
    SPELLED,
    STEPS,
    SYNONYMS,
    UNITS,
    WISHES,
)


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

        0 is the quantity's own word, 1 has filler words or only a unit, 2 has target words or other
        words.
        """
        left = [word for word in self.words if KIND_OF.get(word) != self.kind]
        return 0 if self.words and not left else 1 if SMALL_TALK.issuperset(left) else 2


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
    joint, words = _joint(tokens(text), tuple(robot), unit)
    numbers = [word for word in words if word.isdecimal()]
    rest = [word for word in words if not word.isdecimal()]
    if unit is None and len(rest) > 1 and words[-1] in LETTERS and "_" in text:
        plain = kind or _kind(rest[:-1])
        if plain and rest[-1] in UNITS[plain]:
            unit, rest = rest[-1], rest[:-1]
    found = kind or _kind(rest) or (_measured(rest, unit) if joint is not None else None)
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


def _measured(words: Sequence[str], unit: str | None) -> str | None:
    """Return the quantity of a joint that only a unit names, as in ``elbow actual [deg]``."""
    known = (k for k in (*KINDS, CURRENT) if unit and unit.lower() in UNITS[k])
    return next(known, None) if SMALL_TALK.issuperset(words) else None


def _joint(
    words: list[str], robot: tuple[str, ...], unit: str | None = None
) -> tuple[int | None, list[str]]:
    """Return the joint whose name occurs in the words, and the other words.

    It is the longest name if there are several.
    """
    best: tuple[int, int, int] | None = None  # length, joint, place
    for length, joint, spelled in spellings(robot):
        if best is not None and length < best[0]:
            break
        for at in range(len(words) - length + 1):
            left = words[:at] + words[at + length :]
            # an axis called X is also a position, and A1 an acceleration
            rest = [w for w in left if not w.isdecimal()]
            clear = not _quantity(spelled) or _kind(rest) or _measured(rest, unit)
            if words[at : at + length] == list(spelled) and (left or unit) and clear:
                if best is not None and best[1] != joint:
                    return None, words  # two joints: undecided
                best = length, joint, at
    return (
        (None, words) if best is None else (best[1], words[: best[2]] + words[best[2] + best[0] :])
    )


def _quantity(name: Sequence[str]) -> bool:
    """Return whether the words of a joint's name could be those of a quantity."""
    return all(word.isdecimal() or word in KIND_OF for word in name)
