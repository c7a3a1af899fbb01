"""A diagnosis as text for the terminal."""

import textwrap
from collections.abc import Iterable, Sequence

from jaxidl.gap.result.diagnosis import SURE, Diagnosis, Finding
from jaxidl.report.matrix import ALIKE, KINDS, Entry, Matrix, matrix, spelled
from jaxidl.report.words import (
    badge,
    compared,
    confidence,
    excess,
    frame,
    lengths,
    listed,
    longest,
    on_joint,
    oneline,
    percent,
    readable,
    refined_rows,
    short,
    silent,
    undecided,
    verdict,
)

COLUMNS = 100  # most characters per line
NAME, NARROW, WIDE, NARROWEST = 22, 16, 18, 9  # largest widths of columns, and the least of them

Line = Sequence[str]


def table(d: Diagnosis) -> str:
    """Return the first screen of a diagnosis.

    It has the verdict, joints × kinds of effect, effects of the whole mechanism, errors by joint,
    the residual, and notes on log and model. Lines have at most ``COLUMNS`` characters; the text
    ends without a newline.
    """
    parts = [
        _wrapped(f"{badge(d)}. {verdict(d)}"),
        _found(d),
        _details(d),
        _errors(d),
        _unexplained(d),
        _refined(d),
    ]
    parts += [_doubt(d, *a) for a in d.ambiguous]
    parts += [_wrapped(f"Note: {oneline(note)}.") for note in d.notes]
    return "\n\n".join(
        "\n".join(line[:COLUMNS].rstrip() for line in part) for part in parts if part
    )


def _found(d: Diagnosis) -> list[str]:
    """Return joints × kinds.

    Cells of several numbers have only the names; ``_details`` has the rest.
    """
    m = matrix(d)
    columns = [k for k in range(len(KINDS)) if any(row[k] for row in m.rows)]
    if not columns:
        return []
    widths = [NAME, *(NARROW if k in ALIKE else WIDE for k in columns)]
    head = ["joint", *(f"{KINDS[k]}\n[{m.units[k]}]" if m.units[k] else KINDS[k] for k in columns)]
    body = [
        [oneline(name), *(_cell(row[k], k) for k in columns)]
        for name, row in zip(d.model.names, m.rows, strict=True)
    ]
    what = "Changed since the reference log" if compared(d) else "Missing in the model"
    doubt = (
        f", in parentheses if below {100 * SURE:.0f} %"
        if not all(f.sure for f in d.findings)
        else ""
    )
    about = f"{what}, by joint: value ± standard error, confidence below it{doubt}"
    about += f"; {less}" if (less := excess(d)) else ""
    return [*_wrapped(about), *_boxes([head, *body], widths)]


def _cell(entries: Iterable[Entry], kind: int) -> str:
    """Return the text of a cell, its parts on lines of their own."""
    if kind in ALIKE:
        return "\n".join(
            _doubted(f"{e.value}\n{confidence(e.finding)}" if e.own else e.value, e.sure)
            for e in entries
        )
    names: dict[str, Finding] = {}
    for e in entries:
        names.setdefault(e.what, e.finding)
    return "\n".join(_doubted(f"{label}\n{confidence(f)}", f.sure) for label, f in names.items())


def _doubted(text: str, sure: bool) -> str:
    return text if sure else f"({text})"


def _details(d: Diagnosis) -> list[str]:
    """Return numbers for which the table has no room.

    They are those of the whole mechanism, of links and of other effects.
    """
    m = matrix(d)
    whole = [f for f in d.findings if f.joint is None]
    lines = []
    for f in sorted(whole, key=lambda f: not f.sure):
        numbers = "; ".join(f"{readable(name)} {spelled(p)}" for name, p in f.parameters.items())
        text = ", ".join(
            part
            for part in (
                f"{readable(f.name)}: {numbers}",
                frame(d, f),
                f"confidence {confidence(f)}",
            )
            if part
        )
        lines += _wrapped(_doubted(text, f.sure))
    lines = ["Of the whole mechanism:", *lines] if lines else []
    rest = _rest(d, m)
    return [*lines, *([""] if lines and rest else []), *rest]


def _rest(d: Diagnosis, m: Matrix) -> list[str]:
    lines = []
    for name, row in zip(d.model.names, m.rows, strict=True):
        for kind, cell in enumerate(row):
            if kind in ALIKE:
                continue
            for what in dict.fromkeys(e.what for e in cell):
                parts = [e for e in cell if e.what == what]
                numbers = "; ".join(" ".join(filter(None, (e.label, e.value))) for e in parts)
                lines += _wrapped(_doubted(f"{oneline(name)}, {what}: {numbers}", parts[0].sure))
    return ["In numbers:", *lines] if lines else []


