"""What is to be subtracted from blocks: products that wait until they meet an undivided block.

There they are subtracted in one compression, the sum of all of them with the block itself. Accumulated updates: Boerm,
Numerische Mathematik 142 (2019) 1-41, here with a random range finder.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import DTypeLike

from meeframe.fields import Array
from meeframe_hmatrix.blocks import (
    Block,
    Dense,
    LowRank,
    Split,
    compress,
    converted,
    multiply,
    multiply_transposed,
    rank,
    shape,
    to_dense,
    within,
)
from meeframe_hmatrix.gemm import Outer, subtract_products, table_of
from meeframe_hmatrix.truncation import truncated

SMALL = 250
"""Rows or columns of low-rank blocks up to which the sum of what is pending is formed entry by entry."""


@dataclass(frozen=True, eq=False)
class Pending:
    """What is still to be subtracted from a block: low-rank terms (m, k), (k, n) and products of divided blocks."""

    terms: tuple[tuple[Array, Array], ...] = ()
    products: tuple[tuple[Block, Block], ...] = ()


NOTHING = Pending()


def with_product(pending: Pending, first: Block, second: Block) -> Pending:
    """One more product to subtract; where a factor has low rank the product has, too."""
    if isinstance(first, LowRank) and not (isinstance(second, LowRank) and rank(second) < rank(first)):
        right = multiply_transposed(second, first.right.T).T
        return Pending((*pending.terms, (first.left, right)), pending.products)
    if isinstance(second, LowRank):
        return Pending((*pending.terms, (multiply(first, second.left), second.right)), pending.products)
    return Pending(pending.terms, (*pending.products, (first, second)))


def _part(block: Block, row: int, column: int) -> Block:
    return block.parts[row][column] if isinstance(block, Split) else block


def _inner_parts(first: Block, second: Block) -> int:
    if isinstance(first, Split):
        return len(first.parts[0])
    return len(second.parts) if isinstance(second, Split) else 1


def handed_down(pending: Pending, block: Split, row: int, column: int) -> Pending:
    """The share of one part of a block."""
    part = block.parts[row][column]
    rows, columns = within(part.rows, block.rows), within(part.columns, block.columns)
    share = Pending(tuple((left[rows], right[:, columns]) for left, right in pending.terms))
    for first, second in pending.products:
        for inner in range(_inner_parts(first, second)):
            share = with_product(share, _part(first, row, inner), _part(second, inner, column))
    return share


def subtracted(block: Dense | LowRank, pending: Pending, tolerance: float, dtype: DTypeLike) -> Dense | LowRank:
    """An undivided block less all that is pending."""
    converted_block = converted(block, dtype)
    assert not isinstance(converted_block, Split)
    block = converted_block
    if not pending.terms and not pending.products:
        return block
    if isinstance(block, Dense) or min(shape(block)) <= SMALL:
        array = np.array(to_dense(block), order="C")
        outer = [(block.rows, block.columns, left, right) for left, right in pending.terms]
        for first, second in pending.products:
            outer += _outer_products(first, second)
        if not subtract_products(table_of(outer, block.rows.start, block.columns.start, array.dtype), array):
            raise RuntimeError("BLAS cannot be called from compiled code")
        if isinstance(block, Dense):
            return Dense(block.rows, block.columns, array)
        return LowRank(block.rows, block.columns, *truncated(array, tolerance))
    left = np.concatenate([block.left, *(-part for part, _ in pending.terms)], axis=1)
    right = np.concatenate([block.right, *(part for _, part in pending.terms)], axis=0)

    def product(x: Array) -> Array:
        y = left @ (right @ x)
        for first, second in pending.products:
            y -= multiply(first, multiply(second, x))
        return y

    def transposed(x: Array) -> Array:
        y = right.T @ (left.T @ x)
        for first, second in pending.products:
            y -= multiply_transposed(second, multiply_transposed(first, x))
        return y

    expected = rank(block)  # elimination hardly changes it
    factors = compress(product, transposed, shape(block), expected, tolerance, dtype)
    return LowRank(block.rows, block.columns, *factors)


def _outer_products(first: Block, second: Block) -> Iterator[Outer]:
    """A product as products of two matrices, each in its range of rows and columns."""
    if isinstance(first, LowRank) or isinstance(second, LowRank):
        ((left, right),) = with_product(NOTHING, first, second).terms
        yield first.rows, second.columns, left, right
    elif isinstance(first, Dense) and isinstance(second, Dense):
        yield first.rows, second.columns, first.array, second.array
    else:
        rows = len(first.parts) if isinstance(first, Split) else 1
        columns = len(second.parts[0]) if isinstance(second, Split) else 1
        for row, column, inner in np.ndindex(rows, columns, _inner_parts(first, second)):
            yield from _outer_products(_part(first, row, inner), _part(second, inner, column))
