"""Products, compression and truncated factors of hierarchical matrices agree with dense linear algebra."""

import pickle
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from threading import Event

import numpy as np
import pytest
from meeframe_hmatrix import arithmetic
from meeframe_hmatrix.arithmetic import (
    Form,
    Truncation,
    eliminate,
    solve_block,
    solve_block_from_right,
    substitute,
    worker_pool,
)
from meeframe_hmatrix.blocks import (
    Dense,
    LowRank,
    Split,
    compress,
    convert,
    count_entries,
    leaves,
    multiply,
    multiply_transposed,
    recompress,
    to_dense,
)
from meeframe_hmatrix.field_selection import merge_blocks, select_fields
from meeframe_hmatrix.product import product_of
from meeframe_hmatrix.truncation import SINGLE_PRECISION_TOLERANCE, truncate
from numba import get_num_threads

LEAF = 12


def hierarchical(matrix, rows, columns, tolerance):
    """Return the blocks of a matrix whose entries are smooth away from the diagonal."""
    near = not (rows.stop <= columns.start - LEAF or columns.stop <= rows.start - LEAF)
    entries = matrix[rows, columns]
    if not near:
        return LowRank(rows, columns, *recompress(entries, np.eye(entries.shape[1]), tolerance))
    if len(entries) <= LEAF and entries.shape[1] <= LEAF:
        return Dense(rows, columns, entries)
    ranges = [halves(index_range) for index_range in (rows, columns)]
    return Split(
        rows, columns, tuple(tuple(hierarchical(matrix, r, c, tolerance) for c in ranges[1]) for r in ranges[0])
    )


def halves(index_range):
    middle = (index_range.start + index_range.stop) // 2
    if index_range.stop - index_range.start <= LEAF:
        return [index_range]
    return [slice(index_range.start, middle), slice(middle, index_range.stop)]


def kernel_matrix(rows, columns):
    """Return 1 / distance along a line: unsymmetric, and diagonally dominant if square."""
    x, y = np.linspace(0, 1, rows), np.linspace(0, 1, columns)
    matrix = 1.0 / (np.abs(x[:, None] - y) + 0.01) * (1 + 0.3 * np.sin(5 * x[:, None] + y))
    return matrix + (300.0 * np.eye(rows) if rows == columns else 0.0)


@pytest.fixture(scope="module")
def matrices():
    """Return a square matrix whose halves are divided differently, right-hand sides, and both as blocks (1e-9)."""
    square, wide = kernel_matrix(190, 190), kernel_matrix(190, 110)
    return square, wide, to_blocks(square, 1e-9), to_blocks(wide, 1e-9)


def to_blocks(matrix, tolerance):
    return hierarchical(matrix, slice(0, matrix.shape[0]), slice(0, matrix.shape[1]), tolerance)


def error(actual, expected):
    return np.linalg.norm(actual - expected) / np.linalg.norm(expected)


def test_products_match_the_matrix(matrices):
    square, wide, block, wide_block = matrices
    random = np.random.default_rng(1)
    assert {type(leaf) for leaf in leaves(block)} == {Dense, LowRank}
    assert count_entries(block) < 0.6 * square.size
    for matrix, blocks in ((square, block), (wide, wide_block)):
        x, y = random.normal(size=(matrix.shape[1], 3)), random.normal(size=(matrix.shape[0], 2))
        assert error(to_dense(blocks), matrix) < 2e-9
        assert error(multiply(blocks, x), matrix @ x) < 1e-8
        assert error(multiply_transposed(blocks, y), matrix.T @ y) < 1e-8
        for same in (blocks, convert(blocks, np.float32)):  # another way of merging gives the same digits
            product = product_of(same)
            assert error(product(x[:, 0]), to_dense(convert(same, float)) @ x[:, 0]) < 1e-13
            assert product.numbers.size == count_entries(blocks)


def test_copies_are_independent_of_the_original(matrices):
    _, _, block, _ = matrices
    x = np.random.default_rng(7).normal(size=(block.columns.stop, 2))
    expected = multiply(block, x)
    copied = pickle.loads(pickle.dumps(block))
    for leaf in leaves(copied):
        for array in (leaf.array,) if isinstance(leaf, Dense) else (leaf.left,):
            array *= 2.0
    assert error(multiply(copied, x), 2 * expected) < 1e-14
    assert np.array_equal(multiply(block, x), expected)


