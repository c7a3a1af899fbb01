"""What the study of reliability is made of: sweeps as processes that can be watched and killed, and
ways to do them harm.
"""

import contextlib
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jaxidl import Grid, PaperStudy
from jaxidl.errors import StoreError
from jaxidl.jobs.points import Point
from jaxidl.jobs.store import Store
from jaxidl.paper.runs import META, identity, read_results

GRID = Grid(
    ("pid",),
    ("low", "high"),
    (1e-4, 8e-4),
    (5.0,),
    (5.0,),
    (10,),
    (1, 2, 3, 4, 5, 6),
    ("joint",),
    2,
)
WORDS = [
    "--controllers",
    "pid",
    "--noise",
    "1e-4",
    "8e-4",
    "--friction",
    "5",
    "--stiction",
    "5",
    "--epochs",
    "10",
]
WORDS += [
    "--sources",
    "joint",
    "--executions",
    "2",
    "--devices",
    "1",
    "--per-device",
    "1",
    "--seeds",
]
SEEDS = [str(seed) for seed in GRID.seeds]
CHUNKS = len(GRID)  # of one run each: many moments to be killed at

# the process ends itself at its n-th durable write: with half of the bytes written, all of them, or
# the file renamed, too
DIE_WRITING = """
import os, signal, sys
moment, left = sys.argv[1], int(sys.argv[2])
del sys.argv[1:3]
fsync, replace = os.fsync, os.replace

def die_if(now):
    if left == 0 and moment == now:
        os.kill(os.getpid(), signal.SIGKILL)

def dying_fsync(file):
    global left
    left -= 1
    if left == 0 and moment == "half":
        os.ftruncate(file, os.fstat(file).st_size // 2)
    die_if("half")
    fsync(file)
    die_if("whole")

def dying_replace(old, new):
    replace(old, new)
    die_if("renamed")

os.fsync, os.replace = dying_fsync, dying_replace
from jaxidl.cli import main
sys.exit(main())
"""


def parts_of(out: Path) -> dict[str, int]:
    """The part files beside ``out``: name -> time of writing [ns]."""
    found = {}
    for part in Path(f"{out}.parts").glob("*.npz"):
        with contextlib.suppress(FileNotFoundError):  # removed at the end of the sweep
            found[part.name] = part.stat().st_mtime_ns
    return found


class Life:
    """One process of a sweep from its start to its end, whatever that is."""

    def __init__(
        self,
        out: Path,
        seeds: Sequence[str] = SEEDS,
        code: Sequence[str] = (),
        limit: int = 0,
        **env: str,
    ):
        """``code``: Python to run instead of the command line, and its words; ``limit``: the
        largest file it can write [B].
        """
        start = ["-c", *code] if code else ["-m", "jaxidl"]
        self.out, self.before, self.seen = out, parts_of(out), set(parts_of(out).items())
        self.began = time.monotonic()
        self.process = subprocess.Popen(
            [sys.executable, *start, "sweep", "--out", str(out), *WORDS, *seeds],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ | env,
            preexec_fn=(lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)))
            if limit
            else None,
        )

    def watch(self, until: Callable[[], bool]) -> bool:
        """Look at the parts until something is so; False if the process ended first."""
        while self.process.poll() is None:
            self.seen |= set(parts_of(self.out).items())
            if until():
                return True
            time.sleep(0.005)
        return False

    def watch_for(self, seconds: float) -> bool:
        end = time.monotonic() + seconds
        return self.watch(lambda: time.monotonic() > end)

    def saves_a_part(self) -> bool:
        """Wait for the first part of this life."""
        return self.watch(lambda: len(self.seen) > len(self.before))

    def send(self, number: int) -> None:
        if self.process.poll() is None:
            self.process.send_signal(number)

    def end(self) -> "Life":
        """Wait for its end, watching."""
        self.watch(lambda: False)
        assert self.process.stderr is not None
        self.said = self.process.stderr.read()
        self.process.stderr.close()
        self.status = self.process.wait()
        return self

    def kill(self) -> "Life":
        self.send(signal.SIGKILL)
        return self.end()

    def refused(self, *words: str) -> str:
        """Why this was not a refusal in one line with these words in it; nothing if it was."""
        lines = [line for line in self.said.splitlines() if line.startswith("jaxidl: ")]
        right = (
            len(lines) == 1
            and all(word in lines[0] for word in words)
            and "Traceback" not in self.said
        )
        return (
            "" if self.status == 2 and right else f"status {self.status}, said {self.said[-300:]!r}"
        )


