"""The run of the benchmark.

It makes each case's log, lets the workflow read it, keeps its report, and then computes the score.
"""

import csv
import io
import json
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from jaxidl.errors import ConfigurationError, JaxidlError, one_of
from jaxidl.files import as_json, write_bytes
from jaxidl.gap.benchmark.believed import Diverged
from jaxidl.gap.benchmark.calibration import training_rows
from jaxidl.gap.benchmark.cases import Case, all_cases, truth
from jaxidl.gap.benchmark.robots import Robot, robots, store
from jaxidl.gap.benchmark.score import score
from jaxidl.jobs.pool import each
from jaxidl.jobs.provenance import revision

WHOLE = ("robot", "worn")  # whole robots
FAMILIES = ("single", "none", "pair", "outside", *WHOLE)
SEVERITIES = ("weak", "medium", "clear")
DEVELOPMENT = 2026  # the root to develop with; another one is run once, at the end
ROBOTS = 60
AnyCase = Case | Robot


def chosen(
    families: tuple[str, ...],
    severities: tuple[str, ...],
    every: int,
    root: int = DEVELOPMENT,
    every_robot: int | None = None,
) -> list[AnyCase]:
    """Return the chosen cases: of each family and severity each ``every``-th.

    Of the robots it is each ``every_robot``-th, unless that is None.

    Raises:
        ConfigurationError: for an unknown family or severity, or if no case remains.
    """
    for name in families:
        if name not in FAMILIES:
            raise one_of("a family of cases", name, FAMILIES)
    for name in severities:
        if name not in SEVERITIES:
            raise one_of("a severity", name, SEVERITIES)
    steps = {"--every": every, "--every-robot": every if every_robot is None else every_robot}
    for option, step in steps.items():
        if step < 1:
            raise ConfigurationError(f"{option} of at least 1", str(step), "give 1 for all cases")
    groups: dict[tuple[str, str | None], list[AnyCase]] = {}
    small = all_cases(root) if set(families) - set(WHOLE) else []
    for case in [*small, *(r for family in WHOLE for r in robots(root, ROBOTS, family))]:
        if case.family in families and (case.family != "single" or case.severity in severities):
            groups.setdefault((case.family, case.severity), []).append(case)
    order = sorted(
        groups, key=lambda key: (FAMILIES.index(key[0]), -SEVERITIES.index(key[1] or "clear"))
    )
    found = [
        case
        for key in order
        for case in groups[key][:: steps["--every-robot" if key[0] in WHOLE else "--every"]]
    ]
    if not found:
        raise ConfigurationError("at least one case", "none", "name families and severities")
    return found


def run_benchmark(
    out: Path,
    families: tuple[str, ...],
    severities: tuple[str, ...],
    every: int,
    processes: int,
    root: int = DEVELOPMENT,
    every_robot: int | None = None,
) -> dict[str, Any]:
    """Run the cases that have no report yet, each in its own process, and return the score.

    The score is also in ``out/benchmark.json``. The truth is in ``out/truth.json`` (of each robot
    also in ``out/truth``), which no diagnosis reads; ``out/cases/ID`` holds log and model,
    ``out/reports/ID.json`` the report. A case that fails counts as wrong, with its error in place
    of its report. One whose mechanism its controller lost is no case, and the score says how many
    there were.

    Raises:
        ConfigurationError: for an unknown family or severity, or where ``out`` holds cases of
            another root.
    """
    cases = chosen(families, severities, every, root, every_robot)
    begun = _claim(out, root)
    _each(judge_case, cases, out, processes, lambda case: _report(out, case).is_file())
    driven = [case for case in cases if "lost" not in json.loads(_report(out, case).read_text())]
    known = _truth(driven, out)
    write_bytes(out / "truth.json", json.dumps(known, indent=1).encode())
    result = begun | {"lost": len(cases) - len(driven)} | score(known, _reports(out, list(known)))
    write_bytes(out / "benchmark.json", as_json(result).encode())
    return result


def generate(
    out: Path,
    families: tuple[str, ...] = ("robot",),
    severities: tuple[str, ...] = SEVERITIES,
    every: int = 1,
    processes: int = 1,
    root: int = DEVELOPMENT,
) -> list[Path]:
    """Make the cases' logs and models and ``out/truth.json``, without any diagnosis.

    Returns:
        The cases' folders.

    Raises:
        ConfigurationError: as :func:`run_benchmark`.
    """
    cases = chosen(families, severities, every, root)
    _claim(out, root)
    _each(make_case, cases, out, processes, lambda case: _made(out, case))
    write_bytes(out / "truth.json", json.dumps(_truth(cases, out), indent=1).encode())
    return [out / "cases" / case.id for case in cases]


