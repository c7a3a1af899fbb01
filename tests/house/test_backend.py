"""How programs are compiled: options, precision, kept programs and many devices."""

import json

import jax
import numpy as np
import pytest

from jaxidl import backend
from jaxidl.backend import compiler_options, keep_programs
from jaxidl.jobs.points import points
from jaxidl.jobs.programs import program
from jaxidl.paper.grid import Grid
from jaxidl.paper.runs import LearningRun
from tests.helpers.process import script

GRID = Grid(
    ("pid",), ("low",), (1e-4, 8e-4), (5.0,), (5.0,), (1,), (1, 2), ("joint",), executions=3
)


@pytest.mark.slow
def test_compiler_options_change_no_bit(small_study):
    learning, at = LearningRun(small_study, GRID.executions), list(points(GRID.dims()))
    inputs, kind = learning.job().traced(at), dict(learning.job().kind(at[0]))

    def run(options):
        return jax.jit(
            lambda i: jax.lax.map(lambda one: learning(**kind, **one), i), compiler_options=options
        )(inputs)

    assert compiler_options()  # this XLA knows them
    plain, optioned = run({}), run(compiler_options())
    for name in plain:
        np.testing.assert_array_equal(plain[name], optioned[name])


def test_an_option_that_xla_no_longer_knows_is_left_out(monkeypatch):
    monkeypatch.setattr(backend, "CPU_OPTIONS", {"xla_cpu_option_of_another_age": True})
    assert backend.compiler_options.__wrapped__() == {}


def test_networks_are_computed_in_full_single_precision(small_study):
    """On a GPU the default would be TF32."""
    learning, at = LearningRun(small_study, GRID.executions), list(points(GRID.dims()))
    text = program(learning, learning.job().kind(at[0])).lower(learning.job().traced(at)).as_text()
    products = [line for line in text.splitlines() if "dot_general" in line and "xf32" in line]
    assert len(products) > 10
    assert all("precision = [HIGHEST, HIGHEST]" in line for line in products)


@pytest.fixture
def cache_setting():
    before = jax.config.jax_compilation_cache_dir
    yield
    jax.config.update("jax_compilation_cache_dir", before)


def test_programs_are_kept_in_the_users_cache_by_default(monkeypatch, tmp_path, cache_setting):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    before = jax.config.jax_compilation_cache_dir
    keep_programs()  # JAX_COMPILATION_CACHE_DIR is set, as conftest does: JAX's own setting stands
    assert jax.config.jax_compilation_cache_dir == before
    monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR")
    keep_programs()
    assert jax.config.jax_compilation_cache_dir.startswith(str(tmp_path / "jaxidl" / "programs-"))


EIGHT_DEVICES = """
    import json
    import jax
    jax.config.update("jax_enable_x64", True)
    from jaxidl.jobs.points import points
    from jaxidl.jobs.programs import program
    from jaxidl.paper.grid import Grid
    from jaxidl.paper.runs import LearningRun
    from tests.helpers.studies import SMALL_STUDY

    grid = Grid(("pid",), ("low", "high"), (1e-4, 8e-4), (5.0,), (5.0,), (1,), (1, 2, 3, 4), ("joint",), executions=4)
    learning, at = LearningRun(SMALL_STUDY, grid.executions), list(points(grid.dims()))
    inputs = learning.job().traced(at)
    runs = {}
    for devices in (1, 2, 8):
        error = program(learning, learning.job().kind(at[0]), devices)(inputs)["q_error"]
        assert len(error.sharding.device_set) == devices
        runs[devices] = error.tolist()
    print(json.dumps([len(jax.devices()), runs[1], runs[2], runs[8]]))
"""  # noqa: E501


@pytest.mark.slow
def test_runs_sharded_over_eight_devices_are_those_of_one():
    """Simulated devices; recorded averages may differ in the last bit (XLA sums them in another
    order).
    """
    flags = "--xla_force_host_platform_device_count=8"
    count, *runs = json.loads(script(EIGHT_DEVICES, XLA_FLAGS=flags))
    assert count == 8
    for other in runs[1:]:
        np.testing.assert_allclose(other, runs[0], rtol=1e-14)
