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

from jaxidl import report
from jaxidl.effects import (
    CATALOGUE,
    ActuatorLag,
    CoulombFriction,
    InertiaError,
    OnJoint,
    Payload,
    PositionDependentFriction,
    TorqueScale,
    ViscousFriction,
)
from jaxidl.errors import StoreError
from jaxidl.gap.evidence.localise import Place
from jaxidl.gap.fit.refine import Refinement
from jaxidl.gap.result.diagnosis import (
    Ambiguity,
    Diagnosis,
    Envelope,
    Estimate,
    Finding,
    Gap,
    Row,
    Side,
    Traces,
)
from jaxidl.gap.result.words import number, percent, plus_minus
from jaxidl.gap.workflow import diagnose
from jaxidl.logs.log import from_arrays
from jaxidl.logs.signals import prepare
from jaxidl.report import FIGURES, draw, folder, page, save, table
from jaxidl.report.common import broken
from jaxidl.report.matrix import spelled
from jaxidl.report.terminal import COLUMNS
from jaxidl.report.traces import binned
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


def finding(name, joint, effect, parameters, confidence=0.97, share=0.4, gain=0.857, where=0):
    """One of those that a search hands out."""
    return Finding(
        name,
        joint,
        effect,
        f"{CATALOGUE[name].sentence} (there)",
        parameters,
        confidence,
        100.0,
        share,
        where,
        3.5,
        0.5,
        gain,
        0.013,
    )


def friction(joints, level=3.25, joint=0, confidence=0.97, gain=0.857):
    effect = OnJoint(CoulombFriction(jnp.array([level])), joint, joints)
    unit = "N" if joint == 0 else "Nm"
    return finding(
        "coulomb_friction",
        joint,
        effect,
        {"level": Estimate(level, unit, 0.125)},
        confidence,
        gain=gain,
        where=joint,
    )


def viscous(joints, joint, level=1.5, confidence=0.97, gain=0.3):
    effect = OnJoint(ViscousFriction(jnp.array([level])), joint, joints)
    parameters = {"coefficient": Estimate(level, "Nm s/rad", 0.02)}
    return finding(
        "viscous_friction", joint, effect, parameters, confidence, gain=gain, where=joint
    )


def inertia(joints, joint, confidence=0.97):
    effect = OnJoint(InertiaError(jnp.array([0.25]), jnp.array([-1.0])), joint, joints)
    parameters = {"extra": Estimate(0.25, "kg m^2", 0.0125), "mass": Estimate(-1.0, "kg", 0.05)}
    return finding("inertia_error", joint, effect, parameters, confidence, gain=0.1, where=joint)


def load(confidence=0.97):
    effect = Payload(mass=jnp.array(1.5), com=jnp.array([0.0, 0.1, 0.2]))
    parameters = {
        "mass": Estimate(1.5, "kg", 0.1),
        "com": Estimate([0.0, 0.1, 0.2], "m", [0.01, 0.02, 0.03]),
    }
    return finding("payload", None, effect, parameters, confidence, where=1)


