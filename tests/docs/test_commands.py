"""Commands that the documentation shows are commands that there are."""

import re
import shlex
import warnings
from pathlib import Path

import pytest
import tyro

from jaxidl.cli import COMMANDS
from tests.helpers.paths import ROOT

PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "docs").rglob("*.md")),
    *sorted((ROOT / "experiments").rglob("*.md")),
]


def options(command: str) -> set[str]:
    """Names of a command's options."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        parser = tyro.extras.get_parser(COMMANDS[command])
    return {name for action in parser._actions for name in action.option_strings}


def shown(page: Path) -> list[str]:
    """Commands of jaxidl in a page's blocks and in its text."""
    text = page.read_text(encoding="utf-8")
    blocks = "\n".join(re.findall(r"```\w*\n(.*?)```", text, flags=re.S))
    lines = [line.split("  #")[0].strip() for line in blocks.splitlines()]
    within = re.findall(r"(?<!`)`(jaxidl [^`]+)`(?!`)", text)
    found = [re.sub(r"^(\.venv/bin/|.*&& \.venv/bin/)", "", line) for line in (*lines, *within)]
    return [line for line in found if re.match(r"jaxidl [a-z]", line)]


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_shown_commands_exist(page):
    for line in shown(page):
        _, command, *rest = shlex.split(line.replace("…", " "), comments=True)
        assert command in COMMANDS, line
        used = {word.split("=")[0] for word in rest if re.match(r"--[a-z]", word)}
        unknown = used - options(command)
        assert not unknown, f"{line}: no {', '.join(sorted(unknown))}"


def test_all_commands_are_shown():
    text = "\n".join(line for page in PAGES for line in shown(page))
    assert {command for command in COMMANDS if f"jaxidl {command}" in text} == {*COMMANDS}
