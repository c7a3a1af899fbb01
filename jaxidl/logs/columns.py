"""From a file's header to the columns of a log.

Columns are found by their standard names, by the joints' names, or as specified by the user. A
quantity's columns are a *family*: titles that differ only in the joint. A complete family is taken,
the most literal one first; between two equally literal ones the user has to choose.
"""

import itertools
import re
from collections.abc import Callable, Sequence
from dataclasses import replace

from jaxidl.errors import LogError
from jaxidl.logs.families import INSTANTS, Chosen, Family, Member, Wanted, shortened
from jaxidl.logs.header import Title, control_title, read_title
from jaxidl.logs.joint_names import misspelt
from jaxidl.logs.mapping import mapped
from jaxidl.logs.words import CONTROL, CURRENT, KIND_OF, KINDS, factor

MOST = 10_000  # columns; a header with more is damage, not a log
KNOWN = re.compile(r"(time|run)|(q|tau|qd|qdd|i)(0|[1-9][0-9]{0,3})", re.ASCII)


def choose(name: str, headers: Sequence[str], wanted: Wanted, bare: bool = False) -> Chosen:
    """Return the columns of the file ``name`` that make up a log.

    Args:
        headers: titles of its columns.
        bare: a title without a number may be that of all joints (arrays hold them in one).

    Raises:
        LogError: if a column occurs twice, several may be meant, or ``wanted.columns`` names none.
    """
    if len(headers) > MOST:
        raise LogError(
            f"at most {MOST} columns in {name}", f"{len(headers)}", "keep time, q*, tau* and run"
        )
    _once(name, headers, bare)
    chosen = Chosen({}, {}, {}, ())
    notes: list[str] = []
    given = mapped(name, headers, wanted, bare)
    used = {member.place for family in given for member in family.members}
    meaning = lambda header: (
        (control_title(header, wanted.names) if wanted.control else None)
        or read_title(header, wanted.names)
    )
    titles = [(i, header, meaning(header)) for i, header in enumerate(headers) if i not in used]
    more = tuple(CONTROL) if wanted.control else ()
    for kind in (*INSTANTS, *KINDS, *[CURRENT] * wanted.current, *more):
        family = next((f for f in given if f.kind == kind), None)
        members = [
            Member(i, header, title) for i, header, title in titles if title and title.kind == kind
        ]
        if family is None and not (kind == "time" and _split(members, titles, given)):
            family = _likeliest(name, kind, members, wanted, notes, bare)
        if family is not None:
            _take(name, family, wanted, chosen, notes, bare)
            if kind == "q" and wanted.joints is None and family.joints:
                wanted = replace(wanted, joints=len(family.joints))
    if not given:
        _part(name, [title for _, _, title in titles], chosen, wanted)
    pair = [chosen.places.pop(key, None) for key in ("sec", "nanosec")]
    if "time" not in chosen.places and pair[0] is not None:
        chosen.places.update(
            {"time": pair[0]} if pair[1] is None else {"sec": pair[0], "nanosec": pair[1]}
        )
    places = set(chosen.places.values())
    ignored = tuple(
        header.strip() or "(no name)" for i, header in enumerate(headers) if i not in places
    )
    return Chosen(chosen.places, chosen.factors, chosen.titles, ignored, tuple(notes))


class PartOfRobotError(LogError):
    """A log names some of the robot's joints only."""

    def __init__(self, expected: str, got: str, remedy: str, joints: tuple[str, ...] = ()):
        super().__init__(expected, got, remedy)
        self.joints = joints


