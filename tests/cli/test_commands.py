"""The command line, with right and wrong input."""

import json
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from jaxidl.cli import COMMANDS, _parse, main
from tests.helpers.commands import refusal
from tests.helpers.process import script
from tests.helpers.studies import ARRAYS, run_of

WRONG = [
    [],
    ["bogus"],
    ["learn"],
    ["sweep", "--noise", "1e-4", "5e-4", "7e-4", "8e-4", "--noise-levels", "printed"],
    ["sweep", "--out"],
    ["sweep", "--out", "{d}/r.nc", "--noise", "-1"],
    ["sweep", "--out", "{d}/r.nc", "--noise", "abc"],
    ["sweep", "--out", "{d}/r.nc", "--noise", "nan"],
    ["sweep", "--out", "{d}/r.nc", "--noise", "inf"],
    ["sweep", "--out", "{d}/r.nc", "--seeds"],
    ["sweep", "--out", "{d}/r.nc", "--seeds", "1.5"],
    ["sweep", "--out", "{d}/r.nc", "--seeds", "1", "1"],
    ["sweep", "--out", "{d}/r.nc", "--controllers", "pid", "lqr"],
    ["sweep", "--out", "{d}/r.nc", "--sources", "both"],
    ["sweep", "--out", "{d}/r.nc", "--friction", "-5"],
    ["sweep", "--out", "{d}/r.nc", "--epochs", "0"],
    ["sweep", "--out", "{d}/r.nc", "--executions", "0"],
    ["sweep", "--out", "{d}/r.nc", "--executions", "1", "2"],
    ["sweep", "--out", "{d}/r.nc", "--noise-levels", "paper"],
    ["sweep", "--out", "{d}/r.nc", "--train-on", "nothing"],
    ["sweep", "--out", "{d}/r.nc", "--devices", "0"],
    ["sweep", "--out", "{d}/r.nc", "--per-device", "0"],
    ["sweep", "--out", "{d}/text.txt/r.nc"],
    ["sweep", "--out", "{d}/text.txt"],
    ["sweep", "--out", "{d}/r.nc", "--bogus", "3"],
    ["simulate", "--out", "{d}/t.npz", "--controller", "pid"],
    ["simulate", "--out", "{d}/t.npz", "--controller", "pi", "--gain", "low"],
    ["simulate", "--out", "{d}/t.npz", "--controller", "pid", "--gain", "mid"],
    ["simulate", "--out", "{d}/t.npz", "--controller", "pid", "--gain", "low", "--noise", "-1"],
    ["simulate", "--out", "{d}/t.npz", "--controller", "pid", "--gain", "low", "--seed", "-1"],
    ["simulate", "--out", "{d}/t.npz", "--controller", "pid", "--gain", "low", "--executions", "3"],
    ["simulate", "--out", "{d}/t.npz", "--controller", "pid", "--gain", "low", "--guard"],
    ["simulate", "--out", "{d}/t.npz", "--controller", "pid", "--gain", "low", "--schedule"],
    ["simulate", "--out", "{d}/t.npz", "--controller", "pid", "--gain", "low", "--source", "all"],
    [
        "simulate",
        "--out",
        "{d}/t.npz",
        "--controller",
        "pid",
        "--gain",
        "low",
        "--standard-normal",
        "{d}/none.npy",
    ],
    [
        "simulate",
        "--out",
        "{d}/t.npz",
        "--controller",
        "pid",
        "--gain",
        "low",
        "--standard-normal",
        "{d}/text.txt",
    ],
    [
        "simulate",
        "--out",
        "{d}/t.npz",
        "--controller",
        "pid",
        "--gain",
        "low",
        "--standard-normal",
        "{d}/short.npy",
    ],
    ["simulate", "--out", "{d}/text.txt/t.npz", "--controller", "pid", "--gain", "low"],
    ["figures", "{d}/none.nc", "--out", "{d}/f"],
    ["figures", "{d}/text.txt", "--out", "{d}/f"],
    ["claims", "{d}/none.nc"],
    ["claims", "{d}"],
    ["claims", "a" * 300],
    ["sweep", "--out", "{d}", "--overwrite"],
    ["sweep", "--out", "{d}/r.nc", "--devices", "1000"],
    ["reproduce", "--quick", "--out", "{d}/text.txt"],
]


