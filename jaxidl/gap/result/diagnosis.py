"""The result of the gap workflow for a log and a model."""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from jaxidl.effects import CATALOGUE, Effect, place_of
from jaxidl.files import as_json, plain
from jaxidl.gap.evidence.gram import Key
from jaxidl.gap.evidence.localise import Place
from jaxidl.gap.fit.refine import Refinement
from jaxidl.logs.signals import Signals
from jaxidl.systems import Plant
from jaxidl.systems.mjcf import Model

SURE = 0.8  # confidence from which an effect is named
LIKELY = 0.5  # confidence from which it is more likely right than wrong
MUCH = 0.04  # share of the command, or of its spread, from which an error is spoken of


class Estimate(NamedTuple):
    """A parameter: a number, or a list of them for a table."""

    value: float | list[float]
    unit: str
    stderr: float | list[float]


def plain_number(value: np.ndarray) -> float | list[float]:
    """Return a parameter's values (n,) as an :class:`Estimate` has them."""
    return float(value[0]) if len(value) == 1 else value.tolist()


@dataclass(frozen=True)
class Finding:
    """One effect that was added to the model."""

    name: str
    joint: int | None  # None: belongs to the whole mechanism
    effect: Effect  # ready for a plant
    sentence: str
    parameters: dict[str, Estimate]
    # share of draws that find it times its probability; see :mod:`jaxidl.gap.result.calibration`
    confidence: float
    evidence: float  # decrease of the score without it
    # root mean square of its torque over that of the command, on the joint where it is largest
    share: float
    where: int  # that joint
    # root mean square held-out error there without it, all others refitted [N or Nm]
    held_out_before: float
    held_out_after: float  # the same error with it
    gain: float  # 1 − after/before
    gain_stderr: float
    # bounds of the fitted parameters
    bounds: dict[str, tuple[float, float]] = field(default_factory=dict)
    signs: dict[str, float] = field(default_factory=dict)  # what its confidence was computed from
    nearest: Key | None = None  # the best other effect in its place; None: no other comes near

    @property
    def sure(self) -> bool:
        """Return whether it is named rather than suspected."""
        return self.confidence >= SURE

    @property
    def less(self) -> bool:
        """Return whether the model has too much of it: a value that only a change can have."""
        known = CATALOGUE[self.name].parameters
        return any(np.any(np.asarray(p.value) < known[n].lower) for n, p in self.parameters.items())


class Ambiguity(NamedTuple):
    """Effects that explain a log equally well in each other's place.

    The one that was found comes first. ``experiment`` is what would tell them apart.
    """

    candidates: tuple[Key, ...]
    experiment: str


class Row(NamedTuple):
    """The gain in score that another effect would bring, and why it was not chosen."""

    name: str
    joint: int | None
    promise: float
    reason: str


class Envelope(NamedTuple):
    """Errors (J,) that conventional identification reaches: all common effects fitted at once."""

    torque_rms: list[float]  # on held-out data [N or Nm]
    torque_relative: list[float]  # share of the command's root mean square


class Side(NamedTuple):
    """The gap of one plant on held-out data; J values each."""

    torque_rms: list[float]  # [N or Nm]
    torque_relative: list[float]  # share of the command's root mean square
    rollout_rms: dict[str, list[float]]  # by horizon [m or rad]


class Gap(NamedTuple):
    """The gap before and after, on data that were not used for fitting or ranking."""

    unit: list[str]
    before: Side
    after: Side
    noise_floor: list[float]  # torque error due to encoder noise alone [N or Nm]

    def relative(self, torque_rms: list[float]) -> list[float]:
        """Return torque errors (J,) [N or Nm] over the root mean square of the command."""
        known = np.maximum(self.before.torque_rms, 1e-300)
        return (np.array(torque_rms) * self.before.torque_relative / known).tolist()


class Traces(NamedTuple):
    """The data of the figures: N rows, J joints."""

    time: np.ndarray  # (N,) [s]
    kept_aside: np.ndarray  # (N,) not used for fitting
    q: np.ndarray  # (N, J)
    qd: np.ndarray
    command: np.ndarray  # (N, J) filtered
    before: np.ndarray  # (N, J) residual [N or Nm]
    after: np.ndarray
    counted: np.ndarray  # (N, J) False where a rest begins or ends


