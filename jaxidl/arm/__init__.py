"""The robot experiments: the arm study, pick and place, the limits of the method, real time, and
the gap workflow on the arm.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)

EXPERIMENTS = ("study", "pick", "limits", "latency", "gap")
