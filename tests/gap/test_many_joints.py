"""The gap workflow on a chain of four hinges: friction on every joint, a load, several runs, and
two logs.
"""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from jaxidl.gap import Diagnosis, diagnose
from jaxidl.gap.result.diagnosis import Finding

JOINTS, DT, SECONDS = 4, 0.004, 24.0
VISCOUS, COULOMB = np.array([2.0, 2.0, 1.0, 0.5]), np.array([1.0, 1.0, 0.5, 0.2])
LOAD, COM = 0.4, np.array([0.05, 0.0, 0.1])  # [kg], in the last link's frame [m]
EFFECTS = (
    "viscous_friction",
    "coulomb_friction",
    "constant_offset",
    "spring",
    "inertia_error",
    "payload",
    "coupled_friction",
)


UPRIGHT, ACROSS = "0 0 1", "0 1 0"


def chain(
    load: float = 0.0,
    axes: tuple[str, ...] = (UPRIGHT, ACROSS, UPRIGHT, ACROSS),
    rotor: float = 0.05,
) -> str:
    """Four hinges, their axes by turns upright and across; ``load`` [kg] at the end.

    ``rotor`` is the first one's rotor inertia [kg m^2].
    """
    text = (
        f'<body pos="{COM[0]} {COM[1]} {COM[2]}"><inertial pos="0 0 0" mass="{load}"'
        ' diaginertia="1e-9 1e-9 1e-9"/></body>'
    )
    text = text if load else ""
    for j in reversed(range(JOINTS)):
        mass = (3.0, 2.5, 2.0, 1.0)[j]
        inertial = (
            f'<inertial pos="0.01 0 0.12" mass="{mass}" diaginertia="{0.012 * mass} {0.012 * mass}'
            f' {0.004 * mass}"/>'
        )
        inertia = 0.05 if j else rotor
        hinge = f'<joint name="j{j + 1}" type="hinge" axis="{axes[j]}" armature="{inertia}"/>'
        text = f'<body name="link{j + 1}" pos="0 0 0.24">{hinge}{inertial}{text}</body>'
    return f'<mujoco model="chain"><worldbody>{text}</worldbody></mujoco>'


def moved(
    text: str, friction: float, seed: int = 0, still: tuple[int, ...] = ()
) -> dict[str, np.ndarray]:
    """A log of a chain on smooth paths that are drawn with ``seed``.

    ``friction`` is the share of the whole friction, joints in ``still`` rest.
    """
    model: Any = mujoco.MjModel.from_xml_string(text)  # pyright: ignore[reportAttributeAccessIssue]
    data: Any = mujoco.MjData(model)  # pyright: ignore[reportAttributeAccessIssue]
    rng, time = np.random.default_rng(seed), np.arange(round(SECONDS / DT)) * DT
    q, qd, qdd = (np.zeros((len(time), JOINTS)) for _ in range(3))
    for j in range(JOINTS):
        for hertz in rng.uniform(0.1, 0.7, 4):
            size, phase, w = 0.4 / (1 + 2 * hertz), rng.uniform(0.0, 2 * np.pi), 2 * np.pi * hertz
            size *= j not in still
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


@pytest.mark.slow
def test_nothing_is_named_where_nothing_is_hidden(tmp_path):
    np.savez(tmp_path / "log.npz", allow_pickle=False, **moved(chain(LOAD), 0.0))
    (tmp_path / "model.xml").write_text(chain(LOAD))
    found = diagnose(tmp_path / "log.npz", tmp_path / "model.xml", rollouts=False)  # all effects
    assert found.verdict == "nothing_missing"
    assert not found.findings


def saved(folder: Path, name: str, columns: dict[str, np.ndarray]) -> Path:
    np.savez(folder / name, allow_pickle=False, **columns)
    return folder / name


def weighty(found: Diagnosis) -> dict[tuple[str, int | None], Finding]:
    """Findings of more than a fiftieth of the command.

    What filters leave of dry friction looks like a small rotor.
    """
    return {(f.name, f.joint): f for f in found.findings if f.share > 0.02}


@pytest.mark.slow
def test_friction_of_every_joint_and_the_load_are_named_and_nothing_else(files):
    found = diagnose(*files, effects=EFFECTS, rollouts=False)
    named = weighty(found)
    wanted = {
        (name, j) for name in ("viscous_friction", "coulomb_friction") for j in range(JOINTS)
    } | {("payload", None)}
    assert set(named) == wanted
    assert all(f.sure for f in named.values())
    for j in range(JOINTS):
        assert named["viscous_friction", j].parameters["coefficient"].value == pytest.approx(
            VISCOUS[j], rel=0.02
        )
        assert named["coulomb_friction", j].parameters["level"].value == pytest.approx(
            COULOMB[j], rel=0.02
        )
    load = named["payload", None].parameters
    assert load["mass"].value == pytest.approx(LOAD, rel=0.02)
    np.testing.assert_allclose(load["com"].value, COM, atol=0.005)