def made_up(
    folder,
    names=("slide", "hinge"),
    verdict="named",
    findings=None,
    rows=600,
    silent=(),
    still=(),
    **others,
):
    """A diagnosis by hand of two runs, the second kept aside. Joints in ``silent`` have no command,
    those in ``still`` rest.
    """
    model, joints = chain(folder, names), len(names)
    time = np.tile(np.arange(rows // 2) * 0.02, 2)
    rng = np.random.default_rng(1)
    moves, driven = (np.array([j not in group for j in range(joints)]) for group in (still, silent))
    q = np.sin(2.0 * time[:, None] + np.arange(joints)) * moves + 0.01
    qd = 2.0 * np.cos(2.0 * time[:, None] + np.arange(joints)) * moves
    after = 0.1 * rng.standard_normal((rows, joints))
    before = after + 3.25 * np.sign(qd) * (np.arange(joints) == 0)
    aside = np.arange(rows) >= rows // 2
    findings = (friction(joints),) if findings is None else findings
    judged = moves & driven
    rms = lambda x: np.sqrt(np.mean(x[aside] ** 2, axis=0))
    share = lambda r: np.where(judged, rms(r) / 10.0, np.nan).tolist()
    side = lambda r, far: Side(
        rms(r).tolist(), share(r), {h: [far * float(h)] * joints for h in ("0.1", "0.5")}
    )
    gap = Gap(
        list(model.units),
        side(before, 0.3),
        side(after if findings else before, 0.01 if findings else 0.3),
        [0.05] * joints,
    )
    content = {
        "verdict": verdict,
        "findings": findings,
        "ambiguous": (),
        "where": (
            Place(
                0,
                "reversal",
                0.7,
                0.1,
                f"{names[0]}: 70% of the residual's energy lies at reversals",
            ),
        ),
        "remaining": tuple(
            Place(j, "everywhere", 1.0, 1.0, f"{name}: the rest is spread evenly")
            for j, name in enumerate(names)
        ),
        "gap": gap,
        "envelope": Envelope([0.123] * joints, [0.0456] * joints),
        "unexplained": (),
        "rivals": (
            Row("stiction", 0, 0.0, "its standard error does not exclude zero"),
            Row("base_tilt", None, 3.0, "no"),
        ),
        "network": ((0.01, 0.02),) * joints,
        "model": model,
        "traces": Traces(
            time, aside, q, qd, 10.0 * q * driven, before, after, (np.abs(qd) > 0.02) & moves
        ),
        "band": 20.0,
        "notes": ("column <i> ignored",),
        "options": {
            "held_out": 0.3,
            "effects": ["coulomb_friction", "spring"],
            "min_gain": 0.05,
            "reference": False,
        },
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
        if tag not in ("meta", "img", "br", "wbr"):
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
    assert save(d, str(out)) == out / "report.html"
    content = json.loads((out / "report.json").read_text(), parse_constant=pytest.fail)
    figures = [f"figures/{name}.png" for name in FIGURES]
    assert content["files"] == {
        "model": "model.xml",
        "effects": "effects.json",
        "report": "report.html",
        "figures": figures,
    }
    assert content["verdict"] == "named"
    [effect] = content["effects"]
    assert (effect["effect"], effect["joint"], effect["gain"], effect["gain_stderr"]) == (
        "coulomb_friction",
        0,
        0.857,
        0.013,
    )
    assert (effect["joint_name"], effect["confidence"], effect["share"]) == ("slide", 0.97, 0.4)
    assert effect["parameters"] == {"level": {"value": 3.25, "unit": "N", "stderr": 0.125}}
    assert {"sentence", "held_out_before", "held_out_after", "evidence"} <= effect.keys()
    assert {"joint", "regime", "share", "sentence"} <= content["where"][0].keys()
    assert content["gap"]["unit"] == ["N", "Nm"]
    assert (
        content["gap"]["before"].keys()
        == {"torque_rms", "torque_relative", "rollout_rms"}
        == content["gap"]["after"].keys()
    )
    assert content["envelope"]["torque_relative"] == [0.0456, 0.0456]
    assert {str(p.relative_to(out)) for p in out.rglob("*") if p.is_file()} == PLAIN_FILES | set(
        figures
    )
    for name in figures:
        assert (out / name).read_bytes().startswith(b"\x89PNG")
        assert (out / name).stat().st_size > 5000
    patched = read_model(out / "model.xml")
    assert [(e.effect.name, float(e.effect.level[0])) for e in patched.plant.effects] == [
        ("coulomb_friction", 3.25)
    ]


def test_units_in_the_record_are_those_of_the_joint(tmp_path):
    """The joints are a slide and a hinge."""
    level = CoulombFriction(jnp.array([0.5]))
    both = CoulombFriction(jnp.array([0.5, 0.25]))
    d = made_up(tmp_path, common=(OnJoint(level, 0, 2), OnJoint(level, 1, 2), both))
    save(replace(d, findings=()), tmp_path / "out")
    record = json.loads((tmp_path / "out" / "effects.json").read_text())["effects"]
    assert [e["parameters"]["level"]["unit"] for e in record] == ["N", "Nm", "N or Nm"]


def test_the_page_says_from_which_files_it_is(tmp_path):
    d = made_up(tmp_path)
    files = {"log": ["runs/today.csv"], "reference_log": ["january.csv"], "version": "9.8.7"}
    d = replace(d, options=d.options | files | {"model": "robots/arm.xml"})
    text = Elements(page(d, {}, (), tmp_path)).text
    for words in (
        "Log: today.csv; reference: january.csv; 2 joints: ",
        "Log: runs/today.csv.",
        "Reference log: january.csv.",
        "Model: robots/arm.xml.",
        "Made by jaxidl 9.8.7.",
    ):
        assert words in text


def test_the_page_is_self_contained_escapes_and_has_the_numbers(tmp_path):
    d = made_up(tmp_path, names=(NASTY, "a$b$_{"))
    save(d, tmp_path / "out")
    elements = page_of(tmp_path / "out")
    assert "b" not in [tag for tag, _ in elements.tags]
    assert "i" not in [tag for tag, _ in elements.tags]
    assert NASTY in elements.text
    assert "column <i> ignored" in elements.text.lower()
    relative = d.gap.before.torque_relative[0], d.gap.after.torque_relative[0]
    words = (
        "3.25\xa0±\xa00.12",
        "97 %",
        "85.7 ± 1.3 %",
        *map(percent, relative),
        "3.5 → 0.5 N",
        "50 % of them",
        "20 Hz",
    )
    for text in (
        *words,
        "0.123 N = 4.6 %",
        "The simulation lacks 1 effect.",
        "its standard error does not exclude zero",
    ):
        assert text in elements.text
    assert sum(tag == "img" for tag, _ in elements.tags) == len(FIGURES)
    assert str(tmp_path / "out" / "model.xml") in elements.text
    fragment = report.fragment(d)
    assert "<img" not in fragment
    assert "<b>" not in fragment
    assert not Elements(fragment).open


def variants(folder):
    keys = (("coulomb_friction", 0), ("stiction", 0), ("payload", None))
    doubt = (Ambiguity(keys, "move at several constant speeds"),)
    yield made_up(folder, verdict="nothing_missing", findings=())
    yield made_up(
        folder, verdict="ambiguous", findings=(friction(2, confidence=0.6),), ambiguous=doubt
    )
    nan = float("nan")
    yield made_up(
        folder,
        verdict="unexplained",
        findings=(),
        network=((0.6, 0.05), (nan, nan)),
        unexplained=(0,),
    )
    yield made_up(folder, verdict="unexplained", unexplained=(1,))


@pytest.mark.usefixtures("unpainted")
@pytest.mark.parametrize("number", range(4))
def test_every_verdict_has_its_page(tmp_path, number):
    d = list(variants(tmp_path))[number]
    save(d, tmp_path / "out")
    text = page_of(tmp_path / "out").text
    assert {
        "nothing_missing": "Nothing missing",
        "ambiguous": "Ambiguous",
        "unexplained": "Unexplained",
    }[d.verdict] in text
    files = json.loads((tmp_path / "out" / "report.json").read_text())["files"]["figures"]
    assert ("figures/parameters.png" in files) == bool(d.findings)
    for shown in (text, table(d)):
        assert ("Coulomb friction (slide) and stiction (slide) and payload" in shown) == bool(
            d.ambiguous
        )
        assert ("move at several constant speeds" in shown) == bool(d.ambiguous)
        assert "nan" not in shown.lower()
    if d.verdict == "unexplained" and not d.findings:
        assert "60.0 ± 5.0 % of it: a systematic part remains" in text
        assert "Part of the residual on slide stays unexplained" in text
        assert "Nothing is named." in text
    if d.verdict == "unexplained" and d.findings:
        assert "Part of the residual on hinge stays unexplained" in text
        assert "The simulation lacks 1 effect, named below." in text
        assert "Named nevertheless: Coulomb friction (slide)." in text
        assert "The effect named above still holds." in table(d)
    if not d.findings:
        assert "lacks" not in text
        assert read_model(tmp_path / "out" / "model.xml").plant.effects == ()


def rows_of(text):
    """Cells of the first table, as texts, joint by joint."""
    body = re.search(r"<table class=\"kinds\">.*?<tbody>(.*?)</tbody>", text, re.DOTALL).group(1)
    rows = [
        re.findall(r"<td>(.*?)</td>", row, re.DOTALL)
        for row in re.findall(r"<tr>(.*?)</tr>", body, re.DOTALL)
    ]
    return {
        re.sub("<.*?>", "", row[0]): [
            re.sub("<.*?>", " ", cell).replace("\xa0", " ").split() for cell in row[1:]
        ]
        for row in rows
    }


def test_the_first_table_has_joints_and_kinds(tmp_path):
    """Values stand in the column of their kind, with their confidence; suspicions in grey and in
    parentheses.
    """
    names = ("base", "shoulder_joint", "elbow_joint")
    found = (
        friction(3),
        viscous(3, 1),
        inertia(3, 1),
        friction(3, 0.75, 2, confidence=0.5),
        load(),
    )
    d = made_up(tmp_path, names=names, findings=found)
    text = page(d, {}, (), tmp_path)
    rows = rows_of(text)
    assert tuple(rows) == names
    # kinds of which there is none have no column
    assert rows["base"] == [[], ["3.25", "±", "0.12", "N", "97", "%"], [], []]
    one, dry, rotor, link = rows["shoulder_joint"]
    assert (" ".join(one), " ".join(rotor), dry) == (
        "1.500 ± 0.020 97 %",
        "0.250 ± 0.013 97 %",
        [],
    )
    assert " ".join(link) == "mass -1.000 ± 0.050 kg 97 %"
    assert " ".join(rows["elbow_joint"][1]) == "(0.75 ± 0.12 Nm 50 % )"
    assert text.count('class="doubt"') == 2  # there, and in the list of what each is worth
    words = Elements(text).text.replace("\xa0", " ")
    assert "x 0.000 ± 0.010, y 0.100 ± 0.020, z 0.200 ± 0.030 m" in words
    (place,) = {d.frame(f) for f in d.findings if f.name == "payload"}
    assert f"in the frame of {place}" in words
    assert place
    # a joint's friction is in no body's frame, and neither is what no length belongs to
    assert {d.frame(f) for f in d.findings if f.name != "payload"} == {None}
    assert d.frame(replace(d.findings[0], name="base_tilt", joint=None)) is None
    shown = " ".join(table(d).split())
    assert "(0.75 ± 0.12 Nm" in shown
    assert "mass 1.50 ± 0.10 kg" in shown
    assert f"in the frame of {place}" in shown
    assert "shoulder_joint, mass: -1.000 ± 0.050 kg" in shown
    assert "viscous friction" in shown


def test_a_column_points_to_the_effect_that_contains_its_own(tmp_path):
    """Friction that varies with position has dry friction in it: the joint is not one without."""
    values = np.linspace(0.5, 2.0, 9)
    one = PositionDependentFriction(
        jnp.array([values]), jnp.zeros((1, 9)), jnp.array([-1.0]), jnp.array([1.0])
    )
    parameters = {"level": Estimate(values.tolist(), "Nm", (0.1 * values).tolist())}
    uneven = finding("position_dependent_friction", 1, OnJoint(one, 1, 2), parameters, where=1)
    d = made_up(tmp_path, findings=(uneven,))
    cells = [" ".join(cell) for cell in rows_of(page(d, {}, (), tmp_path))["hinge"]]
    assert cells[0] == "see other"
    assert cells[1].startswith("position dependent friction 0.5 to 2 Nm, each ± 0.12")
    assert report.plot_parameters(d) is not None


def test_the_first_table_is_no_wider_than_a_line_and_nothing_is_cut(tmp_path):
    names = ("a_rather_long_name_of_joint_0", "joint_1")

    def of(name, **values):
        cls = CATALOGUE[name]
        filled = {n: jnp.array([values.get(n, 0.1)]) for n in cls.parameters}
        if "moment" in filled:
            filled["moment"] = jnp.full((1, 3), 0.1)
        given = {n: Estimate(-0.1234, "Nm", 0.0123) for n in cls.parameters}
        return finding(name, 1, OnJoint(cls(**filled), 1, 2), given)

    kinds = ("com_error", "constant_offset", "directional_load_friction", "sublinear_friction")
    found = (viscous(2, 1), friction(2, joint=1), inertia(2, 1), *map(of, kinds))
    text = table(made_up(tmp_path, names=names, findings=found))
    first = text[: text.index("In numbers")]
    assert max(map(len, first.splitlines())) <= COLUMNS
    for word in ("directional", "sublinear", "viscous", "rotor", "offset", "moment"):
        assert re.search(rf"\b{word}\b", first)


@pytest.mark.slow
def test_thirty_findings_on_seven_joints_fit_table_page_and_figures(tmp_path):
    names = tuple(f"a_rather_long_name_of_joint_{k}" for k in range(7))
    many = [make(7, j) for make in (viscous, inertia) for j in range(1, 7)] + [
        friction(7, 1.0 + j, j, 0.5) for j in range(7)
    ]
    uneven = [friction(7, 9.0 + j, j, 0.2, gain=0.02 * j) for j in range(7)]
    found = (*many, *uneven, load(), friction(7), viscous(7, 3), viscous(7, 4))
    assert len(found) == 30
    d = made_up(tmp_path, names=names, findings=found)
    text = table(d)
    assert max(len(line) for line in text.splitlines()) <= COLUMNS
    assert text.startswith("Found. The simulation lacks 16 effects. 14 more are suspected.")
    squeezed = re.sub(r"\s", "", text)
    words = Elements(page(d, draw(d), (), tmp_path)).text
    for name in names:
        assert name in words
        assert name[-20:] in squeezed or name[:20] in squeezed
    # all seven are shown
    assert report.plot_residual(d).get_suptitle() == "What the model does not explain"
    assert len([axes for axes in report.plot_where(d).axes if axes.get_ylabel()]) == 7
    bars = [t.get_text() for t in report.plot_improvement(d).axes[0].get_yticklabels()]
    assert len(bars) == 30
    assert bars[0].startswith(("Coulomb friction", "payload"))
    patches = report.plot_improvement(d).axes[0].patches
    assert sum(p.get_facecolor()[:3] != (1.0, 1.0, 1.0) for p in patches) == sum(
        f.sure for f in d.findings
    )
    gains = [p.get_width() for p in patches]
    assert gains == sorted(gains, reverse=True)


@pytest.mark.parametrize(
    ("group", "sentence"),
    [("silent", "no torque was commanded"), ("still", "the joint hardly moved")],
    ids=["passive", "at rest"],
)
def test_a_joint_that_the_log_says_nothing_of_gets_one_sentence(tmp_path, group, sentence):
    d = made_up(tmp_path, names=("slide", "idle"), **{group: (1,)})
    for text in (table(d), Elements(page(d, draw(d), (), tmp_path)).text):
        assert text.count(f"idle: {sentence}, so this log cannot show what is missing there.") == 1
        assert "nan" not in text.lower()
    rows = [line for line in table(d).splitlines() if line.startswith("idle") and "%" in line]
    assert not rows


def test_with_a_reference_findings_are_changes(tmp_path):
    options = {"held_out": 0.3, "effects": ["payload"], "min_gain": 0.05, "reference": True}
    common = (OnJoint(CoulombFriction(jnp.array([0.5])), 1, 2),)
    d = made_up(tmp_path, findings=(load(),), options=options, common=common)
    same = replace(d, findings=(), verdict="nothing_missing")
    for diagnosis in (d, same):
        page_text = Elements(page(diagnosis, {}, (), tmp_path)).text
        for text in (table(diagnosis), page_text, diagnosis.summary):
            assert "since the reference log" in text
            assert not re.search(
                r"simulation lacks|is missing|Missing", text.replace("what is missing there", "")
            )
    assert "1 effect has changed since the reference log." in d.summary
    save(d, tmp_path / "out")
    assert (
        sorted(
            e.to_dict()["effect"] for e in read_model(tmp_path / "out" / "model.xml").plant.effects
        )[0]
        == "coulomb_friction"
    )


def test_logs_that_have_little_in_them_still_draw(tmp_path):
    d = made_up(tmp_path, rows=40)
    nothing = d.traces._replace(
        before=0.0 * d.traces.before,
        after=0.0 * d.traces.after,
        command=0.0 * d.traces.command,
        counted=d.traces.counted & False,
    )
    side = Side([0.0, 0.0], [float("nan"), 1e299], {"0.1": [float("nan")] * 2})
    empty = replace(d, traces=nothing, gap=Gap(["N", "Nm"], side, side, [0.0, 0.0]), rivals=())
    assert draw(empty).keys() == FIGURES.keys()
    assert "nan" not in table(empty)
    save(empty, tmp_path / "out")
    page_of(tmp_path / "out")


def test_every_figure_is_a_function_of_a_diagnosis(tmp_path):
    d = made_up(tmp_path)
    for name in FIGURES:
        assert isinstance(getattr(report, f"plot_{name}")(d), Figure)
    assert report.plot_parameters(replace(d, findings=())) is None
    assert report.plot_improvement(replace(d, findings=())) is None


@pytest.fixture
def unpainted(monkeypatch):
    """Files of the right names instead of figures: for tests of where things go."""
    needed = ("parameters", "improvement")
    monkeypatch.setattr(
        folder,
        "draw",
        lambda d: {name: b"PNG" for name in FIGURES if d.findings or name not in needed},
    )


@pytest.mark.usefixtures("unpainted")
def test_nothing_is_left_behind_where_nothing_can_be_written(tmp_path, monkeypatch):
    d = made_up(tmp_path)
    file = tmp_path / "file"
    file.write_text("mine")
    for place in (file, file / "below", tmp_path / ("x" * 300)):
        with pytest.raises(StoreError, match=r"^expected [^\n]+; got [^\n]+; [^\n]+$"):
            save(d, place)
    assert file.read_text() == "mine"
    assert {p.name for p in tmp_path.iterdir()} == {"file", "robot.xml"}

    def full(source, target, moved=[]):  # noqa: B006
        moved.append(target)
        if len(moved) > 3:
            raise OSError(errno.ENOSPC, "No space left on device")
        return move(source, target)

    move = folder.os.replace
    monkeypatch.setattr(folder.os, "replace", full)
    with pytest.raises(StoreError, match="no space left"):
        save(d, tmp_path / "a" / "b")
    assert {p.name for p in tmp_path.iterdir()} == {"file", "robot.xml"}


@pytest.mark.usefixtures("unpainted")
def test_what_others_have_in_the_folder_stays(tmp_path):
    d = made_up(tmp_path)
    out = tmp_path / "out"
    (out / "figures").mkdir(parents=True)
    (out / "log.csv").write_text("time")
    (out / "figures" / "mine.png").write_text("mine")
    save(d, out)
    assert (out / "figures" / "parameters.png").exists()
    save(replace(d, findings=(), verdict="nothing_missing"), out)  # over our own report
    assert not (out / "figures" / "parameters.png").exists()
    assert (out / "figures" / "mine.png").read_text() == "mine"
    assert (out / "log.csv").read_text() == "time"
    (out / "report.json").write_text("{}")
    before = (out / "model.xml").read_text()
    with pytest.raises(StoreError, match=r"model\.xml and effects\.json and report\.html"):
        save(d, out)
    assert (out / "model.xml").read_text() == before


@pytest.mark.usefixtures("unpainted")
def test_the_model_itself_is_not_written_over(tmp_path):
    d = made_up(tmp_path)
    save(d, tmp_path / "out")
    again = replace(d, model=read_model(tmp_path / "out" / "model.xml"), findings=())
    with pytest.raises(StoreError, match="a folder other than the model's own"):
        save(again, tmp_path / "out")
    save(again, tmp_path / "second")
    assert len(read_model(tmp_path / "second" / "model.xml").plant.effects) == 1


@pytest.mark.usefixtures("unpainted")
@pytest.mark.parametrize("after", ["gone", "changed"])
def test_a_diagnosis_is_saved_without_its_model_file(tmp_path, after):
    d = made_up(tmp_path)
    save(d, tmp_path / "one")
    if after == "gone":
        d.model.path.unlink()
    else:
        d.model.path.write_text(d.model.path.read_text().replace('mass="2"', 'mass="7"'))
    save(d, tmp_path / "two")
    assert (tmp_path / "two" / "model.xml").read_text() == (
        tmp_path / "one" / "model.xml"
    ).read_text()


@pytest.mark.slow
def test_the_same_diagnosis_gives_the_same_files(tmp_path):
    d = made_up(tmp_path)
    save(d, tmp_path / "out")
    first = {p: p.read_bytes() for p in (tmp_path / "out").rglob("*") if p.is_file()}
    save(d, tmp_path / "out")
    assert {p: p.read_bytes() for p in (tmp_path / "out").rglob("*") if p.is_file()} == first


def test_numbers_are_as_a_person_writes_them():
    assert [percent(x) for x in (1.234, 0.0999, 0.0123, -1e-9, float("nan"), 1e300)] == [
        "123 %",
        "10 %",
        "1.2 %",
        "0 %",
        "-",
        "-",
    ]
    assert plus_minus(21.5229, 0.3449) == "21.52 ± 0.34"
    assert plus_minus(1234.0, 99.7) == "1234 ± 100"
    assert plus_minus(-0.0001, 0.02) == "0.000 ± 0.020"
    assert plus_minus(3.0, 0.0) == "3"
    assert plus_minus(3.0, float("nan")) == "3"
    assert plus_minus(2.5e-7, 1e-8) == "2.5e-07 ± 1e-08"
    assert number(Estimate(0.5, "kg m^2", 0.01)) == "0.500 ± 0.010 kg m²"
    assert number(Estimate(0.5, "1", 0.01)) == "0.500 ± 0.010"
    assert spelled(Estimate([1.0] * 3, "kg m", [0.1] * 3)).startswith("x 1.00 ± 0.10, y 1.00")
    for count in (3, 6):  # levels of friction over position are no tensor
        assert "x" not in spelled(Estimate([1.0] * count, "N", [0.1] * count))


def test_curves_break_at_gaps_and_bins_do_not_reach_across_zero():
    time, values = broken(np.arange(6.0), np.arange(6.0), np.array([0, 3]))
    assert len(time) == 7
    assert np.isnan(values[3])
    time, values = broken(
        np.arange(1e5), np.where(np.arange(1e5) == 77777, 9.0, 0.0), np.array([0])
    )
    assert len(time) < 7000
    assert np.max(values) == 9.0
    x = np.linspace(-1.0, 2.0, 4001)
    centre, mean, spread = binned(x, np.sign(x))
    assert set(np.round(mean[np.abs(centre) > 0.01])) == {-1.0, 1.0}
    assert np.max(spread[centre > 0.0]) == 0.0


@pytest.mark.slow
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
        d = diagnose(
            from_arrays(time, wanted + noise, tau),
            model,
            effects=["viscous_friction", "coulomb_friction", "spring"],
        )
    assert d.verdict == "named"
    assert {f.name for f in d.findings} == {"viscous_friction", "coulomb_friction"}
    save(d, tmp_path / "out")
    assert "coulomb friction" in page_of(tmp_path / "out").text.lower()
    found = read_model(tmp_path / "out" / "model.xml").plant.effects
    assert float(found[0].effect.coefficient[0]) == pytest.approx(3.0, rel=0.05)
    assert float(found[1].effect.level[0]) == pytest.approx(1.5, rel=0.05)


def test_a_command_passes_the_effects_in_the_catalogues_order(tmp_path, monkeypatch):
    """In the model handed out and in a fit to motion; the findings keep their own order."""
    lag = OnJoint(ActuatorLag(jnp.array([0.02])), 0, 2)
    scale = OnJoint(TorqueScale(jnp.array([1.2])), 0, 2)
    one = lambda name, effect, parameter, value: replace(
        finding(name, 0, effect, {parameter: Estimate(value, "1", 0.01)}),
        bounds={parameter: (0.0, 2.0)},
    )
    findings = (
        one("torque_scale", scale, "scale", 1.2),
        one("actuator_lag", lag, "time_constant", 0.02),
    )
    t = 0.01 * np.arange(400)
    log = from_arrays(t, np.sin(np.stack([t, 2.0 * t], 1)), np.cos(np.stack([t, t], 1)))
    signals = prepare(log, chain(tmp_path, ("slide", "hinge")).plant.body)
    d = made_up(tmp_path, findings=findings, signals=signals)
    assert d.plant.effects == d.added == (lag, scale)
    counted = np.ones((len(signals.rows), 2), bool)
    d = replace(d, traces=d.traces._replace(counted=counted))

    def refine(model, found, signals, bounds, **options):
        values = tuple({name: np.ones(1) for name in each} for each in bounds)
        return Refinement(False, "no", tuple(found), values, values, values, 0.5, (1, 1))

    monkeypatch.setattr("jaxidl.gap.result.refined.refine", refine)
    r = d.refined().refinement
    assert r.effects == (scale, lag)
    assert [list(values) for values in r.given] == [["scale"], ["time_constant"]]


def test_the_page_says_where_each_effect_is_written(tmp_path):
    d = made_up(tmp_path, findings=(inertia(2, 1), viscous(2, 0), friction(2), viscous(2, 1)))
    save(d, tmp_path / "out")
    rows = re.findall(r"<tr.*?</tr>", (tmp_path / "out" / "report.html").read_text(), re.DOTALL)
    places = {
        "inertia error": "joint/armature, body/inertial",
        "Coulomb friction": "joint/frictionloss",
        "viscous friction": "joint/damping",
    }
    written = [(name, row) for row in rows for name in places if f"<strong>{name}</strong>" in row]
    said = [(name, re.findall("in model.xml as ([^<]*)", row)) for name, row in written]
    assert len(said) == 4
    assert all(place == [places[name]] for name, place in said), said
