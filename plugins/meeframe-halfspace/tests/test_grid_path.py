"""A grid whose points and cells are implicit gives the results of the same mesh with explicit elements."""

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from meeframe_halfspace import HalfSpace

from meeframe import indenters as rigid
from meeframe.common.errors import MeshError, ResultError
from meeframe.elements import Quad4
from meeframe.indenters.border import longest_side
from meeframe.laws import IsotropicCoulomb
from meeframe.material import library_material
from meeframe.mesh import check_mesh, find_contact_zone, half_space_mesh
from meeframe.mesh.measures import area
from meeframe.mesh.regular import GridCells, GridPoints
from meeframe.mesh.surface import SurfaceMesh
from meeframe.model.cache import system_key
from meeframe.model.case import Case
from meeframe.model.diagnostics import boundary_sides, count_edge_nodes
from meeframe.model.solve import solve_case
from meeframe.model.step import Step
from meeframe.results.files import read_result, write_result
from meeframe.results.records import Region, Result, ZoneFields
from meeframe.results.resultants import resultants

WIDTHS, DIVISIONS = (4e-3, 3e-3), (22, 17)
GRID = half_space_mesh((8e-3, 9e-3), WIDTHS, DIVISIONS, 2, Quad4())
EXPLICIT = replace(GRID, blocks=tuple(GRID.blocks))


def case(mesh: SurfaceMesh, formulation: HalfSpace) -> Case:
    return Case(
        material=library_material("batio3-cofe2o4"),
        mesh=mesh,
        conditions=(),
        indenter=rigid.Sphere(0.1),
        contact_law=IsotropicCoulomb(0.3),
        formulation=formulation,
        steps=(Step(normal_force=200.0, tangential_force=(20.0, 10.0)),),
    )


@pytest.fixture(scope="module")
def both() -> tuple[Result, Result]:
    formulation = HalfSpace(matrix_up_to=0)
    return solve_case(case(GRID, formulation)), solve_case(case(EXPLICIT, formulation))


def test_a_grid_is_a_valid_mesh_of_its_rectangle():
    check_mesh(GRID)
    assert GRID.grid == (DIVISIONS[0] + 1, DIVISIONS[1] + 1)
    assert area(GRID, "contact") == pytest.approx(WIDTHS[0] * WIDTHS[1], rel=1e-13)


def test_zones_agree():
    zone, expected = find_contact_zone(GRID, "contact"), find_contact_zone(EXPLICIT, "contact")
    assert isinstance(zone.cells, GridCells)
    assert not isinstance(expected.cells, GridCells)
    for name in ("points", "frames", "numbers"):
        np.testing.assert_array_equal(getattr(zone, name), getattr(expected, name))
    np.testing.assert_allclose(zone.weights, expected.weights, rtol=1e-12)
    ((kind, nodes),), ((expected_kind, expected_nodes),) = zone.cells, expected.cells
    assert kind == expected_kind
    np.testing.assert_array_equal(nodes, expected_nodes)
    assert longest_side(zone.points, zone.cells) == pytest.approx(longest_side(zone.points, expected.cells), rel=1e-12)


def test_a_mesh_with_moved_points_is_no_grid():
    points = GRID.points.copy()
    points[DIVISIONS[1] + 5, 0] += 0.2 * WIDTHS[0] / DIVISIONS[0]
    moved = replace(GRID, points=points)
    assert moved.grid is None
    with pytest.raises(MeshError, match="not equally spaced"):
        case(moved, HalfSpace())


def test_results_agree(both):
    (step,), (expected,) = both[0].steps, both[1].steps
    assert step.status == expected.status == "converged"
    assert step.iterations == expected.iterations
    for name in ("traction", "displacement", "potentials", "slip", "dissipation"):
        values, others = getattr(step, name), getattr(expected, name)
        assert np.abs(values - others).max() <= 1e-9 * np.abs(others).max(), name
    np.testing.assert_array_equal(step.region, expected.region)
    ours, theirs = (resultants(result.zone, result.steps[0]) for result in both)
    for name in ("contact_area", "stick_area", "torque", "normal_force"):
        assert getattr(ours, name) == pytest.approx(getattr(theirs, name), rel=1e-9, abs=1e-9)


