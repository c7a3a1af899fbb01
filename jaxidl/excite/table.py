"""What a motion is predicted to tell: standard errors and separations, before and after."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from jaxidl.backend import jit_quickly
from jaxidl.excite.criteria import RIDGE, Evidence, separations, standard_errors
from jaxidl.excite.design import Designed
from jaxidl.excite.parameters import Parameter
from jaxidl.excite.prepare import Prepared
from jaxidl.files import markdown
from jaxidl.gap.result.words import readable

MORE_THAN = 1e3  # sizes: a standard error of more says that the motion tells nothing
HARDLY = 0.9  # share of what was known beforehand, likewise


def evidence(made: Prepared, found: Designed) -> tuple[Evidence, Evidence]:
    """Return the evidence before and with the motion.

    Before is the earlier log's or, where there is none, that of the median random motion.
    """
    plan = made.plan
    run = jit_quickly(lambda q, qd, qdd, dt: plan.evidence(q, qd, qdd, dt)[0], static_argnums=3)
    stride = max(1, round(plan.dt / float(found.time[1] - found.time[0])))
    dt = stride * float(found.time[1] - found.time[0])
    new = run(*(x[::stride] for x in (found.q, found.qd, found.qdd)), dt)
    if plan.earlier is not None:
        return plan.earlier, new.plus(plan.earlier)
    return run(*(x[::stride] for x in found.chance), dt), new


def errors(made: Prepared, before: Evidence, after: Evidence) -> list[dict[str, Any]]:
    """Return the predicted standard errors of each parameter, before and after."""
    plan, rows = made.plan, []
    contest = plan.contest
    sets = [tuple(range(len(plan.size)))] if contest is None else contest.free
    seen: set[Parameter] = set()
    grams = [np.asarray(plan.gram(seen)) for seen in (before, after)]
    for own in sets:
        at = np.array(own)
        pair = []
        for gram in grams:
            inside = gram[np.ix_(at, at)]
            pair.append(standard_errors(inside, plan.size[at], 1.0 if contest else RIDGE))
        for n, (a, b) in zip(own, zip(*pair, strict=True), strict=True):
            label = made.labels[n]
            if label not in seen and plan.size[n] > 0.0:
                seen.add(label)
                most = MORE_THAN if contest is None else HARDLY
                known = b < most * plan.size[n]
                rows.append(
                    label._asdict() | {"before": float(a), "after": float(b), "known": bool(known)}
                )
    return rows


def separated(
    made: Prepared, titles: Sequence[str], before: Evidence, after: Evidence
) -> list[dict[str, Any]]:
    """Return for each pair of explanations how far apart it is, before and after.

    It is the expected difference of the gap finder's scores where the wrong one is fitted;
    ``asked`` is what it asks to call them different.
    """
    contest = made.plan.contest
    if contest is None:
        return []
    one, both = (separations(seen, contest) for seen in (before, after))
    return [
        {
            "true": titles[a],
            "fitted": titles[b],
            "before": float(one.score[n]),
            "after": float(both.score[n]),
            "asked": float(both.asked[n]),
        }
        for n, (a, b) in enumerate(contest.pairs)
    ]


def text(
    names: Sequence[str], rows: Sequence[dict[str, Any]], apart: Sequence[dict[str, Any]], old: str
) -> str:
    """Return both tables as Markdown; ``old`` says what "before" is."""
    out = []
    if apart:
        head = ["if it is", "and one fits", f"score apart, {old}", "with this motion", "asked"]
        out.append(
            markdown(
                head,
                (
                    [r["true"], r["fitted"], *(f"{r[k]:.3g}" for k in ("before", "after", "asked"))]
                    for r in apart
                ),
            )
        )
    head = ["effect", "joint", "parameter", f"standard error, {old}", "with this motion", "ratio"]
    out.append(
        markdown(
            head,
            (
                [
                    readable(r["effect"]),
                    "" if r["joint"] is None else names[r["joint"]],
                    r["name"],
                    f"{r['before']:.2g} {r['unit']}".strip(),
                    f"{r['after']:.2g} {r['unit']}".strip() if r["known"] else "not known",
                    f"{r['after'] / r['before']:.2f}",
                ]
                for r in rows
            ),
        )
    )
    return "\n\n".join(out)
