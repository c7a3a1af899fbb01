"""Training of the error model as one scan; the only file that imports optax."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Bool, Float, Int

from jaxidl.errors import ConfigurationError, one_of
from jaxidl.models.mlp import ErrorModel, Params
from jaxidl.scan import scan
from jaxidl.types import Dataset, Key, Scalar

DERIVATIVES = (None, "forward", "reverse")  # modes in which training can be differentiated


@dataclass(frozen=True)
class Training:
    """How the error model is trained after an execution.

    See the reference experiment, "Error model and training".
    """

    epochs: int = 20
    batch: int = 64
    # a number, or traced: as an axis of an ablation, or to differentiate by it
    learning_rate: Scalar = 1e-3
    holdout_every: int = 5  # rows 6, 11, 16, ... are held out; 0: none
    snapshot_epochs: float = 10.0  # about this many epochs between two validations

    def __post_init__(self) -> None:
        rate = self.learning_rate
        # a traced learning rate has been checked before
        if isinstance(rate, float) and not 0.0 <= rate < np.inf:
            raise ConfigurationError("learning_rate >= 0", str(rate), "correct it")
        for name, least in (("batch", 1), ("holdout_every", 0)):
            if getattr(self, name) < least:
                raise ConfigurationError(
                    f"{name} >= {least}", str(getattr(self, name)), "correct it"
                )

    def steps(self, rows: int, executions: int = 1) -> int:
        """Return the number of training steps of one iteration for ``rows`` rows of data."""
        return self.epochs * int(self.mask_of(rows, executions).sum() // self.batch)

    def train_mask(self, rows: int) -> Bool[np.ndarray, " N"]:
        """Return which rows are trained on.

        They are all but the row after each positive multiple of ``holdout_every``.
        """
        index = np.arange(rows)
        if not self.holdout_every:
            return np.ones(rows, bool)
        return (index % self.holdout_every != 1) | (index <= self.holdout_every)

    def mask_of(self, rows: int, executions: int) -> Bool[np.ndarray, " N"]:
        """Return :meth:`train_mask` for each of several executions' rows.

        A copy of an execution holds out the same rows.
        """
        return np.tile(self.train_mask(rows // executions), executions)

    def snapshots(self, rows: int, executions: int = 1) -> Bool[np.ndarray, " S"]:
        """Return after which training steps the validation loss is read.

        They are the first, further ones at regular intervals, and the last.
        """
        steps = self.steps(rows, executions)
        every = max(
            1, int(self.snapshot_epochs * self.mask_of(rows, executions).sum() / self.batch)
        )
        flags = np.arange(steps) % every == 0
        flags[-1:] = True
        return flags


class Learner(NamedTuple):
    """The state that training carries from step to step, and from iteration to iteration."""

    params: Params
    optimiser: Any


class Progress(NamedTuple):
    """What one training run reports."""

    loss: Float[Array, " S"]  # loss of each step before its update, in scaled units
    validation: Scalar  # best validation loss among the snapshots, in scaled units


def adam(
    learning_rate: Scalar, beta1: float = 0.9, beta2: float = 0.999, eps: float = 1e-8
) -> optax.GradientTransformation:
    """Return Adam as in the reference program: θ ← θ − rate·√(1−β₂ᵗ)/(1−β₁ᵗ) · m/(√v + ε).

    ``optax.adam`` adds ε after the bias correction instead; that alone changes losses by 2 % within
    50 steps. Its two divisions per weight also cost more than the single one here, which
    :func:`reciprocal` replaces by multiplications.
    """

    def init(params: optax.Params) -> optax.ScaleByAdamState:
        zeros = jax.tree.map(jnp.zeros_like, params)
        return optax.ScaleByAdamState(count=jnp.zeros([], jnp.int32), mu=zeros, nu=zeros)

    def update(
        updates: optax.Updates, state: Any, params: optax.Params | None = None
    ) -> tuple[optax.Updates, Any]:
        count = state.count + 1
        mu = jax.tree.map(lambda m, g: beta1 * m + (1 - beta1) * g, state.mu, updates)
        nu = jax.tree.map(lambda v, g: beta2 * v + (1 - beta2) * g * g, state.nu, updates)

        def move(m: Array, v: Array) -> Array:
            t = count.astype(m.dtype)
            rate = (
                jnp.asarray(learning_rate, m.dtype)
                * jnp.sqrt(1 - jnp.asarray(beta2, m.dtype) ** t)
                / (1 - jnp.asarray(beta1, m.dtype) ** t)
            )
            return -rate * m * reciprocal(root(v) + eps)

        return jax.tree.map(move, mu, nu), optax.ScaleByAdamState(count=count, mu=mu, nu=nu)

    return optax.GradientTransformation(init, update)


@jax.custom_jvp
def root(v: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return √v, with derivative 0 at v = 0.

    v is 0 for a weight that no sample has moved yet; there the derivative of √ is infinite, and 0·∞
    is NaN.
    """
    return jnp.sqrt(v)


