"""The wheel and the source archive, in an environment that knows nothing of the repository."""

import re
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import numpy as np
import pytest

from experiments import hidden_effects
from tests.helpers.paths import ROOT

pytestmark = pytest.mark.slow


def run(*words: object, cwd: Path) -> str:
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, cwd=cwd)
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


@pytest.fixture(scope="module")
def archives(tmp_path_factory):
    """The wheel and the source archive, built from a copy of what is committed or staged."""
    copy, out = tmp_path_factory.mktemp("copy"), tmp_path_factory.mktemp("dist")
    names = run(
        "git", "ls-files", "-z", "jaxidl", "pyproject.toml", "README.md", "LICENSE", cwd=ROOT
    )
    for name in filter(None, names.split("\0")):
        if (ROOT / name).is_file():
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            (copy / name).write_bytes((ROOT / name).read_bytes())
    run(sys.executable, "-m", "build", "-o", out, copy, cwd=out)
    (wheel,), (source,) = out.glob("*.whl"), out.glob("*.tar.gz")
    return wheel, source


def test_only_what_users_need_is_inside(archives):
    wheel, source = archives
    inside = zipfile.ZipFile(wheel).namelist()
    with tarfile.open(source) as archive:
        inside += archive.getnames()
    for name in inside:
        assert not re.search(r"(^|/)(tests|experiments|benchmark|figures)/|\.nc$", name), name
    for needed in (
        "__init__.pyi",
        "py.typed",
        "jobs/__init__.pyi",
        "robot/__init__.pyi",
        "systems/arm.xml",
        "gap/result/calibration.json",
        "report/page.css",
    ):
        assert f"jaxidl/{needed}" in inside
    assert wheel.stat().st_size < 650_000


@pytest.fixture(scope="module")
def installed(archives, tmp_path_factory):
    """The folder of the commands of an environment into which the wheel was installed."""
    where = tmp_path_factory.mktemp("environment")
    run(sys.executable, "-m", "venv", where, cwd=where)
    pip = [where / "bin" / "pip", "install", "-q", "--no-compile", "-c", ROOT / "constraints.txt"]
    run(*pip, archives[0], cwd=where)
    return where / "bin"


def test_commands_work_away_from_the_repository(installed, tmp_path):
    jaxidl = installed / "jaxidl"
    assert run(jaxidl, "--version", cwd=tmp_path).startswith("jaxidl ")
    run(jaxidl, "simulate", "--controller", "pid", "--gain", "low", "--out", "t.npz", cwd=tmp_path)
    assert np.load(tmp_path / "t.npz")["q"].shape == (1000, 2)
    hidden_effects.main(tmp_path)
    said = run(jaxidl, "gap", "log.csv", "--model", "model.xml", "--out", "report", cwd=tmp_path)
    assert "dry friction" in said
    assert (tmp_path / "report" / "report.html").is_file()
    done = subprocess.run([jaxidl, "gap-benchmark"], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 2
    assert "a checkout of the repository" in done.stderr


def test_the_readmes_example_works_away_from_the_repository(installed, tmp_path):
    (code,) = re.findall(r"^```python\n(.*?)^```$", (ROOT / "README.md").read_text(), re.M | re.S)
    assert run(installed / "python", "-c", code, cwd=tmp_path).startswith("[0.0")
