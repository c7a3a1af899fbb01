"""How the documentation is built: ``sphinx-build -W docs docs/_build/html``."""

import hashlib
import os
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
sys.path.insert(0, str(HERE / "_ext"))

import jaxidl  # noqa: E402

project, author, copyright = "jaxidl", "The jaxidl authors", "The jaxidl authors"
version = release = jaxidl.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "sphinx_design",
    "generated",
    "api",
    "mathml",
]
exclude_patterns = ["_build", "_ext", "conf.py", "**/out/**", "**.ipynb_checkpoints"]

# pages
myst_enable_extensions = ["amsmath", "attrs_block", "attrs_inline", "colon_fence", "deflist",
                          "dollarmath"]  # fmt: skip
myst_heading_anchors = 3
myst_links_external_new_tab = False
suppress_warnings = ["config.cache", "mystnb.unknown_mime_type"]
highlight_language = "text"
html_theme = "furo"
html_title = "jaxidl"
html_favicon = "_static/favicon.svg"
html_static_path = ["_static"]
html_math_renderer = "mathml"
html_css_files = ["jaxidl.css"]
html_copy_source = False
html_show_copyright = False
html_theme_options = {
    "navigation_with_keys": True,
    "light_css_variables": {"color-brand-primary": "#0b5fa5", "color-brand-content": "#0b5fa5"},
    "dark_css_variables": {"color-brand-primary": "#7ab8f5", "color-brand-content": "#7ab8f5"},
}
copybutton_prompt_text = r">>> |\$ "
copybutton_prompt_is_regexp = True

# notebooks: scripts with cells, run when the site is built, and again when they or the package
# change
nb_custom_formats = {".py": "cells.read"}
nb_execution_mode = "cache"
nb_execution_excludepatterns = os.environ.get("JAXIDL_DOCS_NOT_RUN", "").split()
nb_execution_timeout = 600
nb_execution_raise_on_error = True
nb_execution_show_tb = True
nb_merge_streams = True


def code() -> str:
    """Checksum of what the notebooks run."""
    files = sorted([*(ROOT / "jaxidl").rglob("*.py"), *(ROOT / "experiments").glob("own_*.py")])
    return hashlib.sha256(b"".join(f.read_bytes() for f in files)).hexdigest()[:12]


nb_execution_cache_path = os.environ.get("JAXIDL_DOCS_CACHE") or str(
    HERE / "_build" / "notebooks" / code()
)
# reference
autodoc_default_options = {
    "members": True,
    "undoc-members": True,
    "show-inheritance": True,
    "exclude-members": "replace, kind, __new__",
}
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 88
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True
