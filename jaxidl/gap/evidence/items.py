"""Items of a library: what an effect of some shape adds to the command, as columns."""

from collections.abc import Sequence
from typing import Any

import jax
import numpy as np
from jaxtyping import Float

from jaxidl.gap.evidence.gram import Item, Key
from jaxidl.gap.evidence.rows import Rows
from jaxidl.gap.evidence.shape import Shape, amplitudes, limits

# log odds that each parameter costs: a log narrows its range to about a tenth
PARAMETER = float(np.log(10.0))
SAME = 1e-6  # share of a part that an effect which contains it cannot imitate


def beside(
    shape: Shape, columns: np.ndarray, parts: Sequence[tuple[str, np.ndarray]]
) -> tuple[Shape, np.ndarray]:
    """Return a shape restricted to what its parts cannot add, and its columns.

    Only those combinations of its amplitudes remain that add what its ``parts`` (N, J) do not. So
    an effect never takes the place of a simpler one that it contains: beside the simpler one it is
    only what is specific to it.
    """
    each = [(name, imitation(columns, part)) for name, part in parts]
    directions = [(name, amplitudes) for name, amplitudes in each if amplitudes is not None]
    if not directions:
        return shape, columns
    u, s, _ = np.linalg.svd(np.array([d for _, d in directions]).T)
    basis = np.where(np.abs(left := u[:, int(np.sum(s > 1e-9 * s[0])) :]) > 1e-9, left, 0.0)
    return shape._replace(basis=basis, parts=tuple(directions)), np.tensordot(basis.T, columns, 1)


def imitation(columns: np.ndarray, part: np.ndarray) -> Float[np.ndarray, " P"] | None:
    """Return amplitudes with which columns (P, N, J) add a torque (N, J); None if they cannot."""
    flat = columns.reshape(len(columns), -1)
    inverse = np.linalg.pinv(flat @ flat.T, rcond=1e-12, hermitian=True)
    amplitudes = inverse @ (flat @ part.ravel())
    left = part.ravel() - amplitudes @ flat
    return amplitudes if np.linalg.norm(left) < SAME * np.linalg.norm(part) else None


def items_of(
    shapes: Sequence[Shape], rows: Rows, predicted: np.ndarray, others: Sequence[Item] = ()
) -> list[Item]:
    """Return items of shapes of one class, beside ``others`` that may be parts of them."""
    out, whole = [], [shape._replace(basis=None, parts=()) for shape in shapes]
    for shape, columns in zip(whole, columns_of(whole, rows, predicted), strict=True):
        names = shape.cls.contains(shape.free) if shape.free and shape.joint is not None else ()
        simpler = [
            (o.key[0], spread(o, rows)[0])
            for o in others
            if o.key in {(name, shape.joint) for name in names} and len(o.lower) == 1
        ]
        shape, own = beside(shape, columns, simpler)
        if len(own):
            out.append(item(shape, own))
    return [i for i in out if i.joints]


def columns_of(shapes: Sequence[Shape], rows: Rows, predicted: np.ndarray) -> list[np.ndarray]:
    """Return the columns (P, N, J) of each shape; one class is computed side by side."""
    jobs = [(shape, *shape.probes()) for shape in shapes]
    together: dict[Any, list[int]] = {}
    for number, (_, probes, _) in enumerate(jobs):
        alike = [np.shape(x) for x in jax.tree.leaves(probes[0])]
        together.setdefault((jax.tree.structure(probes[0]), str(alike)), []).append(number)
    out: list[np.ndarray] = [np.zeros(0)] * len(jobs)
    for numbers in together.values():
        each = iter(rows.added([p for n in numbers for p in jobs[n][1]], predicted))
        for n in numbers:
            shape, probes, size = jobs[n]
            columns = np.stack([next(each) for _ in probes]) / size[:, None, None]
            out[n] = columns if shape.basis is None else np.tensordot(shape.basis.T, columns, 1)
    return out


def spread(i: Item, rows: Rows) -> np.ndarray:
    """Return an item's columns (P, N, J) on all joints."""
    out = np.zeros((len(i.lower), *rows.gap.shape))
    out[:, :, list(i.joints)] = i.columns
    return out


def item(shape: Shape, columns: np.ndarray) -> Item:
    """Return the item of a shape with columns (P, N, J), on the joints that it affects."""
    cls = shape.cls
    size = np.sqrt(np.mean(columns**2, 1))  # (P, J)
    joints = tuple(
        np.flatnonzero((size > 1e-9 * np.maximum(size.max(initial=0.0), 1e-300)).any(0)).tolist()
    )
    lower, upper = shape.limits()
    part = "+".join(shape.free) if cls.linear else ""
    more = len(limits(shape)[0]) - amplitudes(shape)  # parameters besides
    odds = shape.odds - PARAMETER * ((rank(columns) if shape.free else 0) + more)
    group, none = (cls.name, shape.joint, part), np.zeros(len(lower))
    return Item(
        group,
        shape,
        joints,
        columns[:, :, list(joints)],
        lower,
        upper,
        odds,
        none,
        cls.actuates(),
        cls.common,
    )


def rank(columns: np.ndarray) -> int:
    """Return how many of an effect's columns (P, N, J) the log can tell apart."""
    flat = columns.reshape(len(columns), -1)
    flat = flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300)
    return int(np.sum(np.linalg.eigvalsh(flat @ flat.T) > 1e-6))


def part(m: Item, whole: Item) -> bool:
    """Return whether an effect has another one as a part."""
    return bool(
        {m.key[0], f"{m.key[0]}.{m.group[2]}"} & set(whole.shape.cls.contains(whole.shape.free))
    )


def absorbed(members: Sequence[Item]) -> dict[Key, Key]:
    """Return parts of effects with a shape, named as their whole: its key by theirs."""
    # what two logs have in common is neither a finding nor a part of one
    own = [m for m in members if not m.always]
    keys = {m.key for m in own}
    return {
        (name, m.key[1]): m.key
        for m in own
        if m.shape is not None and not m.shape.cls.linear
        for name, _ in m.shape.parts
        if (name, m.key[1]) in keys
    }
