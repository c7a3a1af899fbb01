"""jaxidl: learn what a robot's rigid-body model gets wrong, for thousands of configurations at
once.

The public names, in one place. A plant is a rigid body plus a list of named physical effects;
executing a task on it gives data from three sources; an error model learns from them, iteration by
iteration; a sweep does that for a whole grid.
"""

from importlib.metadata import version as _version

import lazy_loader as _lazy

# __init__.pyi lists the names; JAX and the rest are imported with the first of them, not before:
# help is there at once
__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
__version__ = _version("jaxidl")
