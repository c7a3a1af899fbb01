"""Every number of the study by its name: what an ablation may vary, and which of them one compiled
program serves.

A name is the path of a field of :class:`jaxidl.paper.study.PaperStudy`: ``modelled_mass``,
``pid_gains.0.1``, ``training.learning_rate``. Some have a shorter one (``ALIASES``), and two set
several numbers in proportion (``GAINS``).
"""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any

from jaxidl.errors import ConfigurationError, one_of
from jaxidl.paper.grid import Value
from jaxidl.paper.study import WIDTHS, PaperStudy
from jaxidl.types import Scalar

ALIASES = {
    "alpha": "smoothing",
    "prior_mass": "modelled_mass",
    "learning_rate": "training.learning_rate",
    "batch": "training.batch",
    "layers": "error_model.layers",
}
# numbers that are not traced, beside whole ones
STATIC = ("dt", "error_model.", "training.snapshot_epochs", *WIDTHS)


def _learner_gain(study: PaperStudy, kp: Scalar) -> PaperStudy:
    share = kp / study.pid_learner[0]
    pid = tuple(share * gain for gain in study.pid_learner)
    return replace(study, pid_learner=pid, doomed_learner=share * study.doomed_learner)


def _applied_gain(study: PaperStudy, kp: Scalar) -> PaperStudy:
    shares = [kp / gains[0] for gains in study.pid_gains]
    pid = tuple(
        tuple(share * gain for gain in gains)
        for share, gains in zip(shares, study.pid_gains, strict=True)
    )
    rates = tuple(share * rate for share, rate in zip(shares, study.doomed_rates, strict=True))
    return replace(study, pid_gains=pid, doomed_rates=rates)


GAINS: dict[str, Callable[[PaperStudy, Scalar], PaperStudy]] = {
    # the learner's kp [N/m], the paper's being 500; its kd, ki, and DOOMED's learner gain in
    # proportion
    "learner_gain": _learner_gain,
    # the applied kp [N/m], the paper's being 25 and 500; kd, ki, and DOOMED's rate in proportion
    "applied_gain": _applied_gain,
}


def leaves(study: PaperStudy) -> dict[str, Value]:
    """Return every number that may vary, by name, with its present value."""
    found = {
        name: value
        for name, value in _leaves(study, "")
        if name not in ("error_model.joints", "training.epochs")
    }
    layers = {"error_model.layers": ",".join(map(str, study.error_model.layers))}
    found = {
        name: value for name, value in found.items() if not name.startswith("error_model.layers.")
    } | layers
    gains: Any = {"learner_gain": study.pid_learner[0], "applied_gain": study.pid_gains[0][0]}
    return {alias: found[name] for alias, name in ALIASES.items()} | gains | found


def _leaves(node: Any, path: str) -> list[tuple[str, Any]]:
    if is_dataclass(node):
        parts = [(f.name, getattr(node, f.name)) for f in fields(node)]
    elif isinstance(node, tuple):
        parts = [(str(place), value) for place, value in enumerate(node)]
    else:
        return [(path, node)]
    return [
        leaf for name, value in parts for leaf in _leaves(value, f"{path}.{name}" if path else name)
    ]


def traced(study: PaperStudy, name: str) -> bool:
    """Return whether one program serves all values of this number.

    Whole numbers, sizes and names make a program of each value.
    """
    full = ALIASES.get(name, name)
    return isinstance(leaves(study)[name], float) and not full.startswith(STATIC)


def parsed(study: PaperStudy, name: str, given: object) -> Value:
    """Return a value of the number ``name`` as an axis holds it, from text or from Python.

    Raises:
        ConfigurationError: for a name that the study has not, or a value of another kind or out of
            bounds.
    """
    known = leaves(study)
    if name not in known:
        raise one_of("a number of the study", name, known)
    like = known[name]
    if isinstance(given, tuple | list):
        given = ",".join(map(str, given))
    try:
        value = type(like)(given)  # type: ignore[call-arg]
        if (isinstance(like, int) and float(str(given)) != value) or (
            isinstance(value, float) and not math.isfinite(value)
        ):
            raise ValueError(given)
    except (TypeError, ValueError):
        kind = "a whole number" if isinstance(like, int) else "a finite number"
        raise ConfigurationError(f"{kind} for {name}", repr(given), "correct the value") from None
    after = varied(study, {name: value})  # the study knows its bounds
    return leaves(after)["layers"] if ALIASES.get(name, name) == "error_model.layers" else value


def check(study: PaperStudy, vary: Sequence[tuple[str, Sequence[Value]]]) -> None:
    """Refuse axes that cannot be: unknown or out of bounds, two that set the same number, and
    combinations that do not fit.

    Raises:
        ConfigurationError: see above.
    """
    for name, values in vary:
        for value in values:
            parsed(study, name, value)
    for (a, _), (b, _) in itertools.combinations(vary, 2):
        if any(
            x == y or f"{x}.".startswith(f"{y}.") or f"{y}.".startswith(f"{x}.")
            for x in _sets(a)
            for y in _sets(b)
        ):
            raise ConfigurationError(
                "axes that set different numbers", f"{a} and {b}", "drop one of them"
            )
    names = [name for name, _ in vary]
    sizes = [(name, values) for name, values in vary if not traced(study, name)]
    for combination in itertools.product(*(values for _, values in sizes)):
        after = varied(study, dict(zip([name for name, _ in sizes], combination, strict=True)))
        rows = int(after.training.train_mask(after.steps - 1).sum())
        if names and rows < after.training.batch:
            got = (
                f"{after.training.batch}, with {rows} training rows from {after.steps} control"
                " steps"
            )
            raise ConfigurationError(
                "a batch no larger than an execution's training rows", got, "change batch or steps"
            )


def _sets(name: str) -> tuple[str, ...]:
    """The numbers that a name sets."""
    both = {
        "learner_gain": ("pid_learner", "doomed_learner"),
        "applied_gain": ("pid_gains", "doomed_rates"),
    }
    return both.get(name, (ALIASES.get(name, name),))


def varied(study: PaperStudy, values: Mapping[str, Any]) -> PaperStudy:
    """Return the study with these numbers instead of its own; traced ones within a program.

    Raises:
        ConfigurationError: for a value out of bounds.
    """
    for name, value in values.items():
        full = ALIASES.get(name, name)
        if name in GAINS:
            study = GAINS[name](study, value)
        else:
            study = _put(
                study, full.split("."), _layers(value) if full == "error_model.layers" else value
            )
    return study


def _put(node: Any, path: list[str], value: Any) -> Any:
    if not path:
        return value
    if isinstance(node, tuple):
        place = int(path[0])
        return (*node[:place], _put(node[place], path[1:], value), *node[place + 1 :])
    return replace(node, **{path[0]: _put(getattr(node, path[0]), path[1:], value)})


def _layers(text: str) -> tuple[int, ...]:
    """Layer widths as on an axis, "200,100,1"."""
    try:
        widths = tuple(int(width) for width in text.split(","))
    except ValueError:
        widths = ()
    if not widths or min(widths) < 1 or widths[-1] != 1:
        raise ConfigurationError(
            "layer widths that end with 1, like 200,100,1", repr(text), "correct the value"
        )
    return widths
