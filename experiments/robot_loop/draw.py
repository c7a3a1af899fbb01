"""Feedback and path error over executions from the logs of run.sh, and what the gap finder named:
``python draw.py WORK FIGURES`` writes robot_loop.png, .pdf, .json and .md.
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jaxidl.arm.found import STATES, judge
from jaxidl.arm.hidden import Logged, truth, visible
from jaxidl.arm.setup import Hidden
from jaxidl.files import markdown, plain, write_bytes
from jaxidl.jobs.provenance import revision
from jaxidl.plot.style import house_style, save

JOINTS = 7
SHARES = (50, 99, 99.9, 100)  # [%] of the steps


def columns(log: Path) -> dict[str, np.ndarray]:
    """Return the columns of a log; those of joints are (T, J)."""
    table = np.genfromtxt(log, delimiter=",", names=True)
    together = {
        name[:-1]: np.stack([table[f"{name[:-1]}{j}"] for j in range(JOINTS)], 1)
        for name in table.dtype.names
        if name.endswith("0")
    }
    return together | {name: table[name] for name in table.dtype.names if name[-1].isalpha()}


def numbers(log: Path) -> dict[str, Any]:
    """Return what an execution is judged by."""
    c = columns(log)
    at = lambda x: np.percentile(x, SHARES).round(1)
    return {
        "rows": len(c["time"]),
        "feedback_mse": float(np.mean(c["tau_feedback_applied"] ** 2)),
        "feedback_rms_joint": np.sqrt(np.mean(c["tau_feedback_applied"] ** 2, 0)),
        "path_error": float(np.abs(c["q"] - c["q_desired"]).mean()),
        "learned_peak": float(np.abs(c["tau_feedforward"]).max()),
        "made_up": int(c["made_up"].sum()),
        "oldest_command": int(c["command_age"].max()),
        "step_us": at(c["step_us"]),
        "interval_us": at(c["interval_us"][1:]),
        "interval_off_us": at(np.abs(c["interval_us"][1:] - 1e3)),
    }


def named(work: Path) -> list[dict[str, Any]]:
    """Return the judgement of what the gap finder said: effect, joint, sizes, state."""
    found, sizes = json.loads((work / "gap/report.json").read_text()), truth(Hidden())
    seen = visible(sizes, Logged(), work / "0.csv", work / "arm.xml")
    hidden = [
        {"effect": key[0], "joint": key[1], "size": size, "visible": seen[key]}
        for key, size in sizes.items()
    ]
    rows = judge(found | {"truth": hidden})
    return [{**row._asdict(), "state": STATES[row.state]} for row in rows]


def draw(runs: list[dict[str, Any]], times: dict[str, np.ndarray], folder: Path) -> None:
    """Draw feedback by joint, mean squared feedback, path error, and the loop's times [us]."""
    feedback = np.array([run["feedback_rms_joint"] for run in runs])
    k = np.arange(len(runs)) + 1
    with house_style():
        figure = Figure(figsize=(7.2, 5.0), layout="constrained")
        (joints, squared), (path, clock) = figure.subplots(2, 2)
        for j in range(JOINTS):
            shade = str(0.75 * j / JOINTS)
            joints.plot(k, feedback[:, j], color=shade, marker="ov^sDP*"[j], label=f"joint {j + 1}")
        joints.set(yscale="log", ylabel="rms [Nm]", title="feedback of each joint")
        joints.legend(ncols=2, fontsize=6.5, loc="upper right")
        squared.plot(k, [run["feedback_mse"] for run in runs], color="#0072B2", marker="o")
        squared.set(yscale="log", ylabel="[Nm²]", title="mean squared feedback")
        path.plot(k, [1e3 * run["path_error"] for run in runs], color="#0072B2", marker="o")
        path.set(ylim=(0.0, None), ylabel="[mrad]", title="mean distance from the desired path")
        for axes in (joints, squared, path):
            axes.set(xlabel="execution", xticks=k)
        for (name, values), color, line in zip(
            times.items(), ("#0072B2", "#D55E00"), ("-", "--"), strict=True
        ):
            share = 100.0 * (1.0 - np.arange(len(values)) / len(values))
            clock.plot(np.sort(values), share, color=color, linestyle=line, label=name)
        clock.set(
            xscale="log",
            yscale="log",
            xlim=(1.0, None),
            xlabel="[µs]",
            ylabel="longer [% of steps]",
        )
        clock.set_title("the loop's times, all executions")
        clock.legend(fontsize=7, loc="upper right")
        save(figure, folder, "robot_loop")


