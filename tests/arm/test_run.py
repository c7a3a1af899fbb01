"""The arm's experiments: kept pieces, tables, figures and the command."""

import json
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest
import xarray as xr

from jaxidl.arm import limits, pick
from jaxidl.arm.found import as_text as found_as_text
from jaxidl.arm.found import judge
from jaxidl.arm.hidden import Logged, record, truth, visible
from jaxidl.arm.run import ArmRun, _write, quick, run_all
from jaxidl.arm.setup import ArmStudy, Hidden, Load
from jaxidl.arm.study import VARIABLES, ArmGrid, run_study, thinned
from jaxidl.arm.table import as_text, falls, interval, ranking
from jaxidl.errors import ConfigurationError, StoreError
from jaxidl.models import Training
from jaxidl.plot import arm, arm_report, arm_tasks
from tests.helpers.commands import refusal

GRID = ArmGrid(
    noise=(1e-5,), accelerations=("causal",), sources=("joint",), seeds=(1, 2, 3), executions=2
)


def small(study: ArmStudy) -> ArmStudy:
    """The same code in seconds."""
    model = replace(study.error_model, layers=(16, 1))
    return replace(
        study, seconds_each=0.05, error_model=model, training=Training(epochs=1, batch=64)
    )


@pytest.mark.slow
def test_a_study_of_the_arm_is_computed_once_and_direct_data_for_one_kind_of_accelerations_only(
    tmp_path, computed
):
    study, path = small(ArmStudy()), tmp_path / "study.nc"
    grid = replace(GRID, accelerations=("causal", "zero_phase"), sources=("direct",), seeds=(1, 2))
    found = run_study(study, grid, path, {"a": 1}, quiet=True)
    assert {(dict(at)["acceleration"], dict(at)["seed"]) for at in computed} == {
        ("causal", 1),
        ("causal", 2),
    }
    computed.clear()
    xr.testing.assert_identical(run_study(study, grid, path, {"a": 1}, quiet=True), found)
    assert {dict(at)["seed"] for at in computed} <= {1}  # the trial of shapes
    assert found["feedback_mse"].dims == ("acceleration", "source", "noise", "seed", "iteration")
    assert np.isfinite(found["feedback_mse"]).all()
    direct = found.sel(source="direct")
    np.testing.assert_array_equal(
        direct["path_error"].sel(acceleration="causal"),
        direct["path_error"].sel(acceleration="zero_phase"),
    )
    kept = thinned(found)
    assert kept["feedback_trace"].dims == (
        "acceleration",
        "source",
        "noise",
        "execution",
        "time",
        "joint",
    )
    assert kept["feedback_trace"].dtype == np.float32


def conditions() -> xr.Dataset:
    """Made-up results: direct data best by far, joint and indirect data a tie, one rise."""
    rng = np.random.default_rng(0)
    levels = {"indirect": 1.0, "direct": 0.3, "joint": 0.98}
    mse = np.stack([np.exp(0.1 * rng.normal(size=(5, 6))) * level for level in levels.values()])
    mse[..., 0] = 20.0
    mse[0, :, 4] = 3.0
    coords = {
        "acceleration": ["causal"],
        "source": list(levels),
        "noise": [1e-5],
        "seed": [1, 2, 3, 4, 5],
        "iteration": range(6),
    }
    dims = ("acceleration", "source", "noise", "seed", "iteration")
    found = xr.Dataset({"feedback_mse": (dims, mse[None, :, None])}, coords)
    return found.assign(finite=np.isfinite(found["feedback_mse"]))


def test_ranking_and_falls_of_made_up_results_are_as_they_were_made():
    rows = ranking(conditions())
    assert rows[0]["source"] == "direct"
    assert [row["apart"] for row in rows] == [False, True, True]
    assert rows[1]["worse"][1] < rows[1]["worse"][0] < rows[1]["worse"][2]
    assert "joint" in as_text(rows)
    fall = {row["source"]: row for row in falls(conditions())}
    assert all(row["fall"] > 0.9 for row in fall.values())
    assert fall["indirect"]["rise"] > 2.0
    assert fall["direct"]["rise"] < fall["direct"]["spread"]
    middle, low, high = interval([1.0, 2.0, 4.0])
    assert middle == pytest.approx(2.0)
    assert low * high == pytest.approx(4.0)


