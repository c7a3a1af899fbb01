"""Fit the confidence of the gap finder's findings to finished benchmarks: ``python
experiments/calibrate.py DIR ...``.

Each DIR is one of ``jaxidl gap-benchmark --out DIR``. The weights go to
``jaxidl/gap/calibration.json``. What is reported about them comes from a benchmark of another root.
"""

import json
import sys
from collections import Counter
from pathlib import Path

from jaxidl.files import write_bytes
from jaxidl.gap import calibration
from jaxidl.gap.benchmark.calibration import fitted, is_right


def main(folders: list[Path]) -> None:
    """Fit and write the weights."""
    rows, roots = [], set()
    for folder in folders:
        roots.add(json.loads((folder / "root.json").read_text())["root"])
        for name, truth in json.loads((folder / "truth.json").read_text()).items():
            path = folder / "reports" / f"{name}.json"
            report = json.loads(path.read_text()) if path.is_file() else {"effects": []}
            for effect in report.get("effects", []):
                rows.append((truth["family"], effect["signs"], is_right(truth, report, effect)))
    counts = Counter(family for family, _, _ in rows)
    result = {
        "weights": fitted(rows),
        "roots": sorted(roots),
        "findings": dict(sorted(counts.items())),
    }
    write_bytes(calibration.WEIGHTS, (json.dumps(result, indent=1) + "\n").encode())
    print(f"{len(rows)} findings of roots {sorted(roots)}: {calibration.WEIGHTS}")


if __name__ == "__main__":
    main([Path(name) for name in sys.argv[1:]])
