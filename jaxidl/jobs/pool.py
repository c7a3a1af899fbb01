"""One process a core, for work that is not a JAX program: items one after the other, each done or
not done.
"""

import multiprocessing
import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from typing import TypeVar

from jaxidl.jobs.progress import Bar

T = TypeVar("T")


def each(
    work: Callable[[T], object],
    items: Sequence[T],
    processes: int,
    what: str,
    total: int | None = None,
) -> None:
    """Do ``work`` for every item in ``processes``, with a bar that says how long it will take.

    ``total`` counts what was done before, too. An exception in one ends all.
    """
    total = len(items) if total is None else total
    done = total - len(items)
    with (
        Bar(what, total, done) as bar,
        ProcessPoolExecutor(processes, multiprocessing.get_context("spawn"), _one_core) as pool,
    ):
        waiting = {pool.submit(work, item) for item in items}
        try:
            while waiting:
                ready, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                for future in ready:
                    future.result()
                done += len(ready)
                bar.advance(len(ready), f"{done}/{total}")
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _one_core() -> None:
    """Processes share the cores already: threads within them only get into each other's way.

    None outlives the program that started it, however that ends.
    """
    threading.Thread(target=_end_with_parent, daemon=True).start()
    os.environ["JAX_PLATFORMS"] = "cpu"
    os.environ["XLA_FLAGS"] = (
        os.environ.get("XLA_FLAGS", "") + " --xla_cpu_multi_thread_eigen=false"
    )


def _end_with_parent() -> None:
    """Wait for the parent's end: its processes would wait for work that never comes."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
