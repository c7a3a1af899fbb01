"""Columns that a log needs and does not have, and the errors about them."""

import difflib
import re
import shlex

from jaxidl.errors import LogError
from jaxidl.logs.families import INSTANTS
from jaxidl.logs.header import read_title
from jaxidl.logs.table import Table, listed, shown
from jaxidl.logs.words import CONTROL, CURRENT, KINDS


def meant(name: str) -> str | None:
    """Return the column that a title may mean.

    ``t [ms]`` is ``time``, ``Torque_1`` is ``tau1``.
    """
    title = read_title(name[:40])
    if title is None or title.wish:
        return None
    return title.kind if title.kind in INSTANTS else f"{title.kind}{title.number or 0}"


def count_joints(table: Table, joints: int | None, current: bool = False) -> int:
    """Return J, after checking that time, and q and tau of each joint 0 to J - 1, are there.

    Args:
        joints: number of the model's joints; None takes that of the log.
        current: true if the log has motor currents instead of torques.

    Raises:
        LogError: if a column is missing, with the one that may be it; if the joints are not the
            model's.
    """
    drive = CURRENT if current else "tau"
    kinds = (*KINDS, *[CURRENT] * current, *CONTROL)
    has = {
        kind: sorted(
            int(key[len(kind) :]) for key in table.columns if re.fullmatch(kind + "[0-9]+", key)
        )
        for kind in kinds
    }
    count = max([0, *has["q"], *has[drive]]) + 1 if joints is None else joints
    if "time" not in table.columns:
        titles = [table.titles.get(key, key) for key in table.columns]
        got = f"columns {listed([*titles, *table.ignored])}"
        raise LogError(
            f"a column time in {table.name}",
            got,
            (near(table, "time") or "add a column time, or name it: --columns time=TITLE")
            + ", in seconds",
        )
    if has["q"] == list(range(count)) and not has[drive]:
        _without_drive(table, count, current)
    for kind in kinds:
        if kind in ("q", drive) or (has[kind] and kind != "tau"):
            _numbered(table, kind, has[kind], count, joints)
    return count


def _without_drive(table: Table, count: int, current: bool) -> None:
    """Raise LogError for a log with positions and no torques, naming possible sources."""
    key, what = (CURRENT, "currents") if current else ("tau", "torques")
    expected = f"{what} {key}0{f'..{key}{count - 1}' if count > 1 else ''} in {table.name}"
    got = f"columns {listed([*table.columns, *table.ignored])}"
    if current:
        torques = "tau0" in table.columns
        remedy = (
            "leave out --torque-constant: the log has torques"
            if torques
            else f"name them: --columns '{key}=title_*'"
        )
        raise LogError(expected, got, remedy)
    titles = {name: read_title(name) for name in table.ignored[:200]}
    if currents := [
        name for name, title in titles.items() if title and title.kind == CURRENT and not title.wish
    ]:
        remedy = "give --torque-constant [Nm/A of the motor] and --gear-ratio, or --motor FILE.yaml"
        raise LogError(expected, f"currents ({shown(currents[0])[1:-1]} ...)", remedy)
    if near(table, "tau0"):
        return
    remedy = (
        "record torque, or motor current with --torque-constant and --gear-ratio, or PWM * supply"
        " voltage * kt / R as tau"
    )
    if wishes := [
        name for name, title in titles.items() if title and title.kind == "q" and title.wish
    ]:
        raise LogError(
            expected, f"positions and their targets only ({shown(wishes[0])[1:-1]} ...)", remedy
        )
    raise LogError(expected, got, f"add a column tau0, or name it: --columns tau0=TITLE; {remedy}")


def _numbered(table: Table, kind: str, has: list[int], count: int, joints: int | None) -> None:
    """Raise LogError unless a kind of column is there for the joints 0, 1, ..., count - 1."""
    if has == list(range(count)):
        return
    missing = sorted(set(range(count)) - set(has))
    remedy = f"remove {kind}{count} and above, or give the model that was measured"
    if missing:
        remedy = (
            near(table, f"{kind}{missing[0]}")
            or f"add a column {kind}{missing[0]}, or name it: --columns {kind}{missing[0]}=TITLE"
        )
        if 0 < len(has) < count and not near(table, f"{kind}{missing[0]}"):
            remedy += "; or choose the joints that the log has: --joints NAME ..."
    from_one = has == list(range(1, len(has) + 1)) and not any(
        f"{other}0" in table.columns for other in KINDS
    )
    if has and from_one and "rename" not in remedy:
        count -= joints is None
        remedy = f"number joints from 0: rename {kind}1 to {kind}0, and so on"
    span = f"column {kind}0" if count == 1 else f"columns {kind}0..{kind}{count - 1}"
    why = (
        "without gaps" if joints is None else f"for the model's {joints} joint{'s' * (joints > 1)}"
    )
    got = [f"{kind}{n}" for n in has] or [*table.columns, *table.ignored]
    raise LogError(f"{span} {why} in {table.name}", listed(got), remedy)


def near(table: Table, key: str) -> str | None:
    """Return the remedy for a missing column if it seems to have another name."""
    candidates = [name for name in table.ignored[:200] if len(name) <= 40]
    close = [name for name in candidates if meant(name) == key] or difflib.get_close_matches(
        key, candidates, 1, 0.7
    )
    if not close:
        return None
    given = shlex.quote(f"{key}={shown(close[0])[1:-1]}")
    return f"rename column {shown(close[0])} to {key}, or give --columns {given}"
