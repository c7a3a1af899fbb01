"""Which set of effects explains a log.

In reading order: ``search`` (the whole method in seven steps), ``estimates`` (what is promising),
``objections`` (what may not be named), ``confidence`` (the search on resampled logs), ``rivals``
(other explanations), and ``find``, which puts them together.
"""

__all__: list[str] = []  # what is public of it, jaxidl.gap lists
