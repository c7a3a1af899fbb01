"""The settings of a study as they stand in results files."""

from dataclasses import asdict
from typing import Any

LATER = ("friction_width", "stiction_width", "kept", "activation_width")  # settings that the first results files did not have


def settings(study: Any) -> dict[str, Any]:
    """All numbers of a dataclass, nested, ready for JSON.

    A setting that earlier versions did not have is left out where it is as it was then: their results can be extended.
    """
    return _since_the_first(asdict(study))


def _since_the_first(node: Any) -> Any:
    if not isinstance(node, dict):
        return node
    return {name: _since_the_first(value) for name, value in node.items() if name not in LATER or value}
