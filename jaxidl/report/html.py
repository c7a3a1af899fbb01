"""The HTML elements that a report needs.

Text is escaped unless it is marked as markup.
"""

from collections.abc import Iterable
from html import escape
from typing import Any

EMPTY = ("br", "img", "meta", "wbr")  # elements without content


class Html(str):
    """Text that is markup already."""


def tag(name: str, /, *content: Any, **attributes: str | None) -> Html:
    """Return an element.

    Content is text (escaped), :class:`Html`, None (left out), or a list or generator of these.
    Attribute names lose a trailing underscore (``class_``); None leaves an attribute out.
    """
    given = "".join(
        f' {key.rstrip("_")}="{escape(value)}"'
        for key, value in attributes.items()
        if value is not None
    )
    return (
        Html(f"<{name}{given}>")
        if name in EMPTY
        else Html(f"<{name}{given}>{join(content)}</{name}>")
    )


def join(content: Iterable[Any]) -> Html:
    """Return pieces of content one after the other."""
    return Html("".join(_markup(piece) for piece in content))


def _markup(piece: Any) -> str:
    if piece is None:
        return ""
    if isinstance(piece, Html):
        return piece
    return (
        join(piece)
        if isinstance(piece, Iterable) and not isinstance(piece, str)
        else escape(str(piece))
    )


def table(
    head: Iterable[Any],
    rows: Iterable[Iterable[Any]],
    numbers: Iterable[int] = (),
    class_: str | None = None,
) -> Html:
    """Return a table that scrolls sideways on a narrow screen.

    Columns in ``numbers`` are aligned to the right.
    """
    right = set(numbers)

    def row(kind: str, cells: Iterable[Any]) -> Html:
        return tag(
            "tr",
            (
                tag(kind, cell, class_="number" if k in right else None)
                for k, cell in enumerate(cells)
            ),
        )

    body = tag("tbody", (row("td", cells) for cells in rows))
    return tag(
        "div",
        tag("table", tag("thead", row("th", head)), body, class_=class_),
        class_="scroll",
        tabindex="0",
    )
