"""From a file's header to the columns of a log: by their own names, by the joints', or by what the user writes.

A quantity's columns are a *family*: titles that differ in nothing but the joint. One that is complete is taken, the most literal
one first; two that are equally literal are for the user to choose between.
"""

import difflib
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from jaxidl.errors import LogError
from jaxidl.gap.header import CURRENT, KINDS, Title, factor, joint_called, read_title, tokens

MOST = 10_000  # columns; a header with more is damage, not a log
INSTANTS = ("time", "sec", "nanosec", "run")  # one column of each
KNOWN = re.compile(r"(time|run)|(q|tau|qd|qdd|i)(0|[1-9][0-9]{0,3})", re.ASCII)
KEY = re.compile(r"(time|run|sec|nanosec)|(qdd|qd|q|tau|i)(?:(0|[1-9][0-9]{0,3})|\.(.+))?", re.ASCII)


@dataclass(frozen=True)
class Wanted:
    """What is looked for in every log of a call. J joints are taken of a robot that may have more."""

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

    places: dict[str, int]  # in the header, of time, run, q0, tau0, ...; q@NAME is the position of a joint that is not taken
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
    """Columns of one quantity; ``joints`` are places in the robot, from ``base`` on where titles are numbered."""

    kind: str
    rank: int
    members: list[Member]
    joints: dict[int, Member] = field(default_factory=dict)
    base: int = 0

    def complete(self, wanted: Wanted) -> bool:
        """Is there one column for each joint that is taken? Notes which is whose."""
        by_name = {m.read.joint: m for m in self.members if m.read.joint is not None}
        if by_name:
            found, base, whole = by_name, 0, len(by_name) == len(self.members) and set(wanted.taken) <= set(by_name)
        else:
            numbers = {m.read.number or 0: m for m in self.members}
            count, base = len(numbers), min(numbers)
            order = range(count)
            if wanted.names:
                order = wanted.taken if count == len(wanted.taken) else range(len(wanted.names))
            whole = count == len(order) == len(self.members) and base <= 1 and max(numbers) == base + count - 1
            whole = whole and (bool(wanted.names) or wanted.joints in (None, count))
            found = {j: numbers[base + i] for i, j in enumerate(order)} if whole else {}
        if whole:
            self.joints, self.base = found, base
        return whole

    def __str__(self) -> str:
        first, last = self.members[0].title.strip(), self.members[-1].title.strip()
        return shortened(first) if len(self.members) == 1 else f"{shortened(first)} .. {shortened(last)}"


def shortened(text: str, most: int = 40) -> str:
    """Return a text that fits a line, and that any terminal prints."""
    plain = "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in text[: 2 * most])
    return plain if len(plain) <= most else plain[: most - 3] + "..."


def choose(name: str, headers: Sequence[str], wanted: Wanted, bare: bool = False) -> Chosen:
    """Return which columns of the file ``name`` a log is made of.

    Args:
        headers: titles of its columns.
        bare: a title without a number may be of all joints (arrays hold them in one).

    Raises:
        LogError: if a column is there twice, several may be meant, or ``wanted.columns`` names none.
    """
    if len(headers) > MOST:
        raise LogError(f"at most {MOST} columns in {name}", f"{len(headers)}", "keep time, q*, tau* and run")
    _once(name, headers, bare)
    chosen = Chosen({}, {}, {}, ())
    notes: list[str] = []
    given = _given(name, headers, wanted)
    used = {member.place for family in given for member in family.members}
    titles = [(i, header, read_title(header, wanted.names)) for i, header in enumerate(headers) if i not in used]
    for kind in (*INSTANTS, *KINDS, *[CURRENT] * wanted.current):
        family = next((f for f in given if f.kind == kind), None)
        members = [Member(i, header, title) for i, header, title in titles if title and title.kind == kind]
        if family is None and not (kind == "time" and _split(members, titles, given)):
            family = _likeliest(name, kind, members, wanted, notes, bare)
        if family is not None:
            _take(name, family, wanted, chosen, notes, bare)
            if kind == "q" and wanted.joints is None and family.joints:
                wanted = replace(wanted, joints=len(family.joints))
    pair = [chosen.places.pop(key, None) for key in ("sec", "nanosec")]
    if "time" not in chosen.places and pair[0] is not None:
        chosen.places.update({"time": pair[0]} if pair[1] is None else {"sec": pair[0], "nanosec": pair[1]})
    places = set(chosen.places.values())
    ignored = tuple(header.strip() or "(no name)" for i, header in enumerate(headers) if i not in places)
    return Chosen(chosen.places, chosen.factors, chosen.titles, ignored, tuple(notes))


def _split(times: list[Member], titles: Sequence[tuple[int, str, Title | None]], given: Sequence[Family]) -> bool:
    """Is time in two columns, of seconds and nanoseconds?"""
    if any(f.kind == "time" for f in given) or any(m.title.strip().lower() == "time" for m in times):
        return False
    kinds = {f.kind for f in given} | {title.kind for _, _, title in titles if title}
    return {"sec", "nanosec"} <= kinds


