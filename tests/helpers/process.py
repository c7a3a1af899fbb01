"""Python in a process of its own."""

import os
import subprocess
import sys
import textwrap
from pathlib import Path

from tests.helpers.paths import ROOT


def python(
    *words: object, cwd: Path = ROOT, **environment: str
) -> subprocess.CompletedProcess[str]:
    """What ``python words`` says and how it ends; ``environment`` is added to this process's.

    In the repository's folder it finds the package and these tests.
    """
    return subprocess.run(
        [sys.executable, *map(str, words)],
        capture_output=True,
        text=True,
        cwd=cwd,
        env=os.environ | environment,
        check=False,
    )


def script(code: str, *words: object, **how) -> str:
    """What indented code prints, which must not fail; ``how`` as for :func:`python`."""
    done = python("-c", textwrap.dedent(code), *words, **how)
    assert done.returncode == 0, done.stderr
    return done.stdout
