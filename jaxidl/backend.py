"""How this machine computes: its devices, XLA's options, and compiled programs kept from one start
to the next.
"""

import contextlib
import os
import platform
import zlib
from functools import cache
from pathlib import Path

import jax

from jaxidl.errors import ConfigurationError

# a GPU's default rounds the inputs of every product to 10 bits (TF32); a CPU has no other
MATMUL_PRECISION = "float32"
PRECISION = "float64 simulation, float32 networks"  # of the studies

CPU_OPTIONS = {
    # without it XLA copies every weight once a training step (3 % of its time): it does not see
    # that the old weights are read for the last time before the new ones are written
    "xla_cpu_copy_insertion_use_region_analysis": True,
}


def choose_devices(count: int | None) -> None:
    """Make every core a device of its own (a no-op for accelerators). Must come before the first
    computation.

    Raises:
        ConfigurationError: for fewer than one device.
    """
    if count is not None and count < 1:
        raise ConfigurationError("at least 1 device", str(count), "leave --devices out to use all")
    # the first computation has been: in a process of somebody else's, who has chosen
    with contextlib.suppress(RuntimeError):
        jax.config.update("jax_num_cpu_devices", min(count or cores(), cores()))


def cores() -> int:
    """CPU cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def keep_programs() -> None:
    """Keep compiled programs on disk from one process to the next: a second start takes seconds
    less.

    In ``JAX_COMPILATION_CACHE_DIR`` if that is set (empty: nowhere), else in the user's cache
    folder, one folder for each kind of processor: XLA compiles for the one it runs on, and home
    folders travel.
    """
    if "JAX_COMPILATION_CACHE_DIR" in os.environ:
        return  # JAX reads it itself
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    jax.config.update(
        "jax_compilation_cache_dir", str(home / "jaxidl" / f"programs-{_processor()}")
    )
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.3)


def _processor() -> str:
    """A short name of this machine's processor and its instruction sets."""
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


@cache
def compiler_options() -> dict[str, bool]:
    """Options for ``jax.jit(compiler_options=…)`` on the present backend; those that its XLA does
    not know are left out.
    """
    if jax.default_backend() != "cpu":
        return {}
    return {name: value for name, value in CPU_OPTIONS.items() if _known(name, value)}


def _known(name: str, value: bool) -> bool:
    try:
        jax.jit(lambda x: x, compiler_options={name: value}).lower(0.0).compile()
    except jax.errors.JaxRuntimeError:
        return False
    return True
