"""A diagnosis as one self-contained HTML page for a screen, a phone or paper.

It has no scripts and fetches nothing.
"""

import base64
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jaxidl.gap.result.diagnosis import Diagnosis
from jaxidl.report.findings import found, worth
from jaxidl.report.html import Html, tag
from jaxidl.report.sections import (
    ambiguous,
    errors,
    left,
    method,
    next_steps,
    places,
    refined,
    remains,
    rivals,
)
from jaxidl.report.words import badge, compared, oneline, verdict

CAPTIONS = {
    "gap": (
        "Above: root mean square torque error on held-out data, relative to the command; dashed:"
        " error due to encoder noise alone; diamonds: conventional identification. Below: how far"
        " the simulation departs from the measurement when it replays the logged torque."
    ),
    "residual": (
        "The residual is the commanded torque minus the one that the model needs for the measured"
        " motion. Its gaps are where a joint comes to rest or breaks away, or where something hit"
        " the robot, which is not counted."
    ),
    "where": (
        "A step at zero velocity is dry friction, a slope over velocity viscous friction, a slope"
        " over acceleration an inertia, a shape over position a spring, ripple or uneven friction."
        " Bars: one standard deviation of the samples."
    ),
    "spectrum": (
        "The dashed line is the noise of the encoders, differentiated twice; no model removes it."
    ),
    "improvement": (
        "How much larger the held-out error is without the effect, all others being fitted"
        " again. Hollow bars: suspected only. Lines: two standard errors."
    ),
    "parameters": (
        "Bars and bands: two standard errors. Where an interval contains zero, this log does not"
        " determine the parameter."
    ),
}


def page(
    d: Diagnosis, figures: Mapping[str, bytes], record: Sequence[Mapping[str, Any]], folder: Path
) -> str:
    """Return the page's text.

    Args:
        d: the diagnosis.
        figures: PNG content by name, as :func:`jaxidl.report.draw` returns it.
        record: the effects of ``effects.json``, those found last.
        folder: where the corrected model will be, for the instructions.
    """
    title = f"Gap report: {d.model.path.name}"
    pictures = {name: _figure(name, content) for name, content in figures.items()}
    told = [pictures.get(name) for name in ("residual", "where", "spectrum")]
    changed = compared(d)
    sections = [
        _head(d, title),
        _section(
            "What has changed since the reference log" if changed else "What is missing", *found(d)
        ),
        _section(
            "The error, before and after" if d.findings else "The error",
            errors(d),
            pictures.get("gap"),
        ),
        _section("What is not explained", left(d)) if d.unexplained else None,
        _section("What this log cannot distinguish", ambiguous(d)) if d.ambiguous else None,
        (
            _section("Improvement by each effect", pictures.get("improvement"), worth(d, record))
            if d.findings
            else None
        ),
        _section("The parameters", pictures["parameters"]) if "parameters" in pictures else None,
        _section("The parameters fitted to motion", refined(d)) if d.refinement else None,
        _section("What was rejected, and why", rivals(d)) if d.rivals else None,
        _section("Where the error is", *told, places(d, d.where, "Joint by joint, in words")),
        _section("What remains", remains(d)),
        _section("What to do next", next_steps(d, record, folder)),
        _section("Data and method", method(d)),
    ]
    meta = (
        tag("meta", charset="utf-8"),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
    )
    style = Html(Path(__file__).with_name("page.css").read_text())
    head = tag("head", *meta, tag("title", title), tag("style", style))
    return f"<!DOCTYPE html>\n{tag('html', head, tag('body', tag('main', sections)), lang='en')}\n"


def fragment(d: Diagnosis) -> str:
    """Return verdict and tables for a notebook, without figures and style sheet."""
    line = tag("p", tag("strong", badge(d)), ": ", verdict(d))
    return tag(
        "div",
        line,
        *found(d),
        errors(d),
        left(d) if d.unexplained else None,
        ambiguous(d) if d.ambiguous else None,
    )


def _head(d: Diagnosis, title: str) -> Html:
    joints = len(d.model.names)
    logs = {
        "log": d.options.get("log", ()),
        "reference": d.options.get("reference_log", ()),
    }
    about = "; ".join(
        [
            f"{what}: {', '.join(oneline(Path(name).name) for name in names)}"
            for what, names in logs.items()
            if names
        ]
        + [f"{joints} joint{'s' * (joints != 1)}: {', '.join(map(oneline, d.model.names))}"]
    )
    about = about[0].upper() + about[1:]
    mark = tag("span", badge(d), class_="badge", style=f"background:var(--{d.verdict})")
    return tag(
        "header",
        tag("h1", title),
        tag("p", about, class_="soft"),
        tag("div", mark, tag("span", verdict(d)), class_="verdict"),
    )


def _section(title: str, *content: Any) -> Html:
    return tag("section", tag("h2", title), *content)


def _figure(name: str, content: bytes) -> Html:
    source = "data:image/png;base64," + base64.b64encode(content).decode()
    return tag(
        "figure",
        tag("div", tag("img", src=source, alt=CAPTIONS[name])),
        tag("figcaption", CAPTIONS[name]),
    )