def test_runs_that_diverged_are_counted_and_left_out():
    data = conditions()
    data["feedback_mse"].loc[{"source": "direct", "seed": 2, "iteration": 3}] = np.nan
    data["finite"] = np.isfinite(data["feedback_mse"])
    rows = {row["source"]: row for row in ranking(data)}
    assert rows["direct"]["rank"] == 3
    assert [rows[name]["diverged"] for name in ("direct", "joint", "indirect")] == [1, 0, 0]
    assert np.isfinite([*rows["direct"]["later"], *rows["direct"]["worse"]]).all()
    assert "1 of the runs diverged" in as_text(ranking(data))
    assert np.isfinite([row["rise"] for row in falls(data)]).all()
    data["finite"].loc[{"source": "direct"}] = False
    assert "5 of the runs diverged" in as_text(ranking(data))
    assert {row["source"] for row in falls(data)} == {"joint", "indirect"}


def test_a_load_is_carried_between_its_two_instants():
    study = replace(ArmStudy(), carried=(Load(0.5, 1.0, 2.0),))
    mass = np.asarray(study.carried_mass())[:, 0]
    t = np.arange(study.steps) * study.dt
    assert mass.max() == pytest.approx(2.0)
    assert not mass[(t <= 0.5) | (t >= 1.0)].any()
    assert study.task().circumstances is not None
    assert ArmStudy().task().circumstances is None


def test_the_lowest_rate_that_lifts_is_found():
    found = {"rates": np.array([1.0, 2.0, 4.0]), "lifted": np.array([0.1, 0.6, 0.9])}
    assert pick.lowest(found) == 2.0
    with pytest.raises(ConfigurationError, match="lighter tool"):
        pick.lowest(found | {"lifted": np.zeros(3)})
    informed, uninformed = (
        limits.Ambiguity().study(informed).error_model for informed in (True, False)
    )
    assert len(informed.circumstance_scales) == len(uninformed.circumstance_scales) + 1


def test_figures_of_made_up_results_can_be_drawn():
    arm.feedback_by_execution(conditions()).canvas.draw()
    arm_tasks.with_and_without_load(
        {"informed": np.ones((2, 3, 2)).tolist(), "uninformed": np.ones((2, 3, 2)).tolist()}
    ).canvas.draw()
    lifts = {"rate": 2.0, "rates": [1.0, 2.0], "lifted": [0.2, 0.6]}
    runs = {source: np.ones((2, 3)).tolist() for source in ("joint", "direct")}
    arm_tasks.pick_and_place(lifts | {"path_error": runs, "feedback_mse": runs}).canvas.draw()
    report = {
        "truth": [
            {"effect": name, "joint": joint, "size": size, "visible": 1.0 if joint == 5 else 9.0}
            for (name, joint), size in truth(Hidden()).items()
        ],
        "effects": [
            {
                "effect": "viscous_friction",
                "joint": 0,
                "confidence": 0.9,
                "parameters": {"coefficient": {"value": 4.1}},
            },
            {
                "effect": "viscous_friction",
                "joint": 1,
                "confidence": 0.7,
                "parameters": {"coefficient": {"value": 4.1}},
            },
            {
                "effect": "coulomb_friction",
                "joint": 1,
                "confidence": 0.8,
                "parameters": {"level": {"value": 4.1}},
            },
            {
                "effect": "spring",
                "joint": 2,
                "confidence": 0.8,
                "parameters": {"stiffness": {"value": 1.0}},
            },
            {
                "effect": "spring",
                "joint": 3,
                "confidence": 0.7,
                "parameters": {"stiffness": {"value": 1.0}},
            },
        ],
        "ambiguous": [
            {
                "candidates": [
                    {"effect": "payload", "joint": None},
                    {"effect": "inertia_error", "joint": 6},
                ]
            }
        ],
    }
    rows = {(row.effect, row.joint): row for row in judge(report)}
    assert [rows["viscous_friction", j].state for j in range(7)] == [
        "found",
        "possible",
        *["missed"] * 3,
        "small",
        "missed",
    ]
    assert rows["viscous_friction", 0].found == 4.1
    assert rows["coulomb_friction", 1].state == "off"
    assert (rows["spring", 2].state, rows["spring", 3].state) == ("extra", "doubt")
    assert rows["payload", None].state == rows["inertia_error", 6].state == "equal"
    assert "inertia_error on joint 7" in rows["payload", None].why
    assert "sampling interval" in rows["actuator_delay", 0].why
    assert found_as_text(report).count("\n") == len(rows) + 1
    arm_tasks.gap_on_the_arm(report).canvas.draw()


