"""What derivatives cost: time and memory against the forward run, for executions and for whole
learning runs.

Ratios within one run on one core. Memory is what the compiled program needs beside its arguments
(XLA's own account).
"""

from common import arguments, in_turns, pin_to_one_core, report

pin_to_one_core()

import time
from functools import partial

import jax
import jax.numpy as jnp

from jaxidl.arm.setup import ArmStudy
from jaxidl.backend import compiler_options, keep_programs
from jaxidl.learning.execute import execute
from jaxidl.learning.iterate import learn
from jaxidl.models import Training
from jaxidl.paper.study import Condition, PaperStudy, draw_noise
from jaxidl.paper.vary import varied
from jaxidl.systems.arm import JOINTS

jax.config.update("jax_enable_x64", True)

GAINS = ("learner_gain", "alpha", "prior_mass", "applied_gain")
VALUES = (500.0, 0.1, 0.5, 25.0)


def point_mass(x, *, derivative=None):
    """Mean position error of one execution of the paper's PID, with networks in the loop, by four
    numbers (4,).
    """
    study = varied(PaperStudy(), dict(zip(GAINS, x, strict=True)))
    s = study.setting("pid", Condition(0, 5e-4, 5.0, 5.0))
    networks = partial(study.error_model.torque, study.error_model.init(jax.random.key(1)))
    noise = jnp.asarray(draw_noise(1, 1, study.steps)[0])
    run = execute(
        s.plant, s.model, s.law, s.task, noise, networks, checkpoint=derivative == "reverse"
    )
    return jnp.abs(run.q - s.reference).mean()


def learning(x, *, derivative=None):
    """Final position error of three executions with two trainings of five epochs between them, by
    four numbers (4,).
    """
    study = varied(PaperStudy(training=Training(epochs=5)), dict(zip(GAINS, x, strict=True)))
    how = {
        "source": "joint",
        "error_model": study.error_model,
        "training": study.training,
        "derivative": derivative,
    }
    setting = study.setting("pid", Condition(0, 5e-4, 5.0, 5.0))
    return learn(setting, jnp.asarray(draw_noise(1, 3, study.steps)), jax.random.key(1), **how)[
        0
    ].q_error[-1]


def seven_joints(x, *, derivative=None):
    """Mean position error of 0.8 s of the arm, without networks, by DOOMED's four numbers (4,),
    gains as factors.
    """
    study = ArmStudy(goals=ArmStudy().goals[:1])
    setting, law = study.setting(1e-5), study.law()
    law = law.replace(
        rate=law.rate * x[0],
        learner_gain=law.learner_gain * x[1],
        smoothing=x[2],
        gradient_smoothing=x[3],
    )
    noise = jnp.zeros((study.steps, JOINTS))
    run = execute(
        setting.plant, setting.model, law, setting.task, noise, checkpoint=derivative == "reverse"
    )
    return jnp.abs(run.q - setting.reference).mean()


def ways(run, x):
    """The programs to compare, by name."""
    yield "value", run
    yield (
        "forward mode, one number",
        lambda x: jax.jvp(partial(run, derivative="forward"), (x,), (jnp.eye(len(x))[0],)),
    )
    yield "forward mode, four numbers", jax.jacfwd(partial(run, derivative="forward"))
    if run is learning:  # reverse mode takes XLA minutes to compile
        return
    yield "reverse, checkpointed", jax.value_and_grad(partial(run, derivative="reverse"))
    yield "reverse, everything kept", jax.value_and_grad(run)


def main() -> None:
    options = arguments(__doc__.splitlines()[0], rounds=5)
    keep_programs()
    rows = []
    for what, run, x in (
        ("execution, point mass", point_mass, VALUES),
        ("learning, point mass", learning, VALUES),
        ("execution, seven joints", seven_joints, (1.0, 1.0, 0.1, 0.9)),
    ):
        programs, memory, compiling = {}, {}, {}
        for name, function in ways(run, x):
            began = time.perf_counter()
            compiled = (
                jax.jit(function, compiler_options=compiler_options()).lower(jnp.array(x)).compile()
            )
            compiling[name] = time.perf_counter() - began
            memory[name] = compiled.memory_analysis().temp_size_in_bytes / 2**20
            programs[name] = partial(compiled, jnp.array(x))
        for name, seconds in in_turns(programs, options.rounds).items():
            best = seconds.min()
            if name == "value":
                base = best
            row = {
                "what": what,
                "way": name,
                "seconds": best,
                "times the value": best / base,
                "memory [MB]": memory[name],
            }
            rows.append(row | {"compiling [s]": compiling[name]})
    report("Derivatives against the forward run", rows, options.json)


if __name__ == "__main__":
    main()
