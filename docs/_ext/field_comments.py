"""Fields of records are documented by comments, ``q: Joints  # (J,) [rad]``: this hands them to
autodoc, and leaves out of signatures what nobody sets.
"""

import ast
import inspect
import re
import textwrap
from functools import cache
from importlib import import_module
from typing import Any

from sphinx.application import Sphinx


@cache
def comments(cls: type) -> dict[str, str]:
    """The comment on each field of a class: beside it, or in the lines above it."""
    try:
        source = textwrap.dedent(inspect.getsource(cls))
    except (OSError, TypeError):
        return {}
    lines, found = source.splitlines(), {}
    body = ast.parse(source).body[0]
    for node in getattr(body, "body", []):
        if not (isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)):
            continue
        beside = re.search(r"#\s*(.+)$", lines[node.end_lineno - 1][node.end_col_offset :])
        above, at = [], node.lineno - 2
        while at >= 0 and lines[at].strip().startswith("#"):
            above.insert(0, lines[at].strip().lstrip("# "))
            at -= 1
        text = beside.group(1) if beside else " ".join(above)
        if text and not text.startswith("type:"):
            found[node.target.id] = text[0].upper() + text[1:]
    return found


def _class(name: str) -> tuple[type | None, str]:
    """The class of a field's full name, and the field."""
    *path, field = name.split(".")
    for cut in range(len(path) - 1, 0, -1):
        try:
            found: Any = import_module(".".join(path[:cut]))
        except ImportError:
            continue
        for part in path[cut:]:
            found = getattr(found, part, None)
        return (found if isinstance(found, type) else None), field
    return None, field


def _bars(line: str) -> str:
    """Escape bars outside of literals: to docutils they would be substitutions."""
    parts = re.split(r"(``.*?``|`.*?`)", line)
    return "".join(p if p.startswith("`") else p.replace("|", r"\|") for p in parts)


def document(
    app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    """Put a field's comment where it has no docstring; bars are absolute values."""
    lines[:] = [_bars(line) for line in lines]
    said = " ".join(lines).strip()
    if what not in ("attribute", "property") or (said and not said.startswith("Alias for field")):
        return
    cls, field = _class(name)
    for base in cls.__mro__ if cls else ():
        text = comments(base).get(field)
        if text:
            lines[:] = [re.sub(r"([*_|])", r"\\\1", text)]
            return
    lines[:] = []


def shorten(
    app: Sphinx, what: str, name: str, obj: object, options: object, signature: str, returns: str
) -> tuple[str, str] | None:
    """Leave flax's and our own internal arguments out."""
    if not signature:
        return None
    signature = re.sub(r", \*, kind: type \| None = None\)", ")", signature)
    signature = re.sub(r"\(\*, kind: type \| None = None\)", "()", signature)
    return re.sub(r", kind: type \| None = None\)", ")", signature), returns


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("autodoc-process-docstring", document)
    app.connect("autodoc-process-signature", shorten)
    return {"parallel_read_safe": True}
