"""Logs that differ from the model in columns, signs, zeros, units, clocks or gravity; or do not."""

import numpy as np
import pytest

from jaxidl.gap import diagnose
from jaxidl.gap.benchmark.mechanisms import TWO_LINK
from jaxidl.gap.evidence.conventions import conventions, late_torques
from jaxidl.gap.evidence.rows import rows_of
from jaxidl.gap.evidence.shape import present
from jaxidl.gap.fit.library import library
from jaxidl.logs.log import from_arrays
from jaxidl.logs.signals import prepare
from jaxidl.report import table
from jaxidl.systems.mjcf import read_model
from jaxidl.systems.tables import inverse_dynamics, tables

DT = 5e-3
T = DT * np.arange(6000)
VISCOUS, DRY = 0.4, 0.3


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    path = tmp_path_factory.mktemp("conventions") / "model.xml"
    path.write_text(TWO_LINK)
    return read_model(path)


@pytest.fixture(scope="module")
def motion(model):
    """Positions and torques of the model with friction."""
    at = np.array([[0.9, 1.7], [1.3, 2.1]])
    size = np.array([[0.7, 0.4], [0.5, 0.6]])
    wave = lambda k: np.real(
        np.sum(size * (1j * at) ** k * np.exp(1j * (at * T[:, None, None] + size)), 2)
    )
    q, qd, qdd = wave(0), wave(1), wave(2)
    body = model.plant.body
    return q, inverse_dynamics(body, q, qd, qdd) + VISCOUS * qd + DRY * np.tanh(qd / 0.01), qd, qdd


def read(model, q, tau):
    noise = 1e-5 * np.random.default_rng(0).standard_normal(q.shape)
    rows = rows_of(prepare(from_arrays(T, q + noise, tau), model.plant.body))
    return conventions(rows, model.names)[0]


def test_a_log_as_the_model_has_it_raises_no_doubt(model, motion):
    q, tau, *_ = motion
    assert read(model, q, tau) == []


@pytest.mark.parametrize(
    ("words", "read_as"),
    [
        ("its torque had the opposite sign", lambda q, tau, j: (q, np.where(j, -tau, tau))),
        (
            "its position and torque had the opposite sign",
            lambda q, tau, j: (np.where(j, -q, q), np.where(j, -tau, tau)),
        ),
        ("90° had to be added", lambda q, tau, j: (q - np.pi / 2 * j, tau)),
        ("-90° had to be added", lambda q, tau, j: (q + np.pi / 2 * j, tau)),
        ("180° had to be added", lambda q, tau, j: (q + np.pi * j, tau)),
        ("its position was in degrees", lambda q, tau, j: (np.where(j, np.rad2deg(q), q), tau)),
    ],
)
@pytest.mark.parametrize("joint", [0, 1])
def test_a_joint_that_is_read_the_wrong_way_is_found(model, motion, words, read_as, joint):
    q, tau, *_ = motion
    (said,) = read(model, *read_as(q, tau, np.arange(2) == joint))
    assert f"{model.names[joint]} reads as if {words}" in said


@pytest.mark.parametrize(
    ("what", "moved", "driven"),
    [("positions and torques", -1, -1), ("positions", -1, 1), ("torques", 1, -1)],
)
def test_columns_of_two_joints_that_were_exchanged_are_found(model, motion, what, moved, driven):
    q, tau, *_ = motion
    (said,) = read(model, q[:, ::moved], tau[:, ::driven])
    assert f"the log reads as if the {what} of shoulder and elbow had been exchanged" in said


@pytest.mark.parametrize("idle", [0.0, 1e-3], ids=["no torque", "noise"])
def test_a_joint_that_a_brake_holds_rests_and_is_not_exchanged(model, motion, idle):
    """Its torque says nothing: neither that the model is in balance nor whose column it is."""
    q, *_ = motion
    held = np.stack([q[:, 0], np.full(len(T), 0.7)], 1)
    qd, qdd = np.gradient(held, DT, axis=0), np.gradient(np.gradient(held, DT, axis=0), DT, axis=0)
    tau = inverse_dynamics(model.plant.body, held, qd, qdd) * [0.5, 0.0]
    tau[:, 1] += idle * np.random.default_rng(2).standard_normal(len(T))
    rows = rows_of(prepare(from_arrays(T, held, tau), model.plant.body))
    assert rows.used.any(0).tolist() == [True, False]
    assert not any("exchanged" in said for said in conventions(rows, model.names)[0])


