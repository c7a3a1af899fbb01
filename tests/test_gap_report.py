"""What a diagnosis looks like: report.json, the page, figures, the terminal's table."""

import errno
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from xml.sax.saxutils import quoteattr

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from matplotlib.figure import Figure

from jaxidl.effects import CoulombFriction, OnJoint, Payload, PositionDependentFriction
from jaxidl.errors import StoreError
from jaxidl.gap import table as tables
from jaxidl.gap.diagnose import diagnose
from jaxidl.gap.diagnosis import Ambiguity, Diagnosis, Estimate, Finding, Gap, Row, Side, Traces
from jaxidl.gap.localise import Place
from jaxidl.gap.log import from_arrays
from jaxidl.plot import report
from jaxidl.plot.gap import FIGURES, draw
from jaxidl.plot.gap_common import broken
from jaxidl.plot.gap_traces import binned
from jaxidl.plot.page import page
from jaxidl.systems.mjcf import read_model

NASTY = '<b>"x"&'
PLAIN_FILES = {"model.xml", "effects.json", "report.html", "report.json"}


def chain(folder, names):
    """A model with a slide and, after it, hinges."""
    opened = ""
    for k, name in enumerate(names):
        kind = 'type="slide" axis="1 0 0"' if k == 0 else 'type="hinge" axis="0 1 0"'
        opened += f'<body pos="0 0 {0.2 * (k > 0)}"><joint name={quoteattr(name)} {kind}/>'
        opened += '<inertial pos="0 0 0.1" mass="2" diaginertia="0.1 0.1 0.1"/>'
    path = folder / "robot.xml"
    path.write_text(f"<mujoco><worldbody>{opened}{'</body>' * len(names)}</worldbody></mujoco>")
    return read_model(path)


def friction(joints, level=3.25):
    effect = OnJoint(CoulombFriction(jnp.array([level])), 0, joints)
    parameters = {"level": Estimate(level, "N", 0.125)}
    return Finding("coulomb_friction", 0, effect, "dry friction (joint 0)", parameters, 3.5, 0.5, 0.857, 0.013)


