"""What ``__init__.py`` imports when it is asked for."""

from .rollout import replay, rollout_errors

__all__ = ["replay", "rollout_errors"]
