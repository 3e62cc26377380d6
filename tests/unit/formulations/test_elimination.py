"""Test elimination of a dense system: by blocks, in place, with row exchanges."""

import numpy as np
import pytest
from scipy.linalg import lu

from meeframe.common.errors import CaseError
from meeframe.formulations.dense_bem.blas import divide_by_lower, subtract_product
from meeframe.formulations.dense_bem.elimination import all_unknowns, eliminate, inverse_norm, last_unknowns
from meeframe.formulations.dense_bem.system import eliminate_regular

SIZES = [(1, 0, 1), (7, 7, 1), (53, 40, 14), (131, 0, 5), (327, 200, 128), (650, 391, 260)]
"""Unknowns, those eliminated first, right-hand sides: less and more columns than are factorised at once, odd halves."""


def _system(unknowns: int, others: int):
    """Return a matrix that requires row exchanges, and right-hand sides."""
    rng = np.random.default_rng(unknowns)
    matrix, right = rng.normal(size=(unknowns, unknowns)), rng.normal(size=(unknowns, others))
    matrix[np.diag_indices(unknowns)] = 0.0 if unknowns > 1 else 2.0
    return matrix, right, np.asfortranarray(np.hstack([matrix, right]))


@pytest.mark.parametrize(("unknowns", "first", "others"), SIZES)
def test_unknowns_solve_the_system(unknowns, first, others):
    matrix, right, columns = _system(unknowns, others)
    eliminate(columns, first)
    expected = np.linalg.solve(matrix, right)
    close = {"rtol": 1e-9, "atol": 1e-10 * np.abs(expected).max()}
    np.testing.assert_allclose(all_unknowns(columns, first, columns[:, unknowns:]), expected, **close)
    np.testing.assert_allclose(last_unknowns(columns, first, columns[:, unknowns:]), expected[first:], **close)


@pytest.mark.parametrize("unknowns", [7, 65, 129, 650])
def test_factors_are_those_of_partial_pivoting(unknowns):
    """The factors and the order of rows equal those of SciPy: multipliers are at most one, so growth is bounded
    alike."""
    matrix, _, columns = _system(unknowns, 1)
    eliminate(columns, unknowns)
    rows, lower, upper = lu(matrix, p_indices=True)
    computed = np.tril(columns[:, :unknowns], -1) + np.eye(unknowns), np.triu(columns[:, :unknowns])
    np.testing.assert_allclose(computed[0], lower, atol=1e-10)
    np.testing.assert_allclose(computed[1], upper, atol=1e-10 * np.abs(upper).max())
    residual = np.abs(matrix - (computed[0] @ computed[1])[rows]).max()
    assert residual <= unknowns * np.finfo(float).eps * np.abs(upper).max()


@pytest.mark.parametrize(("unknowns", "first"), [(327, 200), (60, 60), (60, 0)])
def test_condition_estimate(unknowns, first):
    """The estimate is accurate to the scatter of eight random right-hand sides, also if a single direction
    dominates."""
    matrix, _, _ = _system(unknowns, 1)
    left, values, right = np.linalg.svd(matrix)
    values[-1] = 1e-6
    matrix = (left * values) @ right
    columns = np.asfortranarray(np.hstack([matrix, matrix[:, :1]]))
    eliminate(columns, first)
    expected = np.linalg.norm(np.linalg.inv(matrix))
    assert expected / 3 < inverse_norm(columns, first) < 3 * expected


@pytest.mark.parametrize("loads", [0, 12])
def test_singular_systems_are_rejected(loads):
    matrix, right, _ = _system(30, loads + 1)
    matrix[:, 20] = matrix[:, 3]
    with pytest.raises(
        CaseError, match=r"condition \d\.\de-1[5-9]; allowed: above 1e-14\): the body is very slender, or elements"
    ):
        eliminate_regular(np.asfortranarray(np.hstack([matrix, right])), len(matrix) - right.shape[1] + 1)


def test_zero_pivot_is_rejected():
    matrix, right, _ = _system(30, 1)
    matrix[:, 20] = 0.0
    with pytest.raises(CaseError, match=r"singular to round-off \(reciprocal condition 0"):
        eliminate_regular(np.asfortranarray(np.hstack([matrix, right])), len(matrix) - right.shape[1] + 1)


@pytest.mark.parametrize("entry", [np.nan, np.inf])
def test_nonfinite_matrix_is_not_reported_as_singular(entry):
    matrix, right, _ = _system(30, 1)
    matrix[4, 20] = entry
    with pytest.raises(CaseError, match="coefficients that are not finite"):
        eliminate_regular(np.asfortranarray(np.hstack([matrix, right])), len(matrix) - right.shape[1] + 1)


WHOLE = np.random.default_rng(3).normal(size=(6, 9))
LAYOUTS = {
    "in C order": np.ascontiguousarray(WHOLE),
    "every second row": np.asfortranarray(WHOLE)[::2],
    "columns backwards": np.asfortranarray(WHOLE)[:, ::-1],
    "one column of C order": np.ascontiguousarray(WHOLE)[:, :1],
    "single precision": np.asfortranarray(WHOLE, np.float32),
}


@pytest.mark.parametrize("position", [0, 1, 2], ids=["target", "left", "right"])
@pytest.mark.parametrize("matrix", LAYOUTS.values(), ids=LAYOUTS)
def test_other_memory_layouts_are_rejected(matrix, position):
    rows, columns = matrix.shape
    m, n, k = [(rows, columns, 2), (rows, 2, columns), (2, columns, rows)][position]
    operands = [np.zeros(shape, order="F") for shape in ((m, n), (m, k), (k, n))]
    operands[position] = matrix
    with pytest.raises(ValueError, match=rf"{matrix.dtype}, shape \({rows}, {columns}\) .* columns of float64"):
        subtract_product(*operands)


@pytest.mark.parametrize("shape", [(6, 1), (1, 4), (1, 1), (0, 3), (5, 0)])
def test_single_rows_and_columns_in_any_order(shape):
    """The column stride of a single column and the row stride of a single row are arbitrary."""
    (m, n), rng = shape, np.random.default_rng(4)
    start, left, right = rng.normal(size=shape), rng.normal(size=(m, 3)), rng.normal(size=(3, n))
    triangle = np.tril(rng.normal(size=(m, m)), -1) + np.eye(m)
    expected = np.linalg.solve(triangle, start - left @ right)
    targets = [np.array(start, order="F"), np.array(start, order="C")]
    if n == 1:
        targets.append(start[:, 0].copy()[:, None])
    for target in targets:
        subtract_product(target, np.asfortranarray(left), np.asfortranarray(right))
        divide_by_lower(target, np.asfortranarray(triangle))
        np.testing.assert_allclose(target, expected, atol=1e-13)
