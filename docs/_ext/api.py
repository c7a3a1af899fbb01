"""The Python reference. Fields of records are documented by comments, ``q: Joints  # (J,) [rad]``:
this hands them to autodoc; signatures become shorter, and pages of source have no dead links.
"""

import ast
import re
from collections.abc import Iterator
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.ext.napoleon import GoogleDocstring
from sphinx.pycode import ModuleAnalyzer

BARE = re.compile(r"jaxlib\._jax\.Array|jax\.Array|jaxtyping\.|numpy\.ndarray")
SHORT = {"jaxlib._jax.Array": "Array", "jax.Array": "Array", "jaxtyping.": "",
         "numpy.ndarray": "ndarray"}  # fmt: skip


def comments(source: str) -> Iterator[tuple[tuple[str, str], str]]:
    """Class, field and comment of each field in a module: beside it, or in the lines above it."""
    lines = source.splitlines()

    def of(body: list[ast.stmt], prefix: str) -> Iterator[tuple[tuple[str, str], str]]:
        for node in body:
            if not isinstance(node, ast.ClassDef):
                continue
            name = f"{prefix}{node.name}"
            yield from of(node.body, f"{name}.")
            for field in node.body:
                if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
                    text = _beside(lines, field) or _above(lines, field)
                    if text and not text.startswith("type:"):
                        yield (name, field.target.id), text[0].upper() + text[1:]

    yield from of(ast.parse(source).body, "")


def _beside(lines: list[str], node: ast.AnnAssign) -> str:
    # columns count bytes
    rest = lines[node.end_lineno - 1].encode()[node.end_col_offset :].decode()
    found = re.search(r"#\s*(.+)$", rest)
    return found.group(1) if found else ""


def _above(lines: list[str], node: ast.AnnAssign) -> str:
    said: list[str] = []
    at = node.lineno - 2
    while at >= 0 and lines[at].strip().startswith("#"):
        said.insert(0, lines[at].strip().lstrip("# "))
        at -= 1
    return " ".join(said)


def teach(analyze):
    """Make the analyser of modules know plain comments, too, not only those with ``#:``."""

    def analysed(self: ModuleAnalyzer) -> None:
        fresh = not self._analyzed
        analyze(self)
        for key, text in comments(self.code) if fresh else ():
            self.attr_docs.setdefault(key, [re.sub(r"([*_])", r"\\\1", text), ""])

    return analysed


def escape(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list) -> None:
    """Escape bars outside of literals: they are absolute values, to docutils substitutions."""
    for k, line in enumerate(lines):
        parts = re.split(r"(``.*?``|`.*?`)", line)
        lines[k] = "".join(p if p.startswith("`") else p.replace("|", r"\|") for p in parts)


def shorten(
    app: Sphinx, what: str, name: str, obj: object, options: object, signature: str, returns: str
) -> tuple[str, str] | None:
    """Leave out the argument that nobody sets."""
    if not signature:
        return None
    signature = re.sub(r", \*, kind: type \| None = None\)", ")", signature)
    signature = re.sub(r"\(\*, kind: type \| None = None\)", "()", signature)
    return re.sub(r", kind: type \| None = None\)", ")", signature), returns


def rename(app: Sphinx, doctree: nodes.document) -> None:
    """Arrays by their short names."""
    for signature in doctree.findall(addnodes.desc_signature):
        for text in list(signature.findall(nodes.Text)):
            if BARE.search(text):
                short = BARE.sub(lambda m: SHORT[m.group()], text)
                text.parent.replace(text, nodes.Text(short))


def whole(self: GoogleDocstring) -> tuple[str, list[str]]:
    """The docstring of an attribute is text, even if it has a colon; its type is annotated."""
    return "", self._consume_to_end()


def one_way(
    app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: nodes.document
) -> None:
    """Drop the links from source back to the reference: what is not documented has some, too."""
    if page.startswith("_modules/") and "body" in context:
        back = re.compile(r'<a class="viewcode-back".*?</a>')
        context["body"] = back.sub("", context["body"])


def setup(app: Sphinx) -> dict[str, bool]:
    ModuleAnalyzer.analyze = teach(ModuleAnalyzer.analyze)
    GoogleDocstring._consume_inline_attribute = whole
    app.connect("autodoc-process-docstring", escape)
    app.connect("autodoc-process-signature", shorten)
    app.connect("doctree-read", rename)
    app.connect("html-page-context", one_way)
    return {"parallel_read_safe": True}
