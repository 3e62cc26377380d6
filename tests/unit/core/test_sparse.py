"""Inverses of sparse matrices that may have empty rows."""

import numpy as np
import pytest
import scipy.sparse

from meeframe.common.sparse import sparse_inverse


def test_rows_that_are_zero_are_left_out():
    dense = np.array([[2.0, 1.0, 0.0, 0.0], [0.0, 3.0, 0.0, 1e-30], [0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, -4.0]])
    solution = sparse_inverse(scipy.sparse.csr_array(dense), np.dtype(float))(np.array([1.0, 2.0, 3.0, 4.0]))
    kept = [0, 1, 3]
    np.testing.assert_allclose(solution[kept], np.linalg.solve(dense[np.ix_(kept, kept)], [1.0, 2.0, 4.0]), rtol=1e-14)
    assert solution[2] == 0.0


def test_round_off_of_the_precision_counts_as_zero():
    matrix = scipy.sparse.csr_array(np.diag([1.0, 1e-9]))
    for precision, expected in ((np.float64, 1e9), (np.float32, 0.0)):
        assert sparse_inverse(matrix, np.dtype(precision))(np.ones(2))[1] == pytest.approx(expected)


def test_singular_matrices_give_zero():
    for matrix in (np.ones((2, 2)), np.zeros((2, 2))):
        solution = sparse_inverse(scipy.sparse.csr_array(matrix), np.dtype(float))(np.ones(2))
        np.testing.assert_array_equal(solution, np.zeros(2))
