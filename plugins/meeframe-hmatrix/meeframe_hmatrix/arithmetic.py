"""Truncated LU factors of hierarchical matrices, and solutions with them.

Products to be subtracted from a block are not computed at once: they accumulate (`update`) and are passed down with the
elimination until they reach an undivided block.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property, partial
from typing import Any, TypeVar

import numpy as np
from numba import get_num_threads
from numpy.typing import DTypeLike

from meeframe.plugin import ONE_BLAS_THREAD, Array
from meeframe_hmatrix.accumulated_update import (
    NO_UPDATE,
    AccumulatedUpdate,
    restrict_update,
    subtract_update,
    with_product,
)
from meeframe_hmatrix.blocks import Block, Dense, LowRank, Split, multiply, transpose

Result = TypeVar("Result")


@dataclass(frozen=True, eq=False)
class Truncation:
    """Parameters of the computation of factors.

    Attributes
    ----------
    tolerance
        Relative tolerance in the Frobenius norm, block by block.
    dtype
        Precision, to which blocks are converted one by one when they are used, since a copy of all costs as much as
        many products.
    pool
        Pool of additional threads.
    """

    tolerance: float
    dtype: DTypeLike
    pool: Executor

    def run_all(self, tasks: Sequence[Callable[[], Result]]) -> list[Result]:
        """Return the results of independent tasks, which may be run by other threads.

        This thread runs those that no other has started. Tasks may share out tasks themselves.
        """
        futures = [self.pool.submit(task) for task in tasks[1:]]
        first = tasks[0]()
        return [
            first,
            *(task() if future.cancel() else future.result() for task, future in zip(tasks[1:], futures, strict=True)),
        ]


@contextmanager
def worker_pool() -> Iterator[Executor]:
    """Provide additional threads, each with a single-threaded BLAS; tasks not started are cancelled at the end."""
    with ONE_BLAS_THREAD, ExitStack() as stack:
        pool = ThreadPoolExecutor(max(1, get_num_threads() - 1))
        stack.callback(pool.shutdown, cancel_futures=True)
        yield pool


@dataclass(frozen=True, eq=False)
class DenseFactors:
    """Factors of an undivided diagonal block: the lower one is the identity, the upper one the block.

    Attributes
    ----------
    rows, columns
        Ranges of the block.
    inverse
        Inverse of the block, (n, n), so that solutions are products.
    """

    rows: slice
    columns: slice
    inverse: Array


@dataclass(frozen=True, eq=False)
class SplitFactors:
    """Factors of a divided diagonal block: lower blocks below the diagonal, upper blocks above it, factors on it."""

    rows: slice
    columns: slice
    first: "Factors"
    upper: Block
    lower: Block
    second: "Factors"

    @cached_property
    def upper_transposed(self) -> Block:
        """Transpose of the upper block."""
        return transpose(self.upper)


Factors = DenseFactors | SplitFactors


class Form(StrEnum):
    """A triangle of factors: lower, upper, or the transpose of the upper one, which is lower again."""

    LOWER = "lower"
    UPPER = "upper"
    UPPER_TRANSPOSED = "upper transposed"


@dataclass(frozen=True, eq=False)
class Triangle:
    """A triangle of divided factors in the order of its solution.

    Attributes
    ----------
    order
        Numbers of the diagonal blocks in this order.
    diagonal
        The diagonal blocks in this order.
    coupling
        Block by which the solution of the first enters the equations of the second.
    """

    order: tuple[int, int]
    diagonal: tuple[Factors, Factors]
    coupling: Block


def _triangle(factors: SplitFactors, form: Form) -> Triangle:
    diagonal = factors.first, factors.second
    if form is Form.UPPER:
        return Triangle((1, 0), diagonal[::-1], factors.upper)
    return Triangle((0, 1), diagonal, factors.lower if form is Form.LOWER else factors.upper_transposed)


def eliminate(block: Block, truncation: Truncation, update: AccumulatedUpdate = NO_UPDATE) -> Factors:
    """Return the LU factors of a square block minus an update."""
    if isinstance(block, Dense):
        remainder = subtract_update(block, update, truncation.tolerance, truncation.dtype)
        assert isinstance(remainder, Dense)
        return DenseFactors(block.rows, block.columns, np.linalg.inv(remainder.array))
    assert isinstance(block, Split)
    first = eliminate(block.children[0][0], truncation, restrict_update(update, block, 0, 0))

    def solve_lower() -> Block:
        return solve_block_from_right(first, block.children[1][0], truncation, restrict_update(update, block, 1, 0))

    def solve_upper() -> Block:
        return solve_block(first, Form.LOWER, block.children[0][1], truncation, restrict_update(update, block, 0, 1))

    lower, upper = truncation.run_all([solve_lower, solve_upper])
    remaining = with_product(restrict_update(update, block, 1, 1), lower, upper)
    second = eliminate(block.children[1][1], truncation, remaining)
    return SplitFactors(block.rows, block.columns, first, upper, lower, second)


def solve_block(
    factors: Factors, form: Form, block: Block, truncation: Truncation, update: AccumulatedUpdate = NO_UPDATE
) -> Block:
    """Return X of triangle @ X = block - update, for one of the triangles of factors."""
    if not isinstance(block, Split):
        remainder = subtract_update(block, update, truncation.tolerance, truncation.dtype)
        if isinstance(remainder, Dense):
            return Dense(remainder.rows, remainder.columns, substitute(factors, form, remainder.array))
        return LowRank(remainder.rows, remainder.columns, substitute(factors, form, remainder.left), remainder.right)
    numbers = range(len(block.children[0]))
    columns = truncation.run_all(
        [partial(_column, factors, form, block, number, truncation, update) for number in numbers]
    )
    return Split(block.rows, block.columns, tuple(zip(*columns, strict=True)))


def _column(
    factors: Factors, form: Form, block: Split, column: int, truncation: Truncation, update: AccumulatedUpdate
) -> list[Block]:
    """Return the blocks of a solution in one of its columns."""
    blocks = [line[column] for line in block.children]
    updates = [restrict_update(update, block, row, column) for row in range(len(blocks))]
    if isinstance(factors, DenseFactors):
        return [solve_block(factors, form, blocks[0], truncation, updates[0])]
    triangle = _triangle(factors, form)
    first, second = triangle.order
    blocks[first] = solve_block(triangle.diagonal[0], form, blocks[first], truncation, updates[first])
    block_update = with_product(updates[second], triangle.coupling, blocks[first])
    blocks[second] = solve_block(triangle.diagonal[1], form, blocks[second], truncation, block_update)
    return blocks


def solve_block_from_right(
    factors: Factors, block: Block, truncation: Truncation, update: AccumulatedUpdate = NO_UPDATE
) -> Block:
    """Return X of X @ upper = block - update."""
    update_transposed = AccumulatedUpdate(
        tuple((right.T, left.T) for left, right in update.terms),
        tuple((transpose(second), transpose(first)) for first, second in update.products),
    )
    return transpose(solve_block(factors, Form.UPPER_TRANSPOSED, transpose(block), truncation, update_transposed))


def substitute(factors: Factors, form: Form, x: Array) -> Array:
    """Return triangle^-1 @ x for x (n, k), for one of the triangles of factors."""
    if isinstance(factors, DenseFactors):
        if form is Form.LOWER:
            return x
        inverse = factors.inverse if form is Form.UPPER else factors.inverse.T
        result: Array = inverse @ x
        return result
    n_first = factors.first.rows.stop - factors.rows.start
    blocks = [x[:n_first], x[n_first:]]
    triangle = _triangle(factors, form)
    first, second = triangle.order
    blocks[first] = substitute(triangle.diagonal[0], form, blocks[first])
    blocks[second] = substitute(triangle.diagonal[1], form, blocks[second] - multiply(triangle.coupling, blocks[first]))
    return np.concatenate(blocks)


def apply_inverse(factors: Factors, x: Array) -> Array:
    """Return matrix^-1 @ x for x (n, k) and the factors of a matrix, in their precision."""
    values = x.astype(precision(factors), copy=False)
    result: Array = substitute(factors, Form.UPPER, substitute(factors, Form.LOWER, values)).astype(x.dtype, copy=False)
    return result


def precision(factors: Factors) -> np.dtype[Any]:
    """Return the type of the numbers of factors."""
    return factors.inverse.dtype if isinstance(factors, DenseFactors) else precision(factors.first)