def test_rims_and_borders_agree(both):
    result, expected = both
    step, random = result.steps[0], np.random.default_rng(4)
    region = np.where(random.uniform(size=len(step.region)) < 0.9, Region.SLIP, Region.OPEN)
    for each in (step, replace(step, region=region), replace(step, region=np.full(len(region), Region.STICK))):
        assert count_edge_nodes(result.zone, each) == count_edge_nodes(expected.zone, each)
    explicit = replace(expected.zone, cells=(*expected.zone.cells, ("quad", np.zeros((0, 4), np.int64))))
    sides, ways = boundary_sides(result.zone)
    general_sides, general_ways = boundary_sides(explicit)  # two blocks are never a grid
    order, general = (np.lexsort(each.T) for each in (sides, general_sides))
    np.testing.assert_array_equal(sides[order], general_sides[general])
    np.testing.assert_allclose(ways[order], general_ways[general], atol=1e-18)


def test_the_boundary_is_that_of_the_zone(both):
    result, _ = both
    (step,) = result.steps
    assert isinstance(step.boundary, ZoneFields)
    system = HalfSpace(matrix_up_to=0).reduce(case(EXPLICIT, HalfSpace(matrix_up_to=0)).body)
    recovered = system.recover(step.state.load)
    for name in ("values", "fluxes"):
        expected = getattr(recovered, name)
        assert np.abs(getattr(step.boundary, name) - expected).max() <= 1e-9 * np.abs(expected).max()


def test_files_restore_grids(both, tmp_path: Path):
    result, _ = both
    write_result(tmp_path, result)
    with h5py.File(tmp_path / "result.h5") as file:
        assert file["zone/frames"].shape == (1, 3, 3)
        assert list(file["zone/cells"]) == ["grid"]
        assert {axis: file["zone/points"][axis].shape for axis in "xy"} == {"x": (GRID.grid[0],), "y": (GRID.grid[1],)}
    again = read_result(tmp_path)
    assert again.zone.cells == result.zone.cells
    assert isinstance(again.zone.points, GridPoints)
    for name in ("points", "frames", "weights"):
        np.testing.assert_array_equal(getattr(again.zone, name), getattr(result.zone, name))
    for name in ("points", "values", "fluxes"):
        np.testing.assert_array_equal(getattr(again.steps[0].boundary, name), getattr(result.steps[0].boundary, name))
    with h5py.File(tmp_path / "result.h5", "r+") as file:
        file["zone/cells/grid"][...] = (5, 7)
    with pytest.raises(ResultError, match="is a grid of 5 x 7 nodes instead of 414"):
        read_result(tmp_path)
    with h5py.File(tmp_path / "result.h5", "r+") as file:
        del file["zone/points/y"]
    with pytest.raises(ResultError, match=r"damaged.*'y'"):
        read_result(tmp_path)


def test_files_with_the_points_of_a_grid_are_read(both, tmp_path: Path):
    result, _ = both
    write_result(tmp_path, result)
    with h5py.File(tmp_path / "result.h5", "r+") as file:
        file.attrs["format"] = "meeframe-result 7"
        del file["zone/points"]
        file["zone/points"] = result.zone.points[:]
    again = read_result(tmp_path)
    np.testing.assert_array_equal(again.zone.points, result.zone.points)
    assert again.zone.cells == result.zone.cells


def test_equal_grids_share_stored_systems():
    formulation = HalfSpace()
    again, moved = (half_space_mesh((8e-3, 9e-3), WIDTHS, DIVISIONS, rings, Quad4()) for rings in (2, 3))
    keys = [system_key(formulation, case(mesh, formulation).body) for mesh in (GRID, again, moved)]
    assert keys[0] == keys[1] != keys[2]