@pytest.mark.parametrize("words", WRONG, ids=lambda w: " ".join(w) or "nothing")
def test_wrong_input_gives_one_clear_line_status_2_and_no_file(tmp_path, capsys, words):
    (tmp_path / "text.txt").write_text("not ours")
    np.save(tmp_path / "short.npy", np.zeros((10, 2)))
    before = {p: p.read_bytes() for p in tmp_path.iterdir()}
    assert len(refusal(capsys, *(word.format(d=tmp_path) for word in words))) < 500
    assert {p: p.read_bytes() for p in tmp_path.iterdir()} == before


@pytest.mark.parametrize(
    ("words", "lacks"),
    [
        ("gap log.csv", "--model ROBOT.xml"),
        ("simulate --gain low", "--controller STR"),
        ("simulate", "--controller STR, --gain STR"),
        ("export --c", "DIR"),
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "ascii"])
def test_what_a_command_line_lacks_is_named_without_its_help(words, lacks, encoding):
    command = words.split()[0]
    env = {"PYTHONIOENCODING": encoding}
    done = subprocess.run(
        [sys.executable, "-m", "jaxidl", *words.split()],
        capture_output=True,
        text=True,
        env=os.environ | env,
    )
    said = f"jaxidl: expected {lacks}; got none; see `jaxidl {command} --help`\n"
    assert (done.returncode, done.stderr) == (2, said)


@pytest.mark.parametrize("command", COMMANDS)
def test_a_help_text_says_a_default_once_and_in_plain_words(capsys, command):
    assert main([command, "--help"]) == 0
    said = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "{None}" not in said
    assert "(default: None)" not in said
    assert not re.search(r"\(default: [^()]*\)\.? \((default|optional)", said)


@pytest.mark.parametrize(
    "words",
    [
        ["--help"],
        ["--version"],
        ["sweep", "--help"],
        ["simulate", "--help"],
        ["reproduce", "--help"],
    ],
)
def test_help_is_given(capsys, words):
    assert main(words) == 0
    said = capsys.readouterr().out.lower()
    assert "usage" in said or "jaxidl 0." in said


def test_simulate_is_the_library_and_reads_given_noise(tmp_path, capsys):
    arguments = [
        "--controller",
        "doomed",
        "--gain",
        "high",
        "--friction",
        "8",
        "--stiction",
        "5",
        "--noise",
        "7e-4",
    ]
    assert main(["simulate", *arguments, "--seed", "6", "--out", str(tmp_path / "a.npz")]) == 0
    np.save(tmp_path / "z.npy", np.random.RandomState(6).standard_normal((1000, 2)))
    given = ["--standard-normal", str(tmp_path / "z.npy")]
    assert main(["simulate", *arguments, *given, "--out", str(tmp_path / "b.npz")]) == 0
    wanted = run_of("doomed", "high", 8, 5, 7e-4, 6)
    with np.load(tmp_path / "a.npz") as a, np.load(tmp_path / "b.npz") as b:
        for name in ARRAYS:
            assert a[name].shape == (1000, 2)
            assert a[name].dtype == np.float64
            np.testing.assert_array_equal(a[name], b[name])
            np.testing.assert_allclose(a[name], getattr(wanted, name), rtol=1e-12, atol=1e-9)


def test_simulate_stores_every_execution_of_a_learning_run(tmp_path):
    words = [
        "simulate",
        "--controller",
        "pid",
        "--gain",
        "high",
        "--source",
        "joint",
        "--executions",
        "3",
        "--epochs",
        "1",
    ]
    assert main([*words, "--out", str(tmp_path / "t.npz")]) == 0
    with np.load(tmp_path / "t.npz") as data:
        assert data["q"].shape == (3, 1000, 2)
        assert data["q_error"].shape == (3,)
        assert not data["tau_feedforward"][0].any()
        assert data["tau_feedforward"][1].any()