def test_products_accept_any_memory_layout(matrices):
    square, _, block, _ = matrices
    x = np.random.default_rng(8).normal(size=(2 * block.columns.stop, 4))
    one = np.broadcast_to(x[0, 0], (block.columns.stop, 1))
    for vectors in (x[::2], x[-2::-2], x[: len(square), ::2], np.asfortranarray(x)[: len(square)], one):
        assert error(multiply(block, vectors), square @ vectors) < 1e-8
        assert error(multiply_transposed(block, vectors), square.T @ vectors) < 1e-8


def test_waiting_tasks_are_cancelled_after_an_error(monkeypatch):
    ended, begun = Event(), []

    class Pool(ThreadPoolExecutor):
        def shutdown(self, wait=True, *, cancel_futures=False):
            super().shutdown(False, cancel_futures=cancel_futures)
            ended.set()
            super().shutdown(wait)

    def fail():
        raise ZeroDivisionError

    def wait(number):
        begun.append(number)
        ended.wait(60)

    monkeypatch.setattr(arithmetic, "ThreadPoolExecutor", Pool)
    with pytest.raises(ZeroDivisionError), worker_pool() as pool:
        Truncation(1e-3, np.float64, pool).run_all([fail, *(partial(wait, number) for number in range(300))])
    assert ended.is_set()
    assert len(begun) <= get_num_threads()


def test_mixed_precisions_and_wrong_lengths_are_rejected(matrices):
    _, _, block, _ = matrices
    ((first, second), (third, fourth)) = block.children
    mixed = Split(block.rows, block.columns, ((first, second), (convert(third, np.float32), fourth)))
    with pytest.raises(ValueError, match="float32 in one of float64"):
        multiply(mixed, np.zeros((block.columns.stop, 1)))
    with pytest.raises(ValueError, match="not multiplied with 5 rows"):
        multiply(block, np.zeros((5, 1)))
    with pytest.raises(ValueError, match=r"shape \(5,\); allowed: "):
        product_of(block)(np.zeros(5))


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    ("tolerance", "dtype"),
    [(1e-2, float), (1e-5, float), (1e-8, float), (1e-2, np.float32), (SINGLE_PRECISION_TOLERANCE, np.float32)],
)
def test_compression_meets_tolerance_with_optimal_rank(tolerance, dtype):
    random = np.random.default_rng(2)
    u, v = (np.linalg.qr(random.normal(size=(size, 60)))[0] for size in (200, 150))
    values = 10.0 ** -np.linspace(0, 12, 60)
    factors = (u * values).astype(dtype), v.T.astype(dtype)
    matrix = factors[0] @ factors[1]
    best = int((np.sqrt(np.cumsum(values[::-1] ** 2)[::-1]) > tolerance * np.linalg.norm(values)).sum())
    for left, right in (
        recompress(*factors, tolerance),
        compress(lambda x: matrix @ x, lambda x: matrix.T @ x, matrix.shape, 3, tolerance, dtype),
        truncate(matrix.copy(), tolerance),
    ):
        assert left.dtype == right.dtype == dtype
        assert error(left @ right, matrix) < 1.5 * tolerance
        assert best <= left.shape[1] <= best + 1


def test_zero_matrix_has_rank_zero():
    zero = np.zeros((40, 30))
    compressed = compress(zero.dot, zero.T.dot, zero.shape, 2, 1e-3)
    for left, right in (recompress(zero, np.eye(30), 1e-3), compressed, truncate(zero.copy(), 1e-3)):
        assert left.shape == (40, 0)
        assert right.shape == (0, 30)


@pytest.mark.full
@pytest.mark.parametrize("size", [1e-25, 1.0, 1e25])
def test_truncation_in_single_precision_does_not_depend_on_units(size):
    smooth = 1.0 / (1.0 + np.linspace(0, 1, 40)[:, None] + np.linspace(0, 2, 30))
    left, right = truncate((size * smooth).astype(np.float32), 1e-4)
    assert left.dtype == right.dtype == np.float32
    assert 0 < left.shape[1] < 8
    assert error(left.astype(float) @ right, size * smooth) < 1.5e-4


