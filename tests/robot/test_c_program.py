"""The generated program: no warnings, no undefined behaviour, safe with wrong input, readable."""

import itertools
import re
import subprocess
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxidl.effects as fx
from jaxidl.control import Doomed, Filtered, PdPolicy, Pid, PidGains
from jaxidl.errors import ConfigurationError
from jaxidl.gap.benchmark.mechanisms import TWO_LINK
from jaxidl.learning.execute import Task
from jaxidl.learning.guard import Region
from jaxidl.models import ErrorModel
from jaxidl.robot.c import Controller, generate
from jaxidl.systems import Plant, PointMass, point_mass
from jaxidl.systems.mjcf import read_model
from jaxidl.types import State
from tests.helpers.compiled import InC, build, compiler, compilers, for_32_bits
from tests.helpers.model_files import stored

JOINTS, DT = ("shoulder", "elbow"), 2e-3
NETWORK = ErrorModel(layers=(9, 5, 1), circumstance_scales=(2.0,))
STILL = State(jnp.zeros(2), jnp.zeros(2))
PID = Pid(PidGains(20.0, jnp.array([3.0, 2.0]), 0.01), PidGains(60.0, 5.0, 0.02), 0.2)
DOOMED = Doomed(jnp.array([0.1, 0.2]), 0.5, 0.2, limit=jnp.array([5.0, jnp.inf]))
DRY = fx.AsymmetricFriction(*jnp.array([[1.5, 0.7], [0.9, 1.1], [2.0, 3.0], [1.0, 4.0]]))
TABLE = fx.OnJoint(
    fx.PositionDependentFriction(
        *jnp.array([[[0.5, 0.9]], [[1.0, 2.0]]]), *jnp.array([[0.0], [1.0]])
    ),
    1,
    2,
)  # fmt: skip
# loops over links, effects with all kinds of formulas, networks, guard, filters: all of a program
FOLLOW = """#include "robot.h"
#include <math.h>
#include <stdio.h>
int main(void)
{
    robot_state s;
    robot_real q[2] = {0, 0}, qd[2], d[2], dd[2], tau[2], load[1] = {0.5};
    int t, j, status = 0;
    robot_init(&s, q);
    for (t = 0; t < 500; t++) {
        for (j = 0; j < 2; j++) {
            d[j] = (robot_real)sin(0.01 * t + j);
            qd[j] = (robot_real)(5 * cos(0.01 * t + j));
            dd[j] = -25 * d[j];
            q[j] = d[j] + (robot_real)(0.01 * sin(0.1 * t));
        }
        status |= robot_step(&s, q, t * ROBOT_DT, d, qd, dd, load, tau);
        printf("%.17g %.17g\\n", (double)tau[0], (double)tau[1]);
    }
    return status;
}
"""


def controller(body, law=PID, **rest):
    task = Task(STILL, PdPolicy(STILL.q, 1.0, 1.0), jnp.array([50.0, 30.0]), 8.0, Filtered(), dt=DT)
    region = Region(*jnp.array([[-4.0] * 7, [4.0] * 7]), *jnp.array([[-9.0] * 2, [9.0] * 2]),
                    jnp.array(0.02), 0.5, 2.0)  # fmt: skip
    params = NETWORK.init(jax.random.key(0))
    given = {"error_model": NETWORK, "params": params, "region": region} | rest
    return Controller.of(task, Plant(body, (DRY, TABLE)), law, JOINTS, **given)


@pytest.fixture(scope="module")
def body(tmp_path_factory):
    return read_model(stored(tmp_path_factory.mktemp("model"), TWO_LINK)).plant.body


def written(own, folder, main=FOLLOW):
    folder.mkdir(exist_ok=True)
    code = generate(own, "robot", "two links")
    (folder / "robot.h").write_text(code.header)
    (folder / "robot.c").write_text(code.source)
    (folder / "main.c").write_text(main)
    return folder


