"""A progress bar with the time left; where there is no terminal, a line a minute."""

import sys
import time
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn


class Bar:
    """A bar on the standard error. Use as a context manager.

    Args:
        what: what is being done.
        total: work until the end, in any unit.
        done: how much of it was done before.
        quiet: show nothing.
        transient: leave nothing behind at the end.
    """

    def __init__(
        self,
        what: str,
        total: float | int = 1.0,
        done: float | int = 0.0,
        *,
        quiet: bool = False,
        transient: bool = False,
    ):
        columns = [
            TextColumn("{task.description} {task.fields[count]}"),
            BarColumn(),
            TextColumn("{task.percentage:>3.0f}%"),
        ]
        times = [
            TimeElapsedColumn(),
            TextColumn("elapsed,"),
            TimeRemainingColumn(),
            TextColumn("left"),
        ]
        console = Console(stderr=True)
        quiet |= transient and not console.is_terminal
        self._lines = not (console.is_terminal or quiet)
        self._bar = Progress(
            *columns,
            *times,
            console=console,
            disable=quiet,
            transient=transient,
            speed_estimate_period=600,
        )
        self._task = self._bar.add_task(what, total=total, count="")
        self._bar.update(self._task, completed=done)
        self._said = time.monotonic()

    def __enter__(self) -> "Bar":
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def advance(
        self, by: float | int = 1.0, count: str | None = None, what: str | None = None
    ) -> None:
        """Move on by so much; ``count`` says in words what is done, ``what`` what is being done
        now.
        """
        self._show(count, what, advance=by)

    def at(self, completed: float | int, what: str | None = None) -> None:
        """Move to ``completed`` of the total."""
        self._show(None, what, completed=completed)

    def _show(self, count: str | None, what: str | None, **moved: Any) -> None:
        fields = {"count": count, "description": what}
        moved |= {name: text for name, text in fields.items() if text is not None}
        self._bar.update(self._task, **moved)
        if self._lines and time.monotonic() > self._said + 60.0:
            self._said, now = time.monotonic(), self._bar.tasks[0]
            print(
                f"{now.description} {now.fields['count']} {now.percentage:.0f}%",
                file=sys.stderr,
                flush=True,
            )
