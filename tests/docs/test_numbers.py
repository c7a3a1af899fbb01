"""Numbers in the documentation's prose are those of the committed results."""

import json
import re

import pytest

from tests.helpers.paths import ROOT

FIGURES, BENCHMARKS = ROOT / "figures", ROOT / "experiments" / "bench" / "results"
PAGES = ROOT / "docs"


def results(name: str, folder=FIGURES):
    return json.loads((folder / f"{name}.json").read_text())


def ci(mean: list[float]) -> str:
    """A mean with its interval, as prose has it."""
    return "{:.2g} [{:.2g}, {:.2g}]".format(*mean)


def weighted() -> list[str]:
    rows = {(r["set"], r["of"]): r for r in results("weighted")["rows"]}
    paper = lambda of: rows["the paper's grid, guarded", of]
    ratio = lambda of: f"{paper(of)['ratio'][0]:.2g}"
    worst = paper("DOOMED, low gain")
    bare = rows["other conditions", "all"]
    return [
        f"the final error is {ci(paper('all')['ratio'])} times that of the best of the three",
        f"the error falls to {ratio('PID, low gain')} (low gain) and {ratio('PID, high gain')}"
        f" times (high gain), under DOOMED at high gain to {ratio('DOOMED, high gain')} times",
        f"it is {ci(rows['other conditions, guarded', 'all']['ratio'])} times",
        f"{bare['above_3']} of {bare['executions']} are more than three times worse",
        f"up to {bare['worst']:.0f} times",
        f"is the exception:** {ci(worst['ratio'])} times the best of the three",
        f"{worst['above_3']} of {worst['executions']} executions are more than three times worse",
    ]


def guard() -> list[str]:
    rows = results("guard")["rows"]
    every = lambda key: [row[key] for row in rows]
    return [
        f"No guarded execution is more than {max(every('worst_on')):.1f} times worse",
        f"without the guard the worst is {max(every('worst_off')):.0f} times worse, and"
        f" {sum(every('above_3_off'))} of {sum(every('executions'))} are more than three times",
    ]


def excite() -> list[str]:
    found = results("excite")
    random, least = (found["arm"]["ratios"][f"d over {of}"] for of in ("random", "condition"))
    measured, by = found["ur10e"]["designed over measured"], found["ur10e"]["by effect"]
    resolved = found["wider"]["resolved"]
    right = {name: round(of["share"] * of["n"]) for name, of in resolved.items()}
    share, low, high = (resolved["designed"][k] for k in ("share", "low", "high"))
    return [
        "{:.2f} (95 %: {:.2f} to {:.2f}) of a random motion's".format(*random),
        "{:.2f} ({:.2f} to {:.2f}) of those of motions with the least condition".format(*least),
        f"ratio {measured:.2f}, from {min(by.values()):.2f} for",
        f"to {by['viscous_friction']:.2f} for viscous friction",
        f"{right['designed']} of {found['open']} are right ({100 * share:.0f} %, 95 %:"
        f" {100 * low:.0f} to {100 * high:.0f}), with a random one {right['random']}, before"
        f" {right['before']}",
    ]


def robot_loop() -> list[str]:
    found = results("robot_loop")
    step, early = found["loop_us"].values()
    runs, states = found["executions"], [row["state"] for row in found["gap"]]
    feedback = [run["feedback_mse"] for run in runs]
    path = [1e3 * run["path_error"] for run in runs]
    right, named = (states.count(f"named, {of}") for of in ("size within 20 %", "another size"))
    return [
        f"{step[0]:.0f} µs in the median, {step[2]:.0f} µs at 99.9 %, {step[3]:.0f} µs at worst",
        f"{early[0]:.0f} µs early or late in the median, {early[2] / 1e3:.2f} ms at 99.9 %,"
        f" {early[3] / 1e3:.1f} ms at worst",
        f"feedback from {feedback[0]:.1f} to {feedback[1]:.2f} Nm²"
        f" ({1 - feedback[1] / feedback[0]:.0%} of it)".replace("%", " %"),
        f"nine leave {feedback[-1]:.3f} Nm²",
        f"{path[0]:.1f}, {path[1]:.1f} and {path[-1]:.1f} mrad off its path",
        f"names {right + named} of {sum('not hidden' not in s for s in states)} hidden effects,"
        f" {right} of them within 20 %",
    ]


def benchmark() -> list[str]:
    found = results("gap_benchmark")
    robots, outside = found["robots"], found["outside"]["misnamed"]
    centres = found["robots"]["parameters"]["within_two_stderr_by_effect"]["com_error"]["share"]
    wrong = round(robots["precision"]["n"] * (1.0 - robots["precision"]["share"]))
    return [
        f"Of the {round(outside['n'] * outside['share'])} logs with an effect from outside the"
        " catalogue that get a wrong name",
        {0: "None of the names of robots is", 1: "The only wrong name of robots is"}.get(
            wrong, f"Of the {wrong} wrong names of robots"
        ),
        f"{100 * centres:.0f} % of the true centres of mass",
    ]


def c_step() -> list[str]:
    rows = results("c_step", BENCHMARKS)["rows"]
    times = lambda row: [row[key] for key in ("median", "99 %", "99.9 %")]
    return [
        " | ".join(f"{t:.0f} µs" if t < 1000 else f"{t / 1e3:.1f} ms" for t in times(row))
        for row in rows
        if "MuJoCo" not in row["way"]
    ]


@pytest.mark.parametrize(
    ("page", "said"),
    [
        ("explanation/trust.md", weighted),
        ("explanation/trust.md", guard),
        ("howto/excite.md", excite),
        ("howto/robot.md", robot_loop),
        ("explanation/gap_benchmark.md", benchmark),
        ("howto/export_c.md", c_step),
    ],
)
def test_prose_says_what_was_measured(page, said):
    text = re.sub(r"\s+", " ", (PAGES / page).read_text(encoding="utf-8").replace("**", ""))
    for sentence in said():
        assert sentence.replace("**", "") in text
