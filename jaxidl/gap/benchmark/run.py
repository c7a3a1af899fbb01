"""Run the benchmark: make each case's log, let the workflow read it, keep its report; then the score."""

import json
import multiprocessing
import os
import shutil
import time
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from pathlib import Path
from typing import Any

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from jaxidl.errors import ConfigurationError, JaxidlError, one_of
from jaxidl.files import write_bytes
from jaxidl.gap.benchmark.cases import Case, all_cases, truth, write_case
from jaxidl.gap.benchmark.score import score

FAMILIES = ("single", "none", "pair", "outside")
SEVERITIES = ("weak", "medium", "clear")


def chosen(families: tuple[str, ...], severities: tuple[str, ...], every: int) -> list[Case]:
    """The cases asked for: of each family and severity each ``every``-th.

    Raises:
        ConfigurationError: for an unknown family or severity, or if nothing is left.
    """
    for name in families:
        if name not in FAMILIES:
            raise one_of("a family of cases", name, FAMILIES)
    for name in severities:
        if name not in SEVERITIES:
            raise one_of("a severity", name, SEVERITIES)
    if every < 1:
        raise ConfigurationError("--every of at least 1", str(every), "give 1 for all cases")
    groups: dict[tuple[str, str | None], list[Case]] = {}
    for case in all_cases():
        if case.family in families and (case.family != "single" or case.severity in severities):
            groups.setdefault((case.family, case.severity), []).append(case)
    order = sorted(groups, key=lambda key: (FAMILIES.index(key[0]), -SEVERITIES.index(key[1] or "clear")))
    found = [case for key in order for case in groups[key][::every]]
    if not found:
        raise ConfigurationError("at least one case", "none", "name families and severities")
    return found


def run_benchmark(
    out: Path, families: tuple[str, ...], severities: tuple[str, ...], every: int, processes: int, overwrite: bool = False
) -> dict[str, Any]:
    """Run what has no report yet, each case in its own process, and return the score, which is in ``out/benchmark.json``, too.

    The truth lies in ``out/truth.json``, which no diagnosis reads; ``out/cases/ID`` holds log and model, ``out/reports/ID.json``
    the report. A case that fails counts as wrong, and its error is in its report's place.
    """
    cases = chosen(families, severities, every)
    if overwrite:
        shutil.rmtree(out / "reports", ignore_errors=True)
    write_bytes(out / "truth.json", json.dumps(truth(cases), indent=1).encode())
    left = [case for case in cases if not _report(out, case).is_file()]
    bar = (TextColumn("hidden cases"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*bar) as progress:
        task = progress.add_task("cases", total=len(cases), completed=len(cases) - len(left))
        with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn"), _one_core) as pool:
            waiting = {pool.submit(judge_case, case, out) for case in left}
            try:
                while waiting:
                    done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                    for future in done:
                        future.result()
                    progress.advance(task, len(done))
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise
    reports = {case.id: json.loads(_report(out, case).read_text()) for case in cases}
    result = score(truth(cases), {name: None if "error" in report else report for name, report in reports.items()})
    write_bytes(out / "benchmark.json", json.dumps(_plain(result), indent=1, allow_nan=False).encode())
    return result


def judge_case(case: Case, out: Path) -> None:
    """Make one case's log and write the report of what the workflow finds in it."""
    from jaxidl.gap.diagnose import diagnose

    folder = out / "cases" / case.id
    if not (folder / "model.xml").is_file():
        write_case(case, folder)
    begun = time.perf_counter()
    found: dict[str, Any]
    try:
        found = diagnose(folder / case.log, folder / "model.xml", rollouts=False).to_dict()
    except JaxidlError as error:
        found = {"error": str(error)}
    found["seconds"] = time.perf_counter() - begun
    write_bytes(_report(out, case), json.dumps(found, allow_nan=False).encode())


def _report(out: Path, case: Case) -> Path:
    return out / "reports" / f"{case.id}.json"


def _one_core() -> None:
    """Processes share the cores already: threads within them only get into each other's way."""
    os.environ["JAX_PLATFORMS"] = "cpu"
    os.environ["XLA_FLAGS"] = os.environ.get("XLA_FLAGS", "") + " --xla_cpu_multi_thread_eigen=false"


def _plain(value: Any) -> Any:
    """JSON has no NaN: null."""
    if isinstance(value, dict):
        return {key: _plain(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    return None if isinstance(value, float) and value != value else value