def _errors(d: Diagnosis) -> list[str]:
    """Return torque error and position error of each joint on held-out data, and references."""
    horizon, quiet = longest(d), silent(d)
    sides = (d.gap.before, d.gap.after)[: 1 + bool(d.findings)]
    rows = [["joint", "torque error", "of the command", "conventional", "noise"]]
    rows[0] += [f"position, {horizon} s"] if horizon else []
    for j, name in enumerate(d.model.names):
        if j in quiet:
            continue
        unit = d.model.units[j]
        row = [oneline(name), " → ".join(short(side.torque_rms[j]) for side in sides) + f" {unit}"]
        row += [
            " → ".join(percent(side.torque_relative[j]) for side in sides),
            percent(d.envelope.torque_relative[j]),
        ]
        row += [f"{d.gap.noise_floor[j]:.2g} {unit}"]
        row += (
            [lengths([side.rollout_rms[horizon][j] for side in sides], d.model.kinds[j])]
            if horizon
            else []
        )
        rows.append(row)
    arrow = ", before → after" if d.findings else ""
    about = (
        f"Error on held-out data{arrow}; conventional: error after a fit of friction, offset and"
        " inertias on every joint; noise: error due to encoder noise alone"
    )
    lines = [*_wrapped(about), *_boxes(rows, [NAME, 22, 16, 12, 11, 22])] if len(rows) > 1 else []
    return [*lines, *(line for text in quiet.values() for line in _wrapped(f"{text}."))]


def _unexplained(d: Diagnosis) -> list[str]:
    if not d.unexplained:
        return []
    names = [d.model.names[j] for j in d.unexplained]
    lines = _wrapped(
        f"Not explained on {listed(names)}: the residual there can still be predicted from the"
        " state, or is larger than a conventional model leaves."
    )
    for j in d.unexplained:
        place = next((p.sentence for p in d.remaining if p.joint == j), None)
        lines += _wrapped(f"{place}.", "  ") if place else []
    sure = sum(f.sure for f in d.findings)
    held = (
        f"The {sure} effects named above still hold"
        if sure > 1
        else "The effect named above still holds"
    )
    return [*lines, *(_wrapped(f"{held}.") if sure and not d.doubt else ())]


def _refined(d: Diagnosis) -> list[str]:
    if d.refinement is None:
        return []
    head, rows = refined_rows(d)
    return [
        *_wrapped(f"{head[0].upper()}{head[1:]}"),
        *(f"  {line}" for line in _boxes(rows, [50, 46])),
    ]


def _doubt(
    d: Diagnosis, candidates: Sequence[tuple[str, int | None]], experiment: str
) -> list[str]:
    names = [on_joint(d, key) for key in candidates]
    likelier = candidates[0] in {(f.name, f.joint) for f in d.findings if f.sure}
    return [
        *_wrapped(undecided(names, likelier)),
        *_wrapped(f"To separate them: {experiment}.", "  "),
    ]


def _wrapped(text: str, indent: str = "") -> list[str]:
    whole = text.replace(" ± ", "\xa0±\xa0")  # a line must not end within a number
    return [
        line.replace("\xa0", " ")
        for line in textwrap.wrap(
            whole, COLUMNS, initial_indent=indent, subsequent_indent=indent + "  "
        )
    ]


def _boxes(rows: Sequence[Line], most: Sequence[int]) -> list[str]:
    """Return lines of a table whose cells may have several lines.

    Each cell's lines have at most the given number of characters, fewer where the table would be
    wider than ``COLUMNS``: the widest column gives way first.
    """
    most = list(most)
    while True:
        cells = [[_broken(cell, w) for cell, w in zip(row, most, strict=False)] for row in rows]
        widths = [max(len(line) for row in cells for line in row[k]) for k in range(len(cells[0]))]
        if sum(widths) + 2 * (len(widths) - 1) <= COLUMNS or max(widths) <= NARROWEST:
            break
        most = [min(m, w) for m, w in zip(most, widths, strict=False)]
        most[widths.index(max(widths))] = max(widths) - 1
    lines = []
    for row in cells:
        for n in range(max(map(len, row))):
            words = (
                (cell[n] if n < len(cell) else "").ljust(width)
                for cell, width in zip(row, widths, strict=True)
            )
            lines.append("  ".join(words).rstrip())
    return lines


def _broken(cell: str, width: int) -> list[str]:
    return [part for line in cell.split("\n") for part in textwrap.wrap(line, width) or [""]] or [
        ""
    ]
