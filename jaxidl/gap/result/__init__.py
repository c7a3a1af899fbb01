"""A diagnosis as data, and what it says.

In reading order: ``findings`` (effects with values and a probability, from ``calibration``,
``bent`` and other signs), ``verdict`` (what is certain, in doubt or unexplained; ``network`` and
``swings`` look for what is left), ``diagnosis`` (the record), ``refined`` (the same after a fit to
trajectories), ``words``, ``notes`` and ``experiments`` (its sentences and advice).
"""

__all__: list[str] = []  # what is public of it, jaxidl.gap lists