def test_gravity_the_other_way_round_or_none_is_found(model, motion):
    q, tau, *_ = motion
    still = np.zeros_like(q)
    weight = inverse_dynamics(model.plant.body, q, still, still)
    (said,) = read(model, q, tau - weight)
    assert "the torques that carry the weight had been left out" in said
    (said,) = read(model, q, tau - 2.0 * weight)
    assert "the base hung upside down" in said
    assert "shoulder reads as if 180° had to be added" in said  # in a plane, the same


@pytest.mark.parametrize(
    ("words", "read_as"),
    [
        ("torques had to be multiplied by 1000", lambda q, tau: (q, 1e-3 * tau)),
        ("torques had to be multiplied by 0.1", lambda q, tau: (q, 10.0 * tau)),
        ("positions were in degrees", lambda q, tau: (np.rad2deg(q), tau)),
    ],
)
def test_another_unit_is_found(model, motion, words, read_as):
    (said,) = read(model, *read_as(*motion[:2]))
    assert said.startswith("the log reads as if ")
    assert words in said


def test_another_unit_is_found_where_commands_are_interpolated(model, motion):
    """By a thousandth: as much as the model's own torque where the unit is a thousand times off."""
    q, tau, *_ = motion
    rows = rows_of(prepare(from_arrays(T, q, 1e3 * tau), model.plant.body))
    rough = 1.0 + 2e-3 * np.random.default_rng(1).standard_normal(rows.command.shape)
    (said,), misread = conventions(rows._replace(command=rough * rows.command), model.names)
    assert misread.all()
    assert "torques had to be multiplied by 0.001" in said


def test_another_unit_is_found_where_joints_rest(model, motion):
    q, _, *_ = motion
    size = np.clip(np.sin(0.9 * T), -0.7, 0.7)[:, None]  # rests at both ends
    q = size * [1.0, -0.8] + [0.2, 0.9]
    qd, qdd = np.gradient(q, DT, axis=0), np.gradient(np.gradient(q, DT, axis=0), DT, axis=0)
    tau = inverse_dynamics(model.plant.body, q, qd, qdd) + DRY * np.tanh(qd / 0.01)
    assert read(model, q, tau) == []
    (said,) = read(model, q, 1e3 * tau)
    assert "torques had to be multiplied by 0.001" in said


def test_a_model_with_gravity_along_another_axis_is_found(model, motion, tmp_path):
    q, tau, *_ = motion
    path = tmp_path / "aside.xml"
    option = '<option gravity="-9.81 0 0"/>'
    path.write_text(TWO_LINK.replace("<worldbody>", option + "<worldbody>", 1))
    aside = read_model(path)
    assert aside.plant.body.source.opt.gravity[2] == 0.0
    (said,) = read(aside, q, tau)
    assert "the base stood upright, with its z axis up" in said


def late(model, q, tau, seconds):
    """Sentences on torques that were logged later by some seconds, and on which joints."""
    noise = 1e-5 * np.random.default_rng(0).standard_normal(q.shape)
    then = np.stack([np.interp(T - seconds, T, column) for column in tau.T], 1)
    rows = rows_of(prepare(from_arrays(T, q + noise, then), model.plant.body))
    names = ["viscous_friction", "coulomb_friction", "inertia_error", "constant_offset"]
    made = library(rows, names, present(()))
    return late_torques(made.rows, [i for i in made.score.items if i.common], model.names)


@pytest.mark.parametrize("milliseconds", [20.0, 60.0])
def test_torques_that_are_logged_after_they_act_are_found(model, motion, milliseconds):
    q, tau, *_ = motion
    (said,), misread = late(model, q, tau, 1e-3 * milliseconds)
    assert misread.any()
    number = float(said.split(" ms late")[0].split()[-1])
    assert number == pytest.approx(milliseconds, abs=1e3 * DT / 2)


@pytest.mark.parametrize("milliseconds", [0.0, -20.0])
def test_torques_that_act_late_are_no_matter_of_clocks(model, motion, milliseconds):
    q, tau, *_ = motion
    said, misread = late(model, q, tau, 1e-3 * milliseconds)
    assert said == []
    assert not misread.any()


