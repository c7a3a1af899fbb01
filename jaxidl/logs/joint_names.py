"""Names of joints as people write them: with and without "joint", in any case."""

import difflib
import re
from collections.abc import Sequence
from functools import lru_cache

ALMOST = 0.85  # similarity of a misspelt name


@lru_cache(4096)
def tokens(text: str) -> list[str]:
    """Return words and numbers of a title or a name, in lower case; camel case is split."""
    return re.findall(r"[a-z]+|[0-9]+", re.sub(r"([a-z])([A-Z])", r"\1 \2", text).lower())


@lru_cache(16)
def spellings(robot: tuple[str, ...]) -> list[tuple[int, int, tuple[str, ...]]]:
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
    return {way: j for _, j, way in spellings(tuple(robot))}.get(tuple(tokens(text)))


def joints_called(texts: Sequence[str], robot: Sequence[str]) -> list[str]:
    """Return the names of the joints that texts name, ``elbow_joint`` for ``elbow``.

    What names no joint stays as it is.
    """
    places = [joint_called(text, robot) for text in texts]
    return [text if j is None else robot[j] for text, j in zip(texts, places, strict=True)]


def misspelt(words: Sequence[str], name: str) -> bool:
    """Return whether some of a title's words are almost a joint's name: the same but for a letter.

    Numbers have to be the same.
    """
    wanted = [word for word in tokens(name) if word not in ("joint", "jnt")]
    numbers = lambda those: [word for word in those if word.isdecimal()]
    for first in range(len(words) - len(wanted) + 1):
        part = words[first : first + len(wanted)]
        alike = difflib.SequenceMatcher(None, " ".join(part), " ".join(wanted)).ratio()
        if wanted and numbers(part) == numbers(wanted) and ALMOST < alike < 1.0:
            return True
    return False
