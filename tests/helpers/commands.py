"""The command line, called in this process."""

from jaxidl.cli import main


def refusal(capsys, *words: object) -> str:
    """The line with which a command is refused. The status is 2 and nothing else is printed."""
    assert main([str(word) for word in words]) == 2
    said = capsys.readouterr()
    (line,) = said.err.splitlines()
    assert line.startswith("jaxidl: expected ")
    assert not said.out
    return line
