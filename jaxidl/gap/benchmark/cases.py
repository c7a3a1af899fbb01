"""The cases of the benchmark.

They are every effect alone at three severities, pairs, nothing, and effects outside the catalogue.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from jaxidl.gap.benchmark.catalogue import make
from jaxidl.gap.benchmark.engine import Run, run
from jaxidl.gap.benchmark.hidden import Hidden, generator, hide, number, plans
from jaxidl.gap.benchmark.mechanisms import MECHANISMS
from jaxidl.gap.benchmark.reference import Array


@dataclass(frozen=True)
class Case:
    """One log to be judged.

    The identity says nothing about what is hidden.
    """

    id: str
    mechanism: str
    seed: int
    hidden: tuple[Hidden, ...]
    severity: str | None  # "weak", "medium", "clear"; None where nothing is hidden

    @property
    def family(self) -> str:
        """``"none"``, ``"single"``, ``"pair"`` or ``"outside"``."""
        names = [hidden.effect for hidden in self.hidden]
        return "outside" if names == ["outside"] else ("none", "single", "pair")[len(names)]

    @property
    def log(self) -> str:
        """Name of the log's file, CSV or NPZ at random."""
        return "log.npz" if self.seed % 2 else "log.csv"

    def write(self, folder: Path) -> None:
        """Measure and write log and model: see :func:`write_case`."""
        write_case(self, folder)

    def measure(
        self,
        duration: float = 24.0,
        motion: tuple[Array, Array, Array] | None = None,
        most: Array | None = None,
    ) -> Run:
        """Run the engine, along a given ``motion`` if there is one, and within torques ``most``.

        Raises:
            Diverged: if the controller lost the mechanism, as for a case or two of most roots.
        """
        return run(
            MECHANISMS[self.mechanism],
            [make(*hidden) for hidden in self.hidden],
            self.seed,
            duration,
            motion=motion,
            most=most,
        )


def all_cases(root: int = 2026) -> list[Case]:
    """Return every case.

    Their order is meaningless to the workflow. A case is the same for the same ``root``, whatever
    else is in the list.
    """
    cases = []
    for mechanism in MECHANISMS:
        for label, severity, rows in plans(mechanism, root):
            rng = generator(root, mechanism, label)
            seed = int(rng.integers(2**31))
            hidden = tuple(hide(row, joint, severity, rng, mechanism, seed) for row, joint in rows)
            cases.append(
                Case(
                    f"{mechanism}-{number(root, mechanism, label):08x}",
                    mechanism,
                    seed,
                    hidden,
                    severity if rows else None,
                )
            )
    return cases


def write_case(case: Case, folder: Path, duration: float = 24.0) -> None:
    """Measure ``case`` and write its log and model.

    They are ``folder/log.csv`` or ``folder/log.npz`` and ``folder/model.xml``, without the truth.

    Raises:
        Diverged: if the controller lost the mechanism.
    """
    columns = case.measure(duration).log()
    folder.mkdir(parents=True, exist_ok=True)
    if case.log.endswith("npz"):
        np.savez(folder / case.log, **columns)  # pyright: ignore[reportArgumentType]
    else:
        form = ["%.8g" if name.startswith("tau") else "%.6f" for name in columns]
        table = np.column_stack(list(columns.values()))
        np.savetxt(
            folder / case.log, table, fmt=form, delimiter=",", header=",".join(columns), comments=""
        )
    (folder / "model.xml").write_text(MECHANISMS[case.mechanism])


def truth(cases: Iterable[Case]) -> dict[str, dict[str, Any]]:
    """Return what is hidden, by the cases' identities.

    It is ``mechanism``, ``family``, ``severity`` and ``hidden`` of each.
    """
    return {
        case.id: {
            "mechanism": case.mechanism,
            "family": case.family,
            "severity": case.severity,
            "hidden": [
                {"effect": h.effect, "joint": h.joint, "parameters": dict(h.parameters)}
                for h in case.hidden
            ],
        }
        for case in cases
    }
