"""What the benchmarks share: one core, timing in turns, a table and JSON."""

import argparse
import json
import os
import platform
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np


def pin_to_one_core() -> None:
    """Keep this process on one core. Must come before JAX is imported: it counts cores then."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})


def arguments(description: str, **options: Any) -> argparse.Namespace:
    """``--json FILE`` and the given integer options with their defaults."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--json", type=Path, help="also write the table there, as JSON")
    for name, default in options.items():
        parser.add_argument(
            f"--{name.replace('_', '-')}",
            type=type(default),
            default=default,
            help=f"default {default}",
        )
    return parser.parse_args()


def in_turns(calls: dict[str, Callable[[], Any]], rounds: int) -> dict[str, np.ndarray]:
    """Seconds of each call, (rounds,) each: all of them once a round, so that a slow moment of the
    machine hits all alike.
    """
    import jax

    seconds: dict[str, list[float]] = {name: [] for name in calls}
    for call in calls.values():
        jax.block_until_ready(call())  # compiled, and its memory touched
    for _ in range(rounds):
        for name, call in calls.items():
            began = time.perf_counter()
            jax.block_until_ready(call())
            seconds[name].append(time.perf_counter() - began)
    return {name: np.array(values) for name, values in seconds.items()}


def machine() -> str:
    """Processor, cores in use, and versions."""
    import jax

    names = [line for line in _cpuinfo() if line.startswith("model name")]
    processor = names[0].partition(":")[2].strip() if names else platform.machine()
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return (
        f"{processor}, {cores} core(s), Python {platform.python_version()}, jax {jax.__version__},"
        f" {jax.devices()[0].device_kind}"
    )


def _cpuinfo() -> list[str]:
    try:
        return Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return []


def report(title: str, rows: list[dict[str, Any]], to: Path | None, **about: Any) -> None:
    """Print the rows as a table and, if asked, write them as JSON."""
    from rich.console import Console
    from rich.markup import escape  # "[s]" is a unit, not a style
    from rich.table import Table

    table = Table(title=escape(title), title_justify="left")
    for column in rows[0]:
        table.add_column(
            escape(column), justify="left" if isinstance(rows[0][column], str) else "right"
        )
    for row in rows:
        table.add_row(
            *(
                ""
                if value is None
                else f"{value:.4g}"
                if isinstance(value, float)
                else escape(str(value))
                for value in row.values()
            )
        )
    console = Console(width=None if sys.stdout.isatty() else 140)
    console.print(table)
    for name, value in about.items():
        console.print(f"{name.replace('_', ' ')}: {value}", soft_wrap=True)
    if to is not None:
        from jaxidl.files import write_bytes
        from jaxidl.jobs.provenance import revision

        content = {"title": title, "machine": machine(), "git_revision": revision(), "rows": rows}
        content |= about
        write_bytes(to, (json.dumps(content, indent=2, default=float) + "\n").encode())
