"""Truncated LU factors of hierarchical matrices, and solutions with them.

Products that are to be subtracted from a block are not formed at once: they wait (Pending) and are handed down with the
elimination, until they meet an undivided block and are subtracted in one compression, the sum of all of them with the
block itself. Accumulated updates: Boerm, Numerische Mathematik 142 (2019) 1-41, here with a random range finder.
"""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lu_factor, solve_triangular

from meeframe.core.fields import Array
from meeframe.core.mesh import Indices
from meeframe_hmatrix.blocks import (
    Block,
    Dense,
    LowRank,
    Split,
    compress,
    multiply,
    multiply_transposed,
    shape,
    within,
)

MOST_TERMS = 3
"""Low-rank terms are summed up when their ranks exceed so many times the largest of them."""


@dataclass(frozen=True, eq=False)
class Eliminated:
    """LU factors of an undivided diagonal block, array[order] = lower @ upper, in one array (n, n)."""

    rows: slice
    columns: slice
    factors: Array
    order: Indices


@dataclass(frozen=True, eq=False)
class EliminatedSplit:
    """Factors of a divided diagonal block: lower parts below the diagonal, upper parts above it, factors on it."""

    rows: slice
    columns: slice
    first: "Factors"
    upper: Block
    lower: Block
    second: "Factors"


Factors = Eliminated | EliminatedSplit


@dataclass(frozen=True, eq=False)
class Pending:
    """What is still to be subtracted from a block: low-rank terms (m, k), (k, n) and products of divided blocks."""

    terms: tuple[tuple[Array, Array], ...] = ()
    products: tuple[tuple[Block, Block], ...] = ()


NOTHING = Pending()


def _with_product(pending: Pending, first: Block, second: Block) -> Pending:
    """One more product to subtract; where a factor has low rank the product has, too."""
    if isinstance(first, LowRank):
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


def _condensed(pending: Pending, tolerance: float) -> Pending:
    """The same with the low-rank terms summed up, if they are many."""
    ranks = [left.shape[1] for left, _ in pending.terms]
    if sum(ranks) <= MOST_TERMS * max(ranks, default=0):
        return pending
    left = np.concatenate([left for left, _ in pending.terms], axis=1)
    right = np.concatenate([right for _, right in pending.terms], axis=0)
    size, rank = (len(left), right.shape[1]), max(ranks)
    factors = compress(lambda x: left @ (right @ x), lambda x: right.T @ (left.T @ x), size, rank, tolerance)
    return Pending((factors,), pending.products)


def _subtracted(block: Dense | LowRank, pending: Pending, tolerance: float) -> Dense | LowRank:
    """An undivided block less all that is pending."""
    if not pending.terms and not pending.products:
        return block
    if isinstance(block, Dense):
        array = block.array.copy()
        for left, right in pending.terms:
            array -= left @ right
        for first, second in pending.products:
            array -= _dense_product(first, second, array.shape[1])
        return Dense(block.rows, block.columns, array)
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

    rank = max(block.left.shape[1], *(part.shape[1] for part, _ in pending.terms), 0)
    return LowRank(block.rows, block.columns, *compress(product, transposed, shape(block), rank, tolerance))


def _dense_product(first: Block, second: Block, width: int) -> Array:
    if isinstance(second, Dense):
        return multiply(first, second.array)
    if isinstance(first, Dense):
        return multiply_transposed(second, first.array.T).T
    return multiply(first, multiply(second, np.eye(width)))


def eliminate(block: Block, tolerance: float, pool: Executor, pending: Pending = NOTHING) -> Factors:
    """LU factors of a square block less what is pending, truncated to a relative tolerance block by block."""
    if isinstance(block, Dense):
        rest = _subtracted(block, pending, tolerance)
        assert isinstance(rest, Dense)
        factors, swaps = lu_factor(rest.array, check_finite=False)
        return Eliminated(block.rows, block.columns, factors, _permutation(swaps))
    assert isinstance(block, Split)
    pending = _condensed(pending, tolerance)
    first = eliminate(block.parts[0][0], tolerance, pool, _handed_down(pending, block, 0, 0))
    later = pool.submit(solve_lower, first, block.parts[0][1], tolerance, _handed_down(pending, block, 0, 1))
    lower = solve_upper_right(first, block.parts[1][0], tolerance, _handed_down(pending, block, 1, 0))
    upper = later.result()
    remaining = _with_product(_handed_down(pending, block, 1, 1), lower, upper)
    second = eliminate(block.parts[1][1], tolerance, pool, remaining)
    return EliminatedSplit(block.rows, block.columns, first, upper, lower, second)


def _permutation(swaps: Indices) -> Indices:
    order = np.arange(len(swaps), dtype=np.int64)
    for row, other in enumerate(swaps):
        order[[row, other]] = order[[other, row]]
    return order


