"""Ranges and settings of tests that draw their examples."""

import pytest
from hypothesis import HealthCheck, settings

from jaxidl.learning.sources import SOURCES
from jaxidl.paper.grid import CONTROLLERS, GAINS

# the grid's axes: ranges of numbers, and names
FLOATS = {"noise": (0.0, 1.0), "friction": (0.0, 12.0), "stiction": (0.0, 1000.0)}
COUNTS = {"epochs": (1, 100_000), "seeds": (0, 2**31), "executions": (1, 10_000)}
NAMES = {"controllers": CONTROLLERS, "gains": GAINS, "sources": SOURCES}


def examples(count):
    """The same examples in every run. Fixtures of a function serve all of them."""
    slow = [HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
    return settings(max_examples=count, deadline=None, derandomize=True, suppress_health_check=slow)


# h5netcdf's destructor fails on a file that it could not open, whenever that is collected; it is
# not the file's reader
h5netcdf_may_stumble = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
