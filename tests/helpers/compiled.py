"""C compilers of this machine, and generated controllers as functions of Python."""

import ctypes
import importlib.util
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from jaxidl.robot.c import Controller, generate

STRICT = ("-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror")


@cache
def compilers() -> dict[str, list[str]]:
    """Return the commands of gcc and clang, by name, as far as they are there.

    The package ziglang brings clang.
    """
    found = {name: [name] for name in ("gcc", "clang") if shutil.which(name)}
    if "clang" not in found and (zig := _zig()):
        found["clang"] = zig
    return found


@cache
def _zig() -> list[str]:
    found = importlib.util.find_spec("ziglang")
    return [sys.executable, "-m", "ziglang", "cc"] if found else []


@cache
def for_32_bits() -> list[str]:
    """Return the command of a compiler for a 32-bit machine whose programs run here; or nothing."""
    if zig := _zig():
        return [*zig, "-target", "x86-linux-musl"]
    source = "#include <stdint.h>\nint main(void) { return 0; }\n"
    for name, command in compilers().items():
        if name != "gcc":
            continue
        done = subprocess.run(
            [*command, "-m32", "-x", "c", "-", "-o", "/dev/null"],
            input=source.encode(),
            capture_output=True,
        )
        if done.returncode == 0:
            return [*command, "-m32"]
    return []


def compiler() -> list[str]:
    """Return the command of some compiler; the test is skipped if there is none."""
    if not compilers():
        pytest.skip("no C compiler: neither gcc nor clang is on the path")
    return next(iter(compilers().values()))


def build(command: list[str], folder: Path, out: str, *options: str) -> Path:
    """Compile all C files of a folder; any warning is an error.

    Linked with -ffast-math, a library would flush subnormal numbers to zero in the whole process
    that loads it, this one.
    """
    linking = [word for word in options if word != "-ffast-math"]
    steps = []
    objects = []
    for path in sorted(folder.glob("*.c")):
        objects.append(str(path.with_suffix(f".{out}.o")))
        steps.append([*STRICT, *options, "-c", str(path), "-o", objects[-1]])
    steps.append([*linking, *objects, "-o", str(folder / out), "-lm"])
    for words in steps:
        done = subprocess.run([*command, *words], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr[:3000]
    return folder / out


class InC:
    """A controller, compiled; the arrays of its state are attributes (J,)."""

    def __init__(self, own: Controller, folder: Path, *options: str):
        code = generate(own, "robot", "a model of the tests\nrevision of the tests")
        (folder / "robot.h").write_text(code.header)
        (folder / "robot.c").write_text(code.source)
        self.type = np.float32 if "-DROBOT_SINGLE" in options else np.float64
        # a library of the same name would be taken for the one that is loaded already
        name = f"robot{len(list(folder.glob('*.so')))}.so"
        library = build(compiler(), folder, name, "-O1", "-shared", "-fPIC", *options)
        self.library, self.joints = ctypes.CDLL(str(library)), len(own.joints)
        self.controller = own
        self.fields = _fields(code.header)
        self.state = ctypes.create_string_buffer(1 << 14)

    def _array(self, x) -> np.ndarray:
        return np.ascontiguousarray(x, self.type)

    def call(self, name: str, *given) -> int:
        """Call a function of the header; a float is a time, anything else an array."""
        arrays = [x if isinstance(x, float) else self._array(x) for x in given]
        words = [
            ctypes.c_double(x) if isinstance(x, float) else x.ctypes.data_as(ctypes.c_void_p)
            for x in arrays
        ]
        self.last = arrays[-1]
        return getattr(self.library, f"robot_{name}")(*words)

    def torque(self, name: str, *given) -> np.ndarray:
        """Return what a function of the state writes into its last argument (J,)."""
        self.call(name, *given, np.zeros(self.joints))
        return self.last

    def init(self, q) -> None:
        self.library.robot_init(self.state, self._array(q).ctypes.data_as(ctypes.c_void_p))

    def step(self, *given) -> tuple[int, np.ndarray]:
        """Return status and torque (J,) of a step."""
        arrays = [x if isinstance(x, float) else self._array(x) for x in given]
        tau = self._array(np.full(self.joints, 7.0))
        words = [
            ctypes.c_double(x) if isinstance(x, float) else x.ctypes.data_as(ctypes.c_void_p)
            for x in (*arrays, tau)
        ]
        return self.library.robot_step(self.state, *words), tau

    def __getitem__(self, field: str) -> np.ndarray:
        """Return an array of the state (J,)."""
        at, size = self.fields[field] * self.type().nbytes, self.joints * self.type().nbytes
        return np.frombuffer(self.state.raw[at : at + size], self.type)


def _fields(header: str) -> dict[str, int]:
    """Return where arrays begin in the state, in numbers, as the header declares them."""
    out, at = {}, 0
    for line in header.partition("typedef struct")[2].partition("double time")[0].splitlines():
        words = line.replace("[", " ").replace("]", " ").replace(";", " ").split()
        if words and words[0] == "robot_real":
            out[words[1]] = at
            at += int(words[2]) if words[2].isdigit() else 1
    return out
