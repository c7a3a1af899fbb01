"""What a designed motion is worth: ``python experiments/excite.py FOLDER --work WORK``.

(a) On the seven-joint arm: predicted standard errors of D- and A-optimal motions, of motions of
least condition number, and of random ones, all of the same length and limits. (b) On the measured
UR10e, where its log is there: predicted standard errors of a designed motion of 50 s against those
on the measured excitation, with the noise measured there. (c) On the benchmark's ambiguous single
effects that physics does not tie: the designed motion and a random one of the same length and
limits are executed in the benchmark's engine, and each log is diagnosed together with the old one;
once with limits half as wide again as what the first log reached, once within that.

FOLDER gets excite.md and excite.json, excite.png and excite.pdf; cases of the benchmark stay in
WORK, and an interrupted run continues.
"""

import argparse
import itertools
import json
import os
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxidl.backend import choose_devices, jit_quickly
from jaxidl.errors import JaxidlError
from jaxidl.excite.contest import contested, earlier
from jaxidl.excite.criteria import Evidence, standard_errors
from jaxidl.excite.design import Designed, Effort, design, random_motion
from jaxidl.excite.doubt import doubt
from jaxidl.excite.limits import Limits, limits_of
from jaxidl.excite.parameters import common
from jaxidl.excite.plan import Noise
from jaxidl.excite.prepare import ALIGNMENT, Prepared, prepared
from jaxidl.excite.rehearsal import rehearsed
from jaxidl.excite.table import separated
from jaxidl.files import markdown, plain, write_bytes
from jaxidl.gap import diagnose, read
from jaxidl.gap.benchmark import judge
from jaxidl.gap.benchmark.believed import Diverged
from jaxidl.gap.benchmark.cases import Case, all_cases, truth
from jaxidl.gap.benchmark.mechanisms import MECHANISMS
from jaxidl.gap.benchmark.run import run_benchmark
from jaxidl.gap.benchmark.score import share
from jaxidl.gap.evidence.rows import rows_of
from jaxidl.gap.evidence.shape import present
from jaxidl.gap.fit.library import library, noise_of, residual
from jaxidl.jobs.provenance import revision
from jaxidl.jobs.statistics import geometric
from jaxidl.logs.signals import prepare
from jaxidl.plot.style import house_style, save
from jaxidl.systems.arm import arm
from jaxidl.systems.bounds import bounds
from jaxidl.systems.mjcf import Model, read_model

SPEED, ACCELERATION = 2.0, 6.0  # of the arm's joints [rad/s, rad/s^2]
POSTURE = (0.0, 0.7, 0.0, 1.4, 0.0, -0.7, 0.0)
CRITERIA = ("d", "a", "condition")
# the same motion whichever of them it is: a turned base or encoder or link of a pendulum, a turned
# base or first encoder, or a turned last encoder or last link, of two links in a plane
TIED = (
    ("pendulum", {"position_bias", "base_tilt", "com_error"}),
    ("two_link", {"position_bias", "base_tilt"}),
    ("two_link", {"position_bias", "com_error"}),
    # friction under load by direction, beside friction under load, is another motor constant
    *((m, {"torque_scale", "directional_load_friction"}) for m in MECHANISMS),
)
LIMITS = {"wider": 1.5, "within": 1.0}  # limits over what the first log reached
RATE = 500.0  # of the benchmark's logs [Hz]


def relative(made: Prepared, seen: Evidence) -> np.ndarray:
    """Return standard errors over the columns' sizes, without those of the timing."""
    kept = [n for n, label in enumerate(made.labels) if label.effect != ALIGNMENT]
    size = np.asarray(made.plan.size)
    return (standard_errors(np.asarray(made.plan.gram(seen)), size) / size)[kept]


def of_motion(made: Prepared, motion: Designed, every: int) -> Evidence:
    """Return what every ``every``-th sample of a motion tells about a plan's columns."""
    dt = every * float(motion.time[1] - motion.time[0])
    run = jit_quickly(lambda q, qd, qdd: made.plan.evidence(q, qd, qdd, dt)[0])
    return run(*(x[::every] for x in (motion.q, motion.qd, motion.qdd)))


