"""``jaxidl gap`` through its command line: this version, or the one that ``PYTHONPATH`` holds.

``python jaxidl_gap.py CASE ANSWER.json [EFFECT ...]``. The command gets the fitted part of each run
as logged, and may be limited to some effects. A version that has no ``--reference`` gets the older
log first, and the new one with the model patched by it. CPU seconds are those of the commands
alone. The patched model then meets the held-out part of each run, in the common band: its residual
is what :func:`jaxidl.gap.diagnose` has before it names anything. Where that cannot be had, the
command's own number for the last 30 % of what it was given stands in, and the answer says so.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from cases import CASES, Case, cut_log, save

# of older versions, too
JAXIDL = [sys.executable, "-c", "import sys; from jaxidl.cli import main; sys.exit(main())"]
WORDS = {
    "viscous_friction": "viscous",
    "coulomb_friction": "dry",
    "inertia_error": "rotor",
    "constant_offset": "offset",
}


def command(*words: str) -> float:
    """Run ``jaxidl`` and return its CPU seconds; what it prints goes on."""
    child = subprocess.Popen([*JAXIDL, *words])
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        raise SystemExit(f"jaxidl gap ended with status {child.returncode}")
    return usage.ru_utime + usage.ru_stime


def has_reference() -> bool:
    helped = subprocess.run([*JAXIDL, "gap", "--help"], capture_output=True, text=True, check=False)
    return "--reference" in helped.stdout


def held_out(case: Case, folder: Path, model: Path) -> list[float]:
    """Error (J,) of the patched model on the held-out part of the runs."""
    from jaxidl import gap
    from jaxidl.logs import signals

    signals.choose_band = lambda *_, **__: case.cut
    logs = [cut_log(file, folder / f"held_{Path(file).name}", False) for file in case.runs]
    traces = gap.diagnose(logs, model, effects=("constant_offset",), rollouts=False).traces
    counted = np.asarray(getattr(traces, "counted", np.ones(traces.before.shape, bool)))
    error = np.sqrt((traces.before**2 * counted).sum(axis=0) / counted.sum(axis=0))
    return (error / traces.command.std(axis=0)).tolist()


def main(name: str, answer: str, *effects: str) -> None:
    case, chosen = CASES[name], ["--effects", *effects] if effects else []
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        model, out = folder / "nominal" / "model.xml", folder / "out"
        model.parent.mkdir()
        model.write_text(case.xml)
        logs = [str(cut_log(file, folder / Path(file).name, True)) for file in case.runs]
        seconds, known = 0.0, []
        if case.reference:
            old = str(cut_log(case.reference, folder / "reference.csv", True))
            if has_reference():
                known = ["--reference", old]
            else:
                seconds += command(
                    "gap", old, "--model", str(model), "--out", str(folder / "old"), *chosen
                )
                model = folder / "old" / "model.xml"
        seconds += command("gap", *logs, "--model", str(model), "--out", str(out), *known, *chosen)
        report = json.loads((out / "report.json").read_text())
        own = report["gap"]["after"]["torque_relative"]
        try:
            error, note = held_out(case, folder, out / "model.xml"), {}
        except Exception as reason:
            error, note = (
                own,
                {
                    "note": (
                        f"error as in its own report and band: {type(reason).__name__}: {reason}"[
                            :300
                        ]
                    )
                },
            )
    named, estimated = [], {kind: [None] * len(case.joints) for kind in WORDS.values()}
    for e in report["effects"]:
        values = {k: p["value"] for k, p in e["parameters"].items()}
        named.append(
            {
                "effect": e["effect"],
                "joint": e["joint"],
                "confidence": e.get("confidence"),
                "parameters": values,
            }
        )
        if e["effect"] in WORDS and e["joint"] is not None:
            value = (
                values.get("extra")
                if e["effect"] == "inertia_error"
                else next(iter(values.values()))
            )
            # it is what the joint gets, not what it takes
            sign = -1.0 if e["effect"] == "constant_offset" else 1.0
            estimated[WORDS[e["effect"]]][e["joint"]] = value if value is None else sign * value
        if e["effect"] == "payload":
            estimated |= {"payload": values["mass"], "payload_centre": values["com"]}
    save(
        answer,
        held_out=error,
        own_report=own,
        seconds=seconds,
        estimated=estimated,
        named=named,
        **note,
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
