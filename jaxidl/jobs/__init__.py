"""Many runs of any function: a sweep over labelled axes that continues where it stopped, and other
tools for long work.

Independent of any study: a run is a function of its point on the axes, and everything else
(programs, devices, clusters, files that are complete or absent, resumption, provenance, progress,
intervals over seeds) is implemented here once.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
