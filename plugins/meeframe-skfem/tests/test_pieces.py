"""Components agree with independent references: the assembly of scikit-fem, other solvers, closed forms."""

from dataclasses import replace

import meeframe_skfem.factorisation as factorisation
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from meeframe_skfem import FiniteElements
from meeframe_skfem.assembly import face_masses, stiffness_matrix
from meeframe_skfem.elements import ELEMENTS, HEX8, TET10, cell_rule, face_nodes, tabulate
from meeframe_skfem.factorisation import condense, factorise
from meeframe_skfem.grid import box_volume, graded_positions, tensor_grid
from meeframe_skfem.locate import interpolation
from meeframe_skfem.volume import VolumeMesh, boundary_faces, check_volume
from scipy.sparse import block_array, csr_array, diags_array, eye_array, kron
from skfem import Basis, BilinearForm, ElementHex1, ElementTetP2, MeshHex, MeshTet

from meeframe.common.errors import CaseError, MeshError
from meeframe.elements import Quad4, Quad8, Quad9, Tri6
from meeframe.elements.base import shape_functions
from meeframe.material import library_material, rotation_about
from meeframe.mesh import block_mesh, box_mesh, sphere_mesh
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.testing.strategies import scaled_stiffness

MATERIAL = library_material("orthotropic-mee").rotated(rotation_about((1.0, 2.0, 0.5), 0.8))
AXIS = np.array([0.0, 0.3, 0.7, 1.0])


@pytest.mark.parametrize("element", ELEMENTS, ids=lambda e: e.name)
def test_shape_functions_and_faces(element):
    values, slopes = tabulate(element, element.nodes)
    np.testing.assert_allclose(values, np.eye(len(element.nodes)), atol=1e-14)
    np.testing.assert_allclose(np.einsum("mnk,nx->mkx", slopes, element.nodes), np.tile(np.eye(3), (len(values), 1, 1)))
    centre = element.nodes[: element.n_corners].mean(axis=0)
    for nodes in element.nodes[face_nodes(element)]:
        normal = np.cross(nodes[1] - nodes[0], nodes[2] - nodes[0])
        assert normal @ (nodes[0] - centre) > 0
        assert np.abs((nodes - nodes[0]) @ normal).max() < 1e-14
    assert {tuple(row) for row in np.sort(face_nodes(element)[:, : len(element.faces[0])])} == {
        tuple(sorted(face)) for face in element.faces
    }


@pytest.mark.parametrize("name", ["hex8", "tet10"])
def test_stiffness_matches_scikit_fem(name):
    random = np.random.default_rng(2)
    kind, element, own, mirror = {
        "hex8": (MeshHex, ElementHex1(), HEX8, [0, 3, 2, 1, 4, 7, 6, 5]),
        "tet10": (MeshTet, ElementTetP2(), TET10, [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]),
    }[name]
    mesh = kind.init_tensor(AXIS, AXIS, AXIS)
    mesh = kind(mesh.p + random.uniform(-0.05, 0.05, mesh.p.shape), mesh.t)
    basis = Basis(mesh, element, intorder=5)
    order = np.linalg.norm(own.nodes[:, None] - element.doflocs, axis=2).argmin(axis=1)
    cells, places = basis.element_dofs.T[:, order].astype(np.int64), basis.doflocs.T.copy()
    around = places[cells[:, :5]]  # the first corner and three of its neighbours
    edges = around[:, [1, 3, 4] if name == "hex8" else [1, 2, 3]] - around[:, :1]
    cells = np.where((np.linalg.det(edges) < 0)[:, None], cells[:, mirror], cells)
    matrix = stiffness_matrix(VolumeMesh(places, cells, replace(own, quadrature=5)), scaled_stiffness(MATERIAL))
    assert abs(matrix - matrix.T).max() < 1e-13 * abs(matrix).max()
    matrix = matrix.tocsc()
    for j, k in np.ndindex(5, 5):
        law = scaled_stiffness(MATERIAL)[:, j, k, :]
        form = BilinearForm(lambda u, v, w, law=law: np.einsum("ieq,im,meq->eq", v.grad, law, u.grad))
        difference = matrix[j::5][:, k::5] - form.assemble(basis)
        assert abs(difference).max() < 1e-12 * abs(matrix).max()


def quasi_definite(seed=0, size=60):
    random = np.random.default_rng(seed)
    laplace = kron(diags_array([2.1, -1.0, -1.0], offsets=[0, 1, -1], shape=(size, size)), eye_array(3))
    coupling = csr_array(np.where(random.random((3 * size, 3 * size)) < 0.02, 0.3, 0.0))
    return csr_array(block_array([[laplace, coupling], [coupling.T, -laplace]]))


