"""Every committed result, figure and table, and the command that makes it.

``python experiments/everything.py`` lists them with what they cost on two idle cores;
``python experiments/everything.py NAME ...`` runs the named ones, ``all`` runs all. Results go to
``figures/``, what is only needed on the way to ``out/everything``. A run that was interrupted
continues with the same command.
"""

import shlex
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
WORK = Path("out/everything")
PYTHON = shlex.quote(sys.executable)
JAXIDL = f"{PYTHON} -m jaxidl"
EXPERIMENTS = f"{PYTHON} experiments"
UR10E = "../shared/data/ur10e"


class Made(NamedTuple):
    """Files, the commands that make them, and the minutes that these take."""

    files: tuple[str, ...]
    commands: tuple[str, ...]
    minutes: int


def tuned(name: str, options: str) -> Made:
    folder = WORK / f"tune_{name}"
    copied = [
        f"cp {folder}/tune.{kind} figures/tune_{name}.{kind}" for kind in ("json", "png", "pdf")
    ]
    return Made((f"tune_{name}.*",), (f"{JAXIDL} tune --out {folder} {options}", *copied), 10)


BENCHMARK = f"{JAXIDL} gap-benchmark --root 1907 --severities clear --out {WORK}/benchmark"
EVERYTHING = {
    "study": Made(
        ("study.nc", "fig*.*", "claims.json"),
        (
            f"{JAXIDL} sweep --out figures/study.nc",
            f"{JAXIDL} figures figures/study.nc --out figures",
            f"{JAXIDL} claims figures/study.nc --json > figures/claims.json",
        ),
        85,
    ),
    "ablations": Made(
        ("ablation_*.*", "ablations.json"), (f"{EXPERIMENTS}/ablations.py figures",), 170
    ),
    "film": Made(("learning.*",), (f"{EXPERIMENTS}/learning_film.py figures",), 1),
    "derivatives": Made(
        ("derivative_tells.*",), (f"{EXPERIMENTS}/what_a_derivative_tells.py figures",), 5
    ),
    "tune_arm": tuned("arm", "--plant arm --steps 8 --runs 2 --test-runs 10"),
    "tune_doomed": tuned("doomed", "--controller doomed --steps 20"),
    "tune_pid": tuned("pid", ""),
    "arm": Made(
        ("arm*.*",),
        (
            f"{JAXIDL} arm --out {WORK}/arm",
            f"cp {WORK}/arm/arm*.* figures",
            f"cp {WORK}/arm/gap.md figures/arm_gap.md",
        ),
        35,
    ),
    "gap_benchmark": Made(
        ("gap_benchmark.json", "gap_confusion.png", "gap_reliability.png"),
        (
            f"{BENCHMARK} --every 2 --every-robot 4",
            f"cp {WORK}/benchmark/benchmark.json figures/gap_benchmark.json",
            f"cp {WORK}/benchmark/confusion.png figures/gap_confusion.png",
            f"cp {WORK}/benchmark/reliability.png figures/gap_reliability.png",
        ),
        25,
    ),
    "paper_gap": Made(
        ("paper_gap_learning.*",),
        (
            f"{EXPERIMENTS}/paper_gap.py {WORK}/paper_gap",
            f"cp {WORK}/paper_gap/learning.json figures/paper_gap_learning.json",
            f"cp {WORK}/paper_gap/learning.png figures/paper_gap_learning.png",
        ),
        3,
    ),
    "guard": Made(
        ("guard.*",),
        (f"{EXPERIMENTS}/guard.py figures --sweeps {WORK}/guard",),
        8,
    ),
    "robot_loop": Made(
        ("robot_loop.*",),
        (f"PYTHON={PYTHON} experiments/robot_loop/run.sh {WORK}/robot_loop figures",),
        12,
    ),
    "weighted": Made(
        ("weighted.*",),
        (f"{EXPERIMENTS}/weighted.py figures --sweeps {WORK}/guard",),
        50,
    ),
    "ingredients": Made(
        ("ingredients.*",),
        (f"{EXPERIMENTS}/ingredients.py figures --sweeps {WORK}/ingredients",),
        70,
    ),
    "scheduled": Made(
        ("scheduled.*",),
        (f"{EXPERIMENTS}/scheduled.py figures --sweeps {WORK}/guard",),
        10,
    ),
    "arm_sources": Made(
        ("arm_sources*.*",),
        (f"{EXPERIMENTS}/arm_sources.py figures --sweeps {WORK}/arm_sources",),
        20,
    ),
    "load": Made(("load.*",), (f"{EXPERIMENTS}/load.py figures",), 10),
    "pushes": Made(
        ("pushes.*", "push.*"),
        (f"{EXPERIMENTS}/pushes.py figures --sweeps {WORK}/pushes",),
        30,
    ),
    "excite": Made(
        ("excite.*",),
        (
            f"{EXPERIMENTS}/excite.py figures --work {WORK}/excite --ur10e {UR10E}"
            " --parts arm ur10e --steps 50",
            f"{EXPERIMENTS}/excite.py figures --work {WORK}/excite --parts cases --roots 411 1203",
        ),
        60,
    ),
    "demo": Made(
        ("gap_where.png",),
        (
            f"{EXPERIMENTS}/hidden_effects.py {WORK}/demo",
            f"{JAXIDL} gap {WORK}/demo/log.csv --model {WORK}/demo/model.xml"
            f" --out {WORK}/demo/report",
            f"cp {WORK}/demo/report/figures/where.png figures/gap_where.png",
        ),
        1,
    ),
    "strangers": Made(
        ("strangers.*",),
        (
            "pip download -q --no-deps example-robot-data -d out && unzip -qo out/example_robot*"
            f" -d {WORK}/models",
            f"{EXPERIMENTS}/strangers.py figures --models {WORK}/models --work {WORK}/strangers"
            " --seed 7",
        ),
        15,
    ),
    "peers": Made(("peers.json",), (f"{EXPERIMENTS}/peers/run.py",), 15),
    "report": Made(
        ("gap_report.png",),
        (
            f"{JAXIDL} gap {UR10E}/without_load.csv --model {UR10E}/ur10e.xml --out {WORK}/ur10e",
            f"{EXPERIMENTS}/report_picture.py {WORK}/ur10e/report.html figures/gap_report.png",
        ),
        1,
    ),
}


def main(names: list[str]) -> int:
    if unknown := [name for name in names if name not in (*EVERYTHING, "all")]:
        known = ", ".join(EVERYTHING)
        print(f"expected names among all, {known}; got {', '.join(unknown)}", file=sys.stderr)
        return 2
    if not names:
        for name, made in EVERYTHING.items():
            print(f"{name}: {', '.join(made.files)}, about {made.minutes} min")
            print("".join(f"    {command}\n" for command in made.commands), end="")
        return 0
    (ROOT / WORK).mkdir(parents=True, exist_ok=True)
    for name in EVERYTHING if "all" in names else names:
        for command in EVERYTHING[name].commands:
            print(f"{name}: {command}", flush=True)
            if status := subprocess.run(command, shell=True, cwd=ROOT, check=False).returncode:
                return status
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
