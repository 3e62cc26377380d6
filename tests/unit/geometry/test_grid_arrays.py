"""Arrays of large grids that are made without one number for each node."""

import numpy as np
import pytest

from meeframe.fields import MECHANICAL
from meeframe.indenters.base import MotionModes, motion_density
from meeframe.mesh.regular import GridCells, grid_cells, nodes_of_mixed_cells, outermost_cells, shared_frames
from meeframe.results.records import Zone, ZoneFields


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


def test_nodes_of_mixed_cells_share_one_with_a_node_of_the_other_kind() -> None:
    chosen = np.random.default_rng(2).random((6, 5)) < 0.5
    chosen[:3, :3] = True
    cells = grid_cells(np.arange(chosen.size).reshape(chosen.shape))
    expected = [
        any(chosen.flat[other] != chosen.flat[node] for cell in cells if node in cell for other in cell)
        for node in range(chosen.size)
    ]
    assert 0 < sum(expected) < chosen.size
    for division in (GridCells(chosen.shape), [("quad", cells[:7]), ("quad", cells[7:])]):
        np.testing.assert_array_equal(nodes_of_mixed_cells(division, chosen.ravel()), expected)


def test_columns_of_fields_on_the_zone() -> None:
    rng = np.random.default_rng(3)
    frames = np.linalg.qr(rng.normal(size=(4, 3, 3)))[0]
    zone = Zone(rng.random((4, 3)), frames, np.ones(4), GridCells((2, 2)))
    fields = ZoneFields(zone, *(rng.random((4, width)) for width in (3, 2, 3, 2)))
    np.testing.assert_allclose(fields.values[:, MECHANICAL], np.einsum("na,nai->ni", fields.displacement, frames))
    for source, scalars in (("values", fields.potentials), ("fluxes", fields.scalar_fluxes)):
        every = getattr(fields, source)
        np.testing.assert_array_equal(every[:, 3:], scalars)
        for columns in (MECHANICAL, slice(3, 4), slice(4, 5), slice(3, 5)):
            np.testing.assert_array_equal(fields.columns(source, columns), every[:, columns])