def _part(name: str, titles: Sequence[Title | None], chosen: Chosen, wanted: Wanted) -> None:
    """Raise PartOfRobotError if the joints that the titles name are a part of those wanted.

    If they are fewer and only numbered, or a joint has a torque alone, raise LogError.
    """
    drive = CURRENT if wanted.current else "tau"
    count = len(wanted.taken)
    if all(f"{kind}{j}" in chosen.places for kind in ("q", drive) for j in range(count)):
        return
    numbered = {
        t.number
        for t in titles
        if t and t.kind == "q" and not t.wish and t.joint is None and t.number is not None
    }
    if "q0" not in chosen.places and 1 < len(numbered) < count and wanted.names:
        raise LogError(
            f"positions of the model's {count} joints in {name}",
            f"{len(numbered)} columns of positions",
            "name the joints that the log has, such as --joints "
            + " ".join(wanted.names[j] for j in wanted.taken[: len(numbered)]),
        )
    named = [
        {t.joint for t in titles if t and t.kind == kind and not t.wish and t.joint is not None}
        for kind in ("q", drive)
    ]
    there = sorted(named[0] & named[1])
    if there and not set(wanted.taken) <= set(there):
        names = tuple(wanted.names[j] for j in there)
        for title, j in itertools.product(titles, sorted({*wanted.taken} - {*there})):
            if title and title.joint is None and misspelt(title.words, wanted.names[j]):
                raise LogError(
                    f"columns of {wanted.names[j]} in {name}",
                    f"columns with {' '.join(title.words)}",
                    "correct the titles, or choose the joints that the log has: --joints "
                    + " ".join(names),
                )
        if half := sorted({*wanted.taken} & (named[1] - named[0])):
            raise LogError(
                f"a position beside the torque of {wanted.names[half[0]]} in {name}",
                "none with that joint's name",
                "correct its title, or choose the joints that the log has: --joints "
                + " ".join(names),
            )
        raise PartOfRobotError(
            f"position and torque of {', '.join(wanted.names[j] for j in wanted.taken[:8])}"
            f"{' ...' * (count > 8)} in {name}",
            f"those of {', '.join(names[:8])}{' ...' * (len(names) > 8)}",
            "choose joints that the log has: --joints NAME ...",
            names,
        )


def _split(
    times: list[Member], titles: Sequence[tuple[int, str, Title | None]], given: Sequence[Family]
) -> bool:
    """Return whether time is in two columns, of seconds and nanoseconds."""
    if any(f.kind == "time" for f in given) or any(
        m.title.strip().lower() == "time" for m in times
    ):
        return False
    kinds = {f.kind for f in given} | {title.kind for _, _, title in titles if title}
    return {"sec", "nanosec"} <= kinds


def _once(name: str, headers: Sequence[str], bare: bool) -> None:
    """Raise LogError if a column with a standard name occurs twice."""
    found: dict[str, int] = {}
    for place, header in enumerate(headers):
        if _literal(header, bare):
            key = header.strip().lower()
            if key in found:
                places = f"twice, as columns {found[key] + 1} and {place + 1}"
                raise LogError(
                    f"one column {key} in {name}", places, "remove or rename one of them"
                )
            found[key] = place


def _literal(title: str, bare: bool) -> bool:
    """Return whether a title is one of a log's standard names."""
    key = title.strip().lower() if len(title) < 100 else ""
    return bool(KNOWN.fullmatch(key)) or (bare and key in KINDS)


