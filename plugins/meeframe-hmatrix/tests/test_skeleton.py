"""Test cross approximation: sample points, and the selection of equations that span the others."""

import numpy as np
import pytest
from meeframe_hmatrix.cross_approximation import MIN_SKETCHED_SIZE, interpolation
from meeframe_hmatrix.skeleton import farthest_points
from meeframe_hmatrix.truncation import SINGLE_PRECISION_TOLERANCE


def test_samples_are_dense_close_to_the_box():
    points = np.random.default_rng(4).uniform((1, 0, 0), (9, 1, 1), (4000, 3))
    selected = farthest_points(points, np.zeros(3), np.array([0.0, 1.0, 1.0]), 60)
    assert len(set(selected)) == 60
    close = (points[selected, 0] < 3).mean()
    assert close > 0.5 > (points[:, 0] < 3).mean()
    assert np.array_equal(selected[:20], farthest_points(points, np.zeros(3), np.array([0.0, 1.0, 1.0]), 20))
    assert sorted(farthest_points(points[:5], np.zeros(3), np.ones(3) / 2, 60)) == [0, 1, 2, 3, 4]


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(("n", "decay"), [(100, 0.8), (600, 0.8), (600, 0.97)], ids=["all", "summed", "summed anew"])
@pytest.mark.parametrize(
    ("tolerance", "number"), [(1e-3, np.float32), (SINGLE_PRECISION_TOLERANCE, np.float32), (1e-6, np.float64)]
)
def test_selected_equations_span_the_others(n, decay, tolerance, number):
    random = np.random.default_rng(7)
    source = np.repeat(np.arange(360), 5)
    values = decay ** np.arange(n)
    left, _ = np.linalg.qr(random.normal(size=(len(source), min(n, len(source)))))
    right, _ = np.linalg.qr(random.normal(size=(n, left.shape[1])))
    assert (left.shape[0] * n > MIN_SKETCHED_SIZE) == (n == 600)
    matrix = left * values[: left.shape[1]] @ right.T
    factor, selected = interpolation(matrix.astype(number), source, tolerance)
    assert factor.dtype == number
    assert np.linalg.norm(factor @ matrix[selected] - matrix) < tolerance * np.linalg.norm(matrix)
    assert np.array_equal(factor[selected], np.eye(len(selected)))
    assert np.array_equal(np.flatnonzero(np.isin(source, source[selected])), selected)
    tails = np.sqrt(np.cumsum(values[::-1] ** 2))[::-1]
    rank = int((tails > tolerance * tails[0]).sum())
    assert len(selected) < 2 * rank + 5
