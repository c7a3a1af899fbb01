"""How arguments look in a help text."""

from typing import Any

from tyro.conf import arg

Names = tuple[str, ...]


def optional(metavar: str, default: str | None = None) -> Any:
    """Return an option that may be left out; a help text gives its ``default`` in these words.

    The value of the option is then nothing, which says nothing in a help text.
    """
    hint = "(optional)" if default is None else f"(default: {default})"
    return arg(metavar=metavar, help_behavior_hint=hint)