def test_an_inertia_error_of_the_model_raises_no_doubt(model, motion):
    q, tau, qd, qdd = motion
    body = model.plant.body
    of_elbow = tables(body, q, qd, qdd).by_mass[:, :, 1]
    assert read(model, q, tau + 1.5 * of_elbow) == []


@pytest.mark.slow
def test_the_doubt_is_the_first_that_is_said_and_its_joint_has_no_sure_effect(model, motion):
    q, tau, *_ = motion
    right = diagnose(from_arrays(T, q, tau), model, effects=["viscous_friction"], rollouts=False)
    assert {f.joint for f in right.findings if f.sure} == {0, 1}
    found = diagnose(
        from_arrays(T, q, tau * [1.0, -1.0]), model, effects=["viscous_friction"], rollouts=False
    )
    assert "sign" in found.notes[0]
    assert found.summary.startswith("First of all")
    assert "First of all" in table(found).split(". ")[1]
    assert [f.joint for f in found.findings if f.sure] == [0]  # the other's sign is wrong


def test_a_load_that_is_gone_raises_no_doubt_where_friction_explains_the_torque(model, motion):
    # with torques ten times as large, the error of the load would only look ten times smaller
    q, tau, qd, _ = motion
    friction = VISCOUS * qd + DRY * np.tanh(qd / 0.01)
    size = 2.0 * np.std(tau - friction, axis=0) / np.std(friction, axis=0)
    assert read(model, q, size * friction) == []


def test_joints_that_move_in_turn_do_not_seem_exchanged(model):
    """An exchanged log must explain all of a joint's motion, not some instants of it.

    The springs make the model wrong enough to ask. There is hardly a time at which both move.
    """
    turn = 0.5 * (1.0 + np.tanh((T - T[-1] / 2) / 0.5))[:, None]
    share = np.concatenate([1.0 - turn, turn], 1) ** 2
    speed = 0.8 * np.sin(1.1 * T)[:, None] * share
    q = DT * np.cumsum(speed, axis=0)
    qd, qdd = np.gradient(q, DT, axis=0), np.gradient(np.gradient(q, DT, axis=0), DT, axis=0)
    tau = inverse_dynamics(model.plant.body, q, qd, qdd) + VISCOUS * qd + 30.0 * q
    assert not any("exchanged" in said for said in read(model, q, tau))


@pytest.mark.parametrize("wrong", ["unit", "link"])
def test_a_common_factor_of_all_torques_is_said_beside_heavier_links(model, motion, wrong):
    """One link that is heavier is no matter of the torques."""
    q, tau, qd, qdd = motion
    one = tables(model.plant.body, q, qd, qdd).by_mass[:, :, 1]
    torque = 1.2 * tau if wrong == "unit" else tau + 0.3 * one
    noise = np.random.default_rng(2).standard_normal((2, *q.shape))
    log = from_arrays(T, q + 1e-5 * noise[0], torque + 0.01 * noise[1])
    names = ["viscous_friction", "coulomb_friction", "inertia_error", "com_error"]
    found = diagnose(log, model, effects=names, rollouts=False)
    said = [note for note in found.notes if note.startswith("all links seem to be")]
    link = [f for f in found.findings if f.name in ("inertia_error", "com_error")]
    assert link
    if wrong == "unit":
        assert "about 20% too light" in said[0]
        assert "multiplied by 0.8" in said[0]
        assert not any(f.sure for f in link)
        assert all(f.sure for f in found.findings if f not in link)
    else:
        assert not said
        assert any(f.sure for f in link)


@pytest.mark.slow
def test_friction_that_a_common_factor_explains_is_not_sure(model, motion, tmp_path):
    """The model has all of it, in another unit."""
    path = tmp_path / "model.xml"
    friction = f'<joint damping="{VISCOUS}" frictionloss="{DRY}" '
    path.write_text(TWO_LINK.replace("<joint ", friction))
    q, tau, *_ = motion
    noise = np.random.default_rng(4).standard_normal((2, *q.shape))
    log = from_arrays(T, q + 1e-5 * noise[0], 1.2 * tau + 0.01 * noise[1])
    names = ["viscous_friction", "coulomb_friction", "inertia_error", "com_error"]
    found = diagnose(log, read_model(path), effects=names, rollouts=False)
    assert any(note.startswith("all links seem to be") for note in found.notes)
    assert {f.name for f in found.findings} > {"viscous_friction", "coulomb_friction"}
    assert not any(f.sure for f in found.findings)
