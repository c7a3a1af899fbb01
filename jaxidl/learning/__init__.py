"""Executions and trainings in turn: tasks, data of what was executed, learning, and what keeps it
safe. ``execute`` itself is ``jaxidl.execute``: here that is the name of a module.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
