"""The feedback law and the estimator of motion in C: code within a step, and what it remembers."""

from typing import NamedTuple

import jax
import numpy as np

from jaxidl.control import Doomed, Estimator, FeedbackLaw, Filtered, FiniteDifference, Pid
from jaxidl.control.estimate import share
from jaxidl.errors import ConfigurationError
from jaxidl.robot.c.text import number, table


class Part(NamedTuple):
    """A part of the controller with a memory."""

    tables: str  # constants
    memory: tuple[tuple[str, str], ...]  # arrays (J,) of the state: name and meaning
    code: tuple[str, ...]  # bodies of its functions
    lag: float = 0.0  # of the estimated velocity [s]


_DIFFERENCE = """    for (j = 0; j < J; j++) {
        const real qd = (q[j] - s->q[j]) / DT;
        s->qdd[j] = (qd - s->qd[j]) / DT;
        s->qdd_compared[j] = s->qdd_desired[j];
        s->qd[j] = qd;
    }
"""

_FILTER = """    for (j = 0; j < J; j++) {
        const real difference = (q[j] - s->q[j]) / DT;
        s->qd[j] += velocity_share * (difference - s->qd[j]);
        s->qdd[j] +=
            acceleration_share * ((difference - s->difference[j]) / DT - s->qdd[j]);
        s->qdd_compared[j] += acceleration_share * (s->qdd_late[j] - s->qdd_compared[j]);
        s->difference[j] = difference;
        s->qdd_late[j] = s->qdd_desired[j];
    }
"""


def estimator(given: Estimator, dt: float) -> Part:
    """Return the estimator of velocity and acceleration.

    Its code takes the reading ``q`` into the state ``s``.

    Raises:
        ConfigurationError: for an estimator that has no C.
    """
    if type(given) is FiniteDifference:
        return Part("", (), (_DIFFERENCE,), given.lag(dt))
    if type(given) is not Filtered:
        raise _unknown("an estimator", "Filtered or FiniteDifference", given)
    with jax.enable_x64(True):
        shares = [float(share(band, dt)) for band in (given.velocity_band, given.acceleration_band)]
    names = ("velocity", "acceleration")
    bands = [float(given.velocity_band), float(given.acceleration_band)]
    tables = "".join(
        f"static const real {name}_share = {number(x)}; /* of a new sample: {band:g} Hz */\n"
        for name, x, band in zip(names, shares, bands, strict=True)
    )
    memory = (
        ("difference", "difference of the last two readings over the step"),
        ("qdd_late", "desired acceleration of the step before"),
    )
    return Part(tables, memory, (_FILTER,), given.lag(dt))


_PID_ACT = """    for (j = 0; j < J; j++) {
        const real error = q_desired[j] - s->q[j], rate = qd_desired[j] - s->qd[j];
        const real sample = learner_kp[j] * error + learner_kd[j] * rate
                          + learner_ki[j] * error + s->integral[j];
        s->integral[j] += ki[j] * error;
        s->tau_feedback[j] = kp[j] * error + kd[j] * rate + s->integral[j];
        s->average[j] = s->steps ? SMOOTHING * sample + (1 - SMOOTHING) * s->average[j] : sample;
        s->tau_learning[j] = s->average[j];
    }
"""

_DOOMED_ACT = """    (void)q_desired;
    (void)qd_desired;
    for (j = 0; j < J; j++) {
        s->tau_feedback[j] = s->offset[j];
        s->tau_learning[j] = s->average[j];
    }
"""

_DOOMED_OBSERVE = """    for (j = 0; j < J; j++) {
        const real error = s->qdd[j] - s->qdd_compared[j];
        const real sample = s->offset[j] - learner_gain[j] * error, step = -rate[j] * error;
        const int first = s->steps == 1;
        s->average[j] = first ? sample : SMOOTHING * sample + (1 - SMOOTHING) * s->average[j];
        s->gradient[j] = first ? step
            : GRADIENT_SMOOTHING * step + (1 - GRADIENT_SMOOTHING) * s->gradient[j];
        s->offset[j] = clip(s->offset[j] + s->gradient[j], -offset_limit[j], offset_limit[j]);
    }
"""


_NO_ACT = """    (void)q_desired;
    (void)qd_desired;
    for (j = 0; j < J; j++) s->tau_feedback[j] = s->tau_learning[j] = 0; /* no feedback law */
"""


def law(given: FeedbackLaw | None, joints: int) -> Part:
    """Return the feedback law: code of ``act``, and of ``observe``, which may be empty.

    Raises:
        ConfigurationError: for a law that has no C, or with gains that are not finite.
    """
    if given is None:
        return Part("", (), (_NO_ACT, ""))
    if type(given) is Pid:
        gains = {name: getattr(given.applied, name) for name in ("kp", "kd", "ki")}
        gains |= {f"learner_{name}": getattr(given.learner, name) for name in ("kp", "kd", "ki")}
        memory = (
            ("integral", "sum of ki times the error"),
            ("average", "filtered feedback for the learner"),
        )
        return Part(
            _gains(gains, joints) + _share("SMOOTHING", given.smoothing),
            memory,
            (_PID_ACT, ""),
        )
    if type(given) is not Doomed:
        raise _unknown("a feedback law", "Pid or Doomed", given)
    gains = {"rate": given.rate, "learner_gain": given.learner_gain}
    tables = (
        _gains(gains, joints)
        + table("offset_limit", each(given.limit, joints))
        + _share("SMOOTHING", given.smoothing)
        + _share("GRADIENT_SMOOTHING", given.gradient_smoothing)
    )
    memory = (
        ("offset", "the applied torque"),
        ("gradient", "filtered gradient step"),
        ("average", "filtered feedback for the learner"),
    )
    return Part(tables, memory, (_DOOMED_ACT, _DOOMED_OBSERVE))


def each(value: object, joints: int) -> np.ndarray:
    """Return a number, or one for each joint, as an array (J,)."""
    return np.broadcast_to(np.asarray(value, float), (joints,))


def _gains(gains: dict[str, object], joints: int) -> str:
    arrays = {name: each(value, joints) for name, value in gains.items()}
    for name, array in arrays.items():
        if not np.isfinite(array).all():
            raise ConfigurationError(f"a finite gain {name}", f"{array.tolist()}", "correct it")
    return "".join(table(name, array) for name, array in arrays.items())


def _share(name: str, value: object) -> str:
    return f"#define {name} R({number(float(np.asarray(value)))}) /* weight of a new sample */\n"


def _unknown(what: str, known: str, got: object) -> ConfigurationError:
    return ConfigurationError(
        f"{what} that can be written as C ({known})", type(got).__name__, "use one of these"
    )