@dataclass(frozen=True)
class Diagnosis:
    """The result of :func:`jaxidl.gap.diagnose`."""

    verdict: str  # named, nothing_missing, ambiguous or unexplained
    findings: tuple[Finding, ...]  # those that explain most of the command first
    ambiguous: tuple[Ambiguity, ...]
    where: tuple[Place, ...]  # regimes of the residual before
    remaining: tuple[Place, ...]  # regimes of the residual after
    gap: Gap
    envelope: Envelope
    unexplained: tuple[int, ...]  # joints with a large residual
    rivals: tuple[Row, ...]
    # (J) share of the remaining residual that a network removes, and its standard error
    network: tuple[tuple[float, float], ...]
    model: Model
    traces: Traces
    band: float  # [Hz]
    notes: tuple[str, ...] = ()
    options: dict[str, Any] = field(default_factory=dict)
    # effects that the log shares with the reference log, which are no findings
    common: tuple[Effect, ...] = ()
    # what puts all of it in doubt: conventions that are not the model's, or joints locked there
    doubt: str = ""
    signals: Signals | None = field(default=None, repr=False)  # the log as it was compared
    refinement: Refinement | None = field(default=None, repr=False)  # the result of :meth:`refined`

    @property
    def summary(self) -> str:
        """The result in plain language."""
        from jaxidl.gap.result.words import summarise

        return summarise(self)

    @property
    def ordered(self) -> tuple[Finding, ...]:
        """The findings in the order in which a command passes them."""
        return tuple(sorted(self.findings, key=lambda f: place_of(f.name)))

    @property
    def added(self) -> tuple[Effect, ...]:
        """All effects that the model lacks, in the order in which a command passes them."""
        return (*self.common, *(f.effect for f in self.ordered))

    @property
    def plant(self) -> Plant:
        """The model with the effects found: it simulates, controls and learns like any other."""
        return Plant(self.model.plant.body, (*self.model.plant.effects, *self.added))

    @property
    def doubtful(self) -> bool:
        """Return whether another log could decide between explanations."""
        return self.verdict == "ambiguous" or bool(self.ambiguous)

    @property
    def questioned(self) -> list[str]:
        """Names of the effects that were found, and of those that could be in their place."""
        nearest = (f.nearest for f in self.findings if f.nearest)
        doubts = (key for a in self.ambiguous for key in a.candidates)
        found = (f.name for f in self.findings)
        return list(dict.fromkeys([*found, *(name for name, _ in (*doubts, *nearest))]))

    def frame(self, f: Finding) -> str | None:
        """Return the body in whose frame positions of a finding are, if it has any."""
        units = [p.unit for p in CATALOGUE[f.name].parameters.values()]
        placed = f.joint is None and "length" in units
        return getattr(self.model.plant.body, "carrier", "") if placed else None

    def to_dict(self) -> dict[str, Any]:
        """Return the content of ``report.json``, without ``files``."""
        from jaxidl.gap.result.refined import record

        measured = (
            *("confidence", "evidence", "share", "held_out_before", "held_out_after"),
            *("gain", "gain_stderr", "signs"),
        )
        return plain(
            {
                "verdict": self.verdict,
                "summary": self.summary,
                "effects": [
                    {
                        "effect": f.name,
                        "joint": f.joint,
                        "sentence": f.sentence,
                        "joint_name": None if f.joint is None else self.model.names[f.joint],
                        "frame": self.frame(f),
                        "parameters": {name: p._asdict() for name, p in f.parameters.items()},
                        **{name: getattr(f, name) for name in measured},
                        "nearest": f.nearest and {"effect": f.nearest[0], "joint": f.nearest[1]},
                    }
                    for f in self.findings
                ],
                "ambiguous": [
                    {
                        "candidates": [{"effect": n, "joint": j} for n, j in a.candidates],
                        "experiment": a.experiment,
                    }
                    for a in self.ambiguous
                ],
                "where": [p._asdict() for p in self.where],
                "remaining": [p._asdict() for p in self.remaining],
                "gap": {
                    "unit": self.gap.unit,
                    "before": self.gap.before._asdict(),
                    "after": self.gap.after._asdict(),
                    "noise_floor": self.gap.noise_floor,
                },
                "envelope": self.envelope._asdict(),
                "unexplained_joints": list(self.unexplained),
                "rivals": [r._asdict() for r in self.rivals],
                "network": [
                    {"joint": j, "gain": g, "gain_stderr": s}
                    for j, (g, s) in enumerate(self.network)
                ],
                "joints": list(self.model.names),
                "band_hz": self.band,
                "notes": list(self.notes),
                "options": self.options,
            }
            | ({"refined": record(self)} if self.refinement is not None else {})
        )

    def refined(self, window: float | None = None) -> "Diagnosis":
        """Return the diagnosis with its parameters also fitted to trajectories.

        See :func:`jaxidl.gap.fit.refine.refine`. If the simulation then follows held-out motion
        more closely, the findings, the plant and the gap "after" are those of the refined
        parameters; if not, they stay as they are. ``refinement`` has both sides' numbers in either
        case.

        Args:
            window: length of the rollouts [s]. Default: 0.4 s, or ten samples of a slower log.

        Raises:
            ConfigurationError: for a window of fewer than ten samples, or a diagnosis without
                signals.
        """
        from jaxidl.gap.result.refined import refined

        return refined(self, window)

    def to_json(self, **extra: Any) -> str:
        """Return :meth:`to_dict` as strict JSON."""
        return as_json(self.to_dict() | extra)
