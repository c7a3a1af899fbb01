"""Columns that the user names: ``--columns q0=actual_q_0`` or ``q=actual_q_*``."""

import difflib
import re
from collections.abc import Sequence

from jaxidl.errors import LogError
from jaxidl.logs.families import Family, Member, Wanted, shortened
from jaxidl.logs.header import Title, read_title
from jaxidl.logs.joint_names import joint_called
from jaxidl.logs.words import CONTROL, CURRENT, KINDS

KEY = re.compile(
    rf"(time|run|sec|nanosec)|({'|'.join(CONTROL)}|qdd|qd|q|tau|i)(?:(0|[1-9][0-9]{{0,3}})|\.(.+))?",
    re.ASCII,
)


def mapped(name: str, headers: Sequence[str], wanted: Wanted, bare: bool = False) -> list[Family]:
    """Return the families that ``wanted.columns`` name in the header of the file ``name``.

    They are given as ``KEY=TITLE``.

    Raises:
        LogError: if one cannot be read, or there is no such column.
    """
    found: dict[str, dict[int | str, Member]] = {}
    for text in wanted.columns:
        key, equals, title = text.partition("=")
        parts = KEY.fullmatch(key.strip())
        if not equals or not parts or not title.strip():
            remedy = (
                "write q0=actual_q_0, or 'q=actual_q_*' for all joints; KEY is time, run, q, tau,"
                " qd, qdd or i"
            )
            raise LogError("--columns KEY=TITLE", repr(shortened(text)), remedy)
        kind, title = parts[1] or parts[2], title.strip()
        family, several = found.setdefault(kind, {}), "*" in title
        if parts[1] or parts[3] or parts[4]:
            label: int | str = int(parts[3]) if parts[3] else parts[4] or "all"
            if parts[4] and joint_called(parts[4], wanted.names) is None:
                listed = (
                    ", ".join(wanted.names[:8]) or "numbers, as the model's names are not known"
                )
                raise LogError(
                    f"a joint of the model in --columns {shortened(text)}",
                    parts[4],
                    f"use one of {listed}",
                )
            places = _matching(name, headers, title)
            if several and len(places) != 1:
                raise LogError(
                    f"one column for {key} in {name}",
                    f"{len(places)} that fit {shortened(title)}",
                    "write its full title",
                )
            entries = {label: places[0]}
        elif several:
            entries = {
                _label(text, part, wanted): place for place, part in _starred(name, headers, title)
            }
        else:
            entries = {"all": _matching(name, headers, title)[0]}
        for label, place in entries.items():
            if label in family:
                raise LogError(
                    f"{kind} of each joint once in --columns",
                    f"{shortened(text)} again",
                    "leave one of them out",
                )
            read = read_title(headers[place], (), kind) or Title(kind, (), None, None, None)
            joint = joint_called(label, wanted.names) if isinstance(label, str) else None
            family[label] = Member(
                place,
                headers[place],
                read._replace(joint=joint, number=label if isinstance(label, int) else None),
            )
    families = [Family(kind, 0, list(members.values())) for kind, members in found.items()]
    for family in families:
        if family.kind in (*KINDS, *CONTROL, CURRENT) and not family.complete(wanted, bare):
            count = wanted.joints if wanted.joints is not None else "all"
            got = (
                f"{len(family.members)}:"
                f" {', '.join(shortened(m.title) for m in family.members[:8])}"
            )
            remedy = (
                f"give {family.kind}0, {family.kind}1, ... without gaps, or a pattern such as"
                f" '{family.kind}=title_*'"
            )
            if wanted.joints is not None and len(family.members) < wanted.joints:
                remedy += "; or name the joints that are in the log (--joints)"
            raise LogError(f"--columns for {family.kind} of {count} joints in {name}", got, remedy)
    return families


def _matching(name: str, headers: Sequence[str], title: str) -> list[int]:
    """Return the indices of the columns with a title, which may contain a star."""
    if "*" in title:
        return [place for place, _ in _starred(name, headers, title)]
    plain = [header.strip() for header in headers]
    if title in plain:
        return [plain.index(title)]
    lower = [header.lower() for header in plain]
    if title.lower() in lower:
        return [lower.index(title.lower())]
    near = difflib.get_close_matches(title[:100], [header[:100] for header in plain[:500]], 1, 0.5)
    listed = ", ".join(shortened(header) for header in plain[:8]) + (
        ", ..." if len(plain) > 8 else ""
    )
    remedy = f"did you mean {shortened(near[0])}?" if near else "correct the title"
    raise LogError(
        f"a column {shortened(title)} in {name} (--columns)", f"columns {listed}", remedy
    )


def _starred(name: str, headers: Sequence[str], title: str) -> list[tuple[int, str]]:
    """Return the indices of the columns that match a title with one star.

    Each comes with the text in place of the star.
    """
    if title.count("*") > 1:
        raise LogError(
            "one * in a title (--columns)",
            shortened(title),
            "write * for the joint's number or name only",
        )
    before, after = title.lower().split("*")
    found = []
    for place, header in enumerate(headers):
        text = header.strip().lower()
        if len(text) > len(title) - 1 and text.startswith(before) and text.endswith(after):
            found.append((place, header.strip()[len(before) : len(text) - len(after)]))
    if not found:
        listed = ", ".join(shortened(header.strip()) for header in headers[:8]) + (
            ", ..." if len(headers) > 8 else ""
        )
        raise LogError(
            f"columns {shortened(title)} in {name} (--columns)",
            f"columns {listed}",
            "correct the pattern",
        )
    return found


def _label(text: str, part: str, wanted: Wanted) -> int | str:
    """Return what a star represents: a joint's number, or its name."""
    if part.strip().isdecimal():
        return int(part.strip()[:6])
    if joint_called(part, wanted.names) is None:
        listed = ", ".join(wanted.names[:8]) if wanted.names else "numbers"
        raise LogError(
            f"numbers or joints of the model for * in --columns {shortened(text)}",
            shortened(part),
            f"use {listed}",
        )
    return part