@pytest.mark.full
@pytest.mark.parametrize("solver", ["pardiso", "splu"])
def test_solvers_and_flexibility_match_dense_algebra(solver):
    if solver == "pardiso":
        pytest.importorskip("pypardiso")
    matrix = quasi_definite()
    inverse = np.linalg.inv(matrix.toarray())
    right = np.random.default_rng(1).normal(size=(matrix.shape[0], 3))
    np.testing.assert_allclose(factorise(matrix, solver)(right), inverse @ right, atol=1e-11)
    for unknowns in (np.arange(40, 60), np.array([300, 7, 181, 12, 90])):
        solve, computed = condense(matrix, unknowns, solver)
        np.testing.assert_allclose(computed, inverse[np.ix_(unknowns, unknowns)], atol=1e-11)
        np.testing.assert_array_equal(computed, computed.T)
        np.testing.assert_allclose(solve(right[:, 0]), inverse @ right[:, 0], atol=1e-11)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("element", [Quad4(), Quad9()], ids=lambda e: e.name)
def test_pardiso_and_splu_give_the_same_system(element):
    pytest.importorskip("pypardiso")
    mesh = block_mesh(0.5, 0.8, 0.4, 2, 1, 1, element)
    data = 1e-6 * MATERIAL.scaling.factors / MATERIAL.scaling.factors[0]
    conditions = tuple(BoundaryCondition("base", field, "value", data[field]) for field in range(5))
    body = Body(MATERIAL.stiffness, mesh, conditions, "contact")
    first, second = (FiniteElements(linear_solver=name).reduce(body) for name in ("pardiso", "splu"))
    scale = np.sqrt(np.abs(np.einsum("naa->a", first.diagonal_blocks())))
    difference = (first.dense() - second.dense()) / (scale[:, None, None] * scale)
    assert np.abs(difference).max() < 1e-10
    np.testing.assert_allclose(first.offset / data, second.offset / data, atol=1e-9)


def test_singular_systems_and_missing_pardiso_are_rejected(monkeypatch):
    laplace = diags_array([2.0, -1.0, -1.0], offsets=[0, 1, -1], shape=(50, 50)).tolil()
    laplace[0, 0] = laplace[49, 49] = 1.0
    for solver in ("auto", "splu"):
        with pytest.raises(CaseError, match="singular"):
            factorise(csr_array(laplace), solver)
    monkeypatch.setattr(factorisation, "find_spec", lambda name: None)
    assert not factorisation.uses_pardiso("auto")
    with pytest.raises(CaseError, match="pypardiso is not installed; allowed: auto, splu"):
        FiniteElements(linear_solver="pardiso").check(
            Body(MATERIAL.stiffness, box_mesh((1, 1, 1), (1, 1, 1), Quad4()), (), "z+")
        )


def test_mass_and_flexibility_of_the_zone_are_symmetric():
    """The compliance is flexibility times mass; the mass of a uniform grid follows from that of a line in closed
    form."""
    n, side = 4, 0.4
    mesh = block_mesh(0.5, 0.8, side, n, 1, 1, Quad4())
    conditions = tuple(BoundaryCondition("base", field, "value") for field in range(5))
    system = FiniteElements().reduce(Body(MATERIAL.stiffness, mesh, conditions, "contact"))
    line = np.diag(np.r_[2.0, np.full(n - 1, 4.0), 2.0]) + np.eye(n + 1, k=1) + np.eye(n + 1, k=-1)
    order = np.lexsort((system.points[:, 1], system.points[:, 0]))
    mass = np.kron(line, line) * (side / n / 6) ** 2
    inverse = np.linalg.inv(mass)
    flex = np.einsum("namb,mk->nakb", system.dense()[order][:, :, order], inverse)
    flex = flex * np.array([1, 1, 1, -1, -1])[:, None, None]
    scale = np.sqrt(np.abs(np.einsum("nana->a", flex)))
    flex = flex / (scale[:, None, None] * scale)
    assert np.abs(flex - flex.transpose(2, 3, 0, 1)).max() < 1e-11


@settings(deadline=None, max_examples=30)
@given(st.floats(0.1, 1e3), st.floats(1e-2, 1.0), st.floats(1.0, 3.0))
def test_graded_widths(distance, first, growth):
    positions = graded_positions(distance, first, growth, None)
    widths = np.diff(positions, prepend=0.0)
    assert positions[-1] == pytest.approx(distance, rel=1e-12)
    assert widths[0] <= first * (1 + 1e-9)
    ratios = widths[1:] / widths[:-1]
    assert (ratios > 1 - 1e-9).all()
    assert (ratios < growth * (1 + 1e-6) + 1e-9).all()
    if len(widths) > 1:
        assert np.ptp(ratios) < 1e-6 * ratios.max()
        # with one element fewer the growth would have to be larger
        fewer = first * np.sum(growth ** np.arange(len(widths) - 1))
        assert fewer < distance * (1 + 1e-6)
    assert len(graded_positions(distance, first, growth, 4)) == 4


