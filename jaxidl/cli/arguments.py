"""How arguments look in a help text."""

from typing import Any

from tyro.conf import arg

Names = tuple[str, ...]


def optional(metavar: str) -> Any:
    """Return an option whose default, nothing, says nothing in a help text."""
    return arg(metavar=metavar, help_behavior_hint="(optional)")
