"""Accumulated updates of blocks: products that are subtracted when they reach an undivided block.

Their sum is then subtracted from the block in one compression (Boerm, Numerische Mathematik 142 (2019) 1-41), here with
a random range finder.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import DTypeLike

from meeframe.plugin import Array
from meeframe_hmatrix.blocks import (
    Block,
    Dense,
    LowRank,
    Split,
    compress,
    convert,
    multiply,
    multiply_transposed,
    rank,
    relative_range,
    shape,
    to_dense,
)
from meeframe_hmatrix.gemm import OuterProduct, subtract_products, table_of
from meeframe_hmatrix.truncation import truncate

MAX_ENTRYWISE = 250
"""Largest number of rows or columns of low-rank blocks for which the sum of an update is formed entry by entry."""


@dataclass(frozen=True, eq=False)
class AccumulatedUpdate:
    """An update still to be subtracted from a block: low-rank terms (m, k), (k, n) and products of blocks."""

    terms: tuple[tuple[Array, Array], ...] = ()
    products: tuple[tuple[Block, Block], ...] = ()


NO_UPDATE = AccumulatedUpdate()


def with_product(update: AccumulatedUpdate, first: Block, second: Block) -> AccumulatedUpdate:
    """Return an update with one more product to subtract, as a low-rank term if a factor has low rank."""
    if isinstance(first, LowRank) and not (isinstance(second, LowRank) and rank(second) < rank(first)):
        right = multiply_transposed(second, first.right.T).T
        return AccumulatedUpdate((*update.terms, (first.left, right)), update.products)
    if isinstance(second, LowRank):
        return AccumulatedUpdate((*update.terms, (multiply(first, second.left), second.right)), update.products)
    return AccumulatedUpdate(update.terms, (*update.products, (first, second)))


def _child(block: Block, row: int, column: int) -> Block:
    return block.children[row][column] if isinstance(block, Split) else block


def _inner_count(first: Block, second: Block) -> int:
    if isinstance(first, Split):
        return len(first.children[0])
    return len(second.children) if isinstance(second, Split) else 1


def restrict_update(update: AccumulatedUpdate, block: Split, row: int, column: int) -> AccumulatedUpdate:
    """Return the update of one block of a divided block."""
    child = block.children[row][column]
    rows, columns = relative_range(child.rows, block.rows), relative_range(child.columns, block.columns)
    restricted = AccumulatedUpdate(tuple((left[rows], right[:, columns]) for left, right in update.terms))
    for first, second in update.products:
        for inner in range(_inner_count(first, second)):
            restricted = with_product(restricted, _child(first, row, inner), _child(second, inner, column))
    return restricted


def subtract_update(
    block: Dense | LowRank, update: AccumulatedUpdate, tolerance: float, dtype: DTypeLike
) -> Dense | LowRank:
    """Return an undivided block minus an update."""
    converted_block = convert(block, dtype)
    assert not isinstance(converted_block, Split)
    block = converted_block
    if not update.terms and not update.products:
        return block
    if isinstance(block, Dense) or min(shape(block)) <= MAX_ENTRYWISE:
        array = np.array(to_dense(block), order="C")
        outer = [(block.rows, block.columns, left, right) for left, right in update.terms]
        for first, second in update.products:
            outer += _outer_products(first, second)
        if not subtract_products(table_of(outer, block.rows.start, block.columns.start, array.dtype), array):
            raise RuntimeError("BLAS cannot be called from compiled code")
        if isinstance(block, Dense):
            return Dense(block.rows, block.columns, array)
        return LowRank(block.rows, block.columns, *truncate(array, tolerance))
    left = np.concatenate([block.left, *(-factor for factor, _ in update.terms)], axis=1)
    right = np.concatenate([block.right, *(factor for _, factor in update.terms)], axis=0)

    def product(x: Array) -> Array:
        y = left @ (right @ x)
        for first, second in update.products:
            y -= multiply(first, multiply(second, x))
        return y

    def transposed_product(x: Array) -> Array:
        y = right.T @ (left.T @ x)
        for first, second in update.products:
            y -= multiply_transposed(second, multiply_transposed(first, x))
        return y

    expected = rank(block)  # elimination hardly changes it
    factors = compress(product, transposed_product, shape(block), expected, tolerance, dtype)
    return LowRank(block.rows, block.columns, *factors)


def _outer_products(first: Block, second: Block) -> Iterator[OuterProduct]:
    """Yield a product as products of two matrices, each in its range of rows and columns."""
    if isinstance(first, LowRank) or isinstance(second, LowRank):
        ((left, right),) = with_product(NO_UPDATE, first, second).terms
        yield first.rows, second.columns, left, right
    elif isinstance(first, Dense) and isinstance(second, Dense):
        yield first.rows, second.columns, first.array, second.array
    else:
        rows = len(first.children) if isinstance(first, Split) else 1
        columns = len(second.children[0]) if isinstance(second, Split) else 1
        for row, column, inner in np.ndindex(rows, columns, _inner_count(first, second)):
            yield from _outer_products(_child(first, row, inner), _child(second, inner, column))