def test_twice_the_hidden_effect_is_twice_as_visible(tmp_path):
    logged = Logged(goals=2)
    log, model = tmp_path / "log.npz", tmp_path / "model.xml"
    columns = record(logged)
    np.savez(log, allow_pickle=False, **columns)
    model.write_bytes((files("jaxidl.systems") / "arm.xml").read_bytes())
    rows = truth(Hidden())
    seen = visible(rows, logged, log, model)
    assert set(seen) == set(rows)
    assert all(value > 0.0 for value in seen.values())
    again = visible(
        {key: 2.0 * size for key, size in rows.items() if key[0] != "actuator_delay"},
        logged,
        log,
        model,
    )
    for key, value in again.items():
        assert value == pytest.approx(2.0 * seen[key], rel=0.02)


@pytest.mark.parametrize(
    "words",
    [
        ["--noise", "-1"],
        ["--executions", "1"],
        ["--seeds", "x"],
        ["--experiments", "study", "dance"],
        ["--seeds", "1", "1"],
        ["--noise", "1e-5", "1e-5"],
        ["--seeds", "-1"],
    ],
    ids=" ".join,
)
def test_wrong_options_end_in_one_line(words, tmp_path, capsys):
    refusal(capsys, "arm", "--out", tmp_path / "out", *words)
    assert not (tmp_path / "out").exists()


def test_every_stored_quantity_has_a_unit():
    assert all(about.units and about.long_name for about in VARIABLES.values())


def test_experiments_are_gathered_in_one_file_and_others_settings_are_refused(tmp_path):
    one = ArmRun()
    _write(tmp_path, one, {"pick": {"rate": 2.0, "runs": None, "path_error": [np.nan]}})
    _write(tmp_path, one, {"limits": {"informed": []}})
    kept = json.loads((tmp_path / "arm.json").read_text())
    assert kept["pick"] == {"rate": 2.0, "path_error": [None]}
    assert set(kept["settings"]) == {"pick", "limits"}
    with pytest.raises(StoreError, match="others of pick"):
        run_all(quick(one), tmp_path, ("pick",), quiet=True)
    more = replace(one, task=replace(one.task, seeds=(1, 2, 3, 4)))
    assert more.settings()["pick"] == kept["settings"]["pick"]  # more seeds may join


def tiny() -> ArmRun:
    """All experiments but the gap workflow, in seconds."""
    grid = ArmGrid(
        noise=(1e-4, 1e-6),
        accelerations=("causal", "zero_phase"),
        sources=("direct",),
        seeds=(1,),
        executions=2,
    )
    task, laps = (
        replace(pick.PickAndPlace(), seeds=(1,), executions=2),
        replace(limits.Ambiguity(), seeds=(1,), executions=2),
    )
    return ArmRun(small(ArmStudy()), grid, task, laps, Logged(goals=2), 50)


@pytest.mark.slow
def test_a_whole_run_is_kept_piece_by_piece_and_drawn(tmp_path, monkeypatch):
    for part in (pick.PickAndPlace, limits.Ambiguity):
        whole = part.study
        monkeypatch.setattr(
            part,
            "study",
            lambda self, x, whole=whole: replace(small(whole(self, x)), seconds_each=0.2),
        )
    monkeypatch.setattr(pick, "LIFTED", -1.0)  # so short a motion lifts nothing
    monkeypatch.setattr(pick.PickAndPlace, "seconds_each", 0.2)
    run, experiments = tiny(), ("study", "pick", "limits")
    result = run_all(run, tmp_path, experiments, quiet=True)
    files = lambda: [*(tmp_path / "parts").glob("*.npz"), tmp_path / "study.nc"]
    made = {path.name: path.stat().st_mtime_ns for path in files()}
    assert len(made) == 3 + 2 + 1
    again = run_all(run, tmp_path, experiments, quiet=True)
    assert {path.name: path.stat().st_mtime_ns for path in files()} == made
    xr.testing.assert_equal(result["study"]["data"], again["study"]["data"])
    stored = xr.open_dataset(tmp_path / "arm.nc", engine="h5netcdf")
    # the nearest to a good encoder's, in whatever order they are
    assert float(stored["noise"]) == 1e-6
    assert stored["feedback_mse"].attrs["units"]
    kept = json.loads((tmp_path / "arm.json").read_text())
    assert set(experiments) <= set(kept)
    assert kept["pick"]["finite"] == {"joint": [[True, True]], "direct": [[True, True]]}
    monkeypatch.setattr(arm_report, "_films", lambda *_: [])
    drawn = {path.name for path in arm_report.write_arm_figures(run, result, tmp_path)}
    assert {
        f"arm_{name}.png" for name in ("feedback", "feedback_time", "model_error", "pick", "limits")
    } <= drawn
