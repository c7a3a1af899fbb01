"""Pure functions of a few numbers as C expressions.

A function is traced by JAX and computed with symbols instead of numbers. What only moves values
(slices, scatters, broadcasts) is computed by JAX itself, on the symbols' numbers; arithmetic
becomes text. So any effect of a plant can be written as C, also one that a user defined.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxidl.errors import ConfigurationError
from jaxidl.robot.c.text import scalar, table

# C of elementwise primitives; {0}, {1} … are their arguments
_ARITHMETIC = {
    "add": "{0} + {1}",
    "add_any": "{0} + {1}",
    "sub": "{0} - {1}",
    "mul": "{0} * {1}",
    "div": "{0} / {1}",
    "neg": "-{0}",
    "gt": "{0} > {1}",
    "ge": "{0} >= {1}",
    "lt": "{0} < {1}",
    "le": "{0} <= {1}",
    "eq": "{0} == {1}",
    "ne": "{0} != {1}",
    "and": "{0} && {1}",
    "or": "{0} || {1}",
    "not": "!{0}",
}
_CALLS = {
    "max": "larger",
    "min": "smaller",
    "sign": "sign",
    "square": "square",
    "logistic": "logistic",
    "abs": "M(fabs)",
    **{f: f"M({f})" for f in ("sin", "cos", "tan", "tanh", "exp", "log", "sqrt", "pow", "atan2")},
    **{f: f"M({f})" for f in ("sinh", "cosh", "asin", "acos", "atan", "floor", "ceil", "exp2")},
    **{f: f"M({f})" for f in ("expm1", "log1p")},
}
_BOOLEAN = ("gt", "ge", "lt", "le", "eq", "ne", "and", "or", "not")
_SAME = ("convert_element_type", "copy", "copy_p", "stop_gradient")
_MOVING = (
    "reshape slice squeeze broadcast_in_dim concatenate gather scatter transpose rev"  # noqa: SIM905
    " dynamic_slice dynamic_update_slice pad split".split()
)


class Node(NamedTuple):
    """A value of the program: an operation and its arguments, or a name."""

    name: str
    arguments: tuple[Any, ...] = ()

    @property
    def boolean(self) -> bool:
        return self.name in _BOOLEAN


Value = Node | float | bool


class _Unknown(Exception):
    """An operation that has no C."""


def symbols(name: str, count: int) -> np.ndarray:
    """Return the elements of a C array ``name`` as symbols (count,)."""
    return _array([Node(f"{name}[{i}]") for i in range(count)], (count,))


def trace(function: Callable[..., Any], *inputs: np.ndarray, what: str) -> np.ndarray:
    """Return the symbolic result of a function of arrays of symbols.

    Raises:
        ConfigurationError: naming ``what``, if it computes something that has no C.
    """
    with jax.enable_x64(True):
        closed = jax.make_jaxpr(function)(*(np.zeros(x.shape) for x in inputs))
        try:
            (out,) = _run(closed.jaxpr, closed.consts, inputs)
        except _Unknown as error:
            raise ConfigurationError(
                f"{what} to be a formula of position, velocity and acceleration",
                f"JAX's operation {error}",
                "take it out of the corrected model, or write it without that operation",
            ) from None
    return out


def _run(jaxpr: Any, consts: Sequence[Any], inputs: Sequence[np.ndarray]) -> list[np.ndarray]:
    known: dict[Any, np.ndarray] = dict(
        zip((*jaxpr.constvars, *jaxpr.invars), (*map(np.asarray, consts), *inputs), strict=True)
    )
    read = lambda v: np.asarray(v.val) if hasattr(v, "val") else known[v]
    for eqn in jaxpr.eqns:
        outs = _equation(eqn, [read(v) for v in eqn.invars])
        known.update(zip(eqn.outvars, outs, strict=True))
    return [read(v) for v in jaxpr.outvars]


def _equation(eqn: Any, given: list[np.ndarray]) -> list[np.ndarray]:
    name, params = eqn.primitive.name, eqn.params
    if all(x.dtype != object for x in given):
        out = eqn.primitive.bind(*map(jax.numpy.asarray, given), **params)
        return [np.asarray(x) for x in (out if eqn.primitive.multiple_results else [out])]
    if str(params.get("name", "")).strip("_") in ("interp", "interp_evenly"):
        return [_interpolated(*given)]
    for key in ("jaxpr", "call_jaxpr", "fun_jaxpr"):
        if name != "scan" and hasattr(inner := params.get(key), "eqns"):
            closed = inner if hasattr(inner, "consts") else None
            return _run(closed.jaxpr if closed else inner, closed.consts if closed else (), given)
    if name in _SAME:
        return [given[0]]
    if name in _MOVING:
        return _moved(eqn, given)
    if name in ("reduce_sum", "reduce_max", "reduce_min"):
        return [_reduced(name.removeprefix("reduce_"), given[0], params["axes"])]
    if name == "select_n":
        return [_each(lambda w, no, yes: _make("select", w, yes, no), *given)]
    if name == "clamp":
        return [_each(lambda a, x, b: _make("min", _make("max", x, a), b), *given)]
    if name == "integer_pow":
        return [_each(lambda x: _power(x, int(params["y"])), given[0])]
    if name in _ARITHMETIC or name in _CALLS:
        return [_each(lambda *a: _make(name, *a), *given)]
    raise _Unknown(name)


def _array(flat: Sequence[Any], shape: tuple[int, ...]) -> np.ndarray:
    out = np.empty(len(flat), object)
    out[:] = flat
    return out.reshape(shape)


def _each(function: Callable[..., Any], *given: np.ndarray) -> np.ndarray:
    shape = np.broadcast_shapes(*(x.shape for x in given))
    rows = [np.broadcast_to(x, shape).ravel().tolist() for x in given]
    return _array([function(*row) for row in zip(*rows, strict=True)], shape)


def _moved(eqn: Any, given: list[np.ndarray]) -> list[np.ndarray]:
    """Return what a primitive makes of arrays that it only moves: it is applied to numbers."""
    values: list[Any] = []
    labels: list[Any] = []
    for x, v in zip(given, eqn.invars, strict=True):
        if np.issubdtype(v.aval.dtype, np.integer):  # indices
            if x.dtype == object:
                raise _Unknown("indexing by a computed number")
            labels.append(jax.numpy.asarray(x))
            continue
        labels.append(jax.numpy.asarray(len(values) + np.arange(float(x.size)).reshape(x.shape)))
        values += x.ravel().tolist()
    out = eqn.primitive.bind(*labels, **eqn.params)
    parts = [np.asarray(x) for x in (out if eqn.primitive.multiple_results else [out])]
    if not all(np.isfinite(part).all() for part in parts):
        raise _Unknown(f"{eqn.primitive.name} beyond an array's end")
    return [_array([values[int(i)] for i in part.ravel()], part.shape) for part in parts]


def _reduced(name: str, x: np.ndarray, axes: Sequence[int]) -> np.ndarray:
    name = {"sum": "add"}.get(name, name)
    rest = [i for i in range(x.ndim) if i not in axes]
    rows = x.transpose(*rest, *axes).reshape(*(x.shape[i] for i in rest), -1)
    out = rows[..., 0]
    for i in range(1, rows.shape[-1]):
        out = _each(lambda a, b: _make(name, a, b), out, rows[..., i])
    return np.asarray(out, object)


def _interpolated(x: np.ndarray, at: np.ndarray, values: np.ndarray, *rest: Any) -> np.ndarray:
    if at.dtype == object or values.dtype == object or rest:
        raise _Unknown("interp in a table that is computed")
    at, values = (np.broadcast_to(t, (*x.shape, t.shape[-1])) for t in (at, values))
    rows = zip(x.ravel(), at.reshape(x.size, -1), values.reshape(x.size, -1), strict=True)
    made = [_make("table", symbol, tuple(a.tolist()), tuple(v.tolist())) for symbol, a, v in rows]
    return _array(made, x.shape)


def _power(x: Value, y: int) -> Value:
    if y < 0:
        return _make("div", 1.0, _power(x, -y))
    return _make("square", x) if y == 2 else x if y == 1 else _make("pow", x, float(y))


def _make(name: str, *a: Any) -> Value:
    """Return an operation, or what is left of it where an argument is a number."""
    numbers = [not isinstance(x, Node) for x in a]
    if name == "select":
        return (a[1] if a[0] else a[2]) if numbers[0] else _select(*a)
    if name == "table":
        return float(np.interp(*a)) if numbers[0] else Node(name, a)
    if all(numbers):
        return getattr(jax.lax, _LAX.get(name, name))(*a).item()
    if name in ("add", "add_any") and 0.0 in a:
        return a[1] if numbers[0] else a[0]
    if name == "sub" and numbers[1] and a[1] == 0.0:
        return a[0]
    if name == "mul" and any(n and x == 0.0 for n, x in zip(numbers, a, strict=True)):
        return 0.0
    if name == "mul" and any(n and x == 1.0 for n, x in zip(numbers, a, strict=True)):
        return a[1] if numbers[0] else a[0]
    if name in ("and", "or") and any(numbers):
        number, other = (a[0], a[1]) if numbers[0] else (a[1], a[0])
        return other if bool(number) == (name == "and") else bool(number)
    return Node(name, a)


_LAX: Mapping[str, str] = {
    "and": "bitwise_and", "or": "bitwise_or", "not": "bitwise_not", "add_any": "add",
}  # fmt: skip


def _select(which: Node, yes: Value, no: Value) -> Value:
    return yes if yes == no else Node("select", (which, yes, no))


class Writer:
    """C statements that compute symbolic values; what is used twice has a name of its own."""

    def __init__(self, prefix: str):
        self.prefix = prefix  # of the names of tables
        self.tables: list[str] = []
        self.lines: list[str] = []
        self._named: dict[Node, str] = {}
        self._uses: dict[Node, int] = {}

    def begin(self, values: Sequence[Value]) -> None:
        """Count how often each part of ``values`` is used, and forget the names made so far."""
        self._uses, self._named, self.lines = {}, {}, []
        for value in values:
            self._count(value)

    def _count(self, value: Any) -> None:
        if isinstance(value, Node) and value.arguments:
            self._uses[value] = self._uses.get(value, 0) + 1
            if self._uses[value] == 1:
                for argument in value.arguments:
                    self._count(argument)

    def expression(self, value: Value, *, outer: bool = True) -> str:
        """Return C for a value; ``lines`` has the statements that must come before it."""
        if not isinstance(value, Node):
            return scalar(float(value))
        if not value.arguments:
            return value.name
        if value in self._named:
            return self._named[value]
        text = self._operation(value)
        if self._uses.get(value, 0) > 1:
            name = self._named[value] = f"x{len(self._named) + 1}"
            self.lines.append(f"const {'int' if value.boolean else 'real'} {name} = {text};")
            return name
        plain = outer or value.name in _CALLS or value.name == "table"
        return text if plain else f"({text})"

    def _operation(self, value: Node) -> str:
        name, a = value
        if name == "table":
            number = len(self.tables) // 2
            places = f"{self.prefix}_at_{number}", f"{self.prefix}_value_{number}"
            self.tables += [table(p, np.array(t)) for p, t in zip(places, a[1:], strict=True)]
            within = self.expression(a[0])
            return f"table_value({within}, {len(a[1])}, {places[0]}, {places[1]})"
        if name in _CALLS:
            return f"{_CALLS[name]}({', '.join(self.expression(x) for x in a)})"
        inner = [self.expression(x, outer=False) for x in a]
        if name == "select":
            return "{} ? {} : {}".format(*inner)
        return _ARITHMETIC[name].format(*inner)