def as_text(about: dict[str, Any]) -> str:
    """Return the tables as Markdown."""
    heads = [
        "execution",
        "mean squared feedback [Nm²]",
        "path error [mrad]",
        "largest learned torque [Nm]",
        "step, 50 / 99 / 99.9 / 100 % [µs]",
        "time between readings off 1 ms, 50 / 99 / 99.9 / 100 % [µs]",
    ]
    slash = lambda values: " / ".join(f"{x:.0f}" for x in values)
    rows = [
        [
            str(k),
            f"{run['feedback_mse']:.3g}",
            f"{1e3 * run['path_error']:.3g}",
            f"{run['learned_peak']:.2g}",
            slash(run["step_us"]),
            slash(run["interval_off_us"]),
        ]
        for k, run in enumerate(about["executions"], 1)
    ]
    text = markdown(heads, rows) + "\n"
    text += "\n" + markdown(
        ("all executions [µs]", *(f"{share:g} %" for share in SHARES)),
        [(name, *(f"{x:.0f}" for x in values)) for name, values in about["loop_us"].items()],
    )
    text += "\n"
    if about["stops"]:
        text += "\n" + markdown(
            (
                "fault",
                "the controller's end",
                "braked after [s]",
                "speed then [rad/s]",
                "to rest [ms]",
                "moved meanwhile [rad]",
                "rows of the log",
                "`jaxidl learn` reads it",
            ),
            [
                (
                    name,
                    stop["controller"],
                    f"{stop['braked_at']:.3f}",
                    f"{stop['speed']:.2g}",
                    f"{1e3 * stop['to_rest']:.0f}",
                    f"{stop['travel']:.2g}",
                    stop["rows"],
                    stop["read"].partition(":")[0],
                )
                if "braked_at" in stop
                else (name, stop["controller"], *["never moved"] * 4, stop["rows"], "no")
                for name, stop in about["stops"].items()
            ],
        )
        text += "\n"
    if about["gap"]:
        size = lambda x: "" if x is None else f"{x:.3g}"
        joint = lambda row: "" if row["joint"] is None else str(row["joint"] + 1)
        cells = [
            [
                row["effect"],
                joint(row),
                size(row["hidden"]),
                size(row["found"]),
                row["state"],
                row["why"],
            ]
            for row in about["gap"]
        ]
        text += "\n" + markdown(("effect", "joint", "hidden", "found", "", "why"), cells) + "\n"
    return text


def main() -> int:
    if len(sys.argv) != 3:
        print(f"expected WORK FIGURES; got {' '.join(sys.argv[1:])}", file=sys.stderr)
        return 2
    work, folder = map(Path, sys.argv[1:])
    logs = sorted((path for path in work.glob("*.csv") if path.stem.isdigit()), key=_number)
    runs = [numbers(log) for log in logs]
    report, stops = work / "gap/report.json", work / "stops.json"
    each = [columns(log) for log in logs]
    times = {
        "from reading to command": np.concatenate([c["step_us"] for c in each]),
        "reading early or late": np.concatenate([np.abs(c["interval_us"][1:] - 1e3) for c in each]),
    }
    about = {
        "git_revision": revision(),
        "loop_us": {name: np.percentile(x, SHARES).round(1) for name, x in times.items()},
        "executions": runs,
        "robot": [json.loads(log.with_suffix(".json").read_text()) for log in logs],
        "stops": json.loads(stops.read_text()) if stops.exists() else {},
        "gap": named(work) if report.exists() else [],
    }
    folder.mkdir(parents=True, exist_ok=True)
    content = json.dumps(plain(about), indent=1) + "\n"
    write_bytes(folder / "robot_loop.json", content.encode())
    write_bytes(folder / "robot_loop.md", as_text(about).encode())
    draw(runs, times, folder)
    print(as_text(about))
    return 0


def _number(path: Path) -> int:
    return int(path.stem)


if __name__ == "__main__":
    sys.exit(main())