def run(program):
    done = subprocess.run([str(program)], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr[:3000]
    return np.array([line.split() for line in done.stdout.splitlines()], float)


def unwarned(commands, own, folder):
    """Assert that programs of several compilers and options give the same torques."""
    folder, found = written(own, folder), {}
    for name, command in commands.items():
        for options in (("-O2",), ("-O2", "-ffast-math"), ("-O2", "-DROBOT_SINGLE"),
                        ("-O2", "-DROBOT_DOUBLE_NETWORKS")):  # fmt: skip
            found[name, *options] = run(build(command, folder, "program", *options))
    first, *others = found.values()
    assert np.isfinite(first).all()
    assert np.ptp(first[:, 0]) > 5.0
    for (_, *options), rows in zip(list(found)[1:], others, strict=True):
        # a difference of readings over the step squared has few digits in single precision
        rough = {"-DROBOT_SINGLE": 2e-2, "-DROBOT_DOUBLE_NETWORKS": 1e-4, "-ffast-math": 1e-6}
        tolerance = max((rough.get(option, 1e-6) for option in options), default=1e-6)
        np.testing.assert_allclose(rows, first, rtol=0.0, atol=tolerance * 50.0)


def test_a_compiler_has_nothing_to_warn_of(body, tmp_path):
    unwarned({"any": compiler()}, controller(body, DOOMED), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("law", [PID, DOOMED, None], ids=["pid", "doomed", "none"])
def test_gcc_and_clang_have_nothing_to_warn_of(law, body, tmp_path):
    if missing := [name for name in ("gcc", "clang") if name not in compilers()]:
        pytest.skip(f"no {' and no '.join(missing)}: install it, or ziglang, which has clang")
    unwarned(compilers(), controller(body, law), tmp_path)


@pytest.mark.slow
def test_it_runs_on_a_machine_of_32_bits(body, tmp_path):
    command = for_32_bits()
    if not command:
        pytest.skip("no compiler for 32 bits: install gcc-multilib or ziglang")
    folder = written(controller(body, DOOMED), tmp_path)
    double = "-DROBOT_DOUBLE_NETWORKS"
    wide = run(build(compiler(), folder, "wide", "-O2", double))
    for options in (("-O2",), ("-O2", "-ffast-math")):
        narrow = run(build(command, folder, "narrow", *options, double))
        np.testing.assert_allclose(narrow, wide, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("law", [DOOMED, pytest.param(PID, marks=pytest.mark.slow)])
def test_sanitizers_find_nothing(law, body, tmp_path):
    if "gcc" not in compilers():
        pytest.skip("no gcc, whose sanitizers are used")
    folder = written(controller(body, law), tmp_path)
    flags = ("-g", "-fsanitize=address,undefined,float-divide-by-zero", "-fno-sanitize-recover=all")
    clean = run(build(compilers()["gcc"], folder, "clean", *flags))
    np.testing.assert_allclose(clean, run(build(compilers()["gcc"], folder, "plain")), atol=1e-4)
    # and they would: an index beyond a table's end
    source = (folder / "robot.c").read_text()
    (folder / "robot.c").write_text(source.replace("j < J; j++) tau", "j <= J; j++) tau", 1))
    broken = subprocess.run([build(compilers()["gcc"], folder, "broken", *flags)],
                            capture_output=True)  # fmt: skip
    assert broken.returncode != 0


@pytest.mark.parametrize("options", [("-ffast-math", "-O2"), ("-DROBOT_SINGLE",)])
def test_after_a_number_that_is_not_finite_the_torque_is_zero_until_it_begins_anew(
    options, body, tmp_path
):
    in_c = InC(controller(body), tmp_path, *options)
    q, motion = np.array([0.1, -0.2]), [np.ones(2), np.zeros(2), np.ones(2), np.ones(1)]
    for place, bad in itertools.product(range(6), (np.nan, np.inf, -np.inf)):
        in_c.init(q)
        before = in_c.step(q, 0.0, *motion)
        assert before[0] == 0
        assert np.all(before[1] != 0.0)
        given = [q, DT, *motion]
        given[place] = bad if place == 1 else np.array([0.3, bad])[-len(given[place]) :]
        for attempt in (given, [q, 2 * DT, *motion]):
            status, tau = in_c.step(*attempt)
            assert status == -1
            assert np.all(tau == 0.0)
            assert np.all(in_c["tau"] == 0.0)
        in_c.init(q)
        again = in_c.step(q, 5.0, *motion)
        assert again[0] == 0
        np.testing.assert_array_equal(again[1], before[1])
    in_c.init(np.array([np.nan, 0.0]))
    assert in_c.step(q, 0.0, *motion)[0] == -1


def test_a_late_reading_is_reported(body, tmp_path):
    in_c = InC(controller(body), tmp_path)
    motion = [np.zeros(2)] * 3 + [np.zeros(1)]
    in_c.init(np.zeros(2))
    late = {0: 0, 1: 0, 2.4: 0, 4: 1, 5: 0, 5.2: 1, -500: 1, -499: 0}
    for steps, status in late.items():
        assert in_c.step(np.zeros(2), 7.0 + steps * DT, *motion)[0] == status


def test_the_text_is_the_same_every_time_and_says_where_it_comes_from(body):
    own = controller(body)
    first, second = (generate(own, "arm_1", "model a.xml */ of\nrevision \x1b 123") for _ in "ab")
    assert first == second
    for text in first:
        assert " * model a.xml * / of\n * revision ? 123\n" in text
        assert max(map(len, text.splitlines())) <= 100
        assert "malloc" not in text
        assert text.isascii()
    assert re.search(r"asymmetric_friction: friction that differs between", first.source)
    assert "position_dependent_friction, joint 2" in first.source
    assert re.search(r"= .*table_value\(", first.source)  # looked up, not written out
    public = re.findall(r"^(?:int|void) (\w+)\(", first.header, re.MULTILINE)
    ends = ("init", "step", "sense", "command", "inverse_dynamics", "learned")
    assert public == [f"arm_1_{end}" for end in ends]


class Strange(PointMass):
    """A body of another kind, with dynamics of its own."""


class Odd(Doomed):
    """A law of another kind."""


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        ("2arm", {}, "begins with a letter"),
        ("static", {}, "no word of C"),
        ("a b", {}, "letters, digits"),
        ("robot", {"joints": ("a",)}, "an error model of 1 joints"),
        ("robot", {"params": None}, "an error model and its weights"),
        ("robot", {"law": Odd(1.0, 1.0, 1.0)}, "a feedback law that can be written as C"),
        ("robot", {"law": Pid(PidGains(jnp.nan, 1.0, 1.0), PID.learner, 0.2)}, "a finite gain kp"),
        ("robot", {"model": point_mass(1.0, 3)}, "a rigid body of 2 joints"),
        ("robot", {"model": Strange(jnp.ones(2))}, "a point mass or a rigid body"),
    ],
)
def test_what_has_no_c_is_refused_in_one_line(name, change, said, body):
    with pytest.raises(
        ConfigurationError, match=r"^expected [^\n]+; got [^\n]+; [^\n]+$"
    ) as caught:
        generate(replace(controller(body), **change), name, "")
    assert said in str(caught.value)
