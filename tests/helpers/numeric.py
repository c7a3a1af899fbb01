"""Derivatives forward, reverse and numeric, compared."""

from functools import partial

import jax
import numpy as np
from jax.flatten_util import ravel_pytree

from jaxidl import backend

# a quarter of the time to compile
HASTY = {"xla_llvm_disable_expensive_passes": True, "xla_cpu_use_fusion_emitters": False}
OPTIONS = {"xla_backend_optimization_level": 0} | {
    name: on for name, on in HASTY.items() if backend._known(name, on)
}
quick = partial(jax.jit, compiler_options=OPTIONS)  # for programs that run a few times only


@partial(quick, static_argnums=(0, 1))
def value(function, rebuild, x, fixed):
    return function(*rebuild(x), fixed)


@partial(quick, static_argnums=(0, 1))
def slopes(function, rebuild, x, fixed):
    """Derivatives of ``function(*rebuild(x), fixed)`` by x, forward and reverse."""
    of_x = jax.jit(lambda x: function(*rebuild(x), fixed))  # traced once for both
    return jax.jacfwd(of_x)(x), jax.jacrev(of_x)(x)


def compare(function, arguments, fixed, smooth=True):
    """The forward derivative.

    It is compared with reverse mode and, if ``smooth``, with differences.
    """
    x, rebuild = ravel_pytree(arguments)
    x, size = np.asarray(x), 1e-3 + np.abs(value(function, rebuild, x, fixed))[:, None]
    forward, reverse = map(np.asarray, slopes(function, rebuild, x, fixed))
    assert np.isfinite(size).all()
    assert np.isfinite(forward).all()
    share = np.maximum(np.abs(x), 1e-9) / size
    np.testing.assert_allclose(reverse * share, forward * share, rtol=1e-9, atol=1e-10)
    if smooth:
        steps = np.diag(1e-5 * np.abs(x) + 1e-9)
        up, down = (
            [value(function, rebuild, x + sign * step, fixed) for step in steps] for sign in (1, -1)
        )
        numeric = (np.stack(up, 1) - np.stack(down, 1)) / (2.0 * np.diagonal(steps))
        np.testing.assert_allclose(numeric * share, forward * share, rtol=1e-5, atol=1e-6)
    return forward
