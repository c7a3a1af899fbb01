"""Do the tests notice when the code is wrong? Small changes to eight modules, and which tests fail
because of them.

    python experiments/bench/mutants.py [--each 6] [--only MODULE] [--json FILE]

Each mutant is the module with one operator, comparison or number changed, drawn from a fixed seed.
The quick tests of the module run first; where they all pass, the slow ones run, too. What neither
notices survived: it is printed, to be looked at. With ``--only`` the rows of the other modules that
are in FILE stay there.
"""

# pyright: reportAttributeAccessIssue=false, reportCallIssue=false

import ast
import copy
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from common import arguments, machine, report

from jaxidl.jobs.provenance import revision

ROOT = Path(__file__).resolve().parents[2]
MODULES = {
    "systems/plant.py": ("systems/plant", "paper/golden", "effects/definitions"),
    "learning/execute.py": ("paper/golden", "learning/learning", "learning/guard"),
    "learning/sources.py": ("paper/golden", "learning/learning"),
    "models/training.py": ("models/training", "paper/golden"),
    "gap/fit/score.py": ("gap/sets", "gap/workflow"),
    "gap/choice/estimates.py": ("gap/sets", "gap/workflow"),
    "gap/benchmark/score.py": ("gap/benchmark/score",),
    "jobs/store.py": ("jobs/sweep", "paper/sweep", "paper/properties"),
}
OPPOSITE = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Lt: ast.GtE,
    ast.GtE: ast.Lt,
    ast.Gt: ast.LtE,
    ast.LtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.In: ast.NotIn,
    ast.And: ast.Or,
    ast.Or: ast.And,
}


def places(tree: ast.Module) -> list[tuple[int, str]]:
    """Nodes that can be changed, by their number in a walk, and what the change is called.

    Annotations and ``zip``'s strict are left alone.
    """
    hints = {
        id(x)
        for node in ast.walk(tree)
        for part in ("annotation", "returns")
        for x in _under(getattr(node, part, None))
    }
    hints |= {
        id(node.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.keyword) and node.arg == "strict"
    }
    found = []
    for number, node in enumerate(ast.walk(tree)):
        line = getattr(node, "lineno", 0)
        if id(node) in hints:
            continue
        if isinstance(node, ast.BinOp | ast.BoolOp) and type(node.op) in OPPOSITE:
            found.append(
                (
                    number,
                    f"line {line}: {type(node.op).__name__} -> {OPPOSITE[type(node.op)].__name__}",
                )
            )
        elif isinstance(node, ast.Compare) and type(node.ops[0]) in OPPOSITE:
            found.append(
                (
                    number,
                    (
                        f"line {line}: {type(node.ops[0]).__name__} ->"
                        f" {OPPOSITE[type(node.ops[0])].__name__}"
                    ),
                )
            )
        elif isinstance(node, ast.Constant) and type(node.value) in (int, float):
            found.append((number, f"line {line}: {node.value} -> {node.value + 1}"))
        elif isinstance(node, ast.Constant) and type(node.value) is bool:
            found.append((number, f"line {line}: {node.value} -> {not node.value}"))
    return found


def _under(node: ast.AST | None) -> list[ast.AST]:
    return [] if node is None else list(ast.walk(node))


def mutated(tree: ast.Module, number: int) -> str:
    """The module's text with one node changed."""
    tree = copy.deepcopy(tree)
    node = list(ast.walk(tree))[number]
    if isinstance(node, ast.BinOp | ast.BoolOp):
        node.op = OPPOSITE[type(node.op)]()
    elif isinstance(node, ast.Compare):
        node.ops[0] = OPPOSITE[type(node.ops[0])]()
    elif isinstance(node, ast.Constant):
        node.value = not node.value if isinstance(node.value, bool) else node.value + 1
    return ast.unparse(tree)


def noticed(module: str, text: str, cache: str) -> str:
    """ "quick" or "slow": the tests that fail on this mutant; "" if none does."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for part in ("jaxidl", "tests", "experiments"):
            shutil.copytree(
                ROOT / part, folder / part, ignore=shutil.ignore_patterns("__pycache__")
            )
        shutil.copy(ROOT / "pyproject.toml", folder)
        (folder / "jaxidl" / module).write_text(text)
        files = ["tests/" + test.replace("/", "/test_") + ".py" for test in MODULES[module]]
        environment = os.environ | {
            "PYTHONPATH": name,
            "JAX_COMPILATION_CACHE_DIR": cache,
            "JAX_PLATFORMS": "cpu",
        }
        environment |= {
            "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
            "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "-1",
        }
        for which, marked in (("quick", "not slow"), ("slow", "slow")):
            words = [
                sys.executable,
                "-m",
                "pytest",
                "-x",
                "-q",
                "-o",
                "addopts=",
                "-p",
                "no:cacheprovider",
                "-m",
                marked,
                *files,
            ]
            try:
                done = subprocess.run(
                    words,
                    cwd=folder,
                    env=environment,
                    capture_output=True,
                    check=False,
                    timeout=900,
                )
            except subprocess.TimeoutExpired:
                return which
            if done.returncode not in (0, 5):  # 5: there are none of these
                return which
    return ""


def main() -> None:
    options = arguments(__doc__ or "", each=6, workers=2, only="")
    table, survivors = [], []
    if options.only and options.json and options.json.exists():
        before = json.loads(options.json.read_text())
        table = [row for row in before["rows"] if row["module"] != options.only]
        survivors = [s for s in before["survived"] if not s.startswith(options.only)]
    with tempfile.TemporaryDirectory() as cache, ThreadPoolExecutor(options.workers) as pool:
        for module in [options.only] if options.only else MODULES:
            tree = ast.parse((ROOT / "jaxidl" / module).read_text())
            chosen = random.Random(0).sample(places(tree), options.each)
            texts = [mutated(tree, number) for number, _ in chosen]
            found = list(pool.map(lambda text, module=module: noticed(module, text, cache), texts))
            counts = {which: found.count(which) for which in ("quick", "slow", "")}
            table.append(
                {
                    "module": module,
                    "mutants": len(found),
                    "quick": counts["quick"],
                    "slow": counts["slow"],
                    "revision": revision(),
                }
            )
            survivors += [
                f"{module} {what}" for (_, what), by in zip(chosen, found, strict=True) if not by
            ]
            print(table[-1], file=sys.stderr, flush=True)
    print("survived:", *survivors or ["none"], sep="\n  ", file=sys.stderr)
    report(
        "Mutants noticed by the quick and, where these pass, by the slow tests",
        table,
        options.json,
        machine=machine(),
        survived=survivors,
    )


if __name__ == "__main__":
    main()
