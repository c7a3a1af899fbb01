"""Columns of one quantity, and what is searched for in a log's header."""

from dataclasses import dataclass, field
from typing import NamedTuple

from jaxidl.logs.header import Title

INSTANTS = ("time", "sec", "nanosec", "run")  # one column of each


@dataclass(frozen=True)
class Wanted:
    """What is searched for in every log of a call.

    J joints are used, of a robot that may have more.
    """

    joints: int | None = None  # J; None: as many as the log has
    names: tuple[str, ...] = ()  # names of all joints of the robot, if they are known
    taken: tuple[int, ...] = ()  # indices in ``names`` of the joints that are used
    columns: tuple[str, ...] = ()  # as written by the user: KEY=TITLE
    current: bool = False  # true if the log has motor currents instead of torques
    control: bool = False  # true if what a controller logs (``words.CONTROL``) is needed, too

    @property
    def robot(self) -> int | None:
        """Number of joints of the robot."""
        return len(self.names) or self.joints

    def place(self, joint: int) -> int | None:
        """Return the index of the robot's joint among those that are used."""
        if not self.names:
            return joint
        return self.taken.index(joint) if joint in self.taken else None


@dataclass(frozen=True)
class Chosen:
    """The columns that make up a log."""

    # positions in the header of time, run, q0, tau0, ...; q@NAME is the position of a joint that
    # is not used
    places: dict[str, int]
    factors: dict[str, float]  # factors into SI units; keys not listed are in SI units
    titles: dict[str, str]  # titles as in the header
    ignored: tuple[str, ...]  # titles of columns that are not needed
    notes: tuple[str, ...] = ()


class Member(NamedTuple):
    """A column of a family."""

    place: int
    title: str
    read: Title


@dataclass
class Family:
    """Columns of one quantity.

    ``joints`` are indices in the robot, from ``base`` on where titles are numbered.
    """

    kind: str
    rank: int
    members: list[Member]
    joints: dict[int, Member] = field(default_factory=dict)
    base: int = 0

    @property
    def plain(self) -> bool:
        """Return whether it is one column that names no joint."""
        return (
            len(self.members) == 1
            and self.members[0].read.number is None
            and self.members[0].read.joint is None
        )

    def complete(self, wanted: Wanted, bare: bool = False) -> bool:
        """Return whether there is one column for each joint that is used, and note them.

        If ``bare``, one column may be that of all joints.
        """
        if bare and self.plain:
            return True
        by_name = {m.read.joint: m for m in self.members if m.read.joint is not None}
        if by_name:
            found, base, whole = (
                by_name,
                0,
                len(by_name) == len(self.members) and set(wanted.taken) <= set(by_name),
            )
        else:
            numbers = {m.read.number or 0: m for m in self.members}
            count, base = len(numbers), min(numbers)
            order = range(count)
            if wanted.names:
                order = wanted.taken if count == len(wanted.taken) else range(len(wanted.names))
            whole = (
                count == len(order) == len(self.members)
                and base <= 1
                and max(numbers) == base + count - 1
            )
            whole = whole and (bool(wanted.names) or wanted.joints in (None, count))
            found = {j: numbers[base + i] for i, j in enumerate(order)} if whole else {}
        if whole:
            self.joints, self.base = found, base
        return whole

    def __str__(self) -> str:
        first, last = self.members[0].title.strip(), self.members[-1].title.strip()
        return (
            shortened(first)
            if len(self.members) == 1
            else f"{shortened(first)} .. {shortened(last)}"
        )


def shortened(text: str, most: int = 40) -> str:
    """Return a text short enough for a line, with characters that any terminal prints."""
    plain = "".join(
        letter if letter.isprintable() else ascii(letter)[1:-1] for letter in text[: 2 * most]
    )
    return plain if len(plain) <= most else plain[: most - 3] + "..."