class Whole(NamedTuple):
    """A sweep that nobody disturbed, and when what happened in it [s]."""

    out: Path
    locked: float
    first_part: float
    last_part: float
    end: float

    def left(self, parts: int) -> float:
        """Working time from a first part on, with so many parts there before [s]."""
        return (
            (self.last_part - self.first_part) * max(0, CHUNKS - parts) / CHUNKS
            + self.end
            - self.last_part
        )

    def unlike(self, out: Path) -> str:
        """How the results at ``out`` differ from these, or what else lies there; nothing if all is
        well.
        """
        try:
            ours, theirs = read_results(self.out), read_results(out)
        except StoreError as error:
            return str(error)
        litter = [
            entry.name for entry in out.parent.iterdir() if out.name in entry.name and entry != out
        ]
        names = [
            name for name in ours.variables if not _same(ours[name].values, theirs[name].values)
        ]
        return (
            f"differs in {', '.join(map(str, names))}"
            if names
            else f"left behind {', '.join(litter)}"
            if litter
            else ""
        )


def _same(a: np.ndarray, b: np.ndarray) -> bool:
    if a.dtype != b.dtype or a.shape != b.shape:
        return False
    return a.tolist() == b.tolist() if a.dtype.hasobject else a.tobytes() == b.tobytes()


def whole(out: Path) -> Whole:
    """Run a sweep undisturbed, compiling everything."""
    life, times = Life(out), []
    for moment in (
        lambda: Path(f"{out}.parts", "lock").exists(),
        lambda: len(life.seen) > 0,
        lambda: len(life.seen) == CHUNKS,
    ):
        if not life.watch(moment):
            sys.exit(f"the undisturbed sweep ended with status {life.end().status}: {life.said}")
        times.append(time.monotonic() - life.began)
    if life.end().status != 0:
        sys.exit(f"the undisturbed sweep failed: {life.said}")
    locked, first, last = times
    return Whole(out, locked, first, last, time.monotonic() - life.began)


@contextlib.contextmanager
def small_disk(folder: Path, size: int) -> Iterator[bool]:
    """A disk of ``size`` bytes at ``folder`` if we may make one."""
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "none", str(folder)]
    mounted = (
        os.getuid() == 0
        and shutil.which("mount")
        and subprocess.run(command, capture_output=True).returncode == 0
    )
    try:
        yield bool(mounted)
    finally:
        if mounted:
            subprocess.run(["umount", str(folder)], check=True)


def fill(folder: Path, leave: int) -> None:
    """Fill the small disk up to ``leave`` bytes."""
    (folder / "filler").unlink(missing_ok=True)
    (folder / "filler").write_bytes(bytes(max(0, shutil.disk_usage(folder).free - leave)))


def harmed(content: bytes, chance: random.Random) -> bytes:
    """One bit flipped, or, every fifth time, cut short."""
    place = chance.randrange(len(content))
    if chance.random() < 0.2:
        return content[:place]
    return (
        content[:place] + bytes([content[place] ^ 1 << chance.randrange(8)]) + content[place + 1 :]
    )


def harm_parts(parts: dict[str, bytes], folder: Path, count: int, chance: random.Random) -> Counter:
    """What the store makes of that many damaged parts: detected, harmless, or silently wrong."""

    def load(changed: dict[str, bytes]) -> tuple[dict[Point, bytes], bool]:
        out = folder / "harmed.nc"
        shutil.rmtree(f"{out}.parts", ignore_errors=True)
        Path(f"{out}.parts").mkdir(parents=True)
        for name, content in changed.items():
            Path(f"{out}.parts", name).write_bytes(content)
        with Store(out, identity(PaperStudy(), GRID), META) as store:
            runs = {
                label: b"".join(run[name].tobytes() for name in sorted(run))
                for label, run in store.runs.items()
            }
            return runs, bool(store.damaged)

    sound, _ = load(parts)
    found: Counter = Counter()
    for _ in range(count):
        name = chance.choice(sorted(parts))
        try:
            runs, noticed = load(parts | {name: harmed(parts[name], chance)})
        except StoreError:
            runs, noticed = {}, True
        false = any(sound.get(label) != run for label, run in runs.items())
        found[
            "silently wrong"
            if false or not (noticed or runs == sound)
            else "detected"
            if noticed
            else "harmless"
        ] += 1
    return found


def harm_results(out: Path, folder: Path, count: int, chance: random.Random) -> Counter:
    """What reading makes of that many damaged results files."""
    sound, content, found = read_results(out), out.read_bytes(), Counter()
    for _ in range(count):
        (folder / "harmed.nc").write_bytes(harmed(content, chance))
        try:
            data = read_results(folder / "harmed.nc")
        except StoreError:
            found["detected"] += 1
            continue
        found["harmless" if data.identical(sound) else "silently wrong"] += 1
    return found
