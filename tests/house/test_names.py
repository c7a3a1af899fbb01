"""No module but the catalogue names an effect, so that users' own effects have the same rights."""

import ast
from pathlib import Path

from jaxidl.effects import CATALOGUE, catalogue

PACKAGE = Path(catalogue.__file__).parents[1]
BUILDERS = (  # they put effects into plants, or inject them by an engine of their own
    "__init__.py",
    "learning",
    "arm",
    "paper",
    "tune",
    "gap/benchmark",
    "models",  # a network's scale of torques has the same name
)
NAMES = {name for name in CATALOGUE if "_" in name}  # of one word may be anything
CLASSES = {cls.__name__ for cls in catalogue._BUILT_IN}


def named(path: Path) -> set[str]:
    """Effects that a module names, as classes or as whole strings."""
    nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    classes = {
        getattr(node, key)
        for node in nodes
        for key in ("id", "attr", "name")
        if isinstance(getattr(node, key, None), str)
    }
    texts = {
        node.value
        for node in nodes
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    }
    return (classes & CLASSES) | (texts & NAMES)


def test_no_module_outside_the_catalogue_names_an_effect():
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        place = path.relative_to(PACKAGE).as_posix()
        elsewhere = (
            not place.startswith(("effects/", *(f"{b}/" for b in BUILDERS)))
            and place not in BUILDERS
        )
        if elsewhere and (words := named(path)):
            found[place] = sorted(words)
    assert not found


def test_names_are_seen_where_they_stand(tmp_path):
    for text, seen in (
        ("from jaxidl.effects import Spring as S", {"Spring"}),
        ("x = effects.ViscousFriction", {"ViscousFriction"}),
        ('if effect.name == "torque_scale": pass', {"torque_scale"}),
        ('"""Says torque_scale."""; torque_scale = 1', set()),
    ):
        (tmp_path / "module.py").write_text(text)
        assert named(tmp_path / "module.py") == seen
