"""Errors that a user can cause.

Each carries three things in one line: what was expected, what was found instead, and what to do.
The command line prints that line and exits with status 2. Inside jit nothing raises: failure is a
``finite`` flag in the result.
"""

import difflib
from collections.abc import Iterable


class JaxidlError(Exception):
    """Base of every error that a user can cause and correct.

    Args:
        expected: what would have been right, e.g. ``"noise >= 0 (m)"``.
        got: what was found instead.
        remedy: what to do about it, in the imperative.
    """

    def __init__(self, expected: str, got: str, remedy: str):
        self.expected, self.got, self.remedy = expected, got, remedy
        # so that it can be pickled, and raised again in another process
        super().__init__(expected, got, remedy)

    def __str__(self) -> str:
        return " ".join(f"expected {self.expected}; got {self.got}; {self.remedy}".split())


class ConfigurationError(JaxidlError):
    """A value on an axis or in a configuration is unknown or out of its bounds."""


class EffectError(JaxidlError):
    """An effect's name or parameter is unknown or out of its bounds."""


class ModelError(JaxidlError):
    """A model file cannot be read, or contains something that this package does not simulate."""


class LogError(JaxidlError):
    """A measured log cannot be read, or cannot be used."""


class StoreError(JaxidlError):
    """A results file cannot be read, cannot be written, or belongs to another configuration."""


def one_of(what: str, value: object, valid: Iterable[object]) -> ConfigurationError:
    """Return the error for a name that is not among the valid ones, with the one that is meant."""
    names = [str(v) for v in valid]
    remedy = did_you_mean(str(value), names) or "choose one of these"
    return ConfigurationError(f"{what} to be one of {', '.join(names)}", repr(value), remedy)


def did_you_mean(value: str, names: Iterable[str]) -> str:
    """Return the question whether the most similar name was meant; empty if none is similar."""
    meant = difflib.get_close_matches(value, list(names), n=1)
    return f"did you mean {meant[0]}?" if meant else ""


def needs_checkout(lacking: str) -> ConfigurationError:
    """Return the error for what an installed package leaves out, such as benchmarks."""
    return ConfigurationError(
        "a checkout of the repository",
        f"an installation without {lacking}",
        "clone it and install it with `pip install -e .`",
    )