def arm_errors(seeds: int, steps: int) -> dict[str, Any]:
    """Compare criteria on the arm: geometric means of the standard errors, over random motion's."""
    model = arm()
    file = bounds(model)
    limits = limits_of(
        model.names,
        file._replace(speed=np.full(7, SPEED)),
        reached={"acceleration": np.full(7, ACCELERATION)},
        start=POSTURE,
    )
    made = prepared(model, limits, top=1.0)
    rows: dict[str, list[float]] = {name: [] for name in (*CRITERIA, "random")}
    seconds = []
    for seed, name in itertools.product(range(seeds), (*CRITERIA, "random")):
        plan = made.plan if name == "random" else replace(made.plan, criterion=name)
        began = time.monotonic()
        found = (
            random_motion(plan, None, seed, 100.0)
            if name == "random"
            else design(plan, None, Effort(3, steps, seed))
        )
        seconds.append(time.monotonic() - began)
        gram = of_motion(made, found, 20)
        rows[name].append(float(np.exp(np.mean(np.log(relative(made, gram))))))
        print(f"arm: {name}, seed {seed}: {rows[name][-1]:.4g}, {seconds[-1]:.0f} s", flush=True)
    ratios = {
        f"{a} over {b}": geometric(np.array(rows[a]) / np.array(rows[b]))
        for a, b in (("d", "random"), ("a", "random"), ("condition", "random"), ("d", "condition"))
    }
    return {
        "seeds": seeds,
        "standard_errors": rows,
        "ratios": {n: [r.value, *r.interval] for n, r in ratios.items() if r and r.interval},
        "seconds_of_a_design": max(seconds),
        "load": os.getloadavg()[0],
    }


def measured_arm(folder: Path, steps: int) -> dict[str, Any] | None:
    """Compare a designed motion of 50 s with the measured excitation of the UR10e."""
    path, log_path = folder / "ur10e.xml", folder / "without_load.csv"
    if not path.is_file():
        print(f"no {path}: left out", flush=True)
        return None
    model, log = read_model(path), read(log_path)
    signals = prepare(log, model.plant.body, model.plant.effects)
    rows = library(
        rows_of(signals, model.plant.effects, 0.1), common(), present(model.plant.effects)
    )
    noise, effective = noise_of(
        rows.rows, residual(rows.rows, rows.envelope), rows.envelope.members
    )
    top = lambda x: np.quantile(np.abs(x), 0.999, axis=0)
    reached = {
        "lower": signals.q.min(0),
        "upper": signals.q.max(0),
        "speed": top(signals.qd),
        "acceleration": top(signals.qdd),
        "torque": np.abs(signals.tau).max(0),
    }
    seconds = len(signals.q) * signals.dt
    measured = Noise(noise, effective / (seconds * 0.9), signals.sigma)
    inf = np.full(len(noise), np.inf)
    file = bounds(model)._replace(lower=-inf, upper=inf, torque=inf)
    limits = replace(limits_of(model.names, file, reached=reached), margin=0.0, torque_margin=0.0)
    made = prepared(model, limits, measured, seconds=seconds, top=0.6)
    found = design(made.plan, None, Effort(2, steps), sampling=50.0)
    old = relative(made, earlier(made.plan, signals))
    new = relative(made, of_motion(made, found, 10))
    logs = np.log(new / old)
    groups = [label.effect for label in made.labels if label.effect != ALIGNMENT]
    return {
        "parameters": len(new),
        "seconds": seconds,
        "designed over measured": float(np.exp(logs.mean())),
        "quartiles": np.exp(np.quantile(logs, [0.0, 0.25, 0.5, 0.75, 1.0])),
        "by effect": {
            name: float(
                np.exp(np.mean([x for x, g in zip(logs, groups, strict=True) if g == name]))
            )
            for name in dict.fromkeys(groups)
        },
        "old": old,
        "new": new,
    }