def test_tensor_grid_of_hex8():
    grid = tensor_grid((AXIS, AXIS[:3], AXIS[:2]), HEX8)
    assert grid.points.shape == (4 * 3 * 2, 3)
    assert len(grid.cells) == 3 * 2 * 1
    widths = grid.points[grid.cells[:, 6]] - grid.points[grid.cells[:, 0]]
    assert np.prod(widths, axis=1).sum() == pytest.approx(1.0 * 0.7 * 0.3)


@pytest.mark.parametrize("element", [Quad4(), Quad8(), Quad9()], ids=lambda e: e.name)
def test_shells_fill_a_box(element):
    """Volume, boundary and elements of the zone are correct; no shell is thicker than `growth` times the one inside."""
    body = Body(MATERIAL.stiffness, block_mesh((0.5, 0.4), 0.7, (0.2, 0.24), (4, 6), 2, 2, element), (), "contact")
    mesh = box_volume(body, 1.6, None, None, "shells")
    check_volume(mesh)
    xi, weights = cell_rule(mesh.element)
    jacobians = np.linalg.det(gradients_of(mesh, xi))
    assert (jacobians @ weights).sum() == pytest.approx(1.0 * 0.8 * 0.7, rel=1e-12)
    middles = mesh.points[boundary_faces(mesh).nodes].mean(axis=1)
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    assert (np.minimum(np.abs(middles - low), np.abs(middles - high)).min(axis=1) < 1e-12).all()
    zone = body.mesh.points[np.unique(body.mesh.blocks[0].connectivity[body.mesh.blocks[0].groups == 0])]
    assert np.linalg.norm(mesh.points[:, None] - zone, axis=-1).min(axis=0).max() < 1e-12
    line = np.sort(mesh.points[np.abs(mesh.points[:, :2]).max(axis=1) < 1e-12, 2])[::-1]
    thick = -np.diff(line[:: 1 if element.name == "quad4" else 2])
    assert (thick[1:] < 1.6 * thick[:-1] * (1 + 1e-9)).all()
    assert thick[:4] == pytest.approx(0.045, rel=1e-12)
    assert len(np.unique(np.round(mesh.points, 12), axis=0)) == len(mesh.points), "cells share their nodes"


def test_shells_require_space():
    body = Body(MATERIAL.stiffness, box_mesh((1.0, 1.0, 2.0), (2, 2, 2), Quad4()), (), "z+")
    with pytest.raises(MeshError, match=r'0 m of the box, less than an element of 0\.5 m.*allowed: grid = "tensor"'):
        FiniteElements(grid="shells").check(body)


def gradients_of(mesh, xi):
    """Return the derivatives of positions with respect to reference coordinates, (e, m, 3, 3)."""
    return np.einsum("mnk,enx->emkx", tabulate(mesh.element, xi)[1], mesh.points[mesh.cells])


@pytest.mark.parametrize("element", [Quad4(), Quad9(), Tri6()], ids=lambda e: e.name)
def test_points_on_a_curved_surface_are_located(element):
    """Points computed from reference coordinates are located as combinations of nodes at the same positions."""
    mesh = sphere_mesh(1.0, 3, element)
    (block,) = mesh.blocks
    random = np.random.default_rng(3)
    xi = random.uniform(0.05, 0.45, (len(block.connectivity), 2))
    shape = shape_functions(element, xi)
    places = np.einsum("en,enx->ex", shape, mesh.points[block.connectivity])
    matrix, distance = interpolation(mesh.points, [block], places, 1e-3)
    assert distance.max() < 1e-12
    np.testing.assert_allclose(matrix @ mesh.points, places, atol=1e-12)
    values = random.normal(size=len(mesh.points))
    np.testing.assert_allclose(matrix @ values, np.einsum("en,en->e", shape, values[block.connectivity]), atol=1e-9)
    _, far = interpolation(mesh.points, [block], 3.0 * places, 1e-3)
    assert np.isinf(far).all()


def test_face_masses_of_a_triangle():
    """Quadratic shape functions of a right triangle integrate to zero at corners and a third of the area at mid-
    sides."""
    points = np.array([[0, 0, 0], [2, 0, 0], [0, 1, 0], [1, 0, 0], [1, 0.5, 0], [0, 0.5, 0]], float)
    masses = face_masses(points, Tri6(), np.arange(6)[None])
    np.testing.assert_allclose(masses.sum(axis=(0, 1)), [0, 0, 0, 1 / 3, 1 / 3, 1 / 3], atol=1e-14)
