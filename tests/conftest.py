"""Hostile settings for the whole suite: warnings are errors, silent rank promotion raises. With
``JAXIDL_SIGNATURES=1``, as for the slow tests of ``.ci/run``, signatures are checked, too.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

os.environ.setdefault("JAX_PLATFORMS", "cpu")  # two CPU devices, whatever the machine has

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices, and workers on every core

# Compiled programs are kept for all workers and child processes of this session
OWN_CACHE = "JAX_COMPILATION_CACHE_DIR" not in os.environ and tempfile.mkdtemp(
    prefix="jaxidl-tests-"
)
if OWN_CACHE:
    os.environ["JAX_COMPILATION_CACHE_DIR"] = OWN_CACHE
    os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0"
    os.environ["JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES"] = "-1"

# Most programs are small and run once: they are compiled without optimisations, by XLA's older and
# faster emitters, each as one piece of code
QUICK = "--xla_cpu_use_fusion_emitters=false --xla_cpu_parallel_codegen_split_count=1"
os.environ.setdefault("JAX_DISABLE_MOST_OPTIMIZATIONS", "1")
if "XLA_FLAGS" not in os.environ:  # nor in those of this session's workers
    # an XLA that does not know a flag ends its process
    probe = [sys.executable, "-c", "import jax; jax.devices()"]
    known = subprocess.run(probe, env=os.environ | {"XLA_FLAGS": QUICK}, capture_output=True)
    os.environ["XLA_FLAGS"] = "" if known.returncode else QUICK

import jax
import pytest
from jaxtyping import install_import_hook

pytest.register_assert_rewrite("tests.helpers")

from tests.helpers.paths import EMPS, REFERENCE, ROOT

jax.config.update("jax_num_cpu_devices", 2)
jax.config.update("jax_numpy_rank_promotion", "raise")
jax.config.update("jax_enable_x64", True)  # physics is tested in float64, as the programs run it

# Signatures are not checked in the benchmark's engine, a plain Python loop of 10⁵ small steps. The
# quick tests do without: checks are a fifth of their time
CHECKED = [f"jaxidl.{path.stem}" for path in (ROOT / "jaxidl").glob("[a-z]*") if path.stem != "gap"]
GAP = (ROOT / "jaxidl" / "gap").glob("[a-z]*")
CHECKED += [f"jaxidl.gap.{path.stem}" for path in GAP if path.stem != "benchmark"]
if os.environ.get("JAXIDL_SIGNATURES"):
    install_import_hook(CHECKED, "beartype.beartype")

from jaxidl.backend import CPU_OPTIONS, compiler_options
from jaxidl.gap.benchmark.mechanisms import MECHANISMS
from jaxidl.jobs.programs import Job, program
from jaxidl.systems.mjcf import read_model
from tests.helpers.model_files import stored
from tests.helpers.registry import restored
from tests.helpers.studies import SMALL_STUDY

SLOW = (  # variants of tests of which another variant stays with the quick ones
    "test_no_derivative_is_nan_where_effects_have_kinks[pid",
    "test_a_tight_torque_limit_is_kept_and_no_random_motion_tells_more[0.2]",
    (
        "test_a_signal_ends_a_sweep_soon_with_one_line_and_what_is_finished_kept[[<Signals.SIGINT:"
        " 2>]]"
    ),
    (
        "test_a_signal_ends_a_sweep_soon_with_one_line_and_what_is_finished_kept[[<Signals.SIGTERM:"
        " 15>]]"
    ),
    "test_hidden_effect_is_named_with_its_parameter[case0]",
    "test_hidden_effect_is_named_with_its_parameter[case1]",
    "test_hidden_effect_is_named_with_its_parameter[case3]",
    "test_hidden_effect_is_named_with_its_parameter[case4]",
    "test_hidden_effect_is_named_with_its_parameter[case5]",
    "test_model_patched_with_what_the_encoder_does_lacks_nothing[delay",
    "test_plain_mujoco_moves_the_exported_model_as_our_plant_moves[two_link]",
    "test_the_learner_removes_what_is_known_to_be_missing[constant bias-direct]",
    "test_the_learner_removes_what_is_known_to_be_missing[constant bias-joint]",
    "test_the_learner_removes_what_is_known_to_be_missing[viscous friction-indirect]",
    "test_the_learner_removes_what_is_known_to_be_missing[viscous friction-joint]",
    "test_the_learner_removes_what_is_known_to_be_missing[mass error-indirect]",
    "test_the_learner_removes_what_is_known_to_be_missing[mass error-direct]",
    "test_learning_works_for_any_number_of_joints[3]",
    "test_inertia_and_motor_constant_of_a_slider_are_reported_to_be_ambiguous[motor]",
    "test_torques_logged_a_part_of_a_sample_late_are_no_gap[0.125]",
    "test_scan_vmap_and_a_python_loop_give_the_same_execution[doomed]",
    "test_derivatives_of_an_execution_and_its_data[law",
    "test_derivatives_of_an_execution_and_its_data[policy",
    "test_derivatives_of_an_execution_and_its_data[the paper's effects, blurred",
    "test_derivatives_of_an_execution_and_its_data[estimator differences]",
    "test_fast_training_is_plain_training[float32",
    "test_nothing_is_named_where_nothing_is_hidden[slider]",
    "test_results_do_not_depend_on_chunks[3]",
    "test_results_do_not_depend_on_devices[8]",
    "test_a_damaged_part_is_named_and_computed_again[cut",
    "test_a_damaged_part_is_named_and_computed_again[empty",
)


@pytest.hookimpl(tryfirst=True)  # before some are left out
def pytest_collection_modifyitems(items):
    """Mark the slow variants; where all tests were collected, each must be one."""
    for item in items:
        if item.name.startswith(SLOW):
            item.add_marker(pytest.mark.slow)
    if {item.path for item in items} >= set((ROOT / "tests").rglob("test_*.py")):
        unknown = [s for s in SLOW if not any(item.name.startswith(s) for item in items)]
        if unknown:
            raise pytest.UsageError(f"no test is one of these slow variants: {unknown}")


def pytest_unconfigure(config):
    """Leave no cache behind."""
    if OWN_CACHE:
        shutil.rmtree(OWN_CACHE, ignore_errors=True)


@pytest.fixture(autouse=True, scope="module")
def drop_programs():
    """Compiled programs of a finished file: all of the suite's together need more memory maps than
    a process may have.
    """
    yield
    jax.clear_caches()


@pytest.fixture(scope="session")
def reference() -> Path:
    """Folder with the reference program's own numbers."""
    if not (REFERENCE / "traces.npz").exists():
        pytest.skip(f"no reference data at {REFERENCE}; set JAXIDL_REFERENCE")
    return REFERENCE