def training_table(out: Path, path: Path | None = None) -> Path:
    """Write one row for each effect of each finished report in ``out`` as CSV.

    Columns are those of :func:`.calibration.training_rows`; a number that an entry does not have is
    left empty.

    Args:
        out: the folder of the benchmark.
        path: the file. Default: ``out/training.csv``.

    Returns:
        Its path.

    Raises:
        ConfigurationError: where ``out`` holds no finished benchmark.
    """
    path = path or out / "training.csv"
    if not (out / "truth.json").is_file():
        raise ConfigurationError(
            f"a benchmark in {out}", "no truth.json", "run jaxidl gap-benchmark with --out there"
        )
    known = json.loads((out / "truth.json").read_text())
    names = [name for name in known if (out / "reports" / f"{name}.json").is_file()]
    rows = list(training_rows({name: known[name] for name in names}, _reports(out, names)))
    columns = list(dict.fromkeys(key for row in rows for key in row))
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_bytes(path, text.getvalue().encode())
    return path


def make_case(case: AnyCase, out: Path) -> None:
    """Write one case's log and model if they are missing, and the truth about a robot."""
    if _made(out, case):
        return
    record = case.write(out / "cases" / case.id)
    if record is not None:
        store(out / "truth" / f"{case.id}.json", record)


def judge_case(case: AnyCase, out: Path) -> None:
    """Make one case's log and write the report of what the workflow finds in it."""
    from jaxidl.gap.workflow import diagnose

    folder = out / "cases" / case.id
    try:
        make_case(case, out)
    except Diverged as error:
        write_bytes(_report(out, case), json.dumps({"lost": str(error)}).encode())
        return
    begun, cpu = time.perf_counter(), time.process_time()
    found: dict[str, Any]
    try:
        found = diagnose(folder / case.log, folder / "model.xml", rollouts=False).to_dict()
    except JaxidlError as error:
        found = {"error": str(error)}
    found |= {"seconds": time.perf_counter() - begun, "cpu_seconds": time.process_time() - cpu}
    write_bytes(_report(out, case), json.dumps(found, allow_nan=False).encode())


def _each(
    work: Callable[[AnyCase, Path], None],
    cases: list[AnyCase],
    out: Path,
    processes: int,
    done: Any,
) -> None:
    """Do ``work`` for each case that is not ``done``, in processes."""
    left = [case for case in cases if not done(case)]
    each(partial(_at, work, out), left, processes, "hidden cases", len(cases))


def _at(work: Callable[[AnyCase, Path], None], out: Path, case: AnyCase) -> None:
    work(case, out)


def _claim(out: Path, root: int) -> dict[str, Any]:
    """Return the folder's root, and the revision with which its cases were begun.

    Raises:
        ConfigurationError: if the folder has cases of another root: scores would be combined.
    """
    path = out / "root.json"
    if path.is_file():
        held = json.loads(path.read_text())
        if held["root"] != root:
            raise ConfigurationError(
                f"cases of root {root} in {out}",
                f"cases of root {held['root']}",
                "give another --out or --root",
            )
        return held
    begun = {"root": root, "revision": revision()}
    write_bytes(path, json.dumps(begun).encode())
    return begun


def _truth(cases: list[AnyCase], out: Path) -> dict[str, Any]:
    """Return the truth about the cases; that about robots is known once they have run."""
    known: dict[str, Any] = truth(case for case in cases if isinstance(case, Case))
    for case in cases:
        if isinstance(case, Robot):
            known[case.id] = json.loads((out / "truth" / f"{case.id}.json").read_text())
    return known


def _reports(out: Path, names: list[str]) -> dict[str, Any]:
    """Return the reports by the cases' identities, None for one that failed."""
    reports = {name: json.loads((out / "reports" / f"{name}.json").read_text()) for name in names}
    return {name: None if "error" in report else report for name, report in reports.items()}


def _made(out: Path, case: AnyCase) -> bool:
    """Return whether a case's files are there.

    A robot's truth is written last, a small case's model.
    """
    truth_too = isinstance(case, Case) or (out / "truth" / f"{case.id}.json").is_file()
    return (
        (out / "cases" / case.id / "model.xml").is_file()
        and (out / "cases" / case.id / case.log).is_file()
        and truth_too
    )


def _report(out: Path, case: AnyCase) -> Path:
    return out / "reports" / f"{case.id}.json"
