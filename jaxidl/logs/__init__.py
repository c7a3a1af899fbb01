"""Measured logs as robots record them.

They are read from files, their columns are recognised and checked, and they are resampled to one
uniform time grid.
"""

from jaxidl.logs.log import Log, from_arrays, read

__all__ = ["Log", "from_arrays", "read"]
