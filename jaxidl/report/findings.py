"""The findings on the page: what is missing by joint, and what each finding is worth."""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from jaxidl.effects import CATALOGUE
from jaxidl.gap.result.diagnosis import SURE, Diagnosis, Finding
from jaxidl.report.html import Html, join, table, tag
from jaxidl.report.matrix import KINDS, Entry, matrix, spelled
from jaxidl.report.words import (
    compared,
    confidence,
    error_unit,
    excess,
    frame,
    gain,
    oneline,
    percent,
    readable,
    short,
)


def found(d: Diagnosis) -> Iterator[Html]:
    """Return joints × kinds of effect, then the effects of the whole mechanism."""
    if not d.findings:
        yield tag(
            "p",
            (
                "This log shows no change."
                if compared(d)
                else "No effect of the catalogue was added."
            ),
        )
        return
    m = matrix(d)
    doubt = (
        ""
        if all(f.sure for f in d.findings)
        else f" In grey and in parentheses: suspected only, confidence below {100 * SURE:.0f} %."
    )
    less = f" {less[0].upper()}{less[1:]}." if (less := excess(d)) else ""
    yield tag(
        "p",
        tag("small", f"Value ± standard error, below it the effect's confidence.{doubt}{less}"),
    )
    columns = [k for k in range(len(KINDS)) if any(row[k] for row in m.rows)]
    if columns:
        units = {k: [tag("br"), tag("small", m.units[k])] if m.units[k] else [] for k in columns}
        head = ["joint", *([KINDS[k], *units[k]] for k in columns)]
        rows = [
            [_name(name), *(_cell(row[k]) for k in columns)]
            for name, row in zip(d.model.names, m.rows, strict=True)
        ]
        yield table(head, rows, class_="kinds")
    whole = [f for f in d.findings if f.joint is None]
    if whole:
        yield tag("h3", "Of the whole mechanism")
        yield table(
            ["effect", "parameters", "confidence"],
            ([_whole(d, f) for f in sorted(whole, key=lambda f: not f.sure)]),
        )


def _name(name: str) -> list[Any]:
    """Return a name that may continue in the next line after its underscores."""
    first, *rest = oneline(name).split("_")
    return [first, *(["_", tag("wbr"), part] for part in rest)]


def _cell(entries: Sequence[Entry]) -> Any:
    out: list[Any] = []
    for k, e in enumerate(entries):
        last = (
            k + 1 == len(entries)
            or entries[k + 1].finding is not e.finding
            or entries[k + 1].what != e.what
        )
        first = k == 0 or entries[k - 1].what != e.what
        text = [tag("strong", e.what), tag("br")] if e.what and first else []
        value = _tight(" ".join(filter(None, (e.label, e.value))))
        certain = [tag("br"), tag("small", confidence(e.finding))] if last and e.own else []
        out.append(
            tag(
                "div",
                *_doubted([*text, value, *certain], e.sure),
                class_=None if e.sure else "doubt",
            )
        )
    return out


def _tight(text: str) -> str:
    """Return a text whose lines do not end within a number or after the name of an axis."""
    return re.sub(r"\b([xyz]{1,2}) (?=-?\d)", "\\1\xa0", text.replace(" ± ", "\xa0±\xa0"))


def _doubted(content: Sequence[Any], sure: bool) -> Sequence[Any]:
    return content if sure else ["(", *content, ")"]


def _whole(d: Diagnosis, f: Finding) -> list[Any]:
    place = frame(d, f)
    names = (
        [tag("strong", readable(f.name)), tag("br"), tag("small", place)]
        if place
        else [tag("strong", readable(f.name))]
    )
    known = CATALOGUE[f.name].parameters
    numbers = [
        tag(
            "div",
            f"{readable(n)} ",
            tag("strong", _tight(spelled(p))),
            tag("br"),
            tag("small", known[n].meaning),
        )
        for n, p in f.parameters.items()
    ]
    row: list[Any] = [names, numbers, confidence(f)]
    return (
        row
        if f.sure
        else [
            tag("div", *_doubted([cell] if k != 1 else cell, k > 0), class_="doubt")
            for k, cell in enumerate(row)
        ]
    )


def worth(d: Diagnosis, record: Sequence[Mapping[str, Any]]) -> Html:
    """Return what is lost without each effect, and where it is written."""
    written = {
        id(f): entry for f, entry in zip(reversed(d.ordered), reversed(record), strict=False)
    }
    head = [
        "effect",
        "joint",
        "confidence",
        "explains of the command",
        "error without → with it",
        "improvement",
    ]
    rows = [
        list(_worth(d, f, written.get(id(f), {})))
        for f in sorted(d.findings, key=lambda f: -np.nan_to_num(f.gain))
    ]
    about = (
        "The error is that on held-out data without and with the effect, all others being fitted"
        " again."
    )
    return join([tag("p", about), table(head, rows, (2, 3, 4, 5), class_="worth")])


def _worth(d: Diagnosis, f: Finding, entry: Mapping[str, Any]) -> Iterator[Any]:
    place = None
    if entry:
        mjcf = entry.get("mjcf")
        beside = "in effects.json" + (f", for MuJoCo as {mjcf}" if mjcf else "")
        place = [
            tag("br"),
            tag("small", f"in model.xml as {mjcf}" if entry.get("in_mjcf") else beside),
        ]
    yield [
        tag("strong", readable(f.name), class_=None if f.sure else "doubt"),
        tag("br"),
        tag("small", CATALOGUE[f.name].sentence),
        place,
    ]
    where = oneline(d.model.names[f.where])
    yield (
        oneline(d.model.names[f.joint])
        if f.joint is not None
        else ["all", tag("br"), tag("small", f"most on {where}")]
    )
    yield confidence(f) if f.sure else f"({confidence(f)})"
    yield percent(f.share)
    yield f"{short(f.held_out_before)} → {short(f.held_out_after)} {error_unit(d, f)}"
    yield gain(f.gain, f.gain_stderr)