def made_up(folder, names=("slide", "hinge"), verdict="named", findings=None, rows=600, **others):
    """A diagnosis by hand; two runs, the second of which is kept aside."""
    model, joints = chain(folder, names), len(names)
    time = np.tile(np.arange(rows // 2) * 0.02, 2)
    rng = np.random.default_rng(1)
    q = np.sin(2.0 * time[:, None] + np.arange(joints)) + 0.01
    qd = 2.0 * np.cos(2.0 * time[:, None] + np.arange(joints))
    after = 0.1 * rng.standard_normal((rows, joints))
    before = after + 3.25 * np.sign(qd) * (np.arange(joints) == 0)
    aside = np.arange(rows) >= rows // 2
    findings = (friction(joints),) if findings is None else findings
    rms = lambda x: np.sqrt(np.mean(x[aside] ** 2, axis=0))  # noqa: E731
    side = lambda r, far: Side(rms(r).tolist(), (rms(r) / 10.0).tolist(), {h: [far * float(h)] * joints for h in ("0.1", "0.5")})  # noqa: E731
    gap = Gap(
        list(model.units), side(before, 0.3), side(after if findings else before, 0.01 if findings else 0.3), [0.05] * joints
    )
    first = tuple(
        Row(name, 0, gain, 0.02, name == "coulomb_friction") for name, gain in (("stiction", 0.9), ("coulomb_friction", 0.857))
    )
    last = tuple(Row("spring", j, 0.01 - 0.2 * j, 0.02, False) for j in range(joints))
    content = {
        "verdict": verdict,
        "summary": "The simulation lacks something.",
        "findings": findings,
        "ambiguous": (),
        "where": (Place(0, "reversal", 0.7, 0.1, f"{names[0]}: 70% of the residual's energy lies at reversals"),),
        "remaining": tuple(
            Place(j, "everywhere", 1.0, 1.0, f"{name}: the rest is spread evenly") for j, name in enumerate(names)
        ),
        "gap": gap,
        "rounds": (first, last) if findings else (last,),
        "network": ((0.01, 0.02),) * joints,
        "model": model,
        "traces": Traces(time, aside, q, qd, 10.0 * q, before, after, np.abs(qd) > 0.02),
        "band": 20.0,
        "notes": ("column <i> ignored",),
        "options": {"held_out": 0.3, "effects": ["coulomb_friction", "spring"], "min_gain": 0.05},
    }
    return Diagnosis(**content | others)


class Elements(HTMLParser):
    """Tags with attributes, and the text."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.text, self.open = [], "", []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in ("meta", "img", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def page_of(folder):
    text = (folder / "report.html").read_text(encoding="utf-8")
    elements = Elements(text)
    assert not elements.open, "every element is closed"
    names = [tag for tag, _ in elements.tags]
    assert "script" not in names
    assert "link" not in names
    assert "://" not in re.sub(r"base64,[^\"]*", "", text)
    for _, attributes in elements.tags:
        assert "href" not in attributes
        assert attributes.get("src", "data:image/png;base64,").startswith("data:image/png;base64,")
        assert not any(key.startswith("on") for key in attributes)
    return elements


def test_the_folder_is_as_the_contract_says(tmp_path):
    d = made_up(tmp_path)
    out = tmp_path / "deep" / "out"
    assert d.save(out) == out / "report.html"
    content = json.loads((out / "report.json").read_text(), parse_constant=pytest.fail)
    figures = [f"figures/{name}.png" for name in FIGURES]
    assert content["files"] == {"model": "model.xml", "effects": "effects.json", "report": "report.html", "figures": figures}
    assert content["verdict"] == "named"
    [effect] = content["effects"]
    assert (effect["effect"], effect["joint"], effect["gain"], effect["gain_stderr"]) == ("coulomb_friction", 0, 0.857, 0.013)
    assert effect["parameters"] == {"level": {"value": 3.25, "unit": "N", "stderr": 0.125}}
    assert {"sentence", "held_out_before", "held_out_after"} <= effect.keys()
    assert {"joint", "regime", "share", "sentence"} <= content["where"][0].keys()
    assert content["gap"]["unit"] == ["N", "Nm"]
    assert content["gap"]["before"].keys() == {"torque_rms", "torque_relative", "rollout_rms"} == content["gap"]["after"].keys()
    assert {str(p.relative_to(out)) for p in out.rglob("*") if p.is_file()} == PLAIN_FILES | set(figures)
    for name in figures:
        assert (out / name).read_bytes().startswith(b"\x89PNG")
        assert (out / name).stat().st_size > 5000
    patched = read_model(out / "model.xml")
    assert [(e.effect.name, float(e.effect.level[0])) for e in patched.plant.effects] == [("coulomb_friction", 3.25)]


def test_the_page_is_self_contained_escapes_and_has_the_numbers(tmp_path):
    d = made_up(tmp_path, names=(NASTY, "a$b$_{"))
    d.save(tmp_path / "out")
    elements = page_of(tmp_path / "out")
    assert "b" not in [tag for tag, _ in elements.tags]
    assert "i" not in [tag for tag, _ in elements.tags]
    assert NASTY in elements.text
    assert "column <i> ignored" in elements.text.lower()
    relative = d.gap.before.torque_relative[0], d.gap.after.torque_relative[0]
    for text in ("3.25 ± 0.12 N", "85.7 ± 1.3 %", *map(tables.percent, relative), "3.5 → 0.5 N", "50 % of them", "20 Hz"):
        assert text in elements.text
    assert sum(tag == "img" for tag, _ in elements.tags) == len(FIGURES)
    assert str(tmp_path / "out" / "model.xml") in elements.text
    fragment = d._repr_html_()
    assert "<img" not in fragment
    assert "<b>" not in fragment
    assert not Elements(fragment).open


def variants(folder):
    keys = (("coulomb_friction", 0), ("stiction", 0), ("payload", None))
    doubt = (Ambiguity(keys, "move at several constant speeds"),)
    yield made_up(folder, verdict="nothing_missing", findings=())
    yield made_up(folder, verdict="ambiguous", ambiguous=doubt)
    yield made_up(folder, verdict="unexplained", findings=(), network=((0.6, 0.05), (float("nan"), float("nan"))))
    yield made_up(folder, verdict="unexplained")


@pytest.mark.parametrize("number", range(4))
def test_every_verdict_has_its_page(tmp_path, number):
    d = list(variants(tmp_path))[number]
    d.save(tmp_path / "out")
    text = page_of(tmp_path / "out").text
    assert {"nothing_missing": "Nothing missing", "ambiguous": "Ambiguous", "unexplained": "Unexplained"}[d.verdict] in text
    assert ("parameters" in json.loads((tmp_path / "out" / "report.json").read_text())["files"]["figures"][-2]) == bool(
        d.findings
    )
    if d.ambiguous:
        assert "coulomb friction (slide) or stiction (slide) or payload" in text
        assert "move at several constant speeds" in text
    if d.verdict == "unexplained" and not d.findings:
        assert "60.0 ± 5.0 %" in text
        assert "something systematic is left" in text
    if not d.findings:
        assert read_model(tmp_path / "out" / "model.xml").plant.effects == ()


def test_seven_joints_with_a_table_and_a_payload(tmp_path):
    names = tuple(f"a_rather_long_name_of_joint_{k}" for k in range(7))
    values = np.linspace(0.5, 2.0, 9)
    one = PositionDependentFriction(jnp.array([values]), jnp.zeros((1, 9)), jnp.array([-1.0]), jnp.array([1.0]))
    uneven = Finding(
        "position_dependent_friction", 5, OnJoint(one, 5, 7), "friction that varies with position",
        {"level": Estimate(values.tolist(), "Nm", (0.1 * values).tolist())}, 2.0, 1.0, 0.5, 0.1,
    )  # fmt: skip
    load = Finding(
        "payload", None, Payload(mass=jnp.array(1.5), com=jnp.array([0.0, 0.1, 0.2])), "a load",
        {"mass": Estimate(1.5, "kg", 0.1), "com": Estimate([0.0, 0.1, 0.2], "m", [0.01, 0.02, 0.03])}, 2.0, 1.0, 0.5, 0.1,
    )  # fmt: skip
    d = made_up(tmp_path, names=names, findings=(friction(7), uneven, load))
    d.save(tmp_path / "out")
    text = page_of(tmp_path / "out").text
    assert all(name in text for name in names)
    assert "0.5 to 2 Nm" in text
    assert "(0 ± 0.01, 0.1 ± 0.02, 0.2 ± 0.03) m" in text
    assert "4 of 7 joints" in d.plot_residual().get_suptitle()
    shown = [axes.get_ylabel() for axes in d.plot_where().axes if axes.get_ylabel()]
    assert any("joint_5"[-3:] in label or "a_rather_long" in label for label in shown)
    assert len(shown) == 4
    assert max(len(line) for line in tables.as_table(d).splitlines()) <= tables.COLUMNS


def test_logs_that_have_little_in_them_still_draw(tmp_path):
    d = made_up(tmp_path, rows=40)
    nothing = d.traces._replace(
        before=0.0 * d.traces.before, after=0.0 * d.traces.after, command=0.0 * d.traces.command, counted=d.traces.counted & False
    )
    side = Side([0.0, 0.0], [float("nan"), 1e299], {"0.1": [float("nan")] * 2})
    empty = replace(d, traces=nothing, gap=Gap(["N", "Nm"], side, side, [0.0, 0.0]), rounds=())
    assert draw(empty).keys() == FIGURES.keys()
    assert "the torque error" in page(empty, {}, (), tmp_path)
    assert "nan" not in tables.as_table(empty)
    empty.save(tmp_path / "out")
    page_of(tmp_path / "out")


def test_methods_return_figures(tmp_path):
    d = made_up(tmp_path)
    for name in FIGURES:
        assert isinstance(getattr(d, f"plot_{name}")(), Figure)
    assert replace(d, findings=()).plot_parameters() is None


@pytest.fixture
def unpainted(monkeypatch):
    """Files of the right names instead of figures: for tests of where things go."""
    monkeypatch.setattr(report, "draw", lambda d: {name: b"PNG" for name in FIGURES if d.findings or name != "parameters"})


@pytest.mark.usefixtures("unpainted")
def test_nothing_is_left_behind_where_nothing_can_be_written(tmp_path, monkeypatch):
    d = made_up(tmp_path)
    file = tmp_path / "file"
    file.write_text("mine")
    for place in (file, file / "below", tmp_path / ("x" * 300)):
        with pytest.raises(StoreError, match=r"^expected [^\n]+; got [^\n]+; [^\n]+$"):
            d.save(place)
    assert file.read_text() == "mine"
    assert {p.name for p in tmp_path.iterdir()} == {"file", "robot.xml"}

    def full(source, target, moved=[]):  # noqa: B006
        moved.append(target)
        if len(moved) > 3:
            raise OSError(errno.ENOSPC, "No space left on device")
        return move(source, target)

    move = report.os.replace
    monkeypatch.setattr(report.os, "replace", full)
    with pytest.raises(StoreError, match="no space left"):
        d.save(tmp_path / "a" / "b")
    assert {p.name for p in tmp_path.iterdir()} == {"file", "robot.xml"}


@pytest.mark.usefixtures("unpainted")
def test_what_others_have_in_the_folder_stays(tmp_path):
    d = made_up(tmp_path)
    out = tmp_path / "out"
    (out / "figures").mkdir(parents=True)
    (out / "log.csv").write_text("time")
    (out / "figures" / "mine.png").write_text("mine")
    d.save(out)
    assert (out / "figures" / "parameters.png").exists()
    replace(d, findings=(), verdict="nothing_missing").save(out)  # over our own report
    assert not (out / "figures" / "parameters.png").exists()
    assert (out / "figures" / "mine.png").read_text() == "mine"
    assert (out / "log.csv").read_text() == "time"
    (out / "report.json").write_text("{}")
    before = (out / "model.xml").read_text()
    with pytest.raises(StoreError, match=r"model\.xml and effects\.json and report\.html"):
        d.save(out)
    assert (out / "model.xml").read_text() == before


@pytest.mark.usefixtures("unpainted")
def test_the_model_itself_is_not_written_over(tmp_path):
    d = made_up(tmp_path)
    d.save(tmp_path / "out")
    again = replace(d, model=read_model(tmp_path / "out" / "model.xml"), findings=())
    with pytest.raises(StoreError, match="another folder than the model's own"):
        again.save(tmp_path / "out")
    again.save(tmp_path / "second")
    assert len(read_model(tmp_path / "second" / "model.xml").plant.effects) == 1


def test_the_same_diagnosis_gives_the_same_files(tmp_path):
    d = made_up(tmp_path)
    d.save(tmp_path / "out")
    first = {p: p.read_bytes() for p in (tmp_path / "out").rglob("*") if p.is_file()}
    d.save(tmp_path / "out")
    assert {p: p.read_bytes() for p in (tmp_path / "out").rglob("*") if p.is_file()} == first


def test_the_table_says_what_was_found(tmp_path):
    *_, doubt, _, _ = variants(tmp_path)
    text = tables.as_table(doubt)
    assert text.startswith("ambiguous: 1 effect missing")
    assert "coulomb friction (slide)  3.5 → 0.5 N     85.7 ± 1.3 %" in text
    assert "    level 3.25 ± 0.12 N" in text
    assert "not told apart: coulomb friction (slide) or stiction (slide) or payload" in text
    assert tables.as_table(made_up(tmp_path, verdict="nothing_missing", findings=())).startswith("nothing missing: no effect")
    assert [tables.percent(x) for x in (1.234, 0.0999, 0.0123, -1e-9, float("nan"), 1e300)] == [
        "123 %", "10 %", "1.2 %", "0 %", "-", "-",
    ]  # fmt: skip


def test_curves_break_at_gaps_and_bins_do_not_reach_across_zero():
    time, values = broken(np.arange(6.0), np.arange(6.0), np.array([0, 3]))
    assert len(time) == 7
    assert np.isnan(values[3])
    time, values = broken(np.arange(1e5), np.where(np.arange(1e5) == 77777, 9.0, 0.0), np.array([0]))
    assert len(time) < 7000
    assert np.max(values) == 9.0
    x = np.linspace(-1.0, 2.0, 4001)
    centre, mean, spread = binned(x, np.sign(x))
    assert set(np.round(mean[np.abs(centre) > 0.01])) == {-1.0, 1.0}
    assert np.max(spread[centre > 0.0]) == 0.0


def test_a_measured_log_from_end_to_end(tmp_path):
    model = chain(tmp_path, ("slide",))
    dt, steps = 1e-3, 8000
    time = np.arange(steps) * dt
    wanted = 0.3 * np.sin(2.0 * np.pi * 0.7 * time) + 0.1 * np.sin(2.0 * np.pi * 1.9 * time)
    qd = np.gradient(wanted, dt)
    qdd = np.gradient(qd, dt)
    tau = 2.0 * qdd + 3.0 * qd + 1.5 * np.tanh(qd / 1e-3)
    noise = 1e-6 * np.random.default_rng(0).standard_normal(steps)
    with jax.numpy_rank_promotion("allow"):  # MuJoCo's own code is not as strict as this suite
        d = diagnose(from_arrays(time, wanted + noise, tau), model, effects=["viscous_friction", "coulomb_friction", "spring"])
    assert d.verdict == "named"
    assert {f.name for f in d.findings} == {"viscous_friction", "coulomb_friction"}
    d.save(tmp_path / "out")
    assert "coulomb friction" in page_of(tmp_path / "out").text
    found = read_model(tmp_path / "out" / "model.xml").plant.effects
    assert float(found[0].effect.coefficient[0]) == pytest.approx(3.0, rel=0.05)
    assert float(found[1].effect.level[0]) == pytest.approx(1.5, rel=0.05)
