"""Tests of the prolongation of values from loaded nodes to all nodes, and of the preconditioner with it."""

from dataclasses import replace

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace
from meeframe_halfspace.prolongation import LEVELS, MultilevelProlongation
from meeframe_halfspace.system import HalfSpaceSystem

from meeframe.elements import Quad4
from meeframe.material import library_material
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.system.capabilities import apply_fields

MEDIUM = library_material("orthotropic-mee")
WIDTH, NORMAL = 7e-3, 2


def reduced(n: int, periodic: bool = False) -> HalfSpaceSystem:
    mesh = half_space_mesh(10.0 * WIDTH, WIDTH, n - 1, 1, Quad4())
    system = HalfSpace(matrix_up_to=0, periodic=periodic).reduce(Body(MEDIUM.stiffness, mesh, (), "contact"))
    assert isinstance(system, HalfSpaceSystem)
    return system


def spots(n: int) -> np.ndarray:
    """Return flags (n * n,) of the nodes in small spots of several sizes on a grid of n x n nodes."""
    rng, (x, y) = np.random.default_rng(8), np.indices((n, n)) / n
    flags = np.zeros((n, n), bool)
    for centre, radius in zip(rng.uniform(0.15, 0.75, (14, 2)), rng.uniform(0.02, 0.09, 14), strict=True):
        flags |= np.hypot(x - centre[0], y - centre[1]) < radius
    return flags.ravel()


def restricted(system: HalfSpaceSystem, nodes: np.ndarray, prolonged: bool) -> np.ndarray:
    """Return the approximate inverse (f, f) of the normal compliance restricted to nodes (f,)."""
    inverse, prolongation = system.approximate_inverse((NORMAL,)), system.prolongation(nodes)
    columns = []
    for unit in np.eye(len(nodes), dtype=np.float32):
        if prolonged:
            columns.append(prolongation.restrict(inverse(prolongation.prolong(unit)[:, None])[:, 0]))
        else:
            whole = np.zeros(len(system.points), np.float32)
            whole[nodes] = unit
            columns.append(inverse(whole[:, None])[nodes, 0])
    return np.array(columns, float).T


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("periodic", [False, True])
def test_prolongation_is_closer_to_the_restricted_inverse_than_zeros(periodic: bool) -> None:
    """Eigenvalues of the product with the restricted compliance are all one for its inverse.

    None is smaller where the inverse on the whole grid is exact, by its Schur complement.
    """
    system = reduced(40, periodic=periodic)
    nodes = np.flatnonzero(spots(40))
    units = np.eye(len(system.points))[nodes]
    compliance = np.array([apply_fields(system, unit[:, None], (NORMAL,), (NORMAL,))[nodes, 0] for unit in units]).T
    condition = []
    for prolonged in (False, True):
        inverse = restricted(system, nodes, prolonged)
        np.testing.assert_allclose(inverse, inverse.T, atol=1e-5 * np.abs(inverse).max())
        values = np.sort(np.linalg.eigvals(inverse @ compliance).real)
        assert values[0] > (1.0 - 1e-4 if periodic else 0.8)
        condition.append(values[-1] / values[0])
    assert condition[1] < 0.65 * condition[0]
    assert condition[1] < 3.0


@pytest.mark.parametrize("size", [(80, 40), (83, 47), (72, 50)])
def test_prolongation_vanishes_beyond_its_largest_cells(size: tuple[int, int]) -> None:
    """Constant values decay, and vanish beyond cells of the coarsest level next to them, periodically."""
    places = np.ravel_multi_index((np.array([0, 1, 1]), np.array([3, 3, 4])), size)
    prolonged = MultilevelProlongation.of(size, places).prolong(np.ones(3, np.float32))
    np.testing.assert_array_equal(prolonged.ravel()[places], 1.0)
    elsewhere = np.ones(prolonged.size, bool)
    elsewhere[places] = False
    assert prolonged.min() >= 0.0
    assert prolonged.ravel()[elsewhere].max() < 0.9
    assert prolonged[-1].max() > 0.0 or size[0] % 2
    far = np.full(size[0], True)
    far[np.r_[0 : 2 ** (LEVELS + 1), size[0] - 2**LEVELS : size[0]] % size[0]] = False
    assert far.any()
    assert not prolonged[far].any()


@pytest.mark.parametrize("numbering", ["along e1", "along e2", "any"])
def test_prolongation_is_that_of_the_grid_however_nodes_are_numbered(numbering: str) -> None:
    """Nodes may be numbered along either axis or at random."""
    system = reduced(32)
    place = np.lexsort(system.points.T[[1, 0]] if numbering == "along e2" else system.points.T[[0, 1]])
    if numbering == "any":
        place = np.random.default_rng(3).permutation(len(place))
    number = np.empty_like(place)
    number[place] = np.arange(len(place))
    grid = replace(system.grid, numbers=number[system.grid.nodes])
    other = replace(system, grid=grid)
    nodes = np.flatnonzero(spots(32))
    values = np.random.default_rng(1).normal(size=len(nodes)).astype(np.float32)
    expected = system.prolongation(nodes).prolong(values)
    found = other.prolongation(number[nodes]).prolong(values)
    np.testing.assert_allclose(found[number], expected, atol=1e-6)
    whole = np.random.default_rng(2).normal(size=len(place)).astype(np.float32)
    np.testing.assert_allclose(
        other.prolongation(number[nodes]).restrict(whole[place]), system.prolongation(nodes).restrict(whole), atol=1e-5
    )
