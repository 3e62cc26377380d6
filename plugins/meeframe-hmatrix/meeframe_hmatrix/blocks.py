"""Hierarchical matrices: trees of dense, low-rank and divided blocks, products with them, and compression.

Ranges of rows and columns are slices of the whole matrix, so that blocks find each other without their clusters.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from meeframe.plugin import Array, Indices
from meeframe_hmatrix.gemm import COLUMNS, FULL, add_products, located

FIRST_GUESS = 8
"""More random vectors than the rank that is expected, in the compression of a product."""


@dataclass(frozen=True, eq=False)
class Dense:
    """A block given entry by entry, array (m, n)."""

    rows: slice
    columns: slice
    array: Array


@dataclass(frozen=True, eq=False)
class LowRank:
    """The block left @ right, left (m, k), right (k, n)."""

    rows: slice
    columns: slice
    left: Array
    right: Array


@dataclass(frozen=True, eq=False)
class Split:
    """A block divided into parts [row][column], one or two each way."""

    rows: slice
    columns: slice
    parts: tuple[tuple["Block", ...], ...]

    @cached_property
    def dtype(self) -> np.dtype[Any]:
        """The precision of all numbers."""
        leaf = next(leaves(self))
        return (leaf.array if isinstance(leaf, Dense) else leaf.left).dtype

    @cached_property
    def table(self) -> Indices:
        """The table of undivided blocks for `add_products`."""
        return np.concatenate([_table(part, self.dtype) for line in self.parts for part in line])

    def __getstate__(self) -> dict[str, Any]:
        return {one.name: getattr(self, one.name) for one in fields(self)}  # addresses are those of this process


Block = Dense | LowRank | Split


def shape(block: Block) -> tuple[int, int]:
    """Rows and columns."""
    return block.rows.stop - block.rows.start, block.columns.stop - block.columns.start


def rank(block: LowRank) -> int:
    """Columns of its left factor."""
    return block.left.shape[1]


def within(part: slice, whole: slice) -> slice:
    """A range in terms of another that contains it."""
    return slice(part.start - whole.start, part.stop - whole.start)


def leaves(block: Block) -> Iterator[Dense | LowRank]:
    """The undivided blocks of a tree."""
    if isinstance(block, Split):
        for line in block.parts:
            for part in line:
                yield from leaves(part)
    else:
        yield block


def stored(block: Block) -> int:
    """Numbers that a block keeps."""
    return sum(
        leaf.array.size if isinstance(leaf, Dense) else leaf.left.size + leaf.right.size for leaf in leaves(block)
    )


def multiply(block: Block, x: Array) -> Array:
    """block @ x for x (n, k) in the precision of the block; that of a divided block is converted to it."""
    if isinstance(block, Dense):
        product: Array = block.array @ x
        return product
    if isinstance(block, LowRank):
        return block.left @ (block.right @ x)
    return _by_leaves(block, x, False)


def multiply_transposed(block: Block, x: Array) -> Array:
    """block.T @ x for x (m, k), likewise."""
    if isinstance(block, Dense):
        product: Array = block.array.T @ x
        return product
    if isinstance(block, LowRank):
        return block.right.T @ (block.left.T @ x)
    return _by_leaves(block, x, True)


def _by_leaves(block: Split, x: Array, transpose: bool) -> Array:
    """block @ x, or its transpose @ x."""
    here, there = (block.columns, block.rows) if transpose else (block.rows, block.columns)
    result = np.zeros((here.stop - here.start, x.shape[1]), block.dtype)
    if len(x) != there.stop - there.start:
        raise ValueError(f"a block of the shape {shape(block)} is not multiplied with {len(x)} rows")
    values = np.ascontiguousarray(x, block.dtype)
    if not add_products(block.table, transpose, (*located(values, block.dtype), there.start), result, here.start):
        raise RuntimeError("BLAS cannot be called from compiled code")
    return result


def _table(block: Block, dtype: DTypeLike) -> Indices:
    if isinstance(block, Split):
        if block.dtype != dtype:
            raise ValueError(f"a block of {block.dtype} in one of {dtype}")
        return block.table
    (m, n), first, left = shape(block), block.rows.start, block.columns.start
    if isinstance(block, Dense):
        row = first, m, left, n, FULL, *located(block.array, dtype), 0, 0, 0
    else:
        row = first, m, left, n, rank(block), *located(block.left, dtype), *located(block.right, dtype)
    return np.array(row, np.int64).reshape(1, COLUMNS)


def transposed(block: Block) -> Block:
    """The transpose; it shares the numbers."""
    if isinstance(block, Dense):
        return Dense(block.columns, block.rows, block.array.T)
    if isinstance(block, LowRank):
        return LowRank(block.columns, block.rows, block.right.T, block.left.T)
    parts = tuple(tuple(transposed(part) for part in column) for column in zip(*block.parts, strict=True))
    return Split(block.columns, block.rows, parts)


def converted(block: Block, dtype: DTypeLike) -> Block:
    """Return a block in another precision; numbers that have it already are shared."""
    if isinstance(block, Dense):
        return Dense(block.rows, block.columns, block.array.astype(dtype, copy=False))
    if isinstance(block, LowRank):
        left, right = (factor.astype(dtype, copy=False) for factor in (block.left, block.right))
        return LowRank(block.rows, block.columns, left, right)
    return Split(
        block.rows, block.columns, tuple(tuple(converted(part, dtype) for part in line) for line in block.parts)
    )


def to_dense(block: Block) -> Array:
    """All entries, (m, n)."""
    if isinstance(block, Dense):
        return block.array
    if isinstance(block, LowRank):
        product: Array = block.left @ block.right
        return product
    return np.block([[to_dense(part) for part in line] for line in block.parts])


def kept_rank(values: Array, tolerance: float) -> int:
    """Return the number of leading singular values, the rest below tolerance in the relative Frobenius norm."""
    tails = np.sqrt(np.cumsum(np.square(values[::-1], dtype=float)))[::-1]
    return int(np.count_nonzero(tails > tolerance * tails[0])) if len(values) and tails[0] > 0.0 else 0


def recompress(left: Array, right: Array, tolerance: float) -> tuple[Array, Array]:
    """The best factors of left (m, k) @ right (k, n) for a relative tolerance in the Frobenius norm (QR and SVD)."""
    if min(*left.shape, right.shape[1]) == 0:
        return left[:, :0], right[:0]
    q, r = np.linalg.qr(left)
    return _rotated(q, r @ right, tolerance)


def _rotated(q: Array, rows: Array, tolerance: float) -> tuple[Array, Array]:
    """Factors of q @ rows for orthonormal q (m, k), rows (k, n). Raises LinAlgError if they are not finite."""
    if rows.dtype == np.float32:  # its Gram matrix in double precision has all digits, and costs less
        exact = rows.astype(float)
        gram = exact @ exact.T
        if not np.isfinite(gram).all():
            raise np.linalg.LinAlgError("entries of a block are not finite")
        squares, vectors = np.linalg.eigh(gram)
        values = np.sqrt(np.maximum(squares[::-1], 0.0))
        turn = vectors[:, ::-1][:, : kept_rank(values, tolerance)].astype(rows.dtype)
        return q @ turn, turn.T @ rows
    if rows.shape[1] > rows.shape[0]:
        basis, triangle = np.linalg.qr(rows.T)
        u, values, v = np.linalg.svd(triangle.T, full_matrices=False)
        v = v @ basis.T
    else:
        u, values, v = np.linalg.svd(rows, full_matrices=False)
    rank = kept_rank(values, tolerance)
    return q @ (u[:, :rank] * values[:rank]), v[:rank]


def compress(
    product: Callable[[Array], Array],
    transposed: Callable[[Array], Array],
    size: tuple[int, int],
    rank: int,
    tolerance: float,
    dtype: DTypeLike = float,
) -> tuple[Array, Array]:
    """Factors of a matrix known by its products, for a relative tolerance in the Frobenius norm.

    product: X @ (n, k); transposed: X.T @ (m, k); size: (m, n) of X; rank: what is expected;
    dtype: the precision of the products.
    Random range finder: Halko, Martinsson and Tropp, SIAM Review 53 (2011) 217-288, algorithm 4.1; the number of random
    vectors is doubled until some of them are not needed.
    """
    width = rank + FIRST_GUESS
    random = np.random.default_rng(0)
    while True:
        if 2 * width >= min(size):
            if size[1] <= size[0]:
                unity = np.eye(size[1], dtype=dtype)
                return recompress(product(unity), unity, tolerance)
            unity = np.eye(size[0], dtype=dtype)
            return recompress(unity, transposed(unity).T, tolerance)
        q, _ = np.linalg.qr(product(random.standard_normal((size[1], width), dtype)))
        left, right = _rotated(q, transposed(q).T, tolerance)
        if right.shape[0] <= width - FIRST_GUESS // 2:
            return left, right
        width *= 2
