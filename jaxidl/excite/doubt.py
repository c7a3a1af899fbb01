"""An ambiguous diagnosis: the explanations between which its log does not decide.

Each is a list of effects with values, fitted to the log that the diagnosis names.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxidl.effects import CATALOGUE, Effect
from jaxidl.errors import ConfigurationError
from jaxidl.excite.parameters import (
    Parameter,
    common,
)
from jaxidl.excite.plan import Noise
from jaxidl.files import why
from jaxidl.gap.evidence.gram import Item
from jaxidl.gap.evidence.rows import NOISE_MARGIN, rms, rows_of
from jaxidl.gap.evidence.shape import MOST_SCALED, Shape, effect_at, movable, present, vector
from jaxidl.gap.fit.library import Library, library, noise_of, residual
from jaxidl.gap.fit.score import Score, Solution
from jaxidl.gap.fit.shapes import fitted
from jaxidl.gap.inputs import read_again
from jaxidl.gap.result.calibration import margin_of
from jaxidl.gap.result.diagnosis import SURE, Key
from jaxidl.gap.result.words import readable
from jaxidl.logs.log import Log
from jaxidl.logs.signals import Signals, prepare
from jaxidl.systems.free import unit_of
from jaxidl.systems.mjcf import Model

MOST = 4  # explanations: more take time, and the least likely come last
STEP = 1e-3  # relative step of a parameter for differences
WIDE = 3.0  # standard deviation of a parameter beforehand, over its value


class Explanation(NamedTuple):
    """Effects with values; P parameters that a fit may change."""

    keys: tuple[Key, ...]
    effects: tuple[Effect, ...]  # at their values
    moved: tuple[tuple[int, Effect, float], ...]  # (P) which effect, changed, by which step
    labels: tuple[Parameter, ...]  # (P)
    wide: tuple[float, ...]  # (P) standard deviation beforehand
    asked: float = 0.0  # difference in score to any other from which its effects are named


class Doubt(NamedTuple):
    """A diagnosis in doubt, and its log."""

    explanations: tuple[Explanation, ...]
    signals: Signals
    noise: Noise
    left: np.ndarray  # (J,) root mean square residual of the first explanation [N or Nm]
    floor: np.ndarray  # (J,) below which errors are equal for the encoder's noise [N or Nm]
    rate: np.ndarray  # (J,) samples per second of a log that count in the gap finder's score
    log: Log
    model: Model  # of the joints that were looked at
    files: tuple[str, ...]
    titles: tuple[str, ...]

    def reached(self) -> dict[str, np.ndarray]:
        """Return what the log reached, as limits of a motion that goes no further."""
        s = self.signals
        top = lambda x: np.quantile(np.abs(x), 0.999, axis=0)
        return {
            "lower": s.q.min(0),
            "upper": s.q.max(0),
            "speed": top(s.qd),
            "acceleration": top(s.qdd),
            "torque": np.abs(s.tau).max(0),
            "start": s.q.mean(0),
        }


def read_report(folder: Path) -> dict[str, Any]:
    """Return the content of a diagnosis' report.json.

    Raises:
        ConfigurationError: if there is none.
    """
    path = folder / "report.json"
    try:
        report = json.loads(path.read_text(encoding="utf-8"))
        if {"verdict", "effects", "ambiguous", "options"} <= report.keys():
            return report
        got = "another file of that name"
    except OSError as error:
        got = why(error)
    except (ValueError, AttributeError):
        got = "something else than its report.json"
    raise ConfigurationError(
        f"the folder of a diagnosis at {folder}",
        got,
        "give --for the --out of jaxidl gap",
    )


def candidates(report: dict[str, Any]) -> list[tuple[Key, ...]]:
    """Return the explanations as sets of effects, the one that was reported first."""
    key = lambda entry: (str(entry["effect"]), entry["joint"])
    found = tuple(key(e) for e in report["effects"])
    sets = [found]
    for entry in report["ambiguous"]:
        group = [key(c) for c in entry["candidates"]]
        instead = [k for k in group if k not in found]
        if instead:
            # all that was found and is in question goes, each of the others comes in its place
            rest = tuple(k for k in found if k not in group)
            sets += [(*rest, k) for k in instead]
        else:  # the log names several, where one of them may do
            sets += [tuple(k for k in found if k not in group or k == one) for one in group]
    if not report["ambiguous"]:
        unsure = [e for e in report["effects"] if e["confidence"] < SURE]
        for effect in unsure:
            rest = tuple(k for k in found if k != key(effect))
            sets.append(rest)
            if (near := effect.get("nearest")) and key(near) not in found:
                sets.append((*rest, key(near)))
    return list(dict.fromkeys(sets))[:MOST]


def asked(report: dict[str, Any], keys: Sequence[Key]) -> float:
    """Return by how much an explanation's score has to exceed others' for its effects to be named.

    It is known of the effects that were found, and only a motion that makes them explain a larger
    share could help where no difference would be enough.
    """
    need = [
        margin_of(SURE, e["signs"])
        for e in report["effects"]
        if (e["effect"], e["joint"]) in keys and e["confidence"] < SURE and e.get("signs")
    ]
    return max((n for n in need if np.isfinite(n)), default=0.0)


def doubt(folder: Path, model: Model, logs: Sequence[Path] = ()) -> Doubt:
    """Return what the diagnosis in ``folder`` leaves open, with all explanations fitted to its log.

    Args:
        folder: of the diagnosis.
        model: the model that it was made with.
        logs: its logs, if they are no longer where its report says.

    Raises:
        ConfigurationError: if there is no diagnosis.
        LogError: if its logs cannot be read.
    """
    report = read_report(folder)
    sets = candidates(report)
    files = tuple(logs) or tuple(Path(f) for f in report["options"]["log"])
    reading = report["options"].get("reading", {})
    log, part = read_again(files, model.path, reading)
    model = part if reading.get("joints") else model
    with jax.enable_x64(True):
        signals = prepare(log, model.plant.body, model.plant.effects)
        rows = rows_of(signals.thinned(), model.plant.effects, report["options"]["held_out"])
        wanted = [name for keys in sets for name, _ in keys]
        unknown = [name for name in wanted if name not in CATALOGUE]
        if unknown:
            raise ConfigurationError(
                "a diagnosis with effects of the catalogue",
                unknown[0],
                "load the module that registers it (--plugin FILE.py)",
            )
        names = list(dict.fromkeys([*common(), *wanted]))
        made = library(rows, names, present(model.plant.effects))
        solved = [_solved(made, keys) for keys in sets]
    rest = residual(made.rows, solved[0])
    noise, effective = noise_of(made.rows, rest, made.envelope.members)
    seconds = max(float(made.rows.training.mean()) * len(signals.q) * signals.dt, 1e-9)
    measured = Noise(noise, np.maximum(effective / seconds, 1e-3), signals.sigma)
    return Doubt(
        tuple(
            _explanation(keys, s, model)._replace(asked=asked(report, keys))
            for keys, s in zip(sets, solved, strict=True)
        ),
        signals,
        measured,
        rms(rest, made.rows.used & made.rows.training[:, None]),
        NOISE_MARGIN * signals.noise_floor,
        made.score.effective / seconds * (1.0 - report["options"]["held_out"]),
        log,
        model,
        tuple(map(str, files)),
        tuple(titles(sets, model.names)),
    )


def titles(sets: Sequence[tuple[Key, ...]], names: Sequence[str]) -> list[str]:
    """Return names of explanations in words: what is not in all of them."""
    shared = set(sets[0]).intersection(*map(set, sets))
    say = lambda k: readable(k[0]) + (f" on {names[k[1]]}" if k[1] is not None else "")
    return [" and ".join(say(k) for k in keys if k not in shared) or "no more" for keys in sets]


def _solved(made: Library, keys: tuple[Key, ...]) -> Solution:
    """Return the best fit of some effects, shapes included."""
    score = made.score
    members: list[Item] = [i for i in score.items if i.always]
    for key in keys:
        offers = [i for i in score.items if i.key == key and not i.always]
        if offers:
            members.append(max(offers, key=lambda i: score.solve([*members, i]).value))
    for m in [m for m in members if m.shape is not None and movable(m.shape)]:
        now = score.solve(members)
        fresh = fitted(m, now, made.rows, made.predicted, score)
        members = [fresh if o is m else o for o in members]
        score = Score(made.rows, members, score.noise, score.effective, score.anchor, score)
    return score.solve(members)


def _explanation(keys: tuple[Key, ...], found: Solution, model: Model) -> Explanation:
    effects: list[Effect] = []
    moved: list[tuple[int, Effect, float]] = []
    labels: list[Parameter] = []
    wide: list[float] = []
    for m in found.members:
        if m.always or m.shape is None:
            continue
        x = found.x[found.of(m)]
        theta = vector(m.shape, x) if movable(m.shape) else np.asarray(x, float)
        at = lambda v, shape=m.shape: effect_at(shape, v) if movable(shape) else shape.at(v)
        for n, value in enumerate(theta):
            step = STEP * (abs(value) or 1.0)
            changed = theta.copy()
            changed[n] += step
            moved.append((len(effects), at(changed), step))
            name, unit = _label(m.shape, n, model)
            labels.append(Parameter(m.key[0], m.key[1], name, unit))
            wide.append(WIDE * (abs(float(value)) or 1.0))
        if not m.shape.free and (none := m.shape.scaled(0.0)):
            # the gap finder also fits which share of it is there: all of it less none of it
            moved.append((len(effects), m.shape.effect(**none), -1.0))
            labels.append(Parameter(m.key[0], m.key[1], "share", "1"))
            wide.append(MOST_SCALED - 1.0)
        effects.append(at(theta))
    return Explanation(keys, tuple(effects), tuple(moved), tuple(labels), tuple(wide))


def _label(shape: Shape, n: int, model: Model) -> tuple[str, str]:
    """Return name and unit of the n-th number of a shape's parameters."""
    kind = model.kinds[shape.joint if shape.joint is not None else -1]

    def each(names: Sequence[str]) -> list[tuple[str, str]]:
        found = []
        for name in names:
            size = np.size(shape.values[name])
            unit = unit_of(shape.cls.parameters[name].unit, kind)
            found += [(name if size == 1 else f"{name}[{k}]", unit) for k in range(size)]
        return found

    free = each(shape.free)
    if shape.basis is not None:  # a combination is named after its largest part
        free = [free[int(np.abs(column).argmax())] for column in shape.basis.T]
    whole = [*free, *each(movable(shape))]
    return whole[n] if n < len(whole) else ("share", "1")