def _likeliest(
    name: str, kind: str, members: list[Member], wanted: Wanted, notes: list[str], bare: bool
) -> Family | None:
    """Return the family of a quantity to use, None if there is none.

    Columns with standard names are used even if some are missing, so that the error is about them.
    """
    literal = [m for m in members if _literal(m.title, bare)]
    if kind in CONTROL:  # some may be missing, so that the error is about them
        literal = members
    literal += [
        m
        for m in members
        if literal
        and m not in literal
        and m.read.words == (kind,)
        and m.read.joint is None
        and m.read.number not in [other.read.number for other in literal]
    ]  # q_1 beside q0
    useful = [
        m for m in members if not (m.read.wish or (kind in INSTANTS and m.read.number is not None))
    ]
    families = _families(kind, useful, lambda m: m.read.words)
    if literal:
        own = Family(kind, 0, literal)
        families = {"own": own} | {
            k: f for k, f in families.items() if not set(f.members) & set(literal)
        }
    whole = [f for f in families.values() if kind in INSTANTS or f.complete(wanted, bare)]
    if not whole and not literal:  # the torque of a hinge and the force of a slide
        other = lambda m: [word for word in m.read.words if KIND_OF.get(word) != kind]
        named = _families(kind, [m for m in useful if m.read.joint is not None], other)
        whole = [f for f in named.values() if f.complete(wanted, bare)]
    if not whole:
        return families.get("own")
    first = min(f.rank for f in whole)
    best = [f for f in whole if f.rank == first]
    if len(best) == 1 and (len(best[0].members) == 1 or kind not in INSTANTS):
        return best[0]
    options = (
        [str(f) for f in best]
        if len(best) > 1
        else [shortened(m.title.strip()) for m in best[0].members]
    )
    if kind in ("q", "tau", "time", CURRENT, *CONTROL):
        got = f"{', '.join(options[:4])}"
        raise LogError(
            f"one set of columns for {kind} in {name}",
            got,
            f"choose with --columns {_advice(kind, best[0], bare)}",
        )
    notes.append(
        f"{kind} is left out: it may be {' or '.join(options[:4])}; choose with --columns"
        f" {_advice(kind, best[0], bare)}"
    )
    return None


def _families(
    kind: str, members: Sequence[Member], words: Callable[[Member], Sequence[str]]
) -> dict[object, Family]:
    """Return the families of columns in whose titles the same ``words`` are beside the joint."""
    families: dict[object, Family] = {}
    for m in members:
        key = (*words(m), m.read.joint is None)
        families.setdefault(key, Family(kind, m.read.rank + 1, [])).members.append(m)
    return families


def _advice(kind: str, family: Family, bare: bool) -> str:
    """Return how to name a family with ``--columns``."""
    first = family.members[0].title.strip()
    if len(family.members) == 1:
        return (
            f"{kind}={shortened(first)}"
            if kind in INSTANTS or (bare and family.plain)
            else f"{kind}0={shortened(first)}"
        )
    number = family.members[0].read.number
    if number is None:
        return f"{kind}0={shortened(first)} ..."
    at = first.rfind(str(number))
    return f"'{kind}={shortened(first[:at])}*{shortened(first[at + len(str(number)) :])}'"


def _take(
    name: str, family: Family, wanted: Wanted, chosen: Chosen, notes: list[str], bare: bool
) -> None:
    """Write a family's columns into ``chosen``, and what was unexpected into ``notes``."""
    kind, single = family.kind, family.kind in INSTANTS
    entries: dict[str, Member] = {}
    if single or (bare and family.plain):
        entries[kind] = family.members[0]
    elif not family.joints:  # standard names, some of them missing: the error will name them
        for m in family.members:
            number = m.read.number if m.read.number is not None else m.read.joint or 0
            key = m.title.strip().lower() if _literal(m.title, bare) else f"{kind}{number}"
            if key in entries:
                got = f"{shortened(entries[key].title.strip())} and {shortened(m.title.strip())}"
                raise LogError(f"one column {key} in {name}", got, "remove or rename one of them")
            entries[key] = m
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
            raise LogError(
                f"a unit such as {known} in {name}",
                got,
                "convert the column to SI units and drop the unit",
            )
        chosen.places[key], chosen.titles[key] = member.place, member.title.strip()
        if scale != 1.0:
            chosen.factors[key] = scale
    units = dict.fromkeys(str(m.read.unit) for key, m in entries.items() if key in chosen.factors)
    converted = f", converted from {' and '.join(units)}" if units else ""
    literal = all(m.title.strip().lower() == key for key, m in entries.items())
    if not literal or converted:
        order = sorted((key for key in entries if "@" not in key), key=lambda key: (len(key), key))
        read = ", ".join(shortened(entries[key].title.strip()) for key in order[:8]) + (
            ", ..." if len(order) > 8 else ""
        )
        counted = " (numbered from 1)" if family.base == 1 and not single else ""
        notes.append(
            f"{order[0] + (' .. ' + order[-1] if len(order) > 1 else '')} of {name}:"
            f" {read}{counted}{converted}"
        )
