"""A diagnosis as data, and what it says.

In reading order: ``findings`` (effects with values and a probability, from ``calibration``),
``judged`` (the trust in them, with ``weight``, and both sides of the gap; ``network`` and ``notes``
look for what is left), ``verdict`` (what is certain, in doubt or unexplained, and what would settle
it), ``diagnosis`` (the record), ``refined`` (the same after a fit to trajectories) and ``words``
(its sentences).
"""

__all__: list[str] = []  # what is public of it, jaxidl.gap lists