@root.defjvp
def _root_jvp(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    r = jnp.sqrt(primals[0])
    return r, jnp.where(r > 0, tangents[0] / (2 * jnp.where(r > 0, r, 1)), 0)


@jax.custom_jvp
def reciprocal(a: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return 1/a of positive numbers between 1e-30 and 1e30.

    In float32 it is accurate to within 2e-7 relative, in float64 exactly rounded. A core divides 8
    numbers in the time of 40 multiplications, and square roots wait for the same unit: with this,
    Newton's iteration r ← r + r(1 − ar) from an initial guess by the exponent's bits, a training
    step takes 5 % less time.
    """
    if a.dtype != jnp.float32:
        return 1 / a
    # accurate within 13 %
    r = jax.lax.bitcast_convert_type(
        0x7EF311C7 - jax.lax.bitcast_convert_type(a, jnp.int32), jnp.float32
    )
    for _ in range(3):  # each round squares the relative error: 2 %, 3e-4, 8e-8
        r = r * (2 - a * r)
    return r


@reciprocal.defjvp
def _reciprocal_jvp(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    r = reciprocal(*primals)
    return r, -r * r * tangents[0]


def start(training: Training, params: Params) -> Learner:
    """Return a learner that has not learned yet."""
    return Learner(params, adam(training.learning_rate).init(params))


def loss_of(
    model: ErrorModel,
    params: Params,
    x: Float[Array, "F B"],
    y: Float[Array, "J B"],
    *,
    in_training: bool = False,
) -> Scalar:
    """Return the sum over joints of the mean squared error in scaled units."""
    return jnp.sum(jnp.mean((model.apply(params, x, in_training=in_training) - y) ** 2, axis=1))


def draw_batches(key: Key, rows: int, training: Training) -> Int[Array, "S B"]:
    """Return batches drawn without replacement.

    They are reshuffled when fewer rows than a batch remain. Indices count training rows.
    """
    per_epoch = rows // training.batch
    orders = jax.vmap(lambda k: jax.random.permutation(k, rows))(
        jax.random.split(key, training.epochs)
    )
    return orders[:, : per_epoch * training.batch].reshape(-1, training.batch)


def fit(
    model: ErrorModel,
    training: Training,
    learner: Learner,
    data: Dataset,
    batches: Int[Array, "S B"],
    *,
    executions: int = 1,
    derivative: str | None = None,
) -> tuple[Learner, Progress]:
    """Train on ``data`` (N rows) and return the best snapshot.

    ``batches`` (S, B) are indices of training rows. Best is the lowest validation loss among the
    snapshots; weights and optimiser state are both kept. If no snapshot has a finite validation
    loss, the learner is returned unchanged and ``validation`` is infinite.

    Rows are those of ``executions`` of equal length, one after the other; the same rows of each are
    held out.

    With ``derivative`` "forward" or "reverse" the result can be differentiated in that mode through
    all steps, by the data, the weights and the learning rate: the derivative is that of the chosen
    snapshot, whichever else might have been best. The values are the same except for rounding, as
    of any two programs.
    """
    if derivative not in DERIVATIVES:
        raise one_of("derivative", derivative, DERIVATIVES)
    optimiser, fast = adam(training.learning_rate), derivative != "forward"
    mask = training.mask_of(data.x.shape[0], executions)
    dtype = jax.tree.leaves(learner.params)[0].dtype
    x = model.scale_inputs(data.x).astype(dtype).T
    y = (data.y / model.torque_scale).astype(dtype).T
    kept = np.flatnonzero(~mask) if not mask.all() else np.arange(len(mask))
    train, held = np.flatnonzero(mask), (x[:, kept], y[:, kept])
    x, y = x[:, train], y[:, train]

    def one_step(carry: Any, inputs: Any) -> tuple[Any, Any]:
        learner, best, best_loss = carry
        rows, is_snapshot = inputs
        batch = x[:, rows], y[:, rows]
        loss, grads = jax.value_and_grad(lambda p: loss_of(model, p, *batch, in_training=fast))(
            learner.params
        )
        updates, state = optimiser.update(grads, learner.optimiser)
        learner = Learner(optax.apply_updates(learner.params, updates), state)

        def compare():
            validation = loss_of(model, learner.params, *held)
            better = validation < best_loss
            keep = jax.tree.map(lambda new, old: jnp.where(better, new, old), learner, best)
            return keep, jnp.where(better, validation, best_loss)

        best, best_loss = jax.lax.cond(is_snapshot, compare, lambda: (best, best_loss))
        return (learner, best, best_loss), loss

    flags = jnp.asarray(training.snapshots(data.x.shape[0], executions))
    carry = (learner, learner, jnp.asarray(jnp.inf, dtype))
    checkpoint = derivative == "reverse"
    (_, best, validation), losses = scan(one_step, carry, (batches, flags), checkpoint=checkpoint)
    return best, Progress(losses, validation)
