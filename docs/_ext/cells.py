"""Scripts with cells (``# %%``) as notebooks of Python."""

from typing import Any

import jupytext
from nbformat import NotebookNode


def read(text: str, **_: Any) -> NotebookNode:
    """The notebook of a script, whose kernel and language need not be written in its head."""
    notebook = jupytext.reads(text, fmt="py:percent")
    notebook.metadata["kernelspec"] = {
        "name": "python3",
        "display_name": "Python 3",
        "language": "python",
    }
    notebook.metadata["language_info"] = {"name": "python", "pygments_lexer": "ipython3"}
    return notebook
