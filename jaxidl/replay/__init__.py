"""A plant driven by the commands of a measured log.

Rollouts start from measured states, and parameters are fitted to them.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
