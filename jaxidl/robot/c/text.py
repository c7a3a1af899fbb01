"""Numbers, tables and small functions as C text."""

import re
from collections.abc import Callable, Sequence

import numpy as np

LARGEST = "REAL_MAX"  # in place of an infinite bound, which -ffast-math does not allow

_MADE_OF = {  # functions that a part of the program may call, each after those that it calls
    "clip": """static real clip(real x, real low, real high)
{
    return x < low ? low : (x > high ? high : x);
}
""",
    "larger": "static real larger(real a, real b)\n{\n    return a > b ? a : b;\n}\n",
    "smaller": "static real smaller(real a, real b)\n{\n    return a < b ? a : b;\n}\n",
    "sign": "static real sign(real x)\n{\n    return (real)((x > 0) - (x < 0));\n}\n",
    "square": "static real square(real x)\n{\n    return x * x;\n}\n",
    "logistic": "static real logistic(real x)\n{\n    return 1 / (1 + M(exp)(-x));\n}\n",
    "table_value": """/* linear between n positions, constant beyond them */
static real table_value(real x, int n, const real *at, const real *value)
{
    int i = 1;
    if (x < at[0]) return value[0];
    if (x > at[n - 1]) return value[n - 1];
    while (i < n - 1 && x >= at[i]) i++;
    return value[i - 1]
        + (x - at[i - 1]) * (value[i] - value[i - 1]) / (at[i] - at[i - 1]);
}
""",
}


def helpers(text: str) -> str:
    """Return the definitions of those small functions that ``text`` calls."""
    return "\n".join(body for name, body in _MADE_OF.items() if re.search(rf"\b{name}\(", text))


def number(x: float) -> str:
    """Return a number as a C literal that reads back exactly."""
    if np.isinf(x):
        return LARGEST if x > 0 else f"-{LARGEST}"
    text = repr(float(x))
    return text if re.search(r"[.e]", text) else f"{text}.0"


def hexadecimal(x: float) -> str:
    """Return a number as a hexadecimal literal of C99, without zeros at its end."""
    digits, _, exponent = float(x).hex().partition("p")
    return f"{digits.rstrip('0').rstrip('.')}p{exponent.removeprefix('+')}" if x else "0"


def scalar(x: float) -> str:
    """Return a number within an expression, in the program's precision."""
    return number(x) if np.isinf(x) else f"R({number(x)})"


def values(array: np.ndarray, write: Callable[[float], str], indent: int = 4) -> str:
    """Return an array of any rank as a C initialiser, lines of at most 96 characters."""
    space = " " * indent
    if array.ndim > 1:
        inner = ",\n".join(f"{space}{values(row, write, indent + 4)}" for row in array)
        return f"{{\n{inner}\n{space[4:]}}}"
    words = [write(x) for x in array.tolist()]
    flat = "{" + ", ".join(words) + "}"
    if len(flat) + indent < 80:
        return flat
    lines, line = [], space
    for word in words:
        if len(line) + len(word) > 94:
            lines.append(line.rstrip())
            line = space
        line += f"{word}, "
    return "{\n" + "\n".join([*lines, line.rstrip(", ")]) + f"\n{space[4:]}}}"


def table(name: str, array: np.ndarray, comment: str = "", kind: str = "real") -> str:
    """Return the definition of a constant array."""
    sizes = "".join(f"[{n}]" for n in array.shape)
    said = f"/* {comment} */\n" if comment else ""
    write = number if kind == "real" else hexadecimal
    return f"{said}static const {kind} {name}{sizes} = {values(array, write)};\n"


def whole(name: str, numbers: Sequence[int], comment: str) -> str:
    """Return the definition of a constant array of integers."""
    inner = ", ".join(map(str, numbers))
    return f"/* {comment} */\nstatic const int {name}[{len(numbers)}] = {{{inner}}};\n"


def commented(text: str) -> str:
    """Return words that a C comment can hold: one line of ASCII that does not end it."""
    plain = "".join(c if " " <= c <= "~" else "?" for c in " ".join(text.split()))
    return plain.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?")
