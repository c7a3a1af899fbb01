"""Many runs of anything: a sweep over labelled axes that continues where it stopped, and what long
work needs besides.

Knows no study: a run is a function of its point on the axes, and everything else (programs,
devices, clusters, files that are whole or not there, resumption, provenance, progress, intervals
over seeds) is here once.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
