"""One control step of the point mass: how much the error model in the loop costs, for one run and
several, on one core.
"""

from common import arguments, in_turns, machine, pin_to_one_core, report

pin_to_one_core()

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from jaxidl.backend import compiler_options
from jaxidl.learning.execute import execute
from jaxidl.paper.study import Condition, PaperStudy

jax.config.update("jax_enable_x64", True)
STUDY = PaperStudy()


def executions(width: int, with_model: bool):
    """A compiled call of ``width`` executions side by side, low-gain PID in the study's middle
    noise.
    """
    condition = Condition(jnp.asarray(0), jnp.asarray(5e-4), jnp.asarray(5.0), jnp.asarray(5.0))
    setting = STUDY.setting("pid", condition)
    noise = jnp.asarray(np.random.default_rng(0).normal(size=(width, STUDY.steps, 2)))
    params = jax.vmap(STUDY.error_model.init)(jax.random.split(jax.random.key(0), width))

    def one(draws, params):
        model = partial(STUDY.error_model.torque, params) if with_model else None
        return execute(setting.plant, setting.model, setting.law, setting.task, draws, model).q[-1]

    program = jax.jit(jax.vmap(one), compiler_options=compiler_options())
    return lambda: program(noise, params)


def main() -> None:
    options = arguments(__doc__ or "", rounds=15)
    cases = [(width, with_model) for width in (1, 4, 8, 64) for with_model in (False, True)]
    seconds = in_turns({str(case): executions(*case) for case in cases}, options.rounds)
    per_step = {
        case: 1e6 * float(np.median(seconds[str(case)])) / STUDY.steps / case[0] for case in cases
    }
    table = [
        {
            "runs side by side": width,
            "us per step and run": per_step[width, False],
            "with two networks": per_step[width, True],
            "ratio": per_step[width, True] / per_step[width, False],
            "against 1 run": per_step[1, True] / per_step[width, True],
        }
        for width in (1, 4, 8, 64)
    ]
    report(
        f"One control step, medians of {options.rounds} rounds",
        table,
        options.json,
        machine=machine(),
    )


if __name__ == "__main__":
    main()
