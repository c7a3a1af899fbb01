"""A simulated robot, its executions and their logs."""

import jax
import pytest

from jaxidl.learning.execute import desired_trajectory
from jaxidl.learning.guard import Guard
from jaxidl.learning.iterate import learn
from jaxidl.systems.mjcf import read_model
from tests.helpers.executions import (
    DT,
    GANTRY,
    NETWORKS,
    TRAINING,
    columns_of,
    draws_of,
    setting_of,
)
from tests.helpers.logs import write
from tests.helpers.model_files import stored

SEED = 7


@pytest.fixture(scope="session")
def gantry(tmp_path_factory):
    """The model, read from its file."""
    return read_model(stored(tmp_path_factory.mktemp("gantry"), GANTRY))


@pytest.fixture(scope="session")
def learned_in_simulation():
    """Desired states, learner and executions (4, T, J) of ``learn`` with a guard."""
    setting = setting_of("doomed")
    _, learner, runs = learn(
        setting,
        draws_of(4),
        jax.random.key(SEED),
        source="weighted",
        error_model=NETWORKS,
        training=TRAINING,
        train_on="sensed_state",
        record=True,
        guard=Guard(),
    )
    return desired_trajectory(setting.task), learner, runs


@pytest.fixture(scope="session")
def columns(learned_in_simulation):
    """The columns of the second execution's log, in which a feedforward was active."""
    desired, _, runs = learned_in_simulation
    return columns_of(jax.tree.map(lambda x: x[1], runs), DT, desired)


@pytest.fixture(scope="session")
def logs(learned_in_simulation, tmp_path_factory):
    """Logs of the executions, with and without velocities and accelerations."""
    desired, _, runs = learned_in_simulation
    folder = tmp_path_factory.mktemp("logs")
    every = [jax.tree.map(lambda x, k=k: x[k], runs) for k in range(4)]
    return [
        write(
            folder / f"execution{k}{('.csv', '.npz', '.parquet')[k % 3]}",
            columns_of(run, DT, desired, derivatives=k != 1),
        )
        for k, run in enumerate(every)
    ]
