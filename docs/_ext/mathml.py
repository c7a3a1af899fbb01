"""Formulas as MathML, which browsers draw by themselves: no script, nothing fetched."""

import re

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

# accents as part of the letter: where there is no font for mathematics they are lost otherwise
ACCENTS = {"&#x002D9;": "\u0307", "&#x000A8;": "\u0308", "&#x0005E;": "\u0302"}
OVER = re.compile(
    r"<mover[^>]*><mi>([^<]*)</mi><mo[^>]*>(&#x002D9;|&#x000A8;|&#x0005E;)</mo></mover>"
)


def formula(latex: str, display: str = "inline") -> str:
    """MathML of a formula in LaTeX."""
    text = convert(latex, display=display)
    return OVER.sub(lambda m: f'<mi style="font-style: italic">{m[1]}{ACCENTS[m[2]]}</mi>', text)


def inline(self: HTML5Translator, node: nodes.math) -> None:
    self.body.append(formula(node.astext()))
    raise nodes.SkipNode


def block(self: HTML5Translator, node: nodes.math_block) -> None:
    self.body.append(f'<div class="math">{formula(node.astext(), "block")}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
