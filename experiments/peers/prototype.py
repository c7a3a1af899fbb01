"""The prototype of the gap finder's new core, as the program that it is: it is loaded from its own
place, never copied.

``python prototype.py CASE ANSWER.json``; the file lies beside the logs or where
``JAXIDL_PROTOTYPE`` says. It searches on the fitted part of each run, as logged; its choice and
parameters then predict the held-out part. It reads one log at a time, so runs are put one after the
other as it does with a reference.
"""

import importlib.util
import os
import sys
import tempfile
from pathlib import Path
from types import ModuleType

import numpy as np
from cases import CASES, DATA, cut_log, save

PROTOTYPE = Path(
    os.environ.get("JAXIDL_PROTOTYPE", DATA.parent / "design" / "prototype" / "gap_core.py")
)
COUNT = 16  # blocks, its own default


def load() -> ModuleType:
    spec = importlib.util.spec_from_file_location("gap_core", PROTOTYPE)
    if spec is None or spec.loader is None:
        raise SystemExit(f"no prototype at {PROTOTYPE}")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def main(name: str, answer: str) -> None:
    case, core = CASES[name], load()
    joints = case.body.nv
    with tempfile.TemporaryDirectory() as folder:
        model = Path(folder) / "model.xml"
        model.write_text(case.xml)
        # >>> what a user writes: python gap_core.py MODEL LOG [--reference OLD]
        cut = lambda file, first: str(
            cut_log(file, Path(folder) / f"{Path(file).stem}_{first}.csv", first)
        )
        # <<<
        library = lambda file, first: core.library(
            str(model), core.Record(cut(file, first), joints, case.cut)
        )
        parts = [library(file, True) for file in case.runs]
        groups = {k: np.concatenate([g[k] for g, _ in parts]) for k in parts[0][0]}
        residual = np.concatenate([r for _, r in parts])
        start, prior, known, old = frozenset(), core.PRIOR, [], 0
        split = core.blocks(len(residual), COUNT)
        if case.reference:  # as its own main does
            before, left = library(case.reference, True)
            old = len(left)
            known = sorted(
                core.Score(before, left, prior, core.blocks(old, COUNT)).search(), key=str
            )
            groups = {
                k: np.concatenate([np.zeros((old, *x.shape[1:])), x]) for k, x in groups.items()
            }
            both = [np.concatenate([g[k] for k in known], 2) for g in (before, parts[0][0])]
            groups["common", None] = np.concatenate(both)
            split = core.blocks(old, 12) + core.blocks(len(residual), 12, old)
            residual, prior, start = (
                np.concatenate([left, residual]),
                core.CHANGED,
                frozenset({("common", None)}),
            )
        score = core.Score(groups, residual, prior, split)
        found = score.search(start)
        sure = score.confidence(found)
        values = score.values(found)
        errors, torques = [], []
        for file in case.runs:
            held, residual = library(file, False)
            if case.reference:
                held["common", None] = np.concatenate([held[k] for k in known], 2)
            errors.append(residual - sum(held[k] @ values[k] for k in found))
            torques.append(core.Record(cut(file, False), joints, case.cut).tau)
    spread = np.concatenate(torques).std(axis=0)
    estimated: dict[str, object] = {}
    for kind in ("viscous", "dry", "rotor", "offset"):
        at = [values.get((kind, j)) for j in range(joints)]
        estimated[kind] = [None if v is None else float(v[0]) for v in at]
    if ("payload", None) in values:
        v = values["payload", None]
        estimated |= {"payload": float(v[0]), "payload_centre": (v[1:4] / v[0]).tolist()}
    listed = [
        {"effect": k[0], "joint": k[1], "confidence": sure[k], "value": float(values[k][0])}
        for k in sorted(found, key=str)
        if k[0] != "common"
    ]
    save(
        answer,
        held_out=(np.sqrt((np.concatenate(errors) ** 2).mean(axis=0)) / spread).tolist(),
        estimated=estimated,
        named=listed,
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
