"""Hierarchical matrices: trees of dense, low-rank and divided blocks, products with them, and compression.

Ranges of rows and columns are slices of the full matrix, so that blocks can be located without their clusters.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from meeframe.plugin import Array, Indices
from meeframe_hmatrix.gemm import COLUMNS, FULL, add_products, locate

OVERSAMPLING = 8
"""Number of random vectors in addition to the expected rank in the compression of a product."""


@dataclass(frozen=True, eq=False)
class Dense:
    """A block given by its entries, array (m, n)."""

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
    """A block divided into blocks `children[row][column]`, one or two in each direction."""

    rows: slice
    columns: slice
    children: tuple[tuple["Block", ...], ...]

    @cached_property
    def dtype(self) -> np.dtype[Any]:
        """Type of its numbers."""
        leaf = next(leaves(self))
        return (leaf.array if isinstance(leaf, Dense) else leaf.left).dtype

    @cached_property
    def table(self) -> Indices:
        """Table of its undivided blocks, for `add_products`."""
        return np.concatenate([_table(child, self.dtype) for block_row in self.children for child in block_row])

    def __getstate__(self) -> dict[str, Any]:
        return {
            entry.name: getattr(self, entry.name) for entry in fields(self)
        }  # the table has addresses of this process


Block = Dense | LowRank | Split


def shape(block: Block) -> tuple[int, int]:
    """Return the numbers of rows and columns."""
    return block.rows.stop - block.rows.start, block.columns.stop - block.columns.start


def rank(block: LowRank) -> int:
    """Return the number of columns of the left factor."""
    return block.left.shape[1]


def relative_range(inner: slice, outer: slice) -> slice:
    """Return a range relative to another one that contains it."""
    return slice(inner.start - outer.start, inner.stop - outer.start)


def leaves(block: Block) -> Iterator[Dense | LowRank]:
    """Yield the undivided blocks of a tree."""
    if isinstance(block, Split):
        for block_row in block.children:
            for child in block_row:
                yield from leaves(child)
    else:
        yield block


def count_entries(block: Block) -> int:
    """Return the number of stored entries of a block."""
    return sum(
        leaf.array.size if isinstance(leaf, Dense) else leaf.left.size + leaf.right.size for leaf in leaves(block)
    )


def multiply(block: Block, x: Array) -> Array:
    """Return block @ x for x (n, k) in the precision of the block; for a divided block x is converted to it."""
    if isinstance(block, Dense):
        product: Array = block.array @ x
        return product
    if isinstance(block, LowRank):
        return block.left @ (block.right @ x)
    return _multiply_leaves(block, x, False)


def multiply_transposed(block: Block, x: Array) -> Array:
    """Return block.T @ x for x (m, k), like `multiply`."""
    if isinstance(block, Dense):
        product: Array = block.array.T @ x
        return product
    if isinstance(block, LowRank):
        return block.right.T @ (block.left.T @ x)
    return _multiply_leaves(block, x, True)


def _multiply_leaves(block: Split, x: Array, transposed: bool) -> Array:
    """Return block @ x, or its transpose @ x."""
    output_range, input_range = (block.columns, block.rows) if transposed else (block.rows, block.columns)
    result = np.zeros((output_range.stop - output_range.start, x.shape[1]), block.dtype)
    if len(x) != input_range.stop - input_range.start:
        raise ValueError(f"a block of the shape {shape(block)} is not multiplied with {len(x)} rows")
    values = np.ascontiguousarray(x, block.dtype)
    if not add_products(
        block.table, transposed, (*locate(values, block.dtype), input_range.start), result, output_range.start
    ):
        raise RuntimeError("BLAS cannot be called from compiled code")
    return result


def _table(block: Block, dtype: DTypeLike) -> Indices:
    if isinstance(block, Split):
        if block.dtype != dtype:
            raise ValueError(f"a block of {block.dtype} in one of {dtype}")
        return block.table
    (m, n), first, left = shape(block), block.rows.start, block.columns.start
    if isinstance(block, Dense):
        row = first, m, left, n, FULL, *locate(block.array, dtype), 0, 0, 0
    else:
        row = first, m, left, n, rank(block), *locate(block.left, dtype), *locate(block.right, dtype)
    return np.array(row, np.int64).reshape(1, COLUMNS)


def transpose(block: Block) -> Block:
    """Return the transpose, which shares the numbers."""
    if isinstance(block, Dense):
        return Dense(block.columns, block.rows, block.array.T)
    if isinstance(block, LowRank):
        return LowRank(block.columns, block.rows, block.right.T, block.left.T)
    children = tuple(tuple(transpose(child) for child in column) for column in zip(*block.children, strict=True))
    return Split(block.columns, block.rows, children)


def convert(block: Block, dtype: DTypeLike) -> Block:
    """Return the block in another precision; numbers that have it already are shared."""
    if isinstance(block, Dense):
        return Dense(block.rows, block.columns, block.array.astype(dtype, copy=False))
    if isinstance(block, LowRank):
        left, right = (factor.astype(dtype, copy=False) for factor in (block.left, block.right))
        return LowRank(block.rows, block.columns, left, right)
    return Split(
        block.rows,
        block.columns,
        tuple(tuple(convert(child, dtype) for child in block_row) for block_row in block.children),
    )


def to_dense(block: Block) -> Array:
    """Return all entries, (m, n)."""
    if isinstance(block, Dense):
        return block.array
    if isinstance(block, LowRank):
        product: Array = block.left @ block.right
        return product
    return np.block([[to_dense(child) for child in block_row] for block_row in block.children])


def truncated_rank(values: Array, tolerance: float) -> int:
    """Return the number of descending singular values so that the norm of the rest is below the tolerance."""
    tails = np.sqrt(np.cumsum(np.square(values[::-1], dtype=float)))[::-1]
    return int(np.count_nonzero(tails > tolerance * tails[0])) if len(values) and tails[0] > 0.0 else 0


def recompress(left: Array, right: Array, tolerance: float) -> tuple[Array, Array]:
    """Return the best factors of left (m, k) @ right (k, n) for a relative tolerance in the Frobenius norm."""
    if min(*left.shape, right.shape[1]) == 0:
        return left[:, :0], right[:0]
    q, r = np.linalg.qr(left)
    return _truncate_rows(q, r @ right, tolerance)


def _truncate_rows(q: Array, rows: Array, tolerance: float) -> tuple[Array, Array]:
    """Return factors of q @ rows for orthonormal q (m, k), rows (k, n). Raises LinAlgError if they are not finite."""
    if rows.dtype == np.float32:  # the Gram matrix in double precision is accurate and cheaper
        exact = rows.astype(float)
        gram = exact @ exact.T
        if not np.isfinite(gram).all():
            raise np.linalg.LinAlgError("entries of a block are not finite")
        squares, vectors = np.linalg.eigh(gram)
        values = np.sqrt(np.maximum(squares[::-1], 0.0))
        rotation = vectors[:, ::-1][:, : truncated_rank(values, tolerance)].astype(rows.dtype)
        return q @ rotation, rotation.T @ rows
    if rows.shape[1] > rows.shape[0]:
        basis, triangle = np.linalg.qr(rows.T)
        u, values, v = np.linalg.svd(triangle.T, full_matrices=False)
        v = v @ basis.T
    else:
        u, values, v = np.linalg.svd(rows, full_matrices=False)
    rank = truncated_rank(values, tolerance)
    return q @ (u[:, :rank] * values[:rank]), v[:rank]


def compress(
    product: Callable[[Array], Array],
    transposed: Callable[[Array], Array],
    size: tuple[int, int],
    rank: int,
    tolerance: float,
    dtype: DTypeLike = float,
) -> tuple[Array, Array]:
    """Return factors of a matrix given by its products, for a relative tolerance in the Frobenius norm.

    Parameters
    ----------
    product
        X @ (n, k).
    transposed
        X.T @ (m, k).
    size
        Size (m, n) of X.
    rank
        Expected rank.
    tolerance
        Relative tolerance.
    dtype
        Precision of the products.

    Notes
    -----
    Random range finder: Halko, Martinsson and Tropp, SIAM Review 53 (2011) 217-288, algorithm 4.1; the number of random
    vectors is doubled until some of them are not needed.
    """
    width = rank + OVERSAMPLING
    random = np.random.default_rng(0)
    while True:
        if 2 * width >= min(size):
            if size[1] <= size[0]:
                unity = np.eye(size[1], dtype=dtype)
                return recompress(product(unity), unity, tolerance)
            unity = np.eye(size[0], dtype=dtype)
            return recompress(unity, transposed(unity).T, tolerance)
        q, _ = np.linalg.qr(product(random.standard_normal((size[1], width), dtype)))
        left, right = _truncate_rows(q, transposed(q).T, tolerance)
        if right.shape[0] <= width - OVERSAMPLING // 2:
            return left, right
        width *= 2