def solve_lower(factors: Factors, block: Block, tolerance: float, pending: Pending = NOTHING) -> Block:
    """X of lower @ X = block - pending."""
    if not isinstance(block, Split):
        rest = _subtracted(block, pending, tolerance)
        if isinstance(rest, Dense):
            return Dense(rest.rows, rest.columns, lower_solution(factors, rest.array))
        return LowRank(rest.rows, rest.columns, lower_solution(factors, rest.left), rest.right)
    pending = _condensed(pending, tolerance)
    lines: list[list[Block]] = [[] for _ in block.parts]
    for column in range(len(block.parts[0])):
        shares = [_handed_down(pending, block, row, column) for row in range(len(block.parts))]
        if isinstance(factors, Eliminated):
            lines[0].append(solve_lower(factors, block.parts[0][column], tolerance, shares[0]))
            continue
        first = solve_lower(factors.first, block.parts[0][column], tolerance, shares[0])
        share = _with_product(shares[1], factors.lower, first)
        lines[0].append(first)
        lines[1].append(solve_lower(factors.second, block.parts[1][column], tolerance, share))
    return _split(block, lines)


def solve_upper(factors: Factors, block: Block, tolerance: float, pending: Pending = NOTHING) -> Block:
    """X of upper @ X = block - pending."""
    if not isinstance(block, Split):
        rest = _subtracted(block, pending, tolerance)
        if isinstance(rest, Dense):
            return Dense(rest.rows, rest.columns, upper_solution(factors, rest.array))
        return LowRank(rest.rows, rest.columns, upper_solution(factors, rest.left), rest.right)
    pending = _condensed(pending, tolerance)
    lines: list[list[Block]] = [[] for _ in block.parts]
    for column in range(len(block.parts[0])):
        shares = [_handed_down(pending, block, row, column) for row in range(len(block.parts))]
        if isinstance(factors, Eliminated):
            lines[0].append(solve_upper(factors, block.parts[0][column], tolerance, shares[0]))
            continue
        second = solve_upper(factors.second, block.parts[1][column], tolerance, shares[1])
        share = _with_product(shares[0], factors.upper, second)
        lines[1].append(second)
        lines[0].append(solve_upper(factors.first, block.parts[0][column], tolerance, share))
    return _split(block, lines)


def solve_upper_right(factors: Factors, block: Block, tolerance: float, pending: Pending = NOTHING) -> Block:
    """X of X @ upper = block - pending."""
    if not isinstance(block, Split):
        rest = _subtracted(block, pending, tolerance)
        if isinstance(rest, Dense):
            return Dense(rest.rows, rest.columns, upper_transposed_solution(factors, rest.array.T).T)
        return LowRank(rest.rows, rest.columns, rest.left, upper_transposed_solution(factors, rest.right.T).T)
    pending = _condensed(pending, tolerance)
    lines: list[list[Block]] = [[] for _ in block.parts]
    for row, line in enumerate(block.parts):
        shares = [_handed_down(pending, block, row, column) for column in range(len(line))]
        if isinstance(factors, Eliminated):
            lines[row].append(solve_upper_right(factors, line[0], tolerance, shares[0]))
            continue
        first = solve_upper_right(factors.first, line[0], tolerance, shares[0])
        share = _with_product(shares[1], first, factors.upper)
        lines[row] += [first, solve_upper_right(factors.second, line[1], tolerance, share)]
    return _split(block, lines)


def _split(like: Split, lines: Sequence[Sequence[Block]]) -> Split:
    return Split(like.rows, like.columns, tuple(tuple(line) for line in lines))


def lower_solution(factors: Factors, x: Array) -> Array:
    """lower^-1 @ x for x (n, k)."""
    if isinstance(factors, Eliminated):
        return _triangular(factors.factors, x[factors.order], lower=True, unit=True)
    middle = factors.first.rows.stop - factors.rows.start
    first = lower_solution(factors.first, x[:middle])
    second = lower_solution(factors.second, x[middle:] - multiply(factors.lower, first))
    return np.concatenate([first, second])


def upper_solution(factors: Factors, x: Array) -> Array:
    """upper^-1 @ x for x (n, k)."""
    if isinstance(factors, Eliminated):
        return _triangular(factors.factors, x)
    middle = factors.first.rows.stop - factors.rows.start
    second = upper_solution(factors.second, x[middle:])
    first = upper_solution(factors.first, x[:middle] - multiply(factors.upper, second))
    return np.concatenate([first, second])


def upper_transposed_solution(factors: Factors, x: Array) -> Array:
    """upper^-T @ x for x (n, k)."""
    if isinstance(factors, Eliminated):
        return _triangular(factors.factors, x, transposed=True)
    middle = factors.first.rows.stop - factors.rows.start
    first = upper_transposed_solution(factors.first, x[:middle])
    rest = x[middle:] - multiply_transposed(factors.upper, first)
    return np.concatenate([first, upper_transposed_solution(factors.second, rest)])


def _triangular(factors: Array, x: Array, lower: bool = False, unit: bool = False, transposed: bool = False) -> Array:
    solution: Array = solve_triangular(
        factors, x, trans=1 if transposed else 0, lower=lower, unit_diagonal=unit, check_finite=False
    )
    return solution
