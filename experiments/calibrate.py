"""Fit the confidence of the gap finder's findings: ``python experiments/calibrate.py DIR ...
[--only SIGN ...]``.

Each DIR is one of ``jaxidl gap-benchmark --out DIR``, or the ``--work`` of ``strangers.py``. The
weights go to ``jaxidl/gap/result/calibration.json``; with ``--only`` those of other signs stay as
they are there. What is reported about them comes from other roots and seeds.
"""

import argparse
import json
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

from strangers import right

from jaxidl.files import write_bytes
from jaxidl.gap.benchmark.calibration import fitted, is_right
from jaxidl.gap.result import calibration

Row = tuple[str, Mapping[str, float], bool]  # family, signs, whether it is right


def of_benchmark(folder: Path) -> Iterator[Row]:
    """Yield the findings of a benchmark."""
    for name, truth in json.loads((folder / "truth.json").read_text()).items():
        path = folder / "reports" / f"{name}.json"
        report = json.loads(path.read_text()) if path.is_file() else {"effects": []}
        for effect in report.get("effects", []):
            yield truth["family"], effect["signs"], is_right(truth, report, effect)


def of_strangers(folder: Path) -> Iterator[Row]:
    """Yield the findings on published robots."""
    for path in sorted(folder.glob("*/gap/report.json")):
        truth = json.loads((path.parents[1] / "truth.json").read_text())
        for effect in json.loads(path.read_text())["effects"]:
            yield "published", effect["signs"], right(truth, effect) is not None


def main() -> None:
    """Fit and write the weights."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--only", nargs="+", default=[], choices=list(calibration.SIGNS))
    given = parser.parse_args()
    rows: list[Row] = []
    sources = dict[str, list[int]](roots=[], seeds=[])
    for folder in given.folders:
        if (folder / "truth.json").is_file():
            rows += of_benchmark(folder)
            sources["roots"].append(json.loads((folder / "root.json").read_text())["root"])
        else:
            rows += of_strangers(folder)
            sources["seeds"] += {int(path.name.split("-")[0]) for path in folder.glob("*-*")}
    known = json.loads(calibration.WEIGHTS.read_text()) if given.only else {}
    fresh = {
        **{name: sorted(set(numbers)) for name, numbers in sources.items()},
        "findings": dict(sorted(Counter(family for family, _, _ in rows).items())),
    }
    weights = fitted(rows, only=given.only, held=known.get("weights"))
    later = [*known.get("only", []), {"signs": given.only, **fresh}]
    rest = {"only": later} if given.only else fresh
    result = known | {"weights": weights} | rest
    write_bytes(calibration.WEIGHTS, (json.dumps(result, indent=1) + "\n").encode())
    print(f"{len(rows)} findings: {calibration.WEIGHTS}")


if __name__ == "__main__":
    main()
