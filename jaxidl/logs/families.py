"""Columns of one quantity, and what is looked for in a log's header."""

from dataclasses import dataclass, field
from typing import NamedTuple

from jaxidl.logs.header import Title

INSTANTS = ("time", "sec", "nanosec", "run")  # one column of each


@dataclass(frozen=True)
class Wanted:
    """What is looked for in every log of a call. J joints are taken of a robot that may have
    more.
    """

    joints: int | None = None  # J; None: as many as the log has
    names: tuple[str, ...] = ()  # of all joints of the robot, if they are known
    taken: tuple[int, ...] = ()  # places in ``names`` of those that are taken
    columns: tuple[str, ...] = ()  # as the user writes them: KEY=TITLE
    current: bool = False  # are motor currents there instead of torques?

    @property
    def robot(self) -> int | None:
        """How many joints the robot has."""
        return len(self.names) or self.joints

    def place(self, joint: int) -> int | None:
        """The place of the robot's joint among those that are taken."""
        if not self.names:
            return joint
        return self.taken.index(joint) if joint in self.taken else None


@dataclass(frozen=True)
class Chosen:
    """Which columns a log is made of."""

    # in the header, of time, run, q0, tau0, ...; q@NAME is the position of a joint that is not
    # taken
    places: dict[str, int]
    factors: dict[str, float]  # into SI units; what is not there is in SI units
    titles: dict[str, str]  # as they stand in the header
    ignored: tuple[str, ...]  # titles of columns that no one asked for
    notes: tuple[str, ...] = ()


class Member(NamedTuple):
    """A column of a family."""

    place: int
    title: str
    read: Title


@dataclass
class Family:
    """Columns of one quantity; ``joints`` are places in the robot, from ``base`` on where titles
    are numbered.
    """

    kind: str
    rank: int
    members: list[Member]
    joints: dict[int, Member] = field(default_factory=dict)
    base: int = 0

    @property
    def plain(self) -> bool:
        """Is it one column that names no joint?"""
        return (
            len(self.members) == 1
            and self.members[0].read.number is None
            and self.members[0].read.joint is None
        )

    def complete(self, wanted: Wanted, bare: bool = False) -> bool:
        """Is there one column for each joint that is taken? Notes which is whose. If ``bare``, one
        may be of all joints.
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
    """Return a text that fits a line, and that any terminal prints."""
    plain = "".join(
        letter if letter.isprintable() else ascii(letter)[1:-1] for letter in text[: 2 * most]
    )
    return plain if len(plain) <= most else plain[: most - 3] + "..."
