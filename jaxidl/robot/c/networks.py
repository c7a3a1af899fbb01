"""The error model's networks in C: loops over constant tables of weights.

Weights are stored by inputs, and padded with zeros, so that a compiler can compute several outputs
at once without changing the order of any sum. They are hexadecimal numbers, which are exact in
single and in double precision alike.
"""

from typing import Any

import numpy as np

from jaxidl.errors import ConfigurationError
from jaxidl.learning.guard import Region
from jaxidl.models import ErrorModel, Params
from jaxidl.robot.c.text import scalar, table

WIDE = 8  # the outputs of a layer are a multiple of this, its inputs of 4

_LAYER = """/* {inputs} inputs to {outputs} outputs */
static void layer_{k}(int joint, const net *restrict x, net *restrict y)
{{
    const net (*w)[{outputs}] = weights_{k}[joint];
    int i, o;
    for (o = 0; o < {outputs}; o++) y[o] = biases_{k}[joint][o];
    for (i = 0; i < {inputs}; i += 4) {{
        const net *a = w[i], *b = w[i + 1], *c = w[i + 2], *d = w[i + 3];
        const net xa = x[i], xb = x[i + 1], xc = x[i + 2], xd = x[i + 3];
        for (o = 0; o < {outputs}; o++) {{
            y[o] += (a[o] * xa + b[o] * xb) + (c[o] * xc + d[o] * xd);
        }}
    }}
    for (o = 0; o < {outputs}; o++) {{
        const net z = y[o], slope = slopes_{k}[joint][o];
        y[o] = {activation};
    }}
}}
"""

_SHARP = "z >= 0 ? z : slope * z"
_SMOOTH = "slope * z + (1 - slope) * {width} * softplus(z / {width})"

_SOFTPLUS = """/* log(1 + exp(z)) */
static net softplus(net z)
{
    const net low = z > 0 ? -z : z;
    return (z > 0 ? z : 0) + (net)log1p(exp(low));
}
"""

_TOP = """/* the torque of each joint's network for the inputs q, qd, qdd{more} */
static void networks(const real *given, real tau[J])
{{
    net x[{padded}] = {{0}};
    int i, j;
    for (i = 0; i < {inputs}; i++) x[i] = (net)(given[i] / scales[i]);
    for (j = 0; j < J; j++) {{
{arrays}        net sum = biases_{last}[j];
{calls}        for (i = 0; i < {hidden}; i++) sum += weights_{last}[j][i] * {name}[i];
        tau[j] = (real)sum * {torque};
    }}
}}
"""

_GUARDED = """
/* the same within the range of the data that the networks were trained on */
static void learned(const real *given, real tau[J])
{{
    real x[{inputs}];
    int i, j;
    for (i = 0; i < {inputs}; i++) x[i] = clip(given[i], lowest[i], highest[i]);
    networks(x, tau);
    for (j = 0; j < J; j++) tau[j] = clip(tau[j], least[j], most[j]);
}}
"""

_FREE = """
static void learned(const real *given, real tau[J])
{
    networks(given, tau);
}
"""


def learned(model: ErrorModel, params: Params, region: Region | None) -> str:
    """Return C of the error model within its region: tables and the function ``learned``.

    Raises:
        ConfigurationError: for weights that do not belong to the model, or are not finite.
    """
    weights, biases, slopes = _layers(model, params)
    sizes = [_up(weights[0].shape[2], 4), *(_up(w.shape[1], WIDE) for w in weights[:-1])]
    parts: list[str] = []
    scales = np.repeat(
        [model.position_scale, model.velocity_scale, model.acceleration_scale], model.joints
    )
    scales = np.concatenate([scales, model.circumstance_scales])
    parts.append(table("scales", scales, "what inputs are divided by"))
    calls, name = "", "x"
    if model.activation_width > 0.0:
        parts.append(_SOFTPLUS)
    for k, (w, b) in enumerate(zip(weights[:-1], biases, strict=False)):
        rows, columns = sizes[k], sizes[k + 1]
        parts.append(
            table(f"weights_{k}", _padded(w.transpose(0, 2, 1), rows, columns), "", "net")
            + table(f"biases_{k}", _padded(b, columns), "", "net")
            + table(f"slopes_{k}", _padded(slopes[k], columns), "", "net")
        )
        width = f"(net){scalar(model.activation_width)}"
        activation = _SHARP if model.activation_width == 0.0 else _SMOOTH.format(width=width)
        parts.append(_LAYER.format(k=k, inputs=rows, outputs=columns, activation=activation))
        calls += f"        layer_{k}(j, {name}, y{k});\n"
        name = f"y{k}"
    last = len(weights) - 1
    parts.append(
        table(f"weights_{last}", _padded(weights[-1][:, 0], sizes[-1]), "", "net")
        + table(f"biases_{last}", biases[-1][:, 0], "", "net")
    )
    arrays = "".join(f"        net y{k}[{n}];\n" for k, n in enumerate(sizes[1:]))
    top = _TOP.format(
        more=" and circumstances" if model.circumstance_scales else "",
        padded=sizes[0],
        inputs=len(scales),
        arrays=arrays,
        calls=calls,
        last=last,
        hidden=sizes[-1],
        name=name,
        torque=scalar(model.torque_scale),
    )
    return "\n".join([*parts, top]) + _guard(region, len(scales))


def _guard(region: Region | None, inputs: int) -> str:
    if region is None:
        return _FREE
    bounds = {name: np.asarray(getattr(region, name), float) for name in ("lowest", "highest")}
    tables = "".join(table(name, x[:inputs], f"{name} inputs") for name, x in bounds.items())
    tables += "".join(
        table(name, np.asarray(getattr(region, name), float), f"{side} torques")
        for name, side in (("least", "lowest"), ("most", "highest"))
    )
    return f"\n{tables}{_GUARDED.format(inputs=inputs)}"


def _layers(
    model: ErrorModel, params: Params
) -> tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray]]:
    """Return weights (J, out, in), biases (J, out) and slopes (J, out) of each layer."""
    own: dict[str, Any] = params["params"]
    count = len(model.layers)
    weights = [np.asarray(own[f"weights_{k}"]) for k in range(count)]
    biases = [np.asarray(own[f"biases_{k}"])[..., 0] for k in range(count)]
    slopes = [np.asarray(own[f"slopes_{k}"])[..., 0] for k in range(count - 1)]
    shapes = [(model.joints, n) for n in model.layers]
    if [w.shape[:2] for w in weights] != shapes or not all(
        np.isfinite(x).all() for x in (*weights, *biases, *slopes)
    ):
        raise ConfigurationError(
            f"finite weights of {model.joints} networks with layers {model.layers}",
            f"layers {[w.shape[:2] for w in weights]}",
            "give the weights that the error model was trained to",
        )
    return weights, biases, slopes


def _up(n: int, to: int) -> int:
    return -(-n // to) * to


def _padded(x: np.ndarray, *sizes: int) -> np.ndarray:
    """Return an array with its last axes filled up with zeros."""
    lead = x.ndim - len(sizes)
    fill = [(0, 0)] * lead + [(0, n - m) for n, m in zip(sizes, x.shape[lead:], strict=True)]
    return np.pad(x, fill)
