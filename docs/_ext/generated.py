"""Tables that are made when the site is built, from the committed results and from the code:
``{generated} claims``.
"""

import importlib.util
import json
import re
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.util.docutils import SphinxDirective

from jaxidl.files import markdown

ROOT = Path(__file__).resolve().parents[2]
FIGURES = ROOT / "figures"


def load(name: str) -> Any:
    return json.loads((FIGURES / f"{name}.json").read_text(encoding="utf-8"))


def table(headings: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    """A Markdown table whose cells may have bars."""
    clean = [[str(cell).replace("|", "\\|") for cell in row] for row in rows]
    return markdown(tuple(headings), clean)


def interval(mean: dict[str, Any], digits: int = 2) -> str:
    text = f"{mean['value']:.{digits}g}"
    if mean.get("interval"):
        text += " [{:.{d}g}, {:.{d}g}]".format(*mean["interval"], d=digits)
    return text


# the study


def claims() -> str:
    """The verdicts of ``jaxidl claims``, the verdict first."""
    rows = load("claims")["claims"]
    signs = {"holds": "✓", "only partly": "◐", "does not hold": "✗"}
    body = [
        (
            row["statement"],
            f"{signs[row['verdict']]} {row['verdict']}" + f": {row['why']}" * bool(row["why"]),
            interval(row["average"]) if row["average"] else "-",
            interval(row["typical"]) if row["typical"] else "-",
            row["true_if"],
            row["measure"],
            ", ".join(f"{k} {v}" for k, v in row["beside"].items()),
        )
        for row in rows
    ]
    head = ("statement", "verdict", "on average", "typically", "true if", "measured as",
            "the same for others")  # fmt: skip
    seeds = max(row["average"]["seeds"] for row in rows if row["average"])
    note = (
        f"*Geometric mean over {seeds} seeds [95 % interval]. On average: means over settings;"
        f" typically: medians. {rows[0]['left_out']} diverged iterations left out. The last column"
        ' has the same statistic for the other sources, with "(true)" where the statement would'
        " hold for them, too.*"
    )
    return f"{table(head, body)}\n\n{note}"


def claims_counted() -> str:
    """How many statements hold."""
    verdicts = [row["verdict"] for row in load("claims")["claims"]]
    counts = {v: verdicts.count(v) for v in ("holds", "only partly", "does not hold")}
    return (
        f"Of {len(verdicts)} statements {counts['holds']} hold, {counts['only partly']} hold only"
        f" partly, and {counts['does not hold']} do not hold."
    )


def arm_ranking() -> str:
    from jaxidl.arm.table import as_text

    return as_text(load("arm")["study"]["ranking"])


def arm_latency() -> str:
    rows = load("arm")["latency"]
    return table(
        ("what", "median [µs]", "99 %", "99.9 %", "longest", "over 1 ms"),
        (
            (row["what"], *(f"{row[k]:.0f}" for k in ("median [us]", "99 %", "99.9 %", "max")),
             f"{row['over 1 ms']} of {row['of']}")
            for row in rows
        ),
    )  # fmt: skip


def text_table(name: str) -> str:
    """A Markdown table that a command wrote, with effects in words."""
    return (FIGURES / f"{name}.md").read_text(encoding="utf-8")


def ablation_runs() -> str:
    """Command, size and origin of each ablation."""
    rows = [
        (
            f"[{name.replace('_', ' ')}](#ablation-{name.replace('_', '-')})",
            f"`{about['command'].split(' --out')[0]}`",
            about["runs"],
            about["programs"],
            f"{about['seconds']:.0f}",
            f"`{about['revision'][:7]}`",
        )
        for name, about in load("ablations").items()
    ]
    return table(("ablation", "command", "learning runs", "programs", "seconds", "revision"), rows)


# tuning and derivatives


TUNED = {
    "tune_arm": "arm, DOOMED",
    "tune_doomed": "point mass, DOOMED at low gain",
    "tune_pid": "point mass, PID at low gain",
}


def tuning() -> str:
    """What gradient and random search found, on fresh seeds."""
    rows: list[tuple[str, ...]] = []
    for name, title in TUNED.items():
        found = load(name)
        for quantity, words in (("error", "position error"), ("effort", "applied feedback")):
            cells = []
            for pair in ("gradient / as it is", "random / as it is", "gradient / random"):
                mean = found["compared"][pair][quantity]
                low, high = mean["interval"]
                cells.append(f"{mean['ratio']:.2f} [{low:.2f}, {high:.2f}]")
            numbers = str(len(found["numbers"]["as it is"])) if quantity == "error" else ""
            rows.append((f"{title}: {words}", numbers, *cells))
    head = ("fresh seeds, geometric mean of the ratios [95 %]", "numbers tuned",
            "gradient / as it was", "random search / as it was",
            "gradient / random search")  # fmt: skip
    return table(head, rows)


def derivative_tells() -> str:
    """Derivative and differences, sharp and rounded."""
    found = load("derivative_tells")["networks"]

    def number(x: float) -> str:
        return f"{x:,.0f}".replace(",", " ") if abs(x) >= 1e3 else f"{x:.3g}"

    rows = [
        (name, number(about["derivative"]), *(number(x) for x in about["differences"].values()))
        for name, about in found.items()
    ]
    return table(
        ("networks", "derivative", "difference over ±1e-7 of the gain", "±1e-5", "±0.1 %", "±3 %"),
        rows,
    )


# the gap finder


def share(cell: dict[str, Any]) -> str:
    if not cell["n"]:
        return "-"
    low, high = (max(100.0 * cell[k], 0.0) for k in ("low", "high"))
    return f"{100.0 * cell['share']:.0f} % [{low:.0f}, {high:.0f}] of {cell['n']}"


def gap_benchmark() -> str:
    """The headline numbers of the hidden-effects benchmark."""
    b = load("gap_benchmark")
    robots, worn, single = b["robots"], b["worn"], b["singles"]
    best = {kind: share(by["0.9-1.0"]) for kind, by in b["calibration"].items()}
    rows = [
        ("whole robots of 3 to 7 joints: names that are right", share(robots["precision"])),
        ("… hidden effects worth 3 % of a joint's command that are found",
         share(robots["recall"])),
        ("worn robots: names that are right", share(worn["precision"])),
        ("… hidden effects found", share(worn["recall"])),
        ("nothing hidden: false alarms", share(b["none"]["false_alarm"])),
        ("one clear effect: named and nothing else (halves for a tie that is said)",
         share(single["right"])),
        ("… if a tie that physics makes counts in full", share(single["right_or_tied"])),
        ("two effects: each of them found", share(b["pairs"]["found"])),
        ("… if a tie that physics makes counts in full", share(b["pairs"]["found_or_tied"])),
        ("an effect that the catalogue does not have: misnamed with confidence",
         share(b["outside"]["misnamed"])),
        ("names at a confidence of 0.9 to 1.0 that are right: robots", best["robot"]),
        ("… worn robots", best["worn"]),
        ("… one effect", best["single"]),
        ("… two effects", best["pair"]),
        ("… outside the catalogue (none can be right)", best["outside"]),
        ("true values within two standard errors: single effects",
         share(b["parameters"]["within_two_stderr"])),
        ("… robots", share(robots["parameters"]["within_two_stderr"])),
        ("… worn robots", share(worn["parameters"]["within_two_stderr"])),
    ]  # fmt: skip
    cases = ", ".join(f"{n} {kind}" for kind, n in b["cases"].items())
    note = f"*Root {b['root']}, revision `{b['revision'][:7]}`; cases: {cases}.*"
    return table(("what", "share with 95 % interval"), rows) + f"\n\n{note}"


def gap_benchmark_by_effect() -> str:
    """Right, effect by effect."""
    b = load("gap_benchmark")
    robots = b["robots"]
    names = sorted({*b["singles"]["by_effect"], *robots["recall_by_effect"]})
    empty = {"n": 0}
    rows = [
        (f"[`{n}`](#effect-{n.replace('_', '-')})",
         *(share(where.get(n, empty)) for where in (b["singles"]["by_effect"],
           robots["precision_by_effect"], robots["recall_by_effect"])))
        for n in names
    ]  # fmt: skip
    head = ("effect", "alone: right", "robots: names that are right", "robots: hidden ones found")
    return table(head, rows)


def peers() -> str:
    """All peers on the measured logs, a section for each log."""
    path = ROOT / "experiments" / "peers" / "table.py"
    spec = importlib.util.spec_from_file_location("peers_table", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    text = module.table(load("peers"))
    return re.sub(r"^### (\w+)", lambda case: f"**{LOGS.get(case[1], case[1])}**", text, flags=re.M)


LOGS = {
    "emps": "EMPS, a drive",
    "ur10e": "UR10e without load, a model without friction",
    "ur10e_load": "UR10e with 2.8 kg at the flange, a model without friction",
    "ur10e_change": "UR10e with 2.8 kg, the log without load as reference",
    "xl330": "XL330, a servo with a pendulum",
}


# the code


def _bound(x: float) -> str:
    return "-∞" if x == -float("inf") else "∞" if x == float("inf") else f"{x:g}"


def catalogue() -> str:
    """All effects in one table."""
    from jaxidl.effects import CATALOGUE, searched

    rows = []
    for name, cls in CATALOGUE.items():
        parameters = ", ".join(f"{k} [{p.unit}]" for k, p in cls.parameters.items())
        rows.append(
            (
                f"[`{name}`](#effect-{name.replace('_', '-')})",
                cls.sentence,
                parameters,
                ", ".join(dict.fromkeys(cls.mjcf.values())) or "-",
                "yes" if name in searched() else "no",
            )
        )
    return table(("name", "meaning", "parameters", "in MJCF", "looked for"), rows)


def effects() -> str:
    """Each effect: what it is, its parameters with units and bounds."""
    from jaxidl.effects import CATALOGUE

    parts = []
    for name, cls in CATALOGUE.items():
        first = (cls.__doc__ or "").strip().split("\n\n")[0].replace("\n", " ")
        rows = [
            (f"`{k}`", p.unit, p.meaning, f"{_bound(p.lower)} to {_bound(p.upper)}")
            for k, p in cls.parameters.items()
        ]
        doc = " ".join(first.split()).replace("*", "\\*").replace("_", "\\_")
        parts.append(
            f"(effect-{name.replace('_', '-')})=\n## `{name}`\n\n"
            f"{cls.sentence[0].upper() + cls.sentence[1:]}.\n\n{doc}\n\n"
            f"{table(('parameter', 'unit', 'meaning', 'bounds'), rows)}\n\n"
            f"Class {{py:class}}`jaxidl.effects.{cls.__name__}`. To tell it from what looks alike:"
            f" {cls.advice}.\n"
        )
    return "\n".join(parts)


def command(name: str) -> str:
    """The help of one command."""
    import tyro

    from jaxidl.cli import COMMANDS

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        parser = tyro.extras.get_parser(COMMANDS[name], prog=f"jaxidl {name}")
    parts = [_plain(parser.description or ""), "", "{.options}"]
    for action in parser._actions:
        if "--help" in action.option_strings:
            continue
        flags = [f for f in action.option_strings if not f.startswith("--no-")]
        taken = action.nargs != 0 and action.metavar is not None
        metavar = f" {_words(action.metavar)}" if taken else ""
        if "--no-" + (flags[0][2:] if flags else "") in action.option_strings:
            metavar = ""  # a switch
        heading = f"`{flags[0]}{metavar}`" if flags else f"`{metavar.strip()}`"
        heading += "".join(f", `{f}`" for f in flags[1:])
        parts += [heading, f": {_plain(action.help or '')}", ""]
    return "\n".join(parts)


def _words(metavar: Any) -> str:
    text = " ".join(metavar) if isinstance(metavar, tuple) else str(metavar)
    text = text.replace("{None}|", "")
    return re.sub(r"\[(\w+) \[\1 \.\.\.\]\]", r"\1 ...", text)


def _plain(text: str) -> str:
    """Help text as one Markdown paragraph."""
    text = " ".join(text.split())
    text = re.sub(r" ?\(default: (None|False|)\)", "", text)
    text = re.sub(r"([*_<>\[\]|])", r"\\\1", text)
    return re.sub(r"(?<![\w-])(--[a-z][\w-]*)", r"`\1`", text)


def public_names() -> str:
    """The names of the package, with the first sentence of each."""
    import jaxidl

    rows = []
    for name in jaxidl.__all__:
        thing = getattr(jaxidl, name)
        home = getattr(thing, "__module__", "")
        doc = " ".join((getattr(thing, "__doc__", "") or "").strip().split("\n\n")[0].split())
        first = re.split(r"(?<=[^q]\.)\s", doc)[0]  # not after "eq."
        if isinstance(thing, dict):
            first = f"{len(thing)} by name: `{', '.join(list(thing)[:3])}`, …".replace(
                ", ", "`, `", 2
            )
        role = "class" if isinstance(thing, type) else "func"
        where = f"`{home}`" if home else ""
        rows.append((f"{{py:{role}}}`{name} <{_documented(thing, name)}>`" if home else f"`{name}`",
                     first, where))  # fmt: skip
    return table(("name", "meaning", "from"), rows)


def _documented(thing: Any, name: str) -> str:
    """Under which full name the reference has it: of a package that is described as one, or of its
    home.
    """
    import importlib

    package = ".".join(thing.__module__.split(".")[:2])
    page = ROOT / "docs" / "reference" / "api" / f"{package.rpartition('.')[2]}.md"
    described = page.is_file() and f".. automodule:: {package}\n" in page.read_text("utf-8")
    if described and name in importlib.import_module(package).__all__:
        return f"{package}.{name}"
    return f"{thing.__module__}.{name}"


MAKERS: dict[str, Callable[..., str]] = {
    f.__name__.replace("_", "-"): f
    for f in (
        claims, claims_counted, arm_ranking, arm_latency, ablation_runs, tuning, derivative_tells,
        gap_benchmark, gap_benchmark_by_effect, peers, catalogue, effects, command, public_names,
        text_table,
    )
}  # fmt: skip


class Generated(SphinxDirective):
    """``{generated} NAME [ARGUMENT ...]``: Markdown made by the function of that name."""

    required_arguments = 1
    optional_arguments = 4

    def run(self) -> list[nodes.Node]:
        name, *arguments = self.arguments
        for path in FIGURES.glob("*.json"):
            self.env.note_dependency(str(path))
        text = MAKERS[name](*arguments)
        node = nodes.Element()
        node.document = self.state.document
        lines = StringList(text.splitlines(), source=f"<{name}>")
        self.state.nested_parse(lines, self.content_offset, node, match_titles=True)
        return node.children


def check_sections(app: Sphinx, env: Any) -> None:
    """Every command and every ablation has its section."""
    from jaxidl.cli import COMMANDS

    for page, kind, names in (
        ("reference/commands.md", "command ", {*COMMANDS}),
        ("explanation/ablations.md", "text-table ablation_", {*load("ablations")}),
    ):
        text = (Path(app.srcdir) / page).read_text(encoding="utf-8")
        said = set(re.findall(rf"^```\{{generated\}} {kind}(\S+)$", text, flags=re.M))
        for name in sorted(names ^ said):
            logging.getLogger(__name__).warning("%s and %s%s differ", page, kind, name)


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_directive("generated", Generated)
    app.connect("env-updated", check_sections)
    return {"parallel_read_safe": True}