@pytest.mark.parametrize("precision", [np.float32, np.float64])
@pytest.mark.parametrize("entry", [np.nan, np.inf])
def test_truncation_rejects_nonfinite_entries(precision, entry):
    matrix = np.ones((6, 5), precision)
    matrix[2, 3] = entry
    with pytest.raises(np.linalg.LinAlgError, match="not finite"):
        truncate(matrix, 1e-3)
    if precision == np.float32:  # in double precision, the singular value decomposition raises
        matrix[2, 3] = entry
        with np.errstate(invalid="ignore"), pytest.raises(np.linalg.LinAlgError, match="not finite"):
            recompress(np.eye(6, dtype=precision), matrix, 1e-3)


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize(("tolerance", "rows"), [(1e-2, 190), (1e-4, 1040), (1e-4, 190), (1e-7, 190)])
def test_factors_solve_to_tolerance(tolerance, rows):
    square, wide = kernel_matrix(rows, rows), kernel_matrix(rows, 110)
    block, wide_block = to_blocks(square, 1e-9), to_blocks(wide, 1e-9)
    x = np.random.default_rng(3).normal(size=(len(square), 2))
    tall = to_blocks(np.ascontiguousarray(wide.T), 1e-9)
    with worker_pool() as pool:
        truncation = Truncation(tolerance, np.float64, pool)
        factors = eliminate(block, truncation)
        solved_block = solve_block(
            factors, Form.UPPER, solve_block(factors, Form.LOWER, wide_block, truncation), truncation
        )
        from_right = solve_block_from_right(factors, tall, truncation)
    computed = substitute(factors, Form.UPPER, substitute(factors, Form.LOWER, x))
    assert error(computed, np.linalg.solve(square, x)) < tolerance
    assert error(to_dense(solved_block), np.linalg.solve(square, wide)) < 2 * tolerance
    upper = np.linalg.solve(square.T, wide).T @ to_dense_lower(factors, len(square))
    assert error(to_dense(from_right), upper) < 4 * tolerance


def to_dense_lower(factors, size):
    """Return the lower factor, from its inverse."""
    return np.linalg.inv(substitute(factors, Form.LOWER, np.eye(size)))


def test_products_in_chosen_fields_with_empty_blocks():
    random = np.random.default_rng(6)
    nodes, start = 6, 100
    near, left, right = random.normal(size=(2, 15, 15)), random.normal(size=(15, 2)), random.normal(size=(2, 15))
    rows, columns = ([slice(first, first + 15), slice(first + 15, first + 30)] for first in (start, 0))
    zero = LowRank(rows[1], columns[0], np.zeros((15, 0)), np.zeros((0, 15)))
    children = (
        (Dense(rows[0], columns[0], near[0]), LowRank(rows[0], columns[1], left, right)),
        (zero, Dense(rows[1], columns[1], near[1])),
    )
    matrix = np.block([[near[0], left @ right], [np.zeros((15, 15)), near[1]]]).reshape(nodes, 5, nodes, 5)
    to_load, to_displacement = random.normal(size=(nodes, 5, 2)), random.normal(size=(nodes, 3, 5))
    computed = select_fields(Split(slice(start, start + 30), slice(0, 30), children), to_load, to_displacement)
    expected = np.einsum("naj,njmk,mkb->namb", to_displacement, matrix, to_load).reshape(3 * nodes, 2 * nodes)
    assert error(to_dense(computed), expected) < 1e-14
    x = random.normal(size=2 * nodes)
    assert error(product_of(computed)(x), expected @ x) < 1e-14
    assert error(product_of(merge_blocks(computed))(x), expected @ x) < 1e-14


@pytest.mark.full
def test_single_precision_error_is_below_truncation(matrices):
    square, _, block, _ = matrices
    single = convert(block, np.float32)
    assert {to_dense(leaf).dtype for leaf in leaves(single)} == {np.dtype(np.float32)}
    assert 0.0 < error(to_dense(single), square) < 1e-6
    x = np.random.default_rng(5).normal(size=(len(square), 2))
    with worker_pool() as pool:
        factors = eliminate(block, Truncation(SINGLE_PRECISION_TOLERANCE, np.float32, pool))
    assert {to_dense(leaf).dtype for leaf in leaves(factors.upper)} == {np.dtype(np.float32)}
    computed = substitute(factors, Form.UPPER, substitute(factors, Form.LOWER, x))
    assert computed.dtype == np.float64
    assert error(computed, np.linalg.solve(square, x)) < SINGLE_PRECISION_TOLERANCE
