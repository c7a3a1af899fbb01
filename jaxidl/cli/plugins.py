"""Modules with effects of the user's own."""

import importlib.util
import sys
from pathlib import Path

from jaxidl.errors import ConfigurationError, JaxidlError


def load(plugin: str) -> None:
    """Import a Python file or module, whose effects register themselves."""
    from jaxidl.effects import CATALOGUE

    path, known = Path(plugin), set(CATALOGUE)
    try:
        if path.suffix == ".py":
            spec = importlib.util.spec_from_file_location(path.stem, path)
            assert spec is not None
            assert spec.loader is not None
            module = importlib.util.module_from_spec(spec)
            sys.modules[path.stem] = module
            spec.loader.exec_module(module)
        else:
            module = importlib.import_module(plugin)
    except JaxidlError:
        raise
    except Exception as error:  # whatever a user's module raises
        got = f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
        raise ConfigurationError(
            f"a Python file or module in --plugin {plugin}", got, "correct its path or its code"
        ) from None
    mine = any(cls.__module__ == module.__name__ for cls in CATALOGUE.values())
    if not mine and known == set(CATALOGUE):
        raise ConfigurationError(
            f"an effect in --plugin {plugin}",
            "none",
            "put @jaxidl.effects.register above its class",
        )
