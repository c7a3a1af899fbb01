"""Scripts of the studies: all can be imported, and every committed figure has one that makes it."""

import fnmatch
import importlib.util

import pytest

from experiments.everything import EVERYTHING, main
from tests.helpers.paths import ROOT

SCRIPTS = sorted(path for path in (ROOT / "experiments").glob("*.py"))


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_scripts_are_up_to_date_with_the_package(script, monkeypatch):
    monkeypatch.syspath_prepend(str(script.parent))  # as where it is run
    if '__name__ == "__main__"' not in script.read_text():
        pytest.skip("runs as a whole")
    spec = importlib.util.spec_from_file_location(f"script_{script.stem}", script)
    spec.loader.exec_module(importlib.util.module_from_spec(spec))


def test_every_committed_figure_says_how_it_is_made():
    patterns = [name.split()[0] for made in EVERYTHING.values() for name in made.files]
    for path in (ROOT / "figures").iterdir():
        assert any(fnmatch.fnmatch(path.name, pattern) for pattern in patterns), path.name


def test_everything_lists_and_refuses(capsys):
    assert main([]) == 0
    assert "figures/study.nc" in capsys.readouterr().out
    assert main(["bogus"]) == 2
    assert capsys.readouterr().err.startswith("expected names among all, study")
