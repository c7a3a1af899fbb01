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
    """Run ``python words``. ``environment`` is added to this process's.

    The package and these tests can be imported, because the folder is the repository's.
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
