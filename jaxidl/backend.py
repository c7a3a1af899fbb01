"""How this machine computes: devices, XLA's options, and compiled programs.

Compiled programs are kept on disk from one process to the next.
"""

import contextlib
import os
import platform
import zlib
from collections.abc import Callable
from functools import cache, wraps
from pathlib import Path
from typing import Any

import jax

from jaxidl.errors import ConfigurationError

# by default a GPU rounds the inputs of every product to 10 bits (TF32); a CPU does not
MATMUL_PRECISION = "float32"
PRECISION = "float64 simulation, float32 networks"  # in the studies

CPU_OPTIONS = {
    # without it XLA copies every weight once per training step (3 % of its time): it does not see
    # that the old weights are read for the last time before the new ones are written
    "xla_cpu_copy_insertion_use_region_analysis": True,
}

# for programs that take longer to compile than to run: without optimisations, and operation by
# operation, which halves the time again
QUICK_OPTIONS = {"xla_backend_optimization_level": 0, "xla_cpu_use_fusion_emitters": False}
# for programs that run a hundred times: they take twice as long to compile, and half as long to run
OFTEN_OPTIONS = QUICK_OPTIONS | {"xla_backend_optimization_level": 1}


def choose_devices(count: int | None) -> None:
    """Make every core a device of its own (no effect on accelerators).

    Call it before the first computation.

    Raises:
        ConfigurationError: for fewer than one device.
    """
    if count is not None and count < 1:
        raise ConfigurationError("at least 1 device", str(count), "leave out --devices to use all")
    # after the first computation the devices are fixed: the calling program has chosen them
    with contextlib.suppress(RuntimeError):
        jax.config.update("jax_num_cpu_devices", min(count or cores(), cores()))


def cores() -> int:
    """Return the number of CPU cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def keep_programs() -> None:
    """Keep compiled programs on disk from one process to the next.

    A second start then takes seconds less. They are kept in ``JAX_COMPILATION_CACHE_DIR`` if that
    is set (empty: nowhere), otherwise in the user's cache folder, with one folder for each kind of
    processor: XLA compiles for the processor it runs on, and a home folder may be shared between
    machines.
    """
    if "JAX_COMPILATION_CACHE_DIR" in os.environ:
        return  # JAX reads it itself
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    jax.config.update(
        "jax_compilation_cache_dir", str(home / "jaxidl" / f"programs-{_processor()}")
    )
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.05)


def _processor() -> str:
    """Return a short name of this machine's processor and its instruction sets."""
    with contextlib.suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        telling = sorted(
            {
                line
                for line in lines
                if line.startswith(("model name", "flags", "Features", "CPU part"))
            }
        )
        return f"{zlib.crc32(chr(10).join(telling).encode()):08x}"
    return f"{platform.machine()}-{platform.processor()}".replace(" ", "-")


def rounds_at_once() -> int:
    """Return how many rounds of a short loop to write out in the program.

    A GPU then starts one kernel for all of them: an arm's step takes 0.6 of the time. A CPU would
    take 1.15 times as long.
    """
    return 1 if jax.default_backend() == "cpu" else 4


@cache
def compiler_options(*, quick: bool = False, often: bool = False) -> dict[str, bool | int]:
    """Return options for ``jax.jit(compiler_options=…)`` on the current backend.

    Options that its XLA does not know are left out. ``quick`` is for programs that take longer to
    compile than to run, unless they run ``often``.
    """
    if jax.default_backend() != "cpu":
        return {}
    options = OFTEN_OPTIONS if often else QUICK_OPTIONS if quick else CPU_OPTIONS
    return {name: value for name, value in options.items() if _known(name, value)}


def jit_quickly(
    function: Callable[..., Any], often: bool = False, **options: Any
) -> Callable[..., Any]:
    """Return ``jax.jit`` of a function that takes longer to compile than to run, unless ``often``.

    The backend is not asked for before the first call.
    """

    @cache
    def jitted() -> Callable[..., Any]:
        chosen = compiler_options(quick=True, often=often)
        return jax.jit(function, compiler_options=chosen, **options)

    return wraps(function)(lambda *args, **kwargs: jitted()(*args, **kwargs))


def _known(name: str, value: bool | int) -> bool:
    try:
        jax.jit(lambda x: x, compiler_options={name: value}).lower(0.0).compile()
    except jax.errors.JaxRuntimeError:
        return False
    return True