def open_cases(work: Path, root: int, severities: tuple[str, ...]) -> list[tuple[Case, Any]]:
    """Return the benchmark's ambiguous single effects that physics does not tie, with reports."""
    run_benchmark(work, ("single",), severities, 2, os.cpu_count() or 1, root)
    known = truth(all_cases(root))
    out = []
    for case in all_cases(root):
        path = work / "reports" / f"{case.id}.json"
        if not path.is_file() or case.family != "single":
            continue
        report = json.loads(path.read_text())
        doubted = report.get("verdict") == "ambiguous" or report.get("ambiguous")
        if "lost" in report or "error" in report or not doubted:
            continue
        near = [e["nearest"] for e in report["effects"] if e.get("nearest")]
        names = {name for group in judge.candidates(report) for name, _ in group}
        names |= {e["effect"] for e in [*report["effects"], *near]}
        truly = known[case.id]["hidden"][0]["effect"]
        tied = judge.tied(known[case.id]["hidden"][0], case.mechanism) or any(
            case.mechanism == where and truly in group and len((names | {truly}) & group) > 1
            for where, group in TIED
        )
        if not tied:
            out.append((case, report))
    return sorted(out, key=lambda c: c[0].id.split("-")[-1])  # in no order of mechanisms


def wider(reached: dict[str, np.ndarray], factor: float) -> dict[str, np.ndarray]:
    """Return limits ``factor`` times as far, as fast and as hard as a log went."""
    start = reached["start"]
    about = {k: start + factor * (reached[k] - start) for k in ("lower", "upper")}
    more = {k: factor * reached[k] for k in ("speed", "acceleration", "torque")}
    return reached | about | more


def settled(case: Case, report: Any, work: Path, steps: int, factor: float) -> dict[str, Any]:
    """Execute a designed and a random motion for one case, and diagnose each with the old log."""
    folder = work / "doubts" / case.id
    write_bytes(folder / "report.json", json.dumps(report).encode())
    place = work / "cases" / case.id
    model, old = read_model(place / "model.xml"), place / case.log
    hidden = truth([case])[case.id]["hidden"][0]
    found = doubt(folder, model, [old])
    limits = limits_of(model.names, bounds(model), reached=wider(found.reached(), factor))
    made = contested(found, model, limits, top=1.5)
    best = design(made.plan, None, Effort(2, steps, case.seed % 1000), RATE)
    best = rehearsed(best, made, found.explanations, limits, 1.0 / RATE)
    chance = random_motion(made.plan, None, case.seed, RATE)
    out: dict[str, Any] = {
        "case": case.id,
        "hidden": judge.key(hidden),
        "explanations": found.titles,
        "before": judge.single_credit(hidden, report),
    }
    for name, motion in (("designed", best), ("random", chance)):
        # An explanation with a hidden state is simulated from row to row, hence every row.
        every = max(1, round(made.plan.dt * RATE))
        seen, before = of_motion(made, motion, every), made.plan.earlier
        assert before is not None
        apart = separated(made, found.titles, before, seen.plus(before))
        out[name] = executed(case, model, limits, old, motion, hidden) | {
            "separation": min((a["after"] / a["asked"] for a in apart), default=0.0),
            "pairs": apart,
        }
        print(case.id, judge.key(hidden), name, out[name], flush=True)
    return out


def executed(
    case: Case, model: Model, limits: Limits, old: Path, motion: Designed, hidden: Any
) -> dict[str, Any]:
    """Execute a motion in the engine, and diagnose its log together with the old one."""
    try:
        run = case.measure(motion=(motion.q, motion.qd, motion.qdd), most=limits.torque)
    except Diverged as error:
        return {"right": 0.0, "lost": str(error)}
    speed = np.gradient(run.clean, 1.0 / RATE, axis=0)
    kept = bool(
        np.all((run.clean > limits.lower) & (run.clean < limits.upper))
        and np.all(np.abs(speed) < limits.speed)
        and np.all(np.abs(np.gradient(speed, 1.0 / RATE, axis=0)) < limits.acceleration)
        and np.all(np.abs(run.tau) < limits.torque)
    )
    new = old.with_name("new.npz")
    np.savez(new, **run.log())  # pyright: ignore[reportArgumentType]
    try:
        report = diagnose([old, new], model, rollouts=False).to_dict()
    except JaxidlError as error:
        return {"right": 0.0, "error": str(error), "limits_kept": kept}
    return {
        "right": judge.single_credit(hidden, report),
        "verdict": report["verdict"],
        "named": judge.named(report),
        "effects": [[*judge.key(e), e["confidence"]] for e in report["effects"]],
        "limits_kept": kept,
    }


