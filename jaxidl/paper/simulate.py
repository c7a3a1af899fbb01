"""One execution, or one learning run, from the command line into a file of arrays."""

import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jaxtyping import Float

from jaxidl.errors import ConfigurationError, one_of
from jaxidl.files import write_bytes
from jaxidl.learning.execute import execute
from jaxidl.paper.grid import CONTROLLERS, GAINS, Grid
from jaxidl.paper.request import Request
from jaxidl.paper.runs import LearningRun
from jaxidl.paper.study import Condition, PaperStudy, draw_noise


def simulate(request: Request, out: Path, study: PaperStudy | None = None) -> dict[str, np.ndarray]:
    """Simulate in float64, write the arrays to ``out`` as NPZ and return them.

    Raises:
        ConfigurationError: for an unknown name, a level out of bounds, or noise of the wrong shape.
        StoreError: if ``out`` cannot be written.
    """
    study = study or PaperStudy()
    for name in ("guard", "schedule"):
        if getattr(request, name):
            study = replace(study, **{name: "on"})
    at = _checked(request)
    executions = 1 if request.source is None else request.executions or 20
    with jax.enable_x64(True):
        draws = draw_noise(request.seed, executions, study.steps)
        if request.standard_normal is not None:
            draws = _load_draws(Path(request.standard_normal), draws.shape)
        arrays = (
            _execution(study, at, draws[0])
            if request.source is None
            else _learning(study, at, draws)
        )
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    write_bytes(Path(out), buffer.getvalue())
    return arrays


def _checked(request: Request) -> dict[str, Any]:
    """The request as a point; a grid of one value an axis knows what is valid."""
    for what, value, valid in (
        ("controller", request.controller, CONTROLLERS),
        ("gain", request.gain, GAINS),
    ):
        if value not in valid:
            raise one_of(f"--{what}", value, valid)
    for name in ("executions", "guard", "schedule"):
        if request.source is None and getattr(request, name):
            raise ConfigurationError(
                f"--source with --{name}", "no --source", "name the data source to learn from"
            )
    grid = Grid(
        (request.controller,),
        (request.gain,),
        (request.noise,),
        (request.friction,),
        (request.stiction,),
        (request.epochs,),
        (request.seed,),
        ("joint" if request.source is None else request.source,),
        20 if request.executions is None else request.executions,
    )
    return {name: values[0] for name, values in grid.dims().items()}


def _load_draws(path: Path, shape: tuple[int, int, int]) -> Float[np.ndarray, "K T J"]:
    try:
        draws = np.load(path, allow_pickle=False)
    except Exception as error:  # whatever NumPy makes of a broken file
        raise ConfigurationError(
            f"{path} to be a NumPy file", str(error), "save draws with numpy.save"
        ) from None
    wanted = shape if shape[0] > 1 else shape[1:]
    if (
        not isinstance(draws, np.ndarray)
        or draws.shape not in (shape, wanted)
        or draws.dtype.kind != "f"
    ):
        got = (
            f"{draws.dtype} of shape {draws.shape}"
            if isinstance(draws, np.ndarray)
            else "an archive"
        )
        raise ConfigurationError(
            f"{path} to hold floats of shape {wanted}", got, "give one draw per step and joint"
        )
    with np.errstate(over="ignore"):  # a long double may be beyond what a double holds
        draws = draws.reshape(shape).astype(float)
    if not np.isfinite(draws).all():
        raise ConfigurationError(
            f"{path} to hold finite draws", "NaN or infinity", "correct the file"
        )
    return draws


def _execution(
    study: PaperStudy, at: dict[str, Any], draws: Float[np.ndarray, "T J"]
) -> dict[str, np.ndarray]:
    condition = Condition(GAINS.index(at["gain"]), at["noise"], at["friction"], at["stiction"])
    setting = study.setting(at["controller"], condition)
    run = jax.jit(execute)(setting.plant, setting.model, setting.law, setting.task, draws)
    return {name: np.asarray(value) for name, value in vars(run).items() if value is not None}


def _learning(
    study: PaperStudy, at: dict[str, Any], draws: Float[np.ndarray, "K T J"]
) -> dict[str, np.ndarray]:
    metrics, runs = LearningRun(study, len(draws)).trace(at, draws)
    return {
        name: np.asarray(value)
        for name, value in [*vars(runs).items(), *metrics._asdict().items()]
        if value is not None
    }
