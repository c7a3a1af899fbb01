"""Design a motion for a model, and write it to a file with its predicted standard errors."""

import io
import shlex
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxidl import __version__
from jaxidl.errors import ConfigurationError, one_of
from jaxidl.excite.contest import contested, earlier
from jaxidl.excite.design import Designed, Effort, design
from jaxidl.excite.doubt import Doubt, doubt
from jaxidl.excite.limits import Limits, limits_of
from jaxidl.excite.motion import KINDS
from jaxidl.excite.prepare import Prepared, assumed_noise, prepared
from jaxidl.excite.rehearsal import rehearsed
from jaxidl.excite.table import errors, evidence, separated, text
from jaxidl.gap.inputs import words
from jaxidl.logs.joint_names import joints_called
from jaxidl.systems.bounds import Shapes, bounds
from jaxidl.systems.mjcf import Model, names_of, read_model

CRITERIA = ("d", "a")


@dataclass(frozen=True)
class Request:
    """What is asked for."""

    criterion: str = "d"
    kind: str = "fourier"
    seconds: float = 20.0
    top: float = 1.5  # [Hz]
    rate: float = 100.0  # of the file [Hz]
    starts: int = 4
    steps: int = 150
    seed: int = 0

    def __post_init__(self) -> None:
        if self.criterion not in CRITERIA:
            raise one_of("a criterion", self.criterion, CRITERIA)
        if self.kind not in KINDS:
            raise one_of("a kind of motion", self.kind, KINDS)
        least = {"seconds": 1.0, "top": 0.05, "rate": 10.0, "starts": 1, "steps": 1, "seed": 0}
        for name, low in least.items():
            value = getattr(self, name)
            if not low <= value <= 1e6:
                raise ConfigurationError(
                    f"--{name} of at least {low:g}", f"{value:g}", "correct it"
                )
        if self.rate < 10.0 * self.top:
            raise ConfigurationError(
                f"--rate of at least ten times the highest frequency ({10.0 * self.top:g} Hz)",
                f"{self.rate:g}",
                "give a higher --rate or a lower --top",
            )


class Result(NamedTuple):
    """A motion, and what it is predicted to tell."""

    made: Prepared
    limits: Limits
    found: Designed
    rows: list[dict[str, Any]]  # standard errors
    apart: list[dict[str, Any]]  # separations of explanations
    doubt: Doubt | None
    request: Request
    model: Model

    @property
    def old(self) -> str:
        """What "before" means in the tables."""
        return "random motion" if self.doubt is None else "the log alone"

    @property
    def table(self) -> str:
        """The tables in Markdown."""
        return text(self.model.names, self.rows, self.apart, self.old)

    def notes(self) -> list[str]:
        """Return what a reader should know, each in one line."""
        out = []
        if self.found.smaller < 1.0:
            kept = "" if self.doubt is None else ", and all limits in a rehearsal"
            out.append(
                f"the motion was made smaller by {1.0 - self.found.smaller:.0%} to keep the limits"
                f" of torque or clearance{kept}"
            )
        if not self.found.descended:
            out.append(
                "no better motion was found than the best of the random ones, which it is; more"
                " --starts, another --start or wider limits may help"
            )
        for pair in self.apart:
            if pair["after"] < pair["asked"]:
                out.append(
                    f"{pair['true']} and {pair['fitted']}: even this motion hardly tells them apart"
                    f" (score {pair['after']:.3g} of {pair['asked']:.3g} asked); wider limits or a"
                    " known load may"
                )
        if self.doubt is not None:
            logs = shlex.join(self.doubt.files)
            model = shlex.quote(str(self.model.path))
            rest = words(self.doubt.log.reading)
            rest = f"--model {model}{' ' + rest if rest else ''}"
            out.append(f"then, with both logs: jaxidl gap {logs} NEW.csv {rest}")
        return out

    def csv(self) -> str:
        """Return the motion as CSV: time, q0…, qd0…, qdd0…, tau0… in SI units."""
        f, joints = self.found, range(len(self.model.names))
        parts = {"q": f.q, "qd": f.qd, "qdd": f.qdd, "tau": f.tau}
        head = ",".join(["time", *(f"{key}{j}" for key in parts for j in joints)])
        out = io.StringIO()
        np.savetxt(
            out,
            np.column_stack([f.time, *parts.values()]),
            fmt="%.9g",
            delimiter=",",
            header=head,
            comments="",
        )
        return out.getvalue()

    def record(self) -> dict[str, Any]:
        """Return all that led to the motion and what it tells, for JSON."""
        f, d = self.found, self.doubt
        return {
            "version": __version__,
            "model": str(self.model.path),
            "joints": self.model.names,
            "request": asdict(self.request) | {"criterion": self.made.plan.criterion},
            "limits": {k: v for k, v in asdict(self.limits).items() if k != "names"},
            "reached": {
                "lower": f.q.min(0),
                "upper": f.q.max(0),
                "speed": np.abs(f.qd).max(0),
                "acceleration": np.abs(f.qdd).max(0),
                "torque": np.abs(f.tau).max(0),
            },
            "noise": self.made.plan.noise._asdict(),
            "criterion": {"random": f.random, "designed": f.value, "smaller": f.smaller},
            "before": self.old,
            "standard_errors": self.rows,
            "separations": self.apart,
            "logs": () if d is None else d.files,
        }


