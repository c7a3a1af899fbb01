"""The gap workflow on a chain of four hinges: what concerns one joint is tried there, what reaches many is held meanwhile."""

from typing import Any

import jax
import mujoco
import numpy as np
import pytest

from jaxidl.gap import diagnose
from jaxidl.gap.candidates import candidates
from jaxidl.gap.data import data_of
from jaxidl.gap.fit import fit, polished, updated
from jaxidl.gap.gains import Errors, best_gain
from jaxidl.gap.log import read
from jaxidl.gap.rank import Ranking
from jaxidl.gap.signals import prepare
from jaxidl.systems.mjcf import read_model

JOINTS, DT, SECONDS = 4, 0.004, 24.0
VISCOUS, COULOMB = np.array([2.0, 2.0, 1.0, 0.5]), np.array([1.0, 1.0, 0.5, 0.2])
LOAD, COM = 0.4, np.array([0.05, 0.0, 0.1])  # [kg], in the last link's frame [m]
EFFECTS = ("viscous_friction", "coulomb_friction", "constant_offset", "spring", "inertia_error", "payload", "coupled_friction")


def chain(load: float = 0.0) -> str:
    """Four hinges, their axes by turns upright and across; ``load`` [kg] at the end."""
    text = f'<body pos="{COM[0]} {COM[1]} {COM[2]}"><inertial pos="0 0 0" mass="{load}" diaginertia="1e-9 1e-9 1e-9"/></body>'
    text = text if load else ""
    for j in reversed(range(JOINTS)):
        mass = (3.0, 2.5, 2.0, 1.0)[j]
        inertial = f'<inertial pos="0.01 0 0.12" mass="{mass}" diaginertia="{0.012 * mass} {0.012 * mass} {0.004 * mass}"/>'
        axis = ("0 0 1", "0 1 0", "0 0 1", "0 1 0")[j]
        hinge = f'<joint name="j{j + 1}" type="hinge" axis="{axis}" armature="0.05"/>'
        text = f'<body name="link{j + 1}" pos="0 0 0.24">{hinge}{inertial}{text}</body>'
    return f'<mujoco model="chain"><worldbody>{text}</worldbody></mujoco>'


