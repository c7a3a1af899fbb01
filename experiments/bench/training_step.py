"""One training step of one run, on one core, against the matrix-product floor and plain JAX.

The step: batch 64, two networks 6-200-100-50-20-1, forward, backward, Adam. The floor: the same
floating-point operations at the rate of a product of two 1024 x 1024 matrices, measured beside
every sample.
"""

from common import arguments, in_turns, machine, pin_to_one_core, report

pin_to_one_core()

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import optax

from jaxidl.backend import compiler_options
from jaxidl.models import ErrorModel, Training, draw_batches, fit, start
from jaxidl.types import Dataset

MODEL, TRAINING, ROWS = ErrorModel(), Training(epochs=20), 1999
PRODUCT = 1024


def flops(batch: int = 64, joints: int = 2, inputs: int = 6) -> float:
    """Of the matrix products of one step: forward, to the weights, and to all activations but the
    input.
    """
    widths = (inputs, *MODEL.layers)
    layers = [a * b for a, b in itertools.pairwise(widths)]
    return 2.0 * batch * joints * (3 * sum(layers) - layers[0])


def plain(x, y, batches, key):
    """The obvious program: row-major batches, weights (in, out), autodiff, ``optax.adam``, a scan
    over batches.
    """
    widths = (x.shape[1], *MODEL.layers)
    keys = jax.random.split(key, len(MODEL.layers))

    def layer(key, shape):
        glorot = jax.nn.initializers.glorot_uniform()
        leaves = {
            "w": glorot(key, shape),
            "b": jnp.zeros(shape[1]),
            "a": jnp.full(shape[1], MODEL.slope),
        }
        return jax.tree.map(lambda leaf: jnp.stack([leaf, leaf]), leaves)

    params = [layer(k, shape) for k, shape in zip(keys, itertools.pairwise(widths), strict=True)]

    def network(params, h):
        for i, p in enumerate(params):
            h = h @ p["w"] + p["b"][None]
            if i < len(params) - 1:
                h = jnp.where(h >= 0, h, p["a"][None] * h)
        return h[:, 0]

    def loss(params, x, y):
        outputs = jax.vmap(network, in_axes=(0, None), out_axes=1)(params, x)
        return jnp.sum(jnp.mean((outputs - y) ** 2, axis=0))

    optimiser = optax.adam(TRAINING.learning_rate)

    def step(carry, rows):
        params, state = carry
        value, grads = jax.value_and_grad(loss)(params, x[rows], y[rows])
        updates, state = optimiser.update(grads, state)
        return (optax.apply_updates(params, updates), state), value

    return jax.lax.scan(step, (params, optimiser.init(params)), batches)[1]


def ours(x, y, batches, key):
    return fit(MODEL, TRAINING, start(TRAINING, MODEL.init(key)), Dataset(x, y), batches)[1].loss


def main() -> None:
    options = arguments(__doc__ or "", runs=4, rounds=15)
    rng, rows = np.random.default_rng(0), int(TRAINING.train_mask(ROWS).sum())
    x = jnp.asarray(rng.normal(size=(options.runs, ROWS, 6)), jnp.float32)
    y = jnp.asarray(rng.normal(size=(options.runs, ROWS, 2)), jnp.float32) * 800
    keys = jax.random.split(jax.random.key(0), options.runs)
    batches = jax.jit(jax.vmap(lambda key: draw_batches(key, rows, TRAINING)))(keys)
    a = jnp.asarray(rng.normal(size=(PRODUCT, PRODUCT)), jnp.float32)
    product, steps = jax.jit(lambda a: a @ a), TRAINING.steps(ROWS)
    data, jit = (x, y, batches, keys), jax.jit
    programs = {
        "jaxidl": jit(
            lambda *d: jax.lax.map(lambda one: ours(*one), d), compiler_options=compiler_options()
        ),
        "jaxidl, runs side by side (vmap)": jit(
            jax.vmap(ours), compiler_options=compiler_options()
        ),
        "plain vmap(scan(optax.adam))": jit(jax.vmap(plain)),
        "plain, lax.map over runs": jit(lambda *d: jax.lax.map(lambda one: plain(*one), d)),
    }
    floor = lambda: [product(a) for _ in range(10)]
    calls = {}
    for name, program in programs.items():
        compiled = program.lower(*data).compile()
        calls |= {f"floor, {name}": floor, name: lambda compiled=compiled: compiled(*data)}
    seconds = in_turns(calls, options.rounds)
    table = []
    for name in programs:
        step = seconds[name] / options.runs / steps
        ideal = seconds[f"floor, {name}"] / 10 / (2 * PRODUCT**3) * flops()
        ratio = step / ideal
        spread = f"{np.percentile(ratio, 25):.2f} to {np.percentile(ratio, 75):.2f}"
        table.append(
            {
                "way": name,
                "ms per run-step": 1e3 * float(np.median(step)),
                "x floor": float(np.median(ratio)),
                "middle half": spread,
            }
        )
    table.append(
        {
            "way": "floor",
            "ms per run-step": 1e3 * float(np.median(ideal)),
            "x floor": 1.0,
            "middle half": "",
        }
    )
    title = (
        f"One training step of one run, {options.runs} runs of {steps} steps, medians of"
        f" {options.rounds} rounds"
    )
    report(title, table, options.json, machine=machine(), megaflop_per_step=flops() / 1e6)


if __name__ == "__main__":
    main()
