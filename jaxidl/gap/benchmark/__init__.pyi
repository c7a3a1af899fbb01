"""What ``__init__.py`` imports when it is asked for."""

from .catalogue import make
from .engine import simulate
from .friction import CoulombFriction
from .injected import Injected
from .mechanisms import MECHANISMS, PENDULUM, TWO_LINK

__all__ = ["MECHANISMS", "PENDULUM", "TWO_LINK", "CoulombFriction", "Injected", "make", "simulate"]
