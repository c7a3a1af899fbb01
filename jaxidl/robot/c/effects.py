"""The effects of a corrected model in C: what they take of a torque is commanded in addition."""

from collections.abc import Sequence

import numpy as np

from jaxidl.effects import Effect
from jaxidl.effects.load import dissipates
from jaxidl.errors import ConfigurationError
from jaxidl.robot.c.expressions import Writer, symbols, trace
from jaxidl.robot.c.text import commented, table
from jaxidl.systems.free import inner

_HIDDEN = (
    ("actuate", "acts on the command over time"),
    ("start", "has a hidden state"),
    ("sense", "acts on the encoders"),
)

_PROGRAM = """/* adds to the torque of the rigid body what friction and other effects take of it */
static void effects(const real q[J], const real qd[J], const real qdd[J], real tau[J])
{{
    real given[J] = {{0}}, rubbed[J] = {{0}};
{dry_arrays}    int j;
    (void)q;
    (void)qd;
    (void)qdd;

{torque}{load}    for (j = 0; j < J; j++) tau[j] -= given[j] + rubbed[j];
{dry}}}
"""

_DRY_ARRAYS = "    real grip[J] = {0}, direction[J];\n"

_LOAD_ARRAY = "    real load[J];\n"

_LOAD = """    /* what passes the gears */
    for (j = 0; j < J; j++) load[j] = tau[j] - given[j] - rotor[j] * qdd[j];
"""

_DRY = """    for (j = 0; j < J; j++) direction[j] = qd[j] != 0 ? qd[j] : qdd[j];

{grip}    for (j = 0; j < J; j++) tau[j] += larger(grip[j], 0) * sign(direction[j]);
"""


def effects(given: Sequence[Effect], rotors: np.ndarray) -> str:
    """Return C of the function ``effects``; empty where none of them gives a torque.

    It does what :meth:`jaxidl.systems.Plant.inverse_dynamics` does. Effects that only alter the
    rigid body are not its business. What accelerates ``rotors`` (J,) [kg or kg m^2] passes no gear.

    Raises:
        ConfigurationError: for an effect that is not a function of the state at one instant.
    """
    joints, names = len(rotors), ("q", "qd", "tau", "load", "direction")
    q, qd, tau, load, direction = (symbols(name, joints) for name in names)
    writer, torques, grips = Writer("effect"), [], []
    for number, effect in enumerate(given):
        own = inner(effect)
        _refuse_hidden(own, effect, joints)
        if type(own).torque is not Effect.torque:
            traced = trace(effect.torque, q, qd, tau, what=own.name)
            to = "rubbed" if dissipates(effect) else "given"
            torques.append(_lines(writer, effect, traced, to, number))
        if effect.grips():
            traced = trace(effect.dry, q, qd, load, direction, what=own.name)
            grips.append(_lines(writer, effect, traced, "grip", number))
    if not torques and not grips:
        return ""
    dry = _DRY.format(grip="".join(grips)) if grips else ""
    loaded = "load[" in dry
    program = _PROGRAM.format(
        torque="".join(torques),
        load=_LOAD if loaded else "",
        dry=dry,
        dry_arrays=(_DRY_ARRAYS if grips else "") + (_LOAD_ARRAY if loaded else ""),
    )
    tables = [*writer.tables, *([table("rotor", rotors, "[kg or kg m^2]")] if loaded else [])]
    return f"{''.join(tables)}\n{program}".lstrip("\n")


def _refuse_hidden(effect: Effect, whole: Effect, joints: int) -> None:
    kind, state = type(effect), (symbols(name, joints) for name in ("q", "qd", "tau"))
    own = lambda method: getattr(kind, method) is not getattr(Effect, method)
    found = [does for method, does in _HIDDEN if own(method)]
    if own("holds") and trace(whole.holds, *state, what=effect.name).any():
        found.append("keeps joints from accelerating")
    if found:
        raise ConfigurationError(
            "a corrected model of effects that follow from position, velocity and acceleration",
            f"{effect.name}, which {found[0]}",
            "take it out of the corrected model",
        )


def _lines(writer: Writer, effect: Effect, traced: np.ndarray, to: str, number: int) -> str:
    """Return a block of statements that adds the traced values (J,) to an array of C."""
    values = traced.tolist()
    writer.begin(values)
    sums = [
        f"{to}[{j}] += {writer.expression(value)};"
        for j, value in enumerate(values)
        if not (isinstance(value, float) and value == 0.0)
    ]
    joint = getattr(effect, "joint", None)
    where = f", joint {joint + 1}" if isinstance(joint, int) and inner(effect) is not effect else ""
    said = f"{inner(effect).name}{where}: {inner(effect).sentence}"
    inside = "".join(f"        {line}\n" for line in (*writer.lines, *sums))
    return f"    {{ /* {number + 1}. {commented(said)} */\n{inside}    }}\n" if sums else ""
