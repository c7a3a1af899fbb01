"""Chunks as tasks of a Ray cluster: each is computed by one core or one GPU and writes its own part
of the store.

Ray is an optional extra, ``jaxidl[cluster]``. The folder of the results must be shared by all
machines, and all must have the same versions. A task that is lost with its worker or machine is
tried again elsewhere; writing a part twice does no harm.
"""

import logging
import socket
import time
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import jax

from jaxidl.backend import choose_devices, keep_programs
from jaxidl.errors import ConfigurationError, JaxidlError, StoreError
from jaxidl.jobs.points import Point
from jaxidl.jobs.programs import Chunk, Job, Layout, chunks, dispatch, without_padding
from jaxidl.jobs.provenance import device, revision
from jaxidl.jobs.results import Origin
from jaxidl.jobs.store import write_part

RETRIES = 10  # of a task whose worker or machine was lost


def versions() -> dict[str, str]:
    """Return what must be the same on all machines for results to be the same."""
    return {name: version(name) for name in ("jaxidl", "jax", "jaxlib", "numpy")} | {
        "revision": revision()
    }


def compute(
    job: Job, chunk: Chunk, width: int, parts: str, identity: str, wanted: dict[str, Any]
) -> Path:
    """Compute a chunk on one device and write its part; return the part's path.

    Raises:
        ConfigurationError: when this machine's versions are not the ``wanted`` ones.
        StoreError: when the part cannot be written here.
    """
    choose_devices(1)
    keep_programs()
    here = versions()
    if here != wanted:
        unlike = ", ".join(
            f"{name} {value} ({here[name]} there)"
            for name, value in wanted.items()
            if here[name] != value
        )
        raise ConfigurationError(
            "the same versions on all machines of the cluster",
            unlike,
            "install the same ones everywhere",
        )
    began = time.monotonic()
    with jax.enable_x64(True):
        found = without_padding(dispatch(job, chunk, 1, width), chunk)
        origin = Origin(here["revision"], device(width), time.monotonic() - began)
        return write_part(Path(parts), identity, chunk.points, found, origin)


def _knock(address: str) -> None:
    """Raise OSError or ValueError unless somebody listens at HOST:PORT; Ray itself would try, and
    tell, for ten minutes.
    """
    if address not in ("local", "auto"):
        host, _, port = address.removeprefix("ray://").rpartition(":")
        if not host or not port.isdigit():
            raise ValueError("not of the form HOST:PORT")
        socket.create_connection((host.strip("[]"), int(port)), timeout=5).close()


class Cluster:
    """A connection to a Ray cluster; use as a context manager.

    Args:
        address: of a running cluster, or "local" for one on this machine that lives as long as the
            sweep.

    Raises:
        ConfigurationError: if Ray is not installed or no cluster answers.
    """

    def __init__(self, address: str):
        self.address = address

    def __enter__(self) -> "Cluster":
        try:
            import ray
        except ImportError:
            remedy = "pip install 'jaxidl[cluster]'"
            raise ConfigurationError(
                "Ray for --cluster", "an installation without it", remedy
            ) from None
        self.ray: Any = ray
        where: dict[str, Any] = (
            {"include_dashboard": False} if self.address == "local" else {"address": self.address}
        )
        try:
            _knock(self.address)
            ray.init(**where, log_to_driver=False, logging_level=logging.ERROR)
        except Exception as error:  # Ray has many, and words them in paragraphs
            reason = (str(error).strip() or type(error).__name__).splitlines()[0]
            remedy = (
                "start one with `ray start --head`, correct the address, or use --cluster local"
            )
            raise ConfigurationError(f"a Ray cluster at {self.address!r}", reason, remedy) from None
        return self

    def __exit__(self, *_: object) -> None:
        self.ray.shutdown()

    def kind(self) -> str:
        """Return the kind of the cluster's devices: "gpu" if it has one, else "cpu"."""
        return "gpu" if self.ray.cluster_resources().get("GPU", 0) >= 1 else "cpu"

    def run(
        self, job: Job, missing: list[Point], plan: Layout, parts: Path, identity: str
    ) -> Iterator[tuple[Chunk, Path] | None]:
        """Compute chunks; yield each with its part as it is finished, and None now and then while
        waiting.

        Raises:
            ConfigurationError, StoreError: what a task raised, or that its workers were lost too
                often.
        """
        wants = {"num_gpus": 1} if self.kind() == "gpu" else {"num_cpus": 1}
        # max_calls=0: a worker keeps its compiled programs; Ray would end a GPU's after every task
        task = self.ray.remote(max_retries=RETRIES, max_calls=0, **wants)(compute)
        fixed = (plan.width, str(parts.resolve()), identity, versions())
        shared = self.ray.put(job)
        queue, running = chunks(missing, job, 1, plan.per_device), {}
        while True:
            for chunk in queue:
                running[task.remote(shared, chunk, *fixed)] = chunk
                if len(running) >= self._ahead():
                    break
            if not running:
                return
            ready, _ = self.ray.wait(list(running), timeout=0.2)
            yield None
            for reference in ready:
                yield running.pop(reference), self._result(reference)

    def _ahead(self) -> int:
        """Tasks kept submitted: enough for every device there is now, and for some that may
        join.
        """
        resources = self.ray.cluster_resources()
        return 8 + 2 * int(resources.get("GPU", 0) or resources.get("CPU", 1))

    def _result(self, reference: Any) -> Path:
        try:
            return self.ray.get(reference)
        except self.ray.exceptions.RayTaskError as error:
            if isinstance(error.cause, JaxidlError):
                raise error.cause from None
            reason = str(error.cause or error).strip().splitlines()[-1]
            raise StoreError(
                "every task to succeed",
                reason,
                "remove the cause, then run it again; what is done is saved",
            ) from None
        except self.ray.exceptions.RayError as error:
            remedy = "look after the cluster, then run it again; what is done is saved"
            raise StoreError(
                f"a task to survive {RETRIES} lost workers", type(error).__name__, remedy
            ) from None
