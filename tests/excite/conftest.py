"""A pendulum and a plan of a short motion of it."""

import numpy as np
import pytest

from jaxidl.excite.limits import limits_of
from jaxidl.excite.prepare import prepared
from jaxidl.gap.benchmark.mechanisms import PENDULUM
from jaxidl.systems.bounds import bounds
from jaxidl.systems.mjcf import read_model

REACHED = {
    "lower": np.array([-1.5]),
    "upper": np.array([1.5]),
    "speed": np.array([3.0]),
    "acceleration": np.array([12.0]),
    "torque": np.array([20.0]),
}


@pytest.fixture(scope="session")
def pendulum(tmp_path_factory):
    path = tmp_path_factory.mktemp("pendulum") / "model.xml"
    path.write_text(PENDULUM)
    return read_model(path)


@pytest.fixture(scope="session")
def limits(pendulum):
    return limits_of(pendulum.names, bounds(pendulum), reached=REACHED)


@pytest.fixture(scope="session")
def made(pendulum, limits):
    return prepared(pendulum, limits, seconds=6.0, top=1.0)
