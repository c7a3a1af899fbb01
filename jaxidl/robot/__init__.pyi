"""What ``__init__.py`` imports when it is asked for."""

from .execution import Execution, read_execution
from .export import write_c
from .folder import load, save
from .gains import read_gains
from .learn import learn_from, program
from .learned import Learned
from .settings import Wish

__all__ = [
    "Execution",
    "Learned",
    "Wish",
    "learn_from",
    "load",
    "program",
    "read_execution",
    "read_gains",
    "save",
    "write_c",
]