def _once(name: str, headers: Sequence[str], bare: bool) -> None:
    """Complain if a column of a log's own names is there twice."""
    found: dict[str, int] = {}
    for place, header in enumerate(headers):
        if _literal(header, bare):
            key = header.strip().lower()
            if key in found:
                places = f"twice, as columns {found[key] + 1} and {place + 1}"
                raise LogError(f"one column {key} in {name}", places, "remove or rename one of them")
            found[key] = place


def _literal(title: str, bare: bool) -> bool:
    """Is a title one of the log's own names?"""
    key = title.strip().lower() if len(title) < 100 else ""
    return bool(KNOWN.fullmatch(key)) or (bare and key in KINDS)


def _likeliest(name: str, kind: str, members: list[Member], wanted: Wanted, notes: list[str], bare: bool) -> Family | None:
    """The family of a quantity to take, None if there is none.

    Columns of the log's own names are taken even if some are missing, so that the complaint is about them.
    """
    literal = [m for m in members if _literal(m.title, bare)]
    literal += [m for m in members if literal and m not in literal and m.read.words == (kind,) and m.read.joint is None
                and m.read.number not in [other.read.number for other in literal]]  # q_1 beside q0  # fmt: skip
    families: dict[object, Family] = {}
    for m in members:
        if m.read.wish or (kind in INSTANTS and m.read.number is not None):
            continue
        key = (m.read.words, m.read.joint is None)
        families.setdefault(key, Family(kind, m.read.rank + 1, [])).members.append(m)
    if literal:
        own = Family(kind, 0, literal)
        families = {"own": own} | {k: f for k, f in families.items() if not set(f.members) & set(literal)}
    whole = [f for f in families.values() if kind in INSTANTS or f.complete(wanted)]
    if not whole:
        return families.get("own")
    first = min(f.rank for f in whole)
    best = [f for f in whole if f.rank == first]
    if len(best) == 1 and (len(best[0].members) == 1 or kind not in INSTANTS):
        return best[0]
    options = [str(f) for f in best] if len(best) > 1 else [shortened(m.title.strip()) for m in best[0].members]
    if kind in ("q", "tau", "time", CURRENT):
        got = f"{', '.join(options[:4])}"
        raise LogError(f"one set of columns for {kind} in {name}", got, f"choose with --columns {_advice(kind, best[0])}")
    notes.append(f"{kind} is left out: it may be {' or '.join(options[:4])}; choose with --columns {_advice(kind, best[0])}")
    return None


def _advice(kind: str, family: Family) -> str:
    """How to name a family with ``--columns``."""
    first = family.members[0].title.strip()
    if len(family.members) == 1:
        return f"{kind}={shortened(first)}" if kind in ("time", "run") else f"{kind}0={shortened(first)}"
    number = family.members[0].read.number
    if number is None:
        return f"{kind}0={shortened(first)} ..."
    at = first.rfind(str(number))
    return f"'{kind}={shortened(first[:at])}*{shortened(first[at + len(str(number)) :])}'"


def _take(name: str, family: Family, wanted: Wanted, chosen: Chosen, notes: list[str], bare: bool) -> None:
    """Write a family's columns into ``chosen``, and into ``notes`` what was not to be expected of them."""
    kind, single = family.kind, family.kind in INSTANTS
    entries: dict[str, Member] = {}
    only = family.members[0].read
    if single or (bare and len(family.members) == 1 and only.number is None and only.joint is None):
        entries[kind] = family.members[0]
    elif not family.joints:  # columns of the log's own names, some of them missing: they are complained of by name
        entries = {m.title.strip().lower() if _literal(m.title, bare) else f"{kind}{m.read.number}": m for m in family.members}
    else:
        for joint, member in family.joints.items():
            place = wanted.place(joint)
            if place is not None:
                entries[f"{kind}{place}"] = member
            elif kind == "q":
                entries[f"q@{wanted.names[joint]}"] = member
    for key, member in entries.items():
        scale = factor(kind, member.read.unit)
        if scale is None:
            got, known = shortened(member.title.strip()), "rad, deg, m, rad/s, Nm, N, A, s or ms"
            raise LogError(f"a unit such as {known} in {name}", got, "convert the column to SI units and drop the unit")
        chosen.places[key], chosen.titles[key] = member.place, member.title.strip()
        if scale != 1.0:
            chosen.factors[key] = scale
    scales = {chosen.factors.get(key, 1.0) for key in entries} - {1.0}
    converted = f", converted from {family.members[0].read.unit}" if scales else ""
    literal = all(m.title.strip().lower() == key for key, m in entries.items())
    if not literal or converted:
        order = sorted((key for key in entries if "@" not in key), key=lambda key: (len(key), key))
        read = ", ".join(shortened(entries[key].title.strip()) for key in order[:8]) + (", ..." if len(order) > 8 else "")
        counted = " (numbered from 1)" if family.base == 1 and not single else ""
        notes.append(f"{order[0] + (' .. ' + order[-1] if len(order) > 1 else '')} of {name}: {read}{counted}{converted}")


