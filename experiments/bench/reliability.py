"""Is a sweep as hard to kill as it claims? Real processes are killed, starved of disk, interrupted,
and their files damaged.

    python experiments/bench/reliability.py [--kills 20] [--damages 200] [--json FILE]

Everything happens in a temporary folder. Ends with status 1 if anything failed.
"""

import os
import random
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from common import arguments, report
from harm import (
    CHUNKS,
    DIE_WRITING,
    SEEDS,
    Life,
    Whole,
    fill,
    harm_parts,
    harm_results,
    parts_of,
    small_disk,
    whole,
)

rows: list[dict[str, str]] = []


def tell(what: str) -> None:
    print(what, file=sys.stderr, flush=True)


def row(name: str, figure: str, *failures: str, verdict: str = "") -> None:
    """A line of the table; it failed if one of ``failures`` says why."""
    found = "; ".join(failure for failure in failures if failure)
    verdict = verdict or ("FAILED" if found else "ok")
    rows.append(
        {"what": name, "figure": f"{figure} ({found})" if found else figure, "verdict": verdict}
    )


def kills(sound: Whole, folder: Path, count: int, chance: random.Random) -> None:
    """Kill -9 at random moments of the working time, restart until finished, as often as it takes
    to kill ``count`` times.
    """
    killed, sweeps, written, lost, failures = 0, 0, 0, [], []
    while killed < count:
        out, seen, status = folder / f"killed{sweeps}.nc", set(), -1
        while status != 0:
            life = Life(out)
            there = len(life.before)
            # with all parts there, nothing is left but to write the results
            alive = life.saves_a_part() if there < CHUNKS else life.watch_for(sound.locked)
            if alive and killed < count and life.watch_for(chance.uniform(0, sound.left(there))):
                saved = parts_of(out).values()
                lost += [time.time() - max(saved) / 1e9] if saved else []
                life.send(signal.SIGKILL)
            seen |= life.end().seen
            status = life.status
            killed += status == -signal.SIGKILL
            if status not in (0, -signal.SIGKILL):
                failures.append(life.refused())
                break
        sweeps, written = sweeps + 1, written + len(seen)
        failures.append(sound.unlike(out))
        tell(f"  {killed} of {count} kills")
    row(
        "kill -9 at random moments",
        f"{killed} kills in {sweeps} sweeps, each continued to equal results",
        *failures,
    )
    needed = sweeps * CHUNKS
    twice = f"{written - needed} saved twice" if written != needed else ""
    row(
        "… work done again",
        f"{written} chunks saved, {needed} needed; at most {killed} in flight lost",
        twice,
    )
    chunk = (sound.last_part - sound.first_part) / (CHUNKS - 1)
    worst = (
        f"{statistics.median(lost):.2g} s median, {max(lost):.2g} s worst; a chunk takes"
        f" {chunk:.2g} s"
    )
    row("… time since the last save, when killed", worst)


def kills_while_writing(sound: Whole, folder: Path) -> None:
    """Kill -9 half-way through a write, before the rename and after it: of early and later parts,
    and of the results.
    """
    out, failures = folder / "writing.nc", []
    plan = [("half", 1), ("half", 3), ("whole", 1), ("whole", 3), ("renamed", 1), ("renamed", 3)]
    for moment, nth in [*plan, ("half", 0), ("whole", 0), ("renamed", 0)]:
        nth = nth or CHUNKS - len(parts_of(out)) + 1  # 0: the results, which come after all parts
        life = Life(out, code=[DIE_WRITING, moment, str(nth)]).end()
        if life.status != -signal.SIGKILL:
            failures.append(
                f"not killed with the {nth}th file {moment}: status {life.status}, said"
                f" {life.said[-300:]!r}"
            )
    status = Life(out).end().status
    failures += [f"status {status}" if status else "", sound.unlike(out)]
    row(
        "kill -9 while writing",
        f"{len(plan)} parts and 3 results: equal, nothing left behind",
        *failures,
    )


def two_at_once(sound: Whole, folder: Path) -> None:
    """The second process on a file is refused; a killed process leaves no lock."""
    out = folder / "two.nc"
    first = Life(out)
    first.saves_a_part()
    first.send(signal.SIGSTOP)  # it keeps its lock however slowly the second one starts
    second = Life(out).end()
    first.send(signal.SIGCONT)
    first.end()
    row(
        "a second process on the same file",
        "refused in one line, the first undisturbed",
        second.refused("another process"),
        sound.unlike(out),
    )
    out = folder / "lock.nc"
    first = Life(out)
    first.saves_a_part()
    first.kill()
    status = Life(out).end().status
    row(
        "… after kill -9 of the first",
        "let in at once",
        f"status {status}" if status else "",
        sound.unlike(out),
    )


