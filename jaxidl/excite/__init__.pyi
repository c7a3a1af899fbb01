"""What ``__init__.py`` imports when it is asked for."""

from .limits import Limits, limits_of
from .run import Request, Result, excite

__all__ = ["Limits", "Request", "Result", "excite", "limits_of"]