def _given(name: str, headers: Sequence[str], wanted: Wanted) -> list[Family]:
    """Families that the user names with ``KEY=TITLE``."""
    found: dict[str, dict[int | str, Member]] = {}
    for text in wanted.columns:
        key, equals, title = text.partition("=")
        parts = KEY.fullmatch(key.strip())
        if not equals or not parts or not title.strip():
            remedy = "write q0=actual_q_0, or 'q=actual_q_*' for all joints; KEY is time, run, q, tau, qd, qdd or i"
            raise LogError("--columns KEY=TITLE", repr(shortened(text)), remedy)
        kind, title = parts[1] or parts[2], title.strip()
        family, several = found.setdefault(kind, {}), "*" in title
        if parts[1] or parts[3] or parts[4]:
            label: int | str = int(parts[3]) if parts[3] else parts[4] or "all"
            if parts[4] and joint_called(parts[4], wanted.names) is None:
                listed = ", ".join(wanted.names[:8]) or "numbers, as the model's names are not known"
                raise LogError(f"a joint of the model in --columns {shortened(text)}", parts[4], f"use one of {listed}")
            places = _matching(name, headers, title)
            if several and len(places) != 1:
                raise LogError(
                    f"one column for {key} in {name}", f"{len(places)} that fit {shortened(title)}", "write its whole title"
                )
            entries = {label: places[0]}
        elif several:
            entries = {_label(text, part, wanted): place for place, part in _starred(name, headers, title)}
        else:
            entries = {0: _matching(name, headers, title)[0]}
        for label, place in entries.items():
            if label in family:
                raise LogError(f"{kind} of each joint once in --columns", f"{shortened(text)} again", "leave one of them out")
            read = read_title(headers[place], (), kind) or Title(kind, (), None, None, None)
            joint = joint_called(label, wanted.names) if isinstance(label, str) else None
            family[label] = Member(
                place, headers[place], read._replace(joint=joint, number=label if isinstance(label, int) else None)
            )
    families = [Family(kind, 0, list(members.values())) for kind, members in found.items()]
    for family in families:
        if family.kind in (*KINDS, CURRENT) and not family.complete(wanted):
            count = wanted.joints if wanted.joints is not None else "all"
            got = f"{len(family.members)}: {', '.join(shortened(m.title) for m in family.members[:8])}"
            remedy = f"give {family.kind}0, {family.kind}1, ... without gaps, or a pattern such as '{family.kind}=title_*'"
            raise LogError(f"--columns for {family.kind} of {count} joints in {name}", got, remedy)
    return families


def _matching(name: str, headers: Sequence[str], title: str) -> list[int]:
    """Places of the columns with a title, which may hold a star."""
    if "*" in title:
        return [place for place, _ in _starred(name, headers, title)]
    plain = [header.strip() for header in headers]
    if title in plain:
        return [plain.index(title)]
    lower = [header.lower() for header in plain]
    if title.lower() in lower:
        return [lower.index(title.lower())]
    near = difflib.get_close_matches(title[:100], [header[:100] for header in plain[:500]], 1, 0.5)
    listed = ", ".join(shortened(header) for header in plain[:8]) + (", ..." if len(plain) > 8 else "")
    remedy = f"did you mean {shortened(near[0])}?" if near else "correct the title"
    raise LogError(f"a column {shortened(title)} in {name} (--columns)", f"columns {listed}", remedy)


def _starred(name: str, headers: Sequence[str], title: str) -> list[tuple[int, str]]:
    """Places of the columns that fit a title with one star, and what stands for the star in each."""
    if title.count("*") > 1:
        raise LogError("one * in a title (--columns)", shortened(title), "write * for the joint's number or name only")
    before, after = title.lower().split("*")
    found = []
    for place, header in enumerate(headers):
        text = header.strip().lower()
        if len(text) > len(title) - 1 and text.startswith(before) and text.endswith(after):
            found.append((place, header.strip()[len(before) : len(text) - len(after)]))
    if not found:
        listed = ", ".join(shortened(header.strip()) for header in headers[:8]) + (", ..." if len(headers) > 8 else "")
        raise LogError(f"columns {shortened(title)} in {name} (--columns)", f"columns {listed}", "correct the pattern")
    return found


def _label(text: str, part: str, wanted: Wanted) -> int | str:
    """What a star stands for: a joint's number, or its name."""
    if part.strip().isdecimal():
        return int(part.strip()[:6])
    if joint_called(part, wanted.names) is None:
        listed = ", ".join(wanted.names[:8]) if wanted.names else "numbers"
        raise LogError(
            f"numbers or joints of the model for * in --columns {shortened(text)}", shortened(part), f"expected {listed}"
        )
    return part


def looks_like(headers: Sequence[str], words: Sequence[str]) -> list[str]:
    """Titles that have one of some words."""
    return [header for header in headers[:500] if len(header) <= 100 and set(words).intersection(tokens(header))]
