"""Edges of indenters agree with circles and rectangles."""

import numpy as np
import pytest

from meeframe.indenters import find_indenter_edge, longest_side
from meeframe.mesh import local_frames

RADIUS, REACH = 1.03, 0.2
X, Y = (side.ravel() for side in np.meshgrid(np.linspace(-1.5, 1.5, 31), np.linspace(-1.5, 1.5, 31)))
POINTS = np.stack([X, Y, np.zeros_like(X)], axis=1)
FRAMES = local_frames(np.tile([0.0, 0.0, 1.0], (len(POINTS), 1)))


def punch(points, _frames):
    """Return a tilted circular end face: the gap grows along x."""
    x, y = points[:, 0], points[:, 1]
    return np.where(np.hypot(x, y) <= RADIUS, 0.1 * x + 0.3, np.inf)


def test_distance_and_direction_from_a_circle():
    indenter_edge = find_indenter_edge(punch, POINTS, FRAMES, REACH)
    exact = RADIUS - np.hypot(X, Y)
    near = np.abs(exact) < 0.95 * REACH
    assert near.sum() > 100
    assert indenter_edge.distance[near] == pytest.approx(exact[near], rel=2e-3)
    assert (np.sign(indenter_edge.distance[~near]) == np.sign(exact[~near])).all()
    cosine = np.einsum("na,na->n", indenter_edge.outward[near], POINTS[near, :2] / np.hypot(X, Y)[near, None])
    assert cosine.min() > 0.99


def test_gap_is_extrapolated_linearly_beyond_the_edge():
    indenter_edge = find_indenter_edge(punch, POINTS, FRAMES, REACH)
    distance = RADIUS - np.hypot(X, Y)
    outside = (distance < 0.0) & (distance > -0.95 * REACH)
    assert indenter_edge.gap[outside] == pytest.approx((0.1 * X + 0.3)[outside], abs=1e-6)
    assert np.isinf(indenter_edge.gap[distance > 0.0]).all()


def test_indenter_without_end_has_no_edge():
    assert find_indenter_edge(lambda points, _frames: points[:, 0] ** 2, POINTS, FRAMES, REACH) is None


def test_longest_side_of_cells():
    """Sides join corners; the diagonal and mid-side nodes do not count."""
    points = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [3.0, 1.0, 0.0], [0.0, 1.0, 0.0], [1.5, 0.0, 0.0]])
    assert longest_side(points, (("quad", np.array([[0, 1, 2, 3]])),)) == 3.0
    cells = ("triangle", np.array([[1, 2, 4]])), ("triangle6", np.array([[4, 1, 2, 0, 3, 0]]))
    assert longest_side(points, cells) == pytest.approx(np.hypot(1.5, 1.0))