def resolved(cases: list[dict[str, Any]]) -> dict[str, Any]:
    """Return shares of cases that are resolved rightly, and of those predicted to be separated."""
    shares = {"before": share(c["before"] == 1 for c in cases)}
    for name in ("designed", "random"):
        shares[name] = share(float(c[name]["right"] == 1) for c in cases)
        for said, apart in (("separated", True), ("not separated", False)):
            right = [
                float(c[name]["right"] == 1)
                for c in cases
                if (c[name]["separation"] >= 1.0) == apart
            ]
            if right:
                shares[f"{name}, predicted {said}"] = share(right)
    return shares


def text(result: dict[str, Any]) -> str:
    """Return all results as Markdown."""
    out = ["Standard errors are predicted; ratios below one: the first is better.", ""]
    if "arm" in result:
        head = ["seven-joint arm, 20 s", "ratio of standard errors", "95 % over seeds"]
        rows = [
            [name, f"{v[0]:.3f}", f"{v[1]:.3f} to {v[2]:.3f}"]
            for name, v in result["arm"]["ratios"].items()
        ]
        out += [markdown(head, rows), ""]
        out += [
            f"A design took {result['arm']['seconds_of_a_design']:.0f} s at most, with"
            f" {result['arm']['load']:.1f} processes waiting for two cores.",
            "",
        ]
    if result.get("ur10e"):
        u = result["ur10e"]
        head = ["UR10e, 50 s, designed over measured excitation", "ratio of standard errors"]
        rows = [["all", f"{u['designed over measured']:.2f}"]]
        rows += [[name, f"{value:.2f}"] for name, value in u["by effect"].items()]
        out += [markdown(head, rows), ""]
    for where, factor in LIMITS.items():
        if not result.get(where, {}).get("cases"):
            continue
        part = result[where]
        head = [f"limits {factor:g} times what the first log reached", "resolved rightly", "95 %"]
        rows = []
        for name, s in part["resolved"].items():
            span = "" if s["low"] is None else f"{s['low']:.2f} to {s['high']:.2f}"
            rows.append([name, f"{s['share'] * s['n']:.0f} of {s['n']}", span])
        out += [markdown(head, rows), ""]
        head = ["case", "hidden", "explanations", "designed", "random"]
        say = lambda r: (
            f"{'right' if r['right'] == 1 else r.get('verdict', 'lost')},"
            f" {r['separation']:.3g} of what is asked"
        )
        out += [
            markdown(
                head,
                (
                    [
                        c["case"],
                        f"{c['hidden'][0]} {c['hidden'][1]}",
                        "; ".join(c["explanations"]),
                        say(c["designed"]),
                        say(c["random"]),
                    ]
                    for c in part["cases"]
                ),
            ),
            "",
        ]
    return "\n".join(out)


def draw(result: dict[str, Any], folder: Path) -> None:
    """Draw standard errors on both arms, and how often doubts were resolved, as far as known."""
    known = [
        panel
        for part, panel in (("arm", draw_arm), ("ur10e", draw_ur10e), ("wider", draw_doubts))
        if result.get(part)
    ]
    with house_style():
        figure = Figure(figsize=(3.1 * len(known), 3.1), layout="constrained")
        for axes, panel in zip(
            figure.subplots(1, len(known), squeeze=False)[0], known, strict=True
        ):
            panel(axes, result)
        save(figure, folder, "excite")


