"""What the README and the documentation promise: links, commands, code and numbers."""

import json
import re
import shlex
import subprocess
import sys

import numpy as np
import pytest

from jaxidl.cli import _parse
from tests.helpers.paths import ROOT

README = (ROOT / "README.md").read_text()
PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "experiments").glob("**/*.md")),
]
PEERS = {
    "least_squares_links": "least squares",
    "figaroh": "FIGAROH",
    "mujoco_sysid": "mujoco.sysid",
}


def blocks(language: str) -> list[str]:
    """The README's code blocks of one language ("" for commands)."""
    found = re.findall(r"^```(\w*)\n(.*?)^```$", README, re.M | re.S)
    return [text for name, text in found if name == language]


def test_the_readme_is_short():
    assert len(README.splitlines()) <= 150


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    links = re.findall(r"\]\(([^)\s]+)\)", page.read_text())
    inner = [link.partition("#")[0] for link in links if "://" not in link]
    missing = [link for link in inner if link and not (page.parent / link).exists()]
    assert not missing


def test_commands_are_understood():
    lines = [line.partition("#")[0] for block in blocks("") for line in block.splitlines()]
    commands = [line for line in lines if line.startswith("jaxidl ")]
    assert len(commands) > 5
    for command in commands:
        assert _parse(shlex.split(command)[1:]) is not None


@pytest.mark.slow
def test_the_example_runs_and_learns(tmp_path):
    (code,) = blocks("python")
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path, check=True
    )
    errors = [float(number) for number in re.findall(r"\d\.\d+", done.stdout)]
    assert errors[0] == pytest.approx(0.046, abs=0.002)
    assert errors[-1] < 0.01


@pytest.mark.parametrize(
    ("row", "case", "key"),
    [
        ("UR10e, six joints", "ur10e", "held_out"),
        ("EMPS drive", "emps", "held_out"),
        ("XL330", "xl330", "held_out"),
        ("put on its flange", "ur10e_change", "payload"),
    ],
)
def test_the_table_of_peers_is_what_was_measured(row, case, key):
    (line,) = [line for line in README.splitlines() if line.startswith("|") and row in line]
    ours, others = line.replace("*", "").split("|")[2:4]
    peers = json.loads((ROOT / "figures" / "peers.json").read_text())["peers"]

    def said(peer: str) -> str:
        answer = peers[peer]["answers"][case]
        if key == "payload":
            return f"{answer['estimated']['payload']:.2f} kg"
        return f"{100 * np.mean(answer['held_out']):.1f} %"

    assert ours.strip() == said("jaxidl")
    assert others.strip() == ", ".join(f"{name} {said(peer)}" for peer, name in PEERS.items())


def test_the_shares_of_right_names_are_what_was_measured():
    benchmark = json.loads((ROOT / "figures" / "gap_benchmark.json").read_text())
    robots, outside = benchmark["robots"]["precision"], benchmark["outside"]["misnamed"]
    right = round(robots["n"] * robots["share"])
    text = " ".join(README.split())
    assert f"of {robots['n']} names that it gave in 15 simulated robots" in text
    assert f"full of hidden effects, {right} were right" in text
    assert f"{100 * outside['share']:.0f} % were given a wrong name" in text
    strangers = json.loads((ROOT / "figures" / "strangers.json").read_text())["robots"].values()
    assert len(strangers) == 16
    named = sum(r["named"] for r in strangers)
    wrong = sum(len(r["wrong"]) for r in strangers)
    assert f"of {named} in simulations of sixteen published robots" in text
    assert f"than their files have, {named - wrong}." in text