@pytest.mark.slow
def test_the_inertia_of_a_rotor_is_not_given_to_a_light_load(tmp_path):
    """In a plane that turns with the base, no motion tells the two apart."""
    axes = (UPRIGHT, ACROSS, ACROSS, ACROSS)
    model = tmp_path / "model.xml"
    model.write_text(chain(axes=axes))
    log = saved(tmp_path, "log.npz", moved(chain(LOAD, axes, rotor=0.2), 1.0))
    found = diagnose(log, model, effects=EFFECTS, rollouts=False)
    named = weighty(found)
    rotor = named["inertia_error", 0].parameters["extra"]
    assert rotor.value == pytest.approx(0.15, abs=0.01)
    load = named["payload", None].parameters
    assert load["mass"].value == pytest.approx(LOAD, rel=0.03)
    assert np.abs(load["inertia"].value).max() < 0.01


@pytest.mark.slow
def test_all_runs_of_a_log_count_and_no_filter_crosses_their_ends(files, tmp_path):
    """Two runs of different motion: time begins again and positions jump."""
    halves = [moved(chain(LOAD), 1.0, seed) for seed in (0, 5)]
    half = round(SECONDS / DT / 2)
    columns = {
        name: np.concatenate([h[name][:half] for h in halves]) for name in ("time", "q", "tau")
    }
    log = saved(tmp_path, "runs.npz", columns | {"run": np.repeat([1, 2], half)})
    found = diagnose(log, files[1], effects=EFFECTS, rollouts=False)
    values = {(f.name, f.joint): f.parameters for f in found.findings}
    for j in range(JOINTS):
        assert values["viscous_friction", j]["coefficient"].value == pytest.approx(
            VISCOUS[j], rel=0.02
        )
        assert values["coulomb_friction", j]["level"].value == pytest.approx(COULOMB[j], rel=0.03)
    assert values["payload", None]["mass"].value == pytest.approx(LOAD, rel=0.03)


def test_nothing_is_named_on_a_joint_that_stands_still(files, tmp_path):
    log = saved(tmp_path, "still.npz", moved(chain(), 1.0, 1, still=(3,)))
    found = diagnose(log, files[1], effects=EFFECTS[:4], rollouts=False)
    named = {(f.name, f.joint) for f in found.findings}
    assert named == {
        (name, j) for name in ("viscous_friction", "coulomb_friction") for j in range(JOINTS - 1)
    }
    assert any("j4 hardly moved" in note for note in found.notes)
    assert found.verdict == "named"


def test_a_joint_without_torque_leaves_the_others_alone(files, tmp_path):
    """The last joint has no command.

    What moves it is unknown, and no effect on the others may stand in for it.
    """
    columns = moved(chain(), 0.0)
    columns["tau"][:, 3] = 0.0
    found = diagnose(
        saved(tmp_path, "passive.npz", columns),
        files[1],
        effects=(*EFFECTS[:4], "torque_saturation", "motor_coupling"),
        rollouts=False,
    )
    assert np.isfinite(found.gap.after.torque_rms).all()
    assert any("no torque was commanded" in note for note in found.notes)
    assert not [f for f in found.findings if f.joint in (0, 1, 2)]
    assert (found.verdict, found.unexplained) == ("unexplained", (3,))


@pytest.mark.slow
@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["picked-up", "put-down"])
def test_what_changed_between_two_logs_is_the_load_alone(files, tmp_path, sign):
    """Friction of every joint is in both logs, and not in the model: it is no finding."""
    loads = (0.0, LOAD) if sign > 0.0 else (LOAD, 0.0)
    before, after = (
        saved(tmp_path, f"{k}.npz", moved(chain(load), 1.0, seed))
        for k, (load, seed) in enumerate(zip(loads, (2, 3), strict=True))
    )
    found = diagnose(after, files[1], reference=before, effects=EFFECTS, rollouts=False)
    (load,) = weighty(found).values()
    assert (load.name, load.sure) == ("payload", True)
    assert load.parameters["mass"].value == pytest.approx(sign * LOAD, rel=0.05)
    np.testing.assert_allclose(load.parameters["com"].value, COM, atol=0.01)
    assert len(found.common) >= 2 * JOINTS
    assert found.options["reference"]


@pytest.mark.slow
def test_an_encoder_that_was_zeroed_anew_is_what_changed(files, tmp_path):
    """What neither log explains, 7 % of the torque, does not speak against it.

    The load, which the model lacks, turns with the joint.
    """
    before, after = (moved(chain(LOAD), 1.0, seed) for seed in (4, 5))
    for log in (before, after):
        log["tau"] += 0.1 * np.std(log["tau"], 0) * np.sin(40.0 * log["q"])
    after["q"][:, 1] += 0.04
    old, new = (saved(tmp_path, f"{k}.npz", log) for k, log in enumerate((before, after)))
    found = diagnose(
        new, files[1], reference=old, effects=(*EFFECTS, "position_bias"), rollouts=False
    )
    (bias,) = weighty(found).values()
    assert (bias.name, bias.joint, bias.sure) == ("position_bias", 1, True)
    assert bias.parameters["bias"].value == pytest.approx(0.04, rel=0.05)
