"""The little HTML that a report needs: elements whose text is escaped unless it says that it is markup already."""

from collections.abc import Iterable
from html import escape
from typing import Any

EMPTY = ("br", "img", "meta", "wbr")  # elements without content


class Html(str):
    """Text that is markup already."""


def tag(name: str, /, *content: Any, **attributes: str | None) -> Html:
    """An element. Content is text (escaped), :class:`Html`, None (left out), or a list or generator of these.

    Attribute names lose a trailing underscore (``class_``); None leaves an attribute out.
    """
    given = "".join(f' {key.rstrip("_")}="{escape(value)}"' for key, value in attributes.items() if value is not None)
    return Html(f"<{name}{given}>") if name in EMPTY else Html(f"<{name}{given}>{join(content)}</{name}>")


def join(content: Iterable[Any]) -> Html:
    """Pieces of content one after the other."""
    return Html("".join(_markup(piece) for piece in content))


def _markup(piece: Any) -> str:
    if piece is None:
        return ""
    if isinstance(piece, Html):
        return piece
    return join(piece) if isinstance(piece, Iterable) and not isinstance(piece, str) else escape(str(piece))


def table(head: Iterable[Any], rows: Iterable[Iterable[Any]], numbers: Iterable[int] = (), class_: str | None = None) -> Html:
    """Return a table that scrolls sideways on a narrow screen; columns in ``numbers`` are set flush right."""
    right = set(numbers)

    def row(kind: str, cells: Iterable[Any]) -> Html:
        return tag("tr", (tag(kind, cell, class_="number" if k in right else None) for k, cell in enumerate(cells)))

    body = tag("tbody", (row("td", cells) for cells in rows))
    return tag("div", tag("table", tag("thead", row("th", head)), body, class_=class_), class_="scroll", tabindex="0")


STYLE = """
:root{--ground:#fff;--text:#1b1f24;--soft:#5b6470;--line:#d9dee4;--panel:#f5f7f9;--accent:#0b62a3;
--named:#0b62a3;--nothing_missing:#1a7346;--ambiguous:#8a5a00;--unexplained:#b3261e;color-scheme:light dark}
@media (prefers-color-scheme:dark){:root{--ground:#14171a;--text:#e4e7ea;--soft:#a0a9b3;--line:#353b42;--panel:#1d2125;
--accent:#6db5ee;--named:#2f7fbf;--nothing_missing:#2b8a58;--ambiguous:#a87510;--unexplained:#cf4a42}
figure img{filter:invert(.92) hue-rotate(180deg)}}
*{box-sizing:border-box}
body{margin:0;background:var(--ground);color:var(--text);font:16px/1.55 system-ui,-apple-system,"Segoe UI",Roboto,sans-serif}
main{max-width:68rem;margin:0 auto;padding:1.5rem 1.25rem 3rem}
h1{font-size:1.55rem;line-height:1.25;margin:0 0 .25rem;overflow-wrap:anywhere}
h2{font-size:1.2rem;margin:2.4rem 0 .6rem;padding-bottom:.25rem;border-bottom:1px solid var(--line)}
h3{font-size:1rem;margin:1.3rem 0 .4rem;overflow-wrap:anywhere}
p,ul,ol{margin:.5rem 0}li{margin:.25rem 0;overflow-wrap:anywhere}p{overflow-wrap:anywhere}
.soft,figcaption,small{color:var(--soft)}figcaption,small{font-size:.86rem}
.verdict{display:flex;flex-wrap:wrap;gap:.5rem .9rem;align-items:center;margin:1rem 0;padding:.9rem 1rem;background:var(--panel);
border-radius:.6rem;font-size:1.06rem}.verdict>span:last-child{flex:1 1 16rem}
.badge{color:#fff;padding:.2rem .75rem;border-radius:1rem;font-weight:600;white-space:nowrap;
print-color-adjust:exact;-webkit-print-color-adjust:exact}
.scroll{overflow-x:auto;margin:.7rem 0}
table{border-collapse:collapse;min-width:100%;font-size:.9rem}
th,td{padding:.38rem .6rem;text-align:left;vertical-align:top;border-bottom:1px solid var(--line)}
th{font-weight:600;color:var(--soft);vertical-align:bottom}
.number{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}th.number{white-space:normal;min-width:5.5rem}
td strong{font-weight:600}.worth td:first-child{min-width:19rem}
.doubt,.doubt small{color:var(--soft)}td>div+div{margin-top:.35rem}
.kinds td{font-variant-numeric:tabular-nums;min-width:6.2rem}.kinds td:first-child,.kinds th:first-child{position:sticky;left:0;
background:var(--ground);min-width:0;font-weight:600;white-space:nowrap}
.kinds td:nth-child(n+2):nth-child(-n+4){white-space:nowrap}
details{margin:.8rem 0}summary{cursor:pointer;color:var(--accent)}
figure{margin:1rem 0}figure>div{overflow-x:auto}
figure img{display:block;width:100%;min-width:32rem;height:auto;background:#fff;border-radius:.4rem}
pre,code{font:.86rem/1.5 ui-monospace,SFMono-Regular,Menlo,Consolas,monospace}
pre{background:var(--panel);padding:.8rem 1rem;border-radius:.5rem;overflow-x:auto}code{overflow-wrap:anywhere}
@media (max-width:40rem){.worth td:first-child{min-width:12rem}
.kinds td:first-child,.kinds th:first-child{white-space:normal;overflow-wrap:anywhere;min-width:5.6rem;
max-width:6.6rem}main{padding:1rem .9rem 2rem}h1{font-size:1.3rem}}
@media print{:root{--ground:#fff;--text:#000;--soft:#444;--line:#bbb;--panel:#f2f2f2;--accent:#0b62a3}
main{max-width:none;padding:0}figure img{filter:none;min-width:0}figure,tr,pre,.verdict{break-inside:avoid}
h2,h3{break-after:avoid}pre{white-space:pre-wrap}
body{font-size:11pt}}
"""
