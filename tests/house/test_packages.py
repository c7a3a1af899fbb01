"""What stands under which name in the packages."""

import ast
import importlib
import pkgutil
import re
import sys
from types import ModuleType

import pytest

import jaxidl
from tests.helpers.paths import ROOT

PACKAGES = sorted(
    ".".join(path.parent.relative_to(ROOT).parts) for path in ROOT.glob("jaxidl/**/__init__.py")
)
PAGES = sorted([*ROOT.glob("docs/**/*.md"), *ROOT.glob("docs/notebooks/*.py"), ROOT / "README.md"])


def modules() -> list[str]:
    """Import all of the package; return the full names."""
    names = [found.name for found in pkgutil.walk_packages(jaxidl.__path__, "jaxidl.")]
    names.remove("jaxidl.__main__")  # runs when it is imported
    for name in names:
        importlib.import_module(name)
    return names


def test_no_function_hides_the_module_of_its_name():
    """``import a.b as b`` gives what stands under ``b`` in ``a``."""
    for name in modules():
        package, _, last = name.rpartition(".")
        assert getattr(sys.modules[package], last) is sys.modules[name], name


@pytest.mark.parametrize("name", PACKAGES)
def test_a_package_says_what_is_public(name):
    package = importlib.import_module(name)
    assert isinstance(package.__all__, list)  # empty if nothing is
    for public in package.__all__:
        # of a name that is also a module's, the import would decide
        assert not isinstance(getattr(package, public), ModuleType) or name == "jaxidl", public


def imported(text: str) -> set[tuple[str, str]]:
    """Module and name of what the Python in a page or notebook imports from inner modules."""
    lines = re.findall(r"^ *from jaxidl\S* import (?:\([^)]*\)|.*)$", text, re.M)
    found = [node for line in lines for node in ast.parse(line.strip()).body]
    return {
        (node.module, alias.name)
        for node in found
        if isinstance(node, ast.ImportFrom) and node.module and node.module not in PACKAGES
        for alias in node.names
    }


def test_the_documentation_needs_nothing_private():
    public = {
        id(getattr(importlib.import_module(name), thing))
        for name in PACKAGES
        for thing in importlib.import_module(name).__all__
    }
    for page in PAGES:
        for module, name in imported(page.read_text(encoding="utf-8")):
            if module.count(".") > 1:  # of a package
                assert id(getattr(importlib.import_module(module), name)) in public, (page, name)
