"""Measured logs as robots give them: read from files, columns recognised, checked, brought onto one
grid of instants.
"""

from jaxidl.logs.log import Log, read

__all__ = ["Log", "read"]