def draw_arm(axes: Axes, result: dict[str, Any]) -> None:
    """Draw each motion's mean standard error on the arm."""
    marks = {"random": "s", "condition": "v", "d": "^", "a": "o"}
    for n, (name, mark) in enumerate(marks.items()):
        values = result["arm"]["standard_errors"][name]
        axes.plot([n] * len(values), values, mark, color="#0072B2", alpha=0.7)
    axes.set_xticks(range(4), ["random", "condition\nnumber", "D", "A"])
    axes.set_yscale("log")
    axes.set_title("seven-joint arm:\nmean standard error / 5 % torque")


def draw_ur10e(axes: Axes, result: dict[str, Any]) -> None:
    """Draw standard errors on the designed motion over those on the measured one."""
    old, new = (np.array(result["ur10e"][k]) for k in ("old", "new"))
    axes.loglog(old, new, "^", color="#0072B2")
    low, high = min(old.min(), new.min()), max(old.max(), new.max())
    axes.plot([low, high], [low, high], color="0.4", linewidth=0.8)
    axes.set(xlabel="measured excitation", ylabel="designed motion")
    axes.set_title("UR10e: standard errors")


def draw_doubts(axes: Axes, result: dict[str, Any]) -> None:
    """Draw shares of doubts that are resolved rightly, with intervals."""
    for n, name in enumerate(("before", "random", "designed")):
        s = result["wider"]["resolved"][name]
        axes.bar(n, s["share"], color=("0.6", "#D55E00", "#0072B2")[n], width=0.6)
        middle = [[s["share"] - s["low"]], [s["high"] - s["share"]]]
        axes.errorbar(n, s["share"], middle, color="black", capsize=3)
    axes.set_xticks(range(3), ["before", "random\nmotion", "designed\nmotion"])
    axes.set_ylim(0.0, 1.0)
    axes.set_title(f"doubts resolved rightly, n = {len(result['wider']['cases'])}")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--work", type=Path, default=Path("out/everything/excite"))
    parser.add_argument("--ur10e", type=Path, default=Path("../shared/data/ur10e"))
    parser.add_argument("--parts", nargs="+", default=["arm", "ur10e", "cases"])
    parser.add_argument("--limits", nargs="+", default=list(LIMITS), choices=list(LIMITS))
    parser.add_argument("--roots", type=int, nargs="+", default=[310])
    parser.add_argument("--most", type=int, default=20, help="cases of each root")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--steps", type=int, default=100)
    given = parser.parse_args()
    choose_devices(None)
    kept = given.folder / "excite.json"
    result: dict[str, Any] = json.loads(kept.read_text()) if kept.is_file() else {}

    def keep() -> None:
        write_bytes(kept, (json.dumps(plain(result), indent=1) + "\n").encode())
        write_bytes(given.folder / "excite.md", text(plain(result)).encode())

    with jax.enable_x64(True):
        if "cases" in given.parts:
            opened = [
                (given.work / str(root), *found)
                for root in given.roots
                for found in open_cases(given.work / str(root), root, ("clear",))[: given.most]
            ]
            print(f"{len(opened)} open cases", flush=True)
            result |= {"roots": given.roots, "open": len(opened), "cases_revision": revision()}
            for where in given.limits:
                result[where] = {"cases": []}
                for work, case, report in opened:
                    path = work / "settled" / where / f"{case.id}.json"
                    if not path.is_file():
                        done = settled(case, report, work, min(given.steps, 60), LIMITS[where])
                        write_bytes(path, json.dumps(plain(done)).encode())
                    result[where]["cases"].append(json.loads(path.read_text()))
                    result[where]["resolved"] = resolved(result[where]["cases"])
                    keep()
        if "arm" in given.parts:
            result["arm"] = arm_errors(given.seeds, given.steps) | {"git_revision": revision()}
            keep()
        if "ur10e" in given.parts and (found := measured_arm(given.ur10e, given.steps)):
            result["ur10e"] = found | {"git_revision": revision()}
            keep()
    draw(plain(result), given.folder)
    print(text(plain(result)))


if __name__ == "__main__":
    main()
