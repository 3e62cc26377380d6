"""Pairs of nearby points agree with those of a k-d tree."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from meeframe.mesh.nearby import close_point_pairs


def lattice(n):
    return np.stack(np.meshgrid(*[np.arange(n) * 0.1] * 3, indexing="ij"), axis=-1).reshape(-1, 3)


@pytest.mark.parametrize("distance", [1e-9, 1e-3, 0.02])
def test_pairs_match_a_tree(distance):
    rng = np.random.default_rng(1)
    points = lattice(9)
    again = points[rng.integers(len(points), size=200)]  # some of them are repeated
    points = np.concatenate([points, again + rng.uniform(-1.0, 1.0, again.shape) * distance])
    matches = close_point_pairs(points, distance)
    expected = cKDTree(points).query_pairs(distance, output_type="ndarray")
    assert 100 < len(matches) == len(expected)
    assert {*map(tuple, matches)} == {*map(tuple, expected)}


@pytest.mark.parametrize("ratio", [1.0, np.sqrt(2.0), np.sqrt(3.0), np.sqrt(5.0), 0.7548776662466927])
def test_aligned_points(ratio):
    """Points align along plane diagonals of a lattice, or along the direction by which points are sorted (the last
    ratio)."""
    x, y = np.meshgrid(ratio * np.arange(70), np.arange(70), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    points = np.concatenate([points, points[::10]])
    matches = close_point_pairs(points, 1e-9)
    assert {*map(tuple, matches)} == {(10 * k, 4900 + k) for k in range(490)}


def test_equal_and_distant_points():
    assert close_point_pairs(lattice(5), 0.09).size == 0
    assert close_point_pairs(np.ones((3, 3)), 0.0).tolist() == [[0, 1], [1, 2], [0, 2]]
    assert close_point_pairs(np.ones((1, 3)), 1.0).shape == (0, 2)
