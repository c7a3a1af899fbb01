"""Do designed motions keep their limits when executed? ``python experiments/execution.py WORK``.

Of one root of the benchmark, every clear case that hides an effect of the drive becomes a doubt
between that effect, a given other one and none. The motion that is designed for it is executed in
the benchmark's engine, without and with the rehearsal. Printed is the largest share of a limit that
each reaches: more than 1 leaves it.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import jax
import numpy as np
from excite import LIMITS, RATE, wider

from jaxidl.backend import choose_devices
from jaxidl.excite.contest import contested
from jaxidl.excite.design import Designed, Effort, design
from jaxidl.excite.doubt import doubt
from jaxidl.excite.limits import Limits, limits_of
from jaxidl.excite.rehearsal import rehearsed
from jaxidl.gap.benchmark.believed import Diverged
from jaxidl.gap.benchmark.cases import Case, all_cases
from jaxidl.systems.bounds import bounds
from jaxidl.systems.mjcf import read_model

OTHER = {
    "torque_saturation": "torque_curve",
    "torque_curve": "torque_saturation",
    "actuator_lag": "actuator_delay",
    "actuator_delay": "sensor_delay",
    "sensor_delay": "actuator_lag",
    "joint_elasticity": "actuator_lag",
    "backlash": "joint_elasticity",
}
ASKED = 15.0  # difference in score that names an effect


def reached(motion: Designed, case: Case, limits: Limits) -> float:
    """Return the largest share of a limit of position, speed or acceleration in execution.

    It is infinite if the controller lost the mechanism. Commands are cut at the torque limit.
    """
    try:
        run = case.measure(motion=(motion.q, motion.qd, motion.qdd), most=limits.torque)
    except Diverged:
        return float("inf")
    speed = np.gradient(run.clean, 1.0 / RATE, axis=0)
    acceleration = np.gradient(speed, 1.0 / RATE, axis=0)
    middle, half = 0.5 * (limits.lower + limits.upper), 0.5 * (limits.upper - limits.lower)
    shares = (
        (run.clean - middle) / half,
        speed / limits.speed,
        acceleration / limits.acceleration,
    )
    return max(float(np.abs(x).max()) for x in shares)


def compared(case: Case, folder: Path) -> tuple[float, float]:
    """Return the largest share of a limit without and with the rehearsal."""
    case.write(folder)
    model, hidden = read_model(folder / "model.xml"), case.hidden[0]
    entry = lambda name: {"effect": name, "joint": hidden.joint, "confidence": 0.5}
    report: dict[str, Any] = {
        "verdict": "ambiguous",
        "effects": [entry(hidden.effect) | {"nearest": entry(OTHER[hidden.effect])}],
        "ambiguous": [],
        "options": {"held_out": 0.1, "log": [str(folder / case.log)]},
    }
    (folder / "report.json").write_text(json.dumps(report))
    found = doubt(folder, model)
    each = tuple(e._replace(asked=ASKED) for e in found.explanations)
    found = found._replace(explanations=each)
    limits = limits_of(model.names, bounds(model), reached=wider(found.reached(), LIMITS["wider"]))
    made = contested(found, model, limits, top=1.5)
    motion = design(made.plan, None, Effort(2, 40, case.seed % 1000), RATE)
    again = rehearsed(motion, made, found.explanations, limits, 1.0 / RATE)
    return reached(motion, case, limits), reached(again, case, limits)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("work", type=Path)
    parser.add_argument("--root", type=int, default=4143)
    parser.add_argument("--most", type=int, default=24, help="cases")
    given = parser.parse_args()
    choose_devices(None)
    clear = (c for c in all_cases(given.root) if c.family == "single" and c.severity == "clear")
    cases = [c for c in clear if c.hidden[0].effect in OTHER][: given.most]
    left = np.zeros(2, int)
    with jax.enable_x64(True):
        for case in cases:
            shares = compared(case, given.work / case.id)
            left += np.array(shares) > 1.0
            print(case.mechanism, case.hidden[0].effect, *(f"{s:.3f}" for s in shares), flush=True)
    print(f"of {len(cases)} motions {left[0]} leave a limit without the rehearsal, {left[1]} with")


if __name__ == "__main__":
    main()
