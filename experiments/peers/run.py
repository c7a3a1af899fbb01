"""Peers side by side on the shared logs: ``python experiments/peers/run.py [--peers NAME ...]
[--cases NAME ...] [--table]``.

Each peer answers each case in a process of its own, on one core from a cold start, and its CPU
seconds are the system's account of that process. Answers are merged into ``figures/peers.json``;
what cannot run is there with the reason. ``--table`` prints the table of what is there and runs
nothing. See ``experiments/README.md`` for what has to be installed and where it is looked for.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

from cases import CASES, FITTED
from table import table

from jaxidl.files import write_bytes
from jaxidl.jobs.provenance import revision

HERE = Path(__file__).resolve().parent
OUT = HERE.parents[1] / "figures" / "peers.json"
COMMON = ("viscous_friction", "coulomb_friction", "constant_offset", "inertia_error", "payload")


class Peer(NamedTuple):
    """How a peer is called; CASE and ANSWER in its words stand for the case's name and the file it
    writes.
    """

    title: str
    script: str
    words: tuple[str, ...]
    # environment variable with its interpreter, or with the checkout it is imported from
    where: str = ""
    lines: int | None = None  # that a user writes; None: counted between the marks of the script,
    without: str = ""  # but for those under this mark


PEERS = {
    "least_squares": Peer(
        "least squares, nominal links",
        "least_squares.py",
        ("CASE", "nominal", "ANSWER"),
        without="free links",
    ),
    "least_squares_links": Peer(
        "least squares, free links", "least_squares.py", ("CASE", "links", "ANSWER")
    ),
    "prototype": Peer("prototype", "prototype.py", ("CASE", "ANSWER"), lines=1),
    "figaroh": Peer("FIGAROH", "figaroh_fit.py", ("CASE", "ANSWER"), "JAXIDL_PEERS_PYTHON"),
    "mujoco_sysid": Peer(
        "mujoco.sysid", "mujoco_sysid.py", ("CASE", "ANSWER"), "JAXIDL_PEERS_PYTHON"
    ),
    "before": Peer("jaxidl 5a20419", "jaxidl_gap.py", ("CASE", "ANSWER"), "JAXIDL_BEFORE", 1),
    "before_common": Peer(
        "jaxidl 5a20419, common effects",
        "jaxidl_gap.py",
        ("CASE", "ANSWER", *COMMON),
        "JAXIDL_BEFORE",
        1,
    ),
    "jaxidl": Peer("jaxidl", "jaxidl_gap.py", ("CASE", "ANSWER"), lines=1),
}


def count(script: Path, without: str) -> int:
    """Count lines of code between the marks ``# >>>`` and ``# <<<``, without comments, docstrings
    of one line and blank lines.

    Lines under a mark that has the words ``without`` are left out.
    """
    inside, n = False, 0
    for line in map(str.strip, script.read_text().splitlines()):
        if line.startswith(("# >>>", "# <<<")):
            inside = line.startswith("# >>>") and not (without and without in line)
        elif inside and line and not line.startswith(("#", '"""')):
            n += 1
    return n


def ask(name: str, case: str) -> dict[str, object]:
    """Let one peer answer one case: its answer with CPU seconds, or the reason why there is
    none.
    """
    peer, gone = PEERS[name], CASES[case].missing()
    if gone:
        return {"status": "skipped", "reason": gone}
    place = os.environ.get(peer.where, "") if peer.where else ""
    if peer.where and not place:
        return {"status": "skipped", "reason": f"{peer.where} is not set"}
    python = place if peer.where.endswith("PYTHON") else sys.executable
    # nothing kept
    one = {f"{n}_NUM_THREADS": "1" for n in ("OMP", "OPENBLAS", "MKL")} | {
        "JAX_COMPILATION_CACHE_DIR": ""
    }
    environment = (
        os.environ | one | ({"PYTHONPATH": place} if peer.where == "JAXIDL_BEFORE" else {})
    )
    with tempfile.TemporaryDirectory() as folder:
        answer, log = Path(folder) / "answer.json", Path(folder) / "log.txt"
        words = [{"CASE": case, "ANSWER": str(answer)}.get(w, w) for w in peer.words]
        pinned = ["taskset", "-c", "0"] if shutil.which("taskset") else []
        with log.open("w") as out:
            command = [*pinned, python, str(HERE / peer.script), *words]
            child = subprocess.Popen(command, env=environment, cwd=folder, stdout=out, stderr=out)
            _, status, usage = os.wait4(child.pid, 0)
            child.returncode = os.waitstatus_to_exitcode(status)
        if not answer.exists():
            last = [line for line in log.read_text().splitlines() if line.strip()] or ["no output"]
            return {"status": "failed", "reason": last[-1].strip()[:300]}
        found = json.loads(answer.read_text())
    if "reason" in found:
        return {"status": "cannot", **found}
    # a peer that is a command of its own counts itself
    seconds = found.pop("seconds", usage.ru_utime + usage.ru_stime)
    return {"status": "ran", "cpu_seconds": round(seconds, 2), **found}


def known() -> dict[str, Any]:
    """Return the answers so far, peers and cases in the order of the declarations above."""
    found = (
        json.loads(OUT.read_text())
        if OUT.exists()
        else {"fitted": FITTED, "cases": {}, "peers": {}}
    )
    for key, order in (("peers", [*PEERS]), ("cases", [*CASES])):
        found[key] = {name: found[key][name] for name in order if name in found[key]}
    return found


def add(name: str, case: str, answer: dict[str, object]) -> None:
    """Write one answer into the file; one that is skipped here does not replace one from
    elsewhere.
    """
    found, peer = known(), PEERS[name]
    entry = found["peers"].setdefault(name, {"answers": {}})
    entry |= {
        "title": peer.title,
        "lines": count(HERE / peer.script, peer.without) if peer.lines is None else peer.lines,
    }
    if name == "jaxidl":
        answer = answer | {"revision": revision()}
    if answer["status"] != "skipped" or case not in entry["answers"]:
        entry["answers"][case] = answer
    if not CASES[case].missing():
        found["cases"][case] = {"joints": CASES[case].joints, "low_pass_hz": CASES[case].cut}
    write_bytes(OUT, (json.dumps(found, indent=1, allow_nan=False) + "\n").encode())


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--peers",
        nargs="*",
        choices=[*PEERS],
        default=[*PEERS],
        metavar="NAME",
        help=", ".join(PEERS),
    )
    parser.add_argument(
        "--cases",
        nargs="*",
        choices=[*CASES],
        default=[*CASES],
        metavar="NAME",
        help=", ".join(CASES),
    )
    parser.add_argument("--table", action="store_true", help="print the table of what is there")
    options = parser.parse_args()
    for name in [] if options.table else options.peers:
        for case in options.cases:
            print(f"{PEERS[name].title}: {case} ...", file=sys.stderr, flush=True)
            add(name, case, ask(name, case))  # whatever ends early, the rest stays
    print(table(known()))


if __name__ == "__main__":
    main()
