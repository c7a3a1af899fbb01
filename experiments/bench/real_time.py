"""The arm's feedforward at 1 kHz on one core, and MuJoCo's inverse dynamics in C as the yardstick:
see ``jaxidl.arm.real_time``.

Weights are random, as their values cost no time.
"""

from common import arguments, machine, pin_to_one_core, report

pin_to_one_core()

import jax

from jaxidl.arm.real_time import rows
from jaxidl.arm.setup import ArmStudy
from jaxidl.learning.deploy import export_feedforward
from jaxidl.systems.arm import arm


def main() -> None:
    options = arguments(__doc__ or "", rounds=20_000)
    study = ArmStudy()
    with jax.enable_x64(True):
        task, params = study.task(), study.error_model.init(jax.random.key(0))
        content = export_feedforward(task, arm().plant.body, study.error_model, params)
    report(
        "One call each millisecond", rows(content, options.rounds), options.json, machine=machine()
    )


if __name__ == "__main__":
    main()
