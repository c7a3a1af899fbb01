"""What stands under which name in the packages."""

import importlib
import pkgutil
import sys

import jaxidl


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
