"""Hostile settings for the whole suite: warnings are errors, silent rank promotion raises,
signatures are checked.
"""

import os
import shutil
import tempfile
from pathlib import Path

os.environ.setdefault("JAX_PLATFORMS", "cpu")  # two CPU devices, whatever the machine has

# Programs are small and run once: compiled without optimisations, and kept for all workers and
# child processes of this session
os.environ.setdefault("JAX_DISABLE_MOST_OPTIMIZATIONS", "1")
OWN_CACHE = "JAX_COMPILATION_CACHE_DIR" not in os.environ and tempfile.mkdtemp(
    prefix="jaxidl-tests-"
)
if OWN_CACHE:
    os.environ["JAX_COMPILATION_CACHE_DIR"] = OWN_CACHE
    os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0"
    os.environ["JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES"] = "-1"

import jax
import pytest
from jaxtyping import install_import_hook

jax.config.update("jax_num_cpu_devices", 2)
jax.config.update("jax_numpy_rank_promotion", "raise")
jax.config.update("jax_enable_x64", True)  # physics is tested in float64, as the programs run it

# Signatures are checked for as long as the suite runs, but for the benchmark's engine, a plain
# Python loop of 10⁵ small steps
CHECKED = [
    f"jaxidl.{path.stem}"
    for path in Path(__file__).parents[1].glob("jaxidl/[a-z]*")
    if path.stem != "gap"
]
CHECKED += [
    f"jaxidl.gap.{path.stem}" for path in Path(__file__).parents[1].glob("jaxidl/gap/[a-z]*.py")
]
install_import_hook(CHECKED, "beartype.beartype")

REFERENCE = Path(
    os.environ.get("JAXIDL_REFERENCE", Path(__file__).parents[2] / "shared" / "reference")
)


SLOW = (  # variants of tests of which another variant stays with the quick ones
    "test_no_derivative_is_nan_where_effects_have_kinks[pid",
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
    "test_any_number_of_joints[3]",
    "test_scan_vmap_and_a_python_loop_give_the_same_execution[doomed]",
    "test_derivatives_of_an_execution_and_its_data[law",
    "test_derivatives_of_an_execution_and_its_data[policy",
    "test_fast_training_is_plain_training[float32",
    "test_nothing_is_named_where_nothing_is_hidden[slider]",
    "test_results_do_not_depend_on_chunks[3]",
    "test_results_do_not_depend_on_devices[8]",
    "test_a_damaged_part_is_named_and_computed_again[cut",
    "test_a_damaged_part_is_named_and_computed_again[empty",
)


def pytest_collection_modifyitems(items):
    """Mark the slow variants."""
    for item in items:
        if item.name.startswith(SLOW):
            item.add_marker(pytest.mark.slow)


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


@pytest.fixture
def small_study():
    """The paper's study with short executions and small networks: the same code in milliseconds."""
    from jaxidl.models import ErrorModel, Training
    from jaxidl.paper.study import PaperStudy

    return PaperStudy(
        steps=80, error_model=ErrorModel(layers=(12, 6, 1)), training=Training(batch=16)
    )