def moved(text: str, friction: float) -> dict[str, np.ndarray]:
    """A log of a chain on smooth paths, with this share of the friction."""
    model: Any = mujoco.MjModel.from_xml_string(text)  # pyright: ignore[reportAttributeAccessIssue]
    data: Any = mujoco.MjData(model)  # pyright: ignore[reportAttributeAccessIssue]
    rng, time = np.random.default_rng(0), np.arange(round(SECONDS / DT)) * DT
    q, qd, qdd = (np.zeros((len(time), JOINTS)) for _ in range(3))
    for j in range(JOINTS):
        for hertz in rng.uniform(0.1, 0.7, 4):
            size, phase, w = 0.4 / (1 + 2 * hertz), rng.uniform(0.0, 2 * np.pi), 2 * np.pi * hertz
            q[:, j] += size * np.sin(w * time + phase)
            qd[:, j] += size * w * np.cos(w * time + phase)
            qdd[:, j] -= size * w * w * np.sin(w * time + phase)
    tau = np.empty_like(q)
    for t in range(len(time)):
        data.qpos, data.qvel, data.qacc = q[t], qd[t], qdd[t]
        mujoco.mj_inverse(model, data)  # pyright: ignore[reportAttributeAccessIssue]
        tau[t] = data.qfrc_inverse
    tau += friction * (VISCOUS * qd + COULOMB * np.tanh(qd / 1e-3))
    return {"time": time, "q": q + rng.normal(0.0, 1e-6, q.shape), "tau": tau}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A log of the chain with friction on every joint and a load, and the model without both."""
    folder = tmp_path_factory.mktemp("chain")
    np.savez(folder / "log.npz", allow_pickle=False, **moved(chain(LOAD), 1.0))
    (folder / "model.xml").write_text(chain())
    return folder / "log.npz", folder / "model.xml"


def test_nothing_is_named_where_nothing_is_hidden(tmp_path):
    np.savez(tmp_path / "log.npz", allow_pickle=False, **moved(chain(LOAD), 0.0))
    (tmp_path / "model.xml").write_text(chain(LOAD))
    found = diagnose(tmp_path / "log.npz", tmp_path / "model.xml", rollouts=False)  # all effects
    assert found.verdict == "nothing_missing"
    assert not found.findings


def test_friction_of_every_joint_and_the_load_are_named_and_nothing_else(files):
    found = diagnose(*files, effects=EFFECTS, rollouts=False)
    named = {(f.name, f.joint): f for f in found.findings}
    wanted = {(name, j) for name in ("viscous_friction", "coulomb_friction") for j in range(JOINTS)} | {("payload", None)}
    assert set(named) == wanted
    for j in range(JOINTS):
        assert named["viscous_friction", j].parameters["coefficient"].value == pytest.approx(VISCOUS[j], rel=0.02)
        assert named["coulomb_friction", j].parameters["level"].value == pytest.approx(COULOMB[j], rel=0.02)
    load = named["payload", None].parameters
    assert load["mass"].value == pytest.approx(LOAD, rel=0.02)
    np.testing.assert_allclose(load["com"].value, COM, atol=0.005)


def test_a_trial_on_one_joint_holds_what_reaches_beyond_it_and_leaves_other_joints_trials(files):
    log, model = files
    with jax.enable_x64(True):
        known = read_model(model)
        data = data_of(prepare(read(log, joints=JOINTS), known.plant.body, ()), (), 0.3)
        ranking = Ranking(
            data, candidates(data.signals, np.sqrt(np.mean(data.base**2, axis=0)), (*EFFECTS, "torque_ripple")), 0.05
        )
        pool = {c.key: c for c in ranking.pool}
        load, friction = pool["payload", None, ""], pool["viscous_friction", 2, "0"]
        trial = ranking.attempt(load, polish=True)
        assert trial is not None
        ranking.take(trial)
        ranking.rank()
        local = ranking.attempt(friction)
        assert local is not None
        assert local.joints == (2,)
        assert [m.candidate.name for m in local.fit.members if m.candidate.name != "alignment"] == ["viscous_friction"]
        kept = ranking.trials["viscous_friction", 0]
        before = ranking.members[0].theta
        ranking.take(local)
        ripple = ranking.attempt(pool["torque_ripple", 1, "3"])
        assert ripple is not None
        assert [m.candidate.name for m in ripple.fit.held] == ["payload"]
        after = polished(data, ripple.fit, ranking.rows, ripple.joints)
        assert [m.candidate.name for m in after.held] == ["payload"]
        assert after.rms(0) <= ripple.fit.rms(0)
        again = fit(data, (*updated(ripple.fit, data), *ripple.fit.held), ranking.rows, ripple.joints)
        assert again.rms(0) < 1.5 * ripple.fit.rms(0)  # linearised anew it is nearly the same, the load being there still
        (now,) = (m for m in ranking.members if m.candidate.name == "payload")
        assert not np.array_equal(now.theta, before)  # taken, the effect moves it
        assert ("viscous_friction", 2) not in ranking.trials
        assert ranking.trials["viscous_friction", 0] is kept


def errors(*sizes: float) -> Errors:
    """Of blocks all alike: mean squares of each joint."""
    error = 100.0 * np.tile(sizes, (20, 1))
    return Errors(error, np.full_like(error, 1e-3), np.full_like(error, 100.0), np.repeat(error, 2, axis=0) / 2)


def test_of_many_joints_the_one_that_gains_most_counts_unless_all_together_lose():
    gain, overall, where = best_gain(errors(1.0, 1.0, 1.0, 1.0), errors(1.0, 1.0, 1.0, 0.25))
    assert where == [3]
    assert gain.value == pytest.approx(0.5)
    assert overall.value == pytest.approx(1.0 - np.sqrt(3.25 / 4.0))
    gain, overall, where = best_gain(errors(1.0, 1.0, 1.0, 1.0), errors(1.0, 1.0, 1.2, 0.25))
    assert where == [0, 1, 2, 3]  # one joint would pay for the other
    assert gain.value > 0.0
    gain, overall, where = best_gain(errors(1.0, 1.0, 1.0, 1.0), errors(1.0, 1.0, 3.0, 0.25))
    assert where == [0, 1, 2, 3]
    assert gain == overall
    assert gain.value < 0.0
    assert best_gain(errors(1.0, 1.0), errors(1.0, 0.25))[2] == [0, 1]