@pytest.fixture(scope="session")
def emps() -> Path:
    """The log of a measured drive."""
    if not EMPS.is_file():
        pytest.skip(f"no measured drive at {EMPS}; set JAXIDL_EMPS")
    return EMPS


@pytest.fixture
def small_study():
    """The paper's study with short executions and small networks: the same code in milliseconds."""
    return SMALL_STUDY


def _mechanism(name):
    @pytest.fixture(scope="session", name=name)
    def model(tmp_path_factory):
        return read_model(stored(tmp_path_factory.mktemp(name), MECHANISMS[name]))

    return model


# the benchmark's mechanisms, as their files say they are
pendulum, two_link = map(_mechanism, ("pendulum", "two_link"))


clean_catalogue = pytest.fixture(restored)
clean_catalogue_of_file = pytest.fixture(restored, scope="module")


@pytest.fixture(scope="module")
def emitters_of_users():
    """Equal bits are promised of sweeps as users compile them, not with the flags above."""

    def forget():
        compiler_options.cache_clear()
        program.cache_clear()

    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(CPU_OPTIONS, "xla_cpu_use_fusion_emitters", True)
        forget()
        yield
    forget()


@pytest.fixture
def optimised(emitters_of_users):
    """For what runs longer than it compiles."""
    before = jax.config.read("jax_disable_most_optimizations")
    jax.config.update("jax_disable_most_optimizations", False)
    yield
    jax.config.update("jax_disable_most_optimizations", before)


@pytest.fixture
def computed(monkeypatch):
    """The points that sweeps compute from now on."""
    found, original = [], Job.traced
    monkeypatch.setattr(
        Job, "traced", lambda job, points: found.extend(points) or original(job, points)
    )
    return found