@pytest.mark.parametrize(
    ("words", "remedy"),
    [
        ("gp log.csv", "did you mean gap?"),
        ("gap log.csv --modle arm.urdf", "did you mean --model?"),
        ("gap log.csv --model arm.urdf --held-ot 0.2", "did you mean --held-out?"),
        ("sweep --xyz 3", "see `jaxidl sweep --help`"),
        ("ablate --vary learner_gian 1 2", "did you mean learner_gain?"),
    ],
)
def test_a_word_that_is_misspelt_is_answered_with_the_one_that_is_meant(words, remedy, capsys):
    assert main(words.split()) == 2
    out, complaint = capsys.readouterr()
    assert complaint.strip().endswith(remedy)
    assert complaint.count("\n") == 1
    assert not out


def test_the_old_name_of_executions_is_understood():
    words = ["simulate", "--controller", "pid", "--gain", "low", "--source", "joint", "--out", "t"]
    new = _parse([*words, "--executions", "3"])
    for old in (["--iterations", "3"], ["--iterations=3"]):
        assert _parse([*words, *old]).keywords == new.keywords


@pytest.mark.slow
def test_figures_and_claims_read_what_sweep_writes(tmp_path, capsys):
    out = str(tmp_path / "r.nc")
    words = [
        "--noise",
        "1e-4",
        "8e-4",
        "--seeds",
        "1",
        "--friction",
        "5",
        "--stiction",
        "5",
        "--epochs",
        "1",
    ]
    words += ["--controllers", "pid", "--sources", "direct", "joint", "--executions", "2"]
    assert main(["sweep", "--out", out, *words]) == 0
    assert main(["figures", out, "--out", str(tmp_path / "figs")]) == 0
    assert len(list((tmp_path / "figs").iterdir())) == 10
    capsys.readouterr()
    assert main(["claims", out, "--json"]) == 0
    written = json.loads(capsys.readouterr().out)
    assert written["git_revision"]
    assert any(row["average"] for row in written["claims"])


@pytest.mark.parametrize(
    "sent",
    [[signal.SIGINT], [signal.SIGTERM], [signal.SIGINT, signal.SIGTERM, signal.SIGINT]],
    ids=str,
)
def test_a_signal_ends_a_sweep_soon_with_one_line_and_what_is_finished_kept(tmp_path, sent):
    words = [
        "sweep",
        "--out",
        str(tmp_path / "r.nc"),
        "--epochs",
        "1",
        "--seeds",
        "1",
        "--per-device",
        "1",
    ]
    env = {**os.environ, "JAX_PLATFORMS": "cpu"}
    process = subprocess.Popen(
        [sys.executable, "-m", "jaxidl", *words], stderr=subprocess.PIPE, text=True, env=env
    )
    parts = tmp_path / "r.nc.parts"
    deadline = time.monotonic() + 200
    while not list(parts.glob("*.npz")) and time.monotonic() < deadline:
        time.sleep(0.1)
    for number in sent:  # several at once: a terminal and a wrapper may both pass one on
        process.send_signal(number)
    try:
        _, said = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 130
    last = said.strip().splitlines()[-1]
    assert last.startswith("jaxidl: interrupted")
    assert last.endswith("only what is left")
    assert list(parts.glob("*.npz"))
    assert not (tmp_path / "r.nc").exists()


@pytest.mark.parametrize(
    ("words", "platform"),
    [
        (["gap", "none.csv", "--model", "none.xml"], "cpu"),
        (["sweep", "--executions", "0"], None),
    ],
)
def test_only_what_runs_side_by_side_takes_a_gpu(words, platform, monkeypatch, capsys):
    monkeypatch.delenv("JAX_PLATFORMS")
    assert main(words) == 2
    assert os.environ.get("JAX_PLATFORMS") == platform


def test_nothing_is_computed_before_the_devices_are_chosen():
    """Importing the package must not start a JAX backend: the command line sets the number of
    devices after it.
    """
    code = (
        "import jaxidl.cli, jaxidl.jobs.sweeping, jaxidl.paper.simulate, jaxidl.plot.figures, jax;"
    )
    code += "jax.config.update('jax_num_cpu_devices', 3); print(len(jax.devices()))"
    assert script(code).strip() == "3"
