"""Test cross approximation: sample points, and the selection of equations that span the others."""

import numpy as np
import pytest
from meeframe_hmatrix.cross_approximation import LARGE, interpolation
from meeframe_hmatrix.skeleton import spread_out
from meeframe_hmatrix.truncation import SINGLE


def test_sample_points_are_denser_near_the_box():
    places = np.random.default_rng(4).uniform((1, 0, 0), (9, 1, 1), (4000, 3))
    chosen = spread_out(places, np.zeros(3), np.array([0.0, 1.0, 1.0]), 60)
    assert len(set(chosen)) == 60
    near = (places[chosen, 0] < 3).mean()
    assert near > 0.5 > (places[:, 0] < 3).mean()
    assert np.array_equal(chosen[:20], spread_out(places, np.zeros(3), np.array([0.0, 1.0, 1.0]), 20))
    assert sorted(spread_out(places[:5], np.zeros(3), np.ones(3) / 2, 60)) == [0, 1, 2, 3, 4]


@pytest.mark.full(except_for=3)
@pytest.mark.parametrize(("n", "decay"), [(100, 0.8), (600, 0.8), (600, 0.97)], ids=["all", "summed", "summed anew"])
@pytest.mark.parametrize(("tolerance", "number"), [(1e-3, np.float32), (SINGLE, np.float32), (1e-6, np.float64)])
def test_selected_equations_span_the_others(n, decay, tolerance, number):
    random = np.random.default_rng(7)
    source = np.repeat(np.arange(360), 5)
    values = decay ** np.arange(n)
    left, _ = np.linalg.qr(random.normal(size=(len(source), min(n, len(source)))))
    right, _ = np.linalg.qr(random.normal(size=(n, left.shape[1])))
    assert (left.shape[0] * n > LARGE) == (n == 600)
    matrix = left * values[: left.shape[1]] @ right.T
    factor, chosen = interpolation(matrix.astype(number), source, tolerance)
    assert factor.dtype == number
    assert np.linalg.norm(factor @ matrix[chosen] - matrix) < tolerance * np.linalg.norm(matrix)
    assert np.array_equal(factor[chosen], np.eye(len(chosen)))
    assert np.array_equal(np.flatnonzero(np.isin(source, source[chosen])), chosen)
    tails = np.sqrt(np.cumsum(values[::-1] ** 2))[::-1]
    rank = int((tails > tolerance * tails[0]).sum())
    assert len(chosen) < 2 * rank + 5
