"""Formulas as MathML, which browsers draw by themselves: no script, nothing fetched."""

import re

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator


def formula(latex: str, display: str = "inline") -> str:
    """MathML with its dots and hats close above their letters."""
    accents = r"<mover>(<mi>[^<]*</mi>)<mo>(&#x002D9;|&#x000A8;|&#x0005E;)</mo></mover>"
    close = r'<mover accent="true">\1<mo stretchy="false">\2</mo></mover>'
    return re.sub(accents, close, convert(latex, display=display))


def inline(self: HTML5Translator, node: nodes.math) -> None:
    self.body.append(formula(node.astext()))
    raise nodes.SkipNode


def block(self: HTML5Translator, node: nodes.math_block) -> None:
    self.body.append(f'<div class="math">{formula(node.astext(), "block")}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
