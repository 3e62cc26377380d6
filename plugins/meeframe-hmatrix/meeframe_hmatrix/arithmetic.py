"""Truncated LU factors of hierarchical matrices, and solutions with them.

Products that are to be subtracted from a block are not formed at once: they accumulate (`update`) and are handed
down with the elimination, until they meet an undivided block.
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
from meeframe_hmatrix.accumulated_update import NOTHING, AccumulatedUpdate, handed_down, subtracted, with_product
from meeframe_hmatrix.blocks import Block, Dense, LowRank, Split, multiply, transposed

Result = TypeVar("Result")


@dataclass(frozen=True, eq=False)
class Truncation:
    """Accuracy and threads of truncated elimination.

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
    """Threads beside this one, which works, too; each has BLAS for itself. What they have not begun ends with it."""
    with ONE_BLAS_THREAD, ExitStack() as at_end:
        pool = ThreadPoolExecutor(max(1, get_num_threads() - 1))
        at_end.callback(pool.shutdown, cancel_futures=True)
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


def eliminate(block: Block, truncation: Truncation, update: AccumulatedUpdate = NOTHING) -> Factors:
    """LU factors of a square block minus an update."""
    if isinstance(block, Dense):
        rest = subtracted(block, update, truncation.tolerance, truncation.dtype)
        assert isinstance(rest, Dense)
        return Eliminated(block.rows, block.columns, np.linalg.inv(rest.array))
    assert isinstance(block, Split)
    first = eliminate(block.parts[0][0], truncation, handed_down(update, block, 0, 0))

    def left() -> Block:
        return solve_from_right(first, block.parts[1][0], truncation, handed_down(update, block, 1, 0))

    def above() -> Block:
        return solve(first, Form.LOWER, block.parts[0][1], truncation, handed_down(update, block, 0, 1))

    lower, upper = truncation.shared([left, above])
    remaining = with_product(handed_down(update, block, 1, 1), lower, upper)
    second = eliminate(block.parts[1][1], truncation, remaining)
    return EliminatedSplit(block.rows, block.columns, first, upper, lower, second)


def solve(
    factors: Factors, form: Form, block: Block, truncation: Truncation, update: AccumulatedUpdate = NOTHING
) -> Block:
    """X of triangle @ X = block - update, for one of the triangles of factors."""
    if not isinstance(block, Split):
        rest = subtracted(block, update, truncation.tolerance, truncation.dtype)
        if isinstance(rest, Dense):
            return Dense(rest.rows, rest.columns, solution(factors, form, rest.array))
        return LowRank(rest.rows, rest.columns, solution(factors, form, rest.left), rest.right)
    numbers = range(len(block.parts[0]))
    columns = truncation.shared(
        [partial(_column, factors, form, block, number, truncation, update) for number in numbers]
    )
    return Split(block.rows, block.columns, tuple(zip(*columns, strict=True)))


def _column(
    factors: Factors, form: Form, block: Split, column: int, truncation: Truncation, update: AccumulatedUpdate
) -> list[Block]:
    """The parts of a solution in one of its columns."""
    parts = [line[column] for line in block.parts]
    shares = [handed_down(update, block, row, column) for row in range(len(parts))]
    if isinstance(factors, Eliminated):
        return [solve(factors, form, parts[0], truncation, shares[0])]
    triangle = _triangle(factors, form)
    first, second = triangle.order
    parts[first] = solve(triangle.parts[0], form, parts[first], truncation, shares[first])
    share = with_product(shares[second], triangle.coupling, parts[first])
    parts[second] = solve(triangle.parts[1], form, parts[second], truncation, share)
    return parts


def solve_from_right(
    factors: Factors, block: Block, truncation: Truncation, update: AccumulatedUpdate = NOTHING
) -> Block:
    """X of X @ upper = block - update."""
    update_transposed = AccumulatedUpdate(
        tuple((right.T, left.T) for left, right in update.terms),
        tuple((transposed(second), transposed(first)) for first, second in update.products),
    )
    return transposed(solve(factors, Form.UPPER_TRANSPOSED, transposed(block), truncation, update_transposed))


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
    """Return the precision of factors."""
    return factors.inverse.dtype if isinstance(factors, Eliminated) else precision(factors.first)
