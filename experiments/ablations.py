"""The ablations that the paper's argument rests on: ``python experiments/ablations.py FOLDER [NAME
...]``.

Each is one ``jaxidl ablate`` command, and continues where an interrupted run of it stopped. FOLDER
gets ablation_NAME.nc, .md, .png and .pdf of each, and ablations.json with its command, number of
runs, compiled programs, and seconds. ``--seeds N`` gives each N seeds instead of 10.
"""

import argparse
import json
import shlex
import subprocess
import sys
from pathlib import Path

from jaxidl.files import write_bytes
from jaxidl.paper.runs import read_results

BOTH = "--controllers pid doomed"
TWO = "--noise 1e-4 5e-4"
ABLATIONS = {
    "gains": f"--vary learner_gain 25 100 250 500 1000 --vary applied_gain 25 100 500 {TWO}",
    "filter": f"--vary alpha 0.02 0.05 0.1 0.2 0.5 1 {BOTH} {TWO}",
    "prior_mass": f"--vary prior_mass 0 0.5 1 2.5 5 10 {BOTH} {TWO}",
    "state": f"--vary train_on true_state sensed_state --noise 1e-4 5e-4 8e-4 {BOTH}",
    "noise": f"--vary noise 1e-4 5e-4 7e-4 8e-4 7e-3 8e-3 {BOTH}",
    "layers": f"--vary layers 1 20,1 50,20,1 100,50,20,1 200,100,50,20,1 {BOTH} {TWO}",
    "epochs": f"--vary epochs 2 5 10 20 50 {BOTH} {TWO}",
    "kept": f"--vary kept 0 1 3 --epochs 5 {BOTH} {TWO}",
}


def run(name: str, folder: Path, seeds: int) -> None:
    """One ablation, and its line in ablations.json."""
    out = folder / f"ablation_{name}.nc"
    words = f"{ABLATIONS[name]} --seeds {' '.join(map(str, range(1, 1 + seeds)))}"
    command = [sys.executable, "-m", "jaxidl", "ablate", *shlex.split(words), "--out", str(out)]
    # a process each: compiled programs stay in memory until it ends
    status = subprocess.run(command, check=False).returncode
    if status:
        sys.exit(status)
    data, table = read_results(out), folder / "ablations.json"
    found = json.loads(table.read_text()) if table.exists() else {}
    found[name] = {
        "command": f"jaxidl ablate {words} --out ablation_{name}.nc",
        "runs": int(data["q_error"].size / data.sizes["iteration"]),
        "programs": int(data.attrs["programs"]),
        "seconds": float(data.attrs["seconds"]),
        "device": data.attrs["device"],
        "revision": data.attrs["git_revision"],
    }
    write_bytes(table, (json.dumps(found, indent=1) + "\n").encode())


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"{', '.join(ABLATIONS)}; default: all"
    )
    parser.add_argument("--seeds", type=int, default=10)
    options = parser.parse_args()
    for name in options.names or ABLATIONS:
        if name not in ABLATIONS:
            parser.error(
                f"an ablation among {', '.join(ABLATIONS)}; got {name!r}; name one of these"
            )
        print(f"{name} ...", flush=True)
        run(name, options.folder, options.seeds)
