"""Truncated LU factors of hierarchical matrices, and solutions with them.

Products that are to be subtracted from a block are not formed at once: they wait (Pending) and are handed down with the
elimination, until they meet an undivided block and are subtracted in one compression, the sum of all of them with the
block itself. Accumulated updates: Boerm, Numerische Mathematik 142 (2019) 1-41, here with a random range finder.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property, partial
from typing import Any, TypeVar

import numpy as np
from numba import get_num_threads
from numpy.typing import DTypeLike
from threadpoolctl import threadpool_limits

from meeframe.core.fields import Array
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
    transposed,
    within,
)
from meeframe_hmatrix.gemm import Outer, subtract_products, table_of
from meeframe_hmatrix.truncation import truncated

Result = TypeVar("Result")

SMALL = 250
"""Rows or columns of low-rank blocks up to which the sum of what is pending is formed entry by entry."""


@dataclass(frozen=True, eq=False)
class Truncation:
    """How factors are computed.

    tolerance: relative, in the Frobenius norm, block by block; dtype: precision, to which blocks are converted one by
    one when it is their turn, since a copy of them all is as costly as many of its products; pool: threads that help.
    """

    tolerance: float
    dtype: DTypeLike
    pool: Executor

    def shared(self, tasks: Sequence[Callable[[], Result]]) -> list[Result]:
        """Results of independent tasks, which may share their own: this thread does those that no other has begun."""
        begun = [self.pool.submit(task) for task in tasks[1:]]
        first = tasks[0]()
        return [first, *(task() if one.cancel() else one.result() for task, one in zip(tasks[1:], begun, strict=True))]


@contextmanager
def helpers() -> Iterator[Executor]:
    """Threads beside this one, which works, too; each has BLAS for itself."""
    with ThreadPoolExecutor(max(1, get_num_threads() - 1)) as pool, threadpool_limits(1, "blas"):
        yield pool


@dataclass(frozen=True, eq=False)
class Eliminated:
    """Factors of an undivided diagonal block: the lower one is unity, the upper one the block itself.

    inverse: of the block, (n, n), so that solutions are products.
    """

    rows: slice
    columns: slice
    inverse: Array


@dataclass(frozen=True, eq=False)
class EliminatedSplit:
    """Factors of a divided diagonal block: lower parts below the diagonal, upper parts above it, factors on it."""

    rows: slice
    columns: slice
    first: "Factors"
    upper: Block
    lower: Block
    second: "Factors"

    @cached_property
    def upper_transposed(self) -> Block:
        """The transpose of the upper part."""
        return transposed(self.upper)


Factors = Eliminated | EliminatedSplit


class Form(StrEnum):
    """A triangle of factors: the lower one, the upper one, and the upper one transposed, which is lower again."""

    LOWER = "lower"
    UPPER = "upper"
    UPPER_TRANSPOSED = "upper transposed"


@dataclass(frozen=True, eq=False)
class Triangle:
    """A triangle of divided factors as it is solved with, part after part.

    order: numbers of the parts along the diagonal; parts: these, in that order; coupling: the block by which the
    solution of the first enters the equations of the second.
    """

    order: tuple[int, int]
    parts: tuple[Factors, Factors]
    coupling: Block


def _triangle(factors: EliminatedSplit, form: Form) -> Triangle:
    parts = factors.first, factors.second
    if form is Form.UPPER:
        return Triangle((1, 0), parts[::-1], factors.upper)
    return Triangle((0, 1), parts, factors.lower if form is Form.LOWER else factors.upper_transposed)


@dataclass(frozen=True, eq=False)
class Pending:
    """What is still to be subtracted from a block: low-rank terms (m, k), (k, n) and products of divided blocks."""

    terms: tuple[tuple[Array, Array], ...] = ()
    products: tuple[tuple[Block, Block], ...] = ()


NOTHING = Pending()


def _with_product(pending: Pending, first: Block, second: Block) -> Pending:
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


def _handed_down(pending: Pending, block: Split, row: int, column: int) -> Pending:
    """The share of one part of a block."""
    part = block.parts[row][column]
    rows, columns = within(part.rows, block.rows), within(part.columns, block.columns)
    share = Pending(tuple((left[rows], right[:, columns]) for left, right in pending.terms))
    for first, second in pending.products:
        for inner in range(_inner_parts(first, second)):
            share = _with_product(share, _part(first, row, inner), _part(second, inner, column))
    return share


def _subtracted(block: Dense | LowRank, pending: Pending, truncation: Truncation) -> Dense | LowRank:
    """An undivided block less all that is pending."""
    converted_block = converted(block, truncation.dtype)
    assert not isinstance(converted_block, Split)
    block = converted_block
    if not pending.terms and not pending.products:
        return block
    if isinstance(block, Dense) or min(shape(block)) <= SMALL:
        array = np.array(to_dense(block), order="C")
        outer = [(block.rows, block.columns, left, right) for left, right in pending.terms]
        for first, second in pending.products:
            outer += _outer_products(first, second)
        subtract_products(table_of(outer, block.rows.start, block.columns.start, array.dtype), array)
        if isinstance(block, Dense):
            return Dense(block.rows, block.columns, array)
        return LowRank(block.rows, block.columns, *truncated(array, truncation.tolerance))
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
    factors = compress(product, transposed, shape(block), expected, truncation.tolerance, truncation.dtype)
    return LowRank(block.rows, block.columns, *factors)


def _outer_products(first: Block, second: Block) -> Iterator[Outer]:
    """A product as products of two matrices, each in its range of rows and columns."""
    if isinstance(first, LowRank) or isinstance(second, LowRank):
        ((left, right),) = _with_product(NOTHING, first, second).terms
        yield first.rows, second.columns, left, right
    elif isinstance(first, Dense) and isinstance(second, Dense):
        yield first.rows, second.columns, first.array, second.array
    else:
        rows = len(first.parts) if isinstance(first, Split) else 1
        columns = len(second.parts[0]) if isinstance(second, Split) else 1
        for row, column, inner in np.ndindex(rows, columns, _inner_parts(first, second)):
            yield from _outer_products(_part(first, row, inner), _part(second, inner, column))


def eliminate(block: Block, truncation: Truncation, pending: Pending = NOTHING) -> Factors:
    """LU factors of a square block less what is pending."""
    if isinstance(block, Dense):
        rest = _subtracted(block, pending, truncation)
        assert isinstance(rest, Dense)
        return Eliminated(block.rows, block.columns, np.linalg.inv(rest.array))
    assert isinstance(block, Split)
    first = eliminate(block.parts[0][0], truncation, _handed_down(pending, block, 0, 0))

    def left() -> Block:
        return solve_from_right(first, block.parts[1][0], truncation, _handed_down(pending, block, 1, 0))

    def above() -> Block:
        return solve(first, Form.LOWER, block.parts[0][1], truncation, _handed_down(pending, block, 0, 1))

    lower, upper = truncation.shared([left, above])
    remaining = _with_product(_handed_down(pending, block, 1, 1), lower, upper)
    second = eliminate(block.parts[1][1], truncation, remaining)
    return EliminatedSplit(block.rows, block.columns, first, upper, lower, second)


def solve(factors: Factors, form: Form, block: Block, truncation: Truncation, pending: Pending = NOTHING) -> Block:
    """X of triangle @ X = block - pending, for one of the triangles of factors."""
    if not isinstance(block, Split):
        rest = _subtracted(block, pending, truncation)
        if isinstance(rest, Dense):
            return Dense(rest.rows, rest.columns, solution(factors, form, rest.array))
        return LowRank(rest.rows, rest.columns, solution(factors, form, rest.left), rest.right)
    numbers = range(len(block.parts[0]))
    columns = truncation.shared(
        [partial(_column, factors, form, block, number, truncation, pending) for number in numbers]
    )
    return Split(block.rows, block.columns, tuple(zip(*columns, strict=True)))


def _column(
    factors: Factors, form: Form, block: Split, column: int, truncation: Truncation, pending: Pending
) -> list[Block]:
    """The parts of a solution in one of its columns."""
    parts = [line[column] for line in block.parts]
    shares = [_handed_down(pending, block, row, column) for row in range(len(parts))]
    if isinstance(factors, Eliminated):
        return [solve(factors, form, parts[0], truncation, shares[0])]
    triangle = _triangle(factors, form)
    first, second = triangle.order
    parts[first] = solve(triangle.parts[0], form, parts[first], truncation, shares[first])
    share = _with_product(shares[second], triangle.coupling, parts[first])
    parts[second] = solve(triangle.parts[1], form, parts[second], truncation, share)
    return parts


def solve_from_right(factors: Factors, block: Block, truncation: Truncation, pending: Pending = NOTHING) -> Block:
    """X of X @ upper = block - pending."""
    turned = Pending(
        tuple((right.T, left.T) for left, right in pending.terms),
        tuple((transposed(second), transposed(first)) for first, second in pending.products),
    )
    return transposed(solve(factors, Form.UPPER_TRANSPOSED, transposed(block), truncation, turned))


def solution(factors: Factors, form: Form, x: Array) -> Array:
    """triangle^-1 @ x for x (n, k), for one of the triangles of factors."""
    if isinstance(factors, Eliminated):
        if form is Form.LOWER:
            return x
        inverse = factors.inverse if form is Form.UPPER else factors.inverse.T
        solved: Array = inverse @ x
        return solved
    middle = factors.first.rows.stop - factors.rows.start
    parts = [x[:middle], x[middle:]]
    triangle = _triangle(factors, form)
    first, second = triangle.order
    parts[first] = solution(triangle.parts[0], form, parts[first])
    parts[second] = solution(triangle.parts[1], form, parts[second] - multiply(triangle.coupling, parts[first]))
    return np.concatenate(parts)


def solved(factors: Factors, x: Array) -> Array:
    """matrix^-1 @ x for x (n, k) and the factors of a matrix, in their precision."""
    values = x.astype(precision(factors), copy=False)
    result: Array = solution(factors, Form.UPPER, solution(factors, Form.LOWER, values)).astype(x.dtype, copy=False)
    return result


def precision(factors: Factors) -> np.dtype[Any]:
    """Of all their numbers."""
    return factors.inverse.dtype if isinstance(factors, Eliminated) else precision(factors.first)
