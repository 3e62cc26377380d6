"""Arrays of large grids that are made without one number for each node."""

import numpy as np
import pytest

from meeframe.indenters.base import MotionModes, motion_density
from meeframe.mesh.regular import grid_cells, outermost_cells, shared_frames


def test_densities_of_equal_nodes_are_views_of_one_row() -> None:
    points = np.random.default_rng(1).uniform(size=(7, 3))
    modes = MotionModes(points, shared_frames(np.eye(3), 7), np.eye(3), np.zeros(3))
    for number, mode in enumerate(modes):
        density = motion_density(mode, number)
        np.testing.assert_array_equal(density, motion_density(mode.copy(), number))
        assert (density.strides[0] == 0) == (mode.strides[0] == 0)


@pytest.mark.parametrize("shape", [(2, 2), (2, 5), (5, 2), (3, 3), (4, 6)])
def test_outermost_cells_are_those_with_a_node_on_the_border(shape: tuple[int, int]) -> None:
    numbers = np.arange(shape[0] * shape[1]).reshape(shape)
    inside = np.isin(grid_cells(numbers), numbers[1:-1, 1:-1]).all(axis=1)
    expected = {tuple(cell) for cell in grid_cells(numbers)[~inside].tolist()}
    found = [tuple(cell) for cell in outermost_cells(shape).tolist()]
    assert set(found) == expected
    assert len(found) == len(expected)
