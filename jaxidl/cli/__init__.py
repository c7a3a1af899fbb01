"""The command line: ``jaxidl simulate | sweep | figures | claims | reproduce | ablate | tune | arm
| learn | gap | …``.

Anything a user can get wrong ends in one line on the standard error and status 2; Ctrl-C in one
line and status 130. One module for each command; what is heavy (JAX, MuJoCo, matplotlib) is
imported when a command runs, so that help is there at once.
"""

import contextlib
import functools
import gc
import io
import itertools
import os
import re
import signal
import sys
from collections.abc import Callable
from typing import Any, NoReturn

import tyro

from jaxidl import __version__
from jaxidl.cli import (
    ablate,
    arm,
    bench,
    excite,
    export,
    gap,
    learn,
    simulate,
    study,
    sweep,
    tune,
)
from jaxidl.errors import ConfigurationError, JaxidlError, did_you_mean, one_of
from jaxidl.stop import STOP

__all__ = ["COMMANDS", "main"]

COMMANDS = {
    "simulate": simulate.simulate,
    "sweep": sweep.sweep,
    "figures": study.figures,
    "claims": study.claims,
    "reproduce": study.reproduce,
    "ablate": ablate.ablate,
    "tune": tune.tune,
    "arm": arm.arm,
    "learn": learn.learn,
    "export": export.export,
    "gap": gap.gap,
    "gap-benchmark": gap.gap_benchmark,
    "excite": excite.excite,
    "bench": bench.bench,
}

# runs side by side, which a GPU is for; the others run many small programs, one after the other:
# gap takes three times as long on a GPU, and any would reserve most of its memory
SIDE_BY_SIDE = ("sweep", "reproduce", "ablate", "tune", "arm", "bench")
# commands that go on where they were interrupted
RESUMED = ("sweep", "reproduce", "ablate", "tune", "arm", "gap-benchmark")
GARBAGE = 100_000  # objects between two collections
# All matrices are small: threads that share one wait for each other longer than they compute
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
RENAMED = {"--iterations": "--executions"}  # options by their old names


def main(arguments: list[str] | None = None) -> int:
    """Run one command; return its exit status."""
    STOP.clear()
    # a file name that the terminal cannot show is no reason to fail
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
    words = sys.argv[1:] if arguments is None else arguments
    leave = functools.partial(_leave, resumed=bool(words) and words[0] in RESUMED)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, functools.partial(_stop, leave))
    try:
        run = _parse(words)
        if run is not None:
            if words[0] not in SIDE_BY_SIDE:
                os.environ.setdefault("JAX_PLATFORMS", "cpu")
            from jaxidl.backend import keep_programs  # JAX: not for a help text

            keep_programs()
            # tracing makes millions of objects that live on: to look through them again and again
            # takes longer than the rest of a short command
            often = gc.get_threshold()
            gc.set_threshold(GARBAGE)
            try:
                run()
            finally:
                gc.set_threshold(*often)
            sys.stdout.flush()
    except JaxidlError as error:
        print(f"jaxidl: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:  # the reader, `head` for one, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except BaseException:
        if not STOP.is_set():
            raise
        leave()
    return 0


def _stop(leave: Callable[[], NoReturn], *_: object) -> None:
    """Signal handler: the first signal ends the command at the next safe place, the second one at
    once.
    """
    if STOP.is_set():
        leave()
    STOP.set()
    raise KeyboardInterrupt


def _leave(resumed: bool) -> NoReturn:
    go_on = ", and the same command computes only what is left" if resumed else ""
    print(f"jaxidl: interrupted; no file is half-written{go_on}", file=sys.stderr)
    sys.stderr.flush()
    sys.stdout.flush()
    os._exit(130)  # without waiting for the chunk in flight


def _parse(arguments: list[str]) -> Callable[[], None] | None:
    """The command to run with its values, or None where help or the version was asked for."""
    arguments = [_renamed(word) for word in arguments]
    if arguments == ["--version"]:
        print(f"jaxidl {__version__}")
        return None

    def later(command: Callable[..., None]) -> Callable[..., Callable[[], None]]:
        @functools.wraps(command)
        def bound(*args: Any, **values: Any) -> Callable[[], None]:
            return functools.partial(command, *args, **values)

        return bound

    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            return tyro.extras.subcommand_cli_from_dict(
                {name: later(command) for name, command in COMMANDS.items()},
                prog="jaxidl",
                description=(
                    "Learn inverse dynamics, reproduce a published study of it, and find what a"
                    " simulation is missing."
                ),
                args=arguments,
            )
    except SystemExit as stop:
        if not stop.code:
            return None
        raise _unboxed(complaint.getvalue(), arguments) from None


def _options(command: str) -> list[str]:
    """The names of a command's options, as its help has them."""
    text = io.StringIO()
    with contextlib.redirect_stdout(text):
        _parse([command, "--help"])
    return re.findall(r"--[a-z][\w-]*", text.getvalue())


def _renamed(word: str) -> str:
    name, equals, value = word.partition("=")
    return RENAMED.get(name, name) + equals + value


def _unboxed(box: str, arguments: list[str]) -> ConfigurationError:
    """tyro explains in a framed box of several lines; ours is one line: what stands between the
    title and the next ruler.

    Where the terminal's encoding has no frames, a ruler stands below the title, too.
    """
    known = arguments[0] if arguments and arguments[0] in COMMANDS else ""
    remedy = f"see `jaxidl {known} --help`".replace("  ", " ")
    if arguments and not known and not arguments[0].startswith("-"):
        return one_of("the command", arguments[0], COMMANDS)
    options = _options(known) if known else []
    given = [word.partition("=")[0].replace("_", "-") for word in arguments]
    for word in (w for w in given if w.startswith("--") and known and w not in options):
        guess = did_you_mean(word, options) or remedy
        return ConfigurationError(f"options of `jaxidl {known}`", word, guess)
    # after these words each option that is missing has its own line, and its help deeper ones
    if lacking := re.search(r"(?m)^([^\w\n]*)Missing from .*\n((?:\1 .*\n)*)", box):
        margin, below = lacking.groups()
        first = re.compile(rf"{re.escape(margin)} {{4}}(\S.*)")
        named = [found[1] for line in below.splitlines() if (found := first.match(line))]
        missing = ", ".join(name.strip("│| ") for name in named)
        return ConfigurationError(missing, "none", remedy)
    lines = [line.strip("│| \t") for line in box.splitlines()[1:]]
    ruler = re.compile(r"[─+-]*").fullmatch
    message = itertools.takewhile(lambda line: not ruler(line), itertools.dropwhile(ruler, lines))
    return ConfigurationError("a command line that can be understood", " ".join(message), remedy)