def full_disk(sound: Whole, folder: Path) -> None:
    """No room for a part, then none for the results: the old ones stay, and with room the same
    command finishes.
    """
    one = sound.out.stat().st_size
    parts = CHUNKS * 8192  # their size on a disk that counts in pages
    with small_disk(folder / "disk", 4 * one + 2 * parts) as real:
        out = folder / "disk" / "full.nc"
        failures = [f"status {status}" if (status := Life(out, SEEDS[:1]).end().status) else ""]
        old = out.read_bytes()
        for leave in (0, parts + one // 2):
            if real:
                fill(out.parent, leave)
            limit = 0 if real else leave - parts if leave else 1000
            failures.append(
                Life(out, limit=limit, JAX_COMPILATION_CACHE_DIR="")
                .end()
                .refused("free some space")
            )
            failures.append("" if out.read_bytes() == old else "the old results changed")
        (out.parent / "filler").unlink(missing_ok=True)
        way = "a real one" if real else "by a limit on the size of files"
        failures += [
            f"status {status}" if (status := Life(out).end().status) else "",
            sound.unlike(out),
        ]
        row(
            f"full disk ({way})",
            "one line, the old results untouched; finished with room",
            *failures,
        )
        read_only(sound, out, real)


def read_only(sound: Whole, out: Path, mounted: bool) -> None:
    """A folder that cannot be written."""
    if not mounted and os.getuid() == 0:
        row(
            "read-only folder",
            "root may write everywhere, and nothing can be mounted here",
            verdict="skipped",
        )
        return
    old = out.read_bytes()
    if mounted:
        subprocess.run(["mount", "-o", "remount,ro", str(out.parent)], check=True)
    else:
        out.parent.chmod(0o500)
    failure = Life(out, [*SEEDS, "7"]).end().refused("choose another --out")
    if not mounted:
        out.parent.chmod(0o700)
    row(
        "read-only folder",
        "one line, the old results untouched",
        failure,
        "" if out.read_bytes() == old else "results changed",
    )


def damage(sound: Whole, folder: Path, count: int, chance: random.Random) -> None:
    """Bits flipped in, and ends cut off, part files and a results file."""
    out = folder / "parts.nc"
    life = Life(out)
    life.watch(lambda: len(life.seen) >= 4)
    life.kill()
    parts = {name: Path(f"{out}.parts", name).read_bytes() for name in parts_of(out)}
    for what, found in (
        ("parts", harm_parts(parts, folder / "harm", count, chance)),
        ("results files", harm_results(sound.out, folder, count, chance)),
    ):
        figure = ", ".join(
            f"{found[kind]} {kind}" for kind in ("detected", "harmless", "silently wrong")
        )
        row(f"{count} damaged {what}", figure, "numbers changed" if found["silently wrong"] else "")


def interruptions(sound: Whole, folder: Path, count: int, chance: random.Random) -> None:
    """Ctrl-C spread over a sweep, from its first look at the store to its end; programs are
    compiled anew.
    """
    seconds, failures, done = [], [], 0
    while done < count:
        out = folder / f"interrupted{done}.nc"
        life = Life(out, JAX_COMPILATION_CACHE_DIR="")
        life.watch(lambda lock=Path(f"{out}.parts", "lock"): lock.exists())
        alive = life.watch_for((done + chance.random()) / count * (sound.end - sound.locked))
        kept, sent = set(parts_of(out).items()), time.monotonic()
        life.send(signal.SIGINT)
        if life.end().status == 0 or not alive:  # faster than reckoned: too late to interrupt
            out.unlink()
            continue
        seconds.append(time.monotonic() - sent)
        lines = [line for line in life.said.splitlines() if line.startswith("jaxidl: ")]
        right = (
            life.status == 130
            and len(lines) == 1
            and "only what is left" in lines[0]
            and "Traceback" not in life.said
        )
        failures.append("" if right else f"status {life.status}, said {life.said[-300:]!r}")
        failures.append("" if kept <= set(parts_of(out).items()) else "finished parts lost")
        done += 1
    status = Life(out).end().status
    failures += [f"status {status}" if status else "", sound.unlike(out)]
    figure = (
        f"{statistics.median(seconds):.2g} s median, {max(seconds):.2g} s worst of {count}; status"
        " 130, one line, continued"
    )
    row("Ctrl-C", figure, *failures)


def main() -> None:
    options = arguments(__doc__ or "", kills=20, damages=200, seed=1)
    chance = random.Random(options.seed)
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        # killed processes write there, too
        os.environ["JAX_COMPILATION_CACHE_DIR"] = str(folder / "programs")
        tell("an undisturbed sweep")
        sound = whole(folder / "whole.nc")
        tell(
            f"kills at random moments of a sweep that starts in {sound.first_part:.0f} s and ends"
            f" after {sound.end:.0f} s"
        )
        kills(sound, folder, options.kills, chance)
        tell("kills while writing")
        kills_while_writing(sound, folder)
        tell("two processes on one file")
        two_at_once(sound, folder)
        tell("full disk, read-only folder")
        full_disk(sound, folder)
        tell("damaged files")
        damage(sound, folder, options.damages, chance)
        tell("Ctrl-C")
        interruptions(sound, folder, 5, chance)
    report(
        "Reliability of `jaxidl sweep`",
        rows,
        options.json,
        seed=options.seed,
        seconds=round(time.monotonic() - began),
    )
    sys.exit(any(line["verdict"] == "FAILED" for line in rows))


if __name__ == "__main__":
    main()
