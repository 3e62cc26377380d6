"""Points of a grid that are made when they are read are the array that they stand for."""

import pickle

import numpy as np
import pytest

from meeframe.mesh.regular import GridPoints, extreme_points

X, Y = np.array([-1.0, 0.5, 3.0, 3.5]), np.array([-2.0, 0.0, 1.0])
OTHERS = np.array([[7.0, 8.0, 0.0], [9.0, 1.0, 0.0]])
GRID = np.array([[x, y, 0.0] for x in X for y in Y])


@pytest.fixture(params=[(), (OTHERS,)], ids=["grid", "with others"])
def both(request):
    return GridPoints.make(X, Y, *request.param), np.concatenate([GRID, *request.param])


def test_it_is_the_array(both):
    points, expected = both
    np.testing.assert_array_equal(np.asarray(points), expected)
    assert (len(points), points.shape, points.ndim) == (len(expected), expected.shape, expected.ndim)
    assert (points.nbytes, points.dtype) == (expected.nbytes, expected.dtype)
    np.testing.assert_array_equal(np.asarray(pickle.loads(pickle.dumps(points))), expected)


@pytest.mark.parametrize(
    "index",
    [
        *(3, -2, np.int64(5), slice(2, 9), slice(None, None, -3), np.array([4, 0, -1]), np.array([[1, 2], [-3, 4]])),
        *((slice(None), 1), (np.array([2, 5]), slice(2)), ..., [1, 2]),
    ],
)
def test_indices_select_as_in_the_array(both, index):
    points, expected = both
    np.testing.assert_array_equal(points[index], expected[index])


def test_masks_select_as_in_the_array(both):
    points, expected = both
    mask = np.arange(len(expected)) % 3 == 1
    np.testing.assert_array_equal(points[mask], expected[mask])


@pytest.mark.parametrize("index", [100, -100, np.array([1, 100]), np.array([-100])])
def test_numbers_beyond_the_points_are_an_error(both, index):
    with pytest.raises((IndexError, ValueError)):
        both[0][index]


def test_operators_functions_and_methods_apply(both):
    points, expected = both
    matrix = np.arange(9.0).reshape(3, 3)
    for result, of_array in (
        (points @ matrix, expected @ matrix),
        (2.0 * points - 1.0, 2.0 * expected - 1.0),
        (np.ptp(points, axis=0), np.ptp(expected, axis=0)),
        (points.mean(axis=0), expected.mean(axis=0)),
        (points.T, expected.T),
        (np.concatenate([points, points]), np.concatenate([expected, expected])),
    ):
        np.testing.assert_array_equal(result, of_array)


def test_extreme_points_have_the_extremes_of_linear_functions(both):
    points, expected = both
    for slope in np.random.default_rng(3).normal(size=(5, 3)):
        assert (extreme_points(points) @ slope).max() == pytest.approx((expected @ slope).max(), rel=1e-14)


@pytest.mark.parametrize("rows", [slice(None), slice(None, None, 2), slice(1, 3)])
@pytest.mark.parametrize("columns", [slice(None), slice(None, None, 2), slice(2)])
def test_points_on_some_rows_and_columns(rows, columns):
    points = GridPoints.make(X, Y, OTHERS).on(rows, columns)
    np.testing.assert_array_equal(points, GRID.reshape(4, 3, 3)[rows, columns].reshape(-1, 3))