def _part(model: Path, joints: Sequence[str]) -> Model:
    return read_model(model, joints_called(joints, names_of(model)) if joints else None)


def excite(
    model: Model | str | Path,
    request: Request = Request(),
    *,
    joints: Sequence[str] = (),
    limits: Path | None = None,
    start: Sequence[float] = (),
    diagnosis: Path | None = None,
    watch: Callable[[str, float], None] = lambda what, share: None,
) -> Result:
    """Return a motion for an experiment, and what it is predicted to tell.

    Args:
        model: of the mechanism, or its MJCF or URDF file.
        request: what kind of motion.
        joints: names of the joints that move, of a model's file; the others are locked. Default:
            all, or those of the diagnosis.
        limits: YAML file as :func:`jaxidl.excite.limits.limits_of` takes it.
        start: posture (J,) at both ends [m or rad].
        diagnosis: folder of a diagnosis to settle; then the criterion is T-optimal.
        watch: called with the stage and its share done; a KeyboardInterrupt from it ends the
            search with the best motion so far.

    Raises:
        ConfigurationError: if limits, start or diagnosis cannot be used.
        ModelError: if the model cannot be read.
        LogError: if the diagnosis' log cannot be read.
    """
    if joints and diagnosis is not None:
        raise ConfigurationError(
            "joints, or a diagnosis, which has its own", "both", "leave out --joints"
        )
    with jax.enable_x64(True):
        known = model if isinstance(model, Model) else _part(Path(model), joints)
        asked = {k: getattr(request, k) for k in ("seconds", "kind", "top")}
        watch("reading", 0.0)
        open_ = None if diagnosis is None else doubt(diagnosis, known)
        known = known if open_ is None else open_.model
        inside = limits_of(
            known.names,
            bounds(known),
            limits,
            None if open_ is None else open_.reached(),
            tuple(start),
        )
        encoder = (
            assumed_noise(np.ones((1, len(known.names)))).encoder
            if open_ is None
            else open_.signals.sigma
        )
        inside.checked(encoder)
        if open_ is not None and len(open_.explanations) > 1:
            made = contested(open_, known, inside, **asked)
        else:
            noise = None if open_ is None else open_.noise
            made = prepared(known, inside, noise, criterion=request.criterion, **asked)
            if open_ is not None:
                plan = replace(made.plan, earlier=earlier(made.plan, open_.signals))
                made = made._replace(plan=plan)
        shapes = Shapes(known, inside.clearance)
        found = design(
            made.plan,
            shapes if shapes.any else None,
            Effort(request.starts, request.steps, request.seed),
            request.rate,
            lambda share: watch("designing", share),
        )
        if open_ is not None:
            watch("rehearsing", 0.0)
            found = rehearsed(found, made, open_.explanations, inside, float(open_.signals.dt))
        before, after = evidence(made, found)
        titles = () if open_ is None else open_.titles
        rows, apart = errors(made, before, after), separated(made, titles, before, after)
    return Result(made, inside, found, rows, apart, open_, request, known)
