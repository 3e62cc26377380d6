"""Two bodies whose contact zones have different divisions: integrals, transfer, and contact agree with closed forms."""

import pickle
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial import Delaunay

from meeframe.common.errors import MeshError
from meeframe.contact.problem import Status, resultant
from meeframe.elements import Quad4, Quad8, Quad9, Tri3, Tri6
from meeframe.elements.base import SurfaceElement
from meeframe.fields import Array
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.material import Material, library_material
from meeframe.mesh import box_mesh, find_contact_zone, half_space_mesh, local_frames
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.mesh.mortar import Cells, find_mortar
from meeframe.solvers import Auto, StoppingCriteria, solve
from meeframe.system.capabilities import (
    ApproximateInverse,
    EdgeResolution,
    FieldwiseApply,
    Multigrid,
    Persistence,
    Restriction,
)
from meeframe.system.dense import DenseSystem
from meeframe.system.two_body import combine_bodies, second_displacement, second_load
from meeframe.testing.capabilities import check_capabilities
from meeframe.testing.half_space import indentation_problem
from meeframe.testing.matrix_free import MatrixFree

TURN = np.array([1.0, -1.0, -1.0])
RADIUS, APPROACH, SIDE, COLUMN = 0.1, 5e-5, 5e-3, 1e-2
STEEL, GLASS = Material.isotropic(210e9, 0.3), Material.isotropic(70e9, 0.22)
ELEMENTS = {element.name: element for element in (Quad4(), Quad8(), Quad9(), Tri3(), Tri6())}


@cache
def half_space(material: Material, divisions: int, element: SurfaceElement, width: float = SIDE) -> DenseSystem:
    mesh = half_space_mesh(0.1, width, divisions, 5, element)
    system = DenseBEM().reduce(Body(material.stiffness, mesh, (), "contact"))
    assert isinstance(system, DenseSystem)
    return system


def disc(n: int, radius: float, seed: int) -> tuple[Array, Cells]:
    """Return an unstructured disc with n nodes on its border, in SI units of the zone."""
    random = np.random.default_rng(seed)
    angle = 2.0 * np.pi * np.arange(n) / n + random.uniform()
    inner = random.uniform(-radius, radius, (n * n // 4, 2))
    inner = inner[np.linalg.norm(inner, axis=1) < radius * (1.0 - 3.0 / n)]
    plane = np.concatenate([radius * np.column_stack([np.cos(angle), np.sin(angle)]), inner])
    triangles = Delaunay(plane).simplices.astype(np.int64)
    along, across = (plane[triangles[:, k]] - plane[triangles[:, 0]] for k in (1, 2))
    inverted = along[:, 0] * across[:, 1] < along[:, 1] * across[:, 0]
    triangles[inverted] = triangles[inverted][:, ::-1]
    return np.column_stack([plane, np.zeros(len(plane))]), (("triangle", triangles),)


def square(element: SurfaceElement, divisions: int, width: float = SIDE, bend: float = 0.0) -> tuple[Array, Cells]:
    """Return a zone of a half space, bent to a paraboloid of curvature `bend` [1/m]."""
    zone = find_contact_zone(half_space_mesh(0.1, width, divisions, 2, element), "contact")
    points = zone.points.copy()
    points[:, 2] -= bend * (points[:, :2] ** 2).sum(axis=1) / 2.0
    return points, zone.cells


# integrals


@pytest.mark.full(except_for=3)
@pytest.mark.parametrize("name", ELEMENTS)
@pytest.mark.parametrize("other", ELEMENTS)
def test_integrals_on_the_same_square(name: str, other: str) -> None:
    """Integrals over both surfaces equal those of their shape functions to round-off, and so do first moments."""
    first, second = square(ELEMENTS[name], 3), square(ELEMENTS[other], 4)
    mortar = find_mortar(*first, second[0] * TURN, second[1])
    largest = mortar.first.sum(axis=1).max()
    np.testing.assert_allclose(mortar.mixed.sum(axis=1), mortar.first.sum(axis=1), atol=1e-14 * largest)
    np.testing.assert_allclose(mortar.mixed.sum(axis=0), mortar.second.sum(axis=0), atol=1e-13 * largest)
    moments = mortar.mixed @ (second[0] * TURN), mortar.first @ first[0]
    np.testing.assert_allclose(*moments, atol=1e-14 * largest * SIDE)
    assert mortar.first.sum() == pytest.approx(SIDE**2, rel=1e-13)


@pytest.mark.parametrize("seed", range(3))
def test_outlines_with_small_differences(seed: int) -> None:
    """Polygons of 24 and 31 sides approximate the same circle; integrals and moments of the first remain exact."""
    first, second = disc(24, 1e-3, seed), disc(31, 1e-3, seed + 10)
    mortar = find_mortar(*first, second[0] * TURN, second[1])
    np.testing.assert_allclose(mortar.mixed.sum(axis=1), mortar.first.sum(axis=1), rtol=1e-12)
    moments = mortar.mixed @ (second[0] * TURN), mortar.first @ first[0]
    np.testing.assert_allclose(*moments, atol=1e-13 * np.abs(moments[1]).max())


def test_transfer_is_exact_for_linear_functions_and_conserves_work() -> None:
    first, second = disc(24, 1e-3, 1), square(Quad4(), 7)
    mortar = find_mortar(*first, second[0] * TURN, second[1])
    mixed, mass, other = (matrix.toarray() for matrix in (mortar.mixed, mortar.first, mortar.second))
    place = second[0] * TURN
    displaced = np.linalg.solve(mass, mixed @ (3.0 + place @ [1.0, -2.0, 0.0]))
    np.testing.assert_allclose(displaced, 3.0 + first[0] @ [1.0, -2.0, 0.0], rtol=1e-12)
    random = np.random.default_rng(0)
    load, displacement = random.normal(size=len(mass)), random.normal(size=len(other))
    work = load @ mass @ np.linalg.solve(mass, mixed @ displacement)
    assert np.linalg.solve(other, mixed.T @ load) @ other @ displacement == pytest.approx(work, rel=1e-10)


WRONG = {
    "beside": (
        (square(Quad4(), 4), square(Quad4(), 5, 0.8 * SIDE)),
        "12 of the 16 elements .* up to 64% of their area",
    ),
    "far": ((square(Quad4(), 4), square(Quad4(), 5, bend=400.0)), r"0\.0025 m apart .* allowed: 0\.000707 m"),
    "upside down": ((square(Quad4(), 4), square(Quad4(), 5)), "do not face each other: 25 elements of the second body"),
    "cells": ((square(Quad4(), 4), (square(Quad4(), 5)[0], ())), "second body has no cells"),
    "unknown": ((square(Quad4(), 4), (square(Quad4(), 5)[0], (("quad16", np.zeros((1, 16), int)),))), "type quad16"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_incompatible_zones_are_rejected(wrong: str) -> None:
    (first, second), message = WRONG[wrong]
    turn = np.ones(3) if wrong == "upside down" else TURN
    with pytest.raises(MeshError, match=message):
        find_mortar(*first, second[0] * turn, second[1])


# systems


@pytest.fixture(scope="module")
def steel() -> DenseSystem:
    return half_space(library_material("orthotropic-mee"), 8, Quad4())


@pytest.fixture(scope="module")
def finer() -> DenseSystem:
    """Return a wider triangular mesh of a half space with an offset."""
    system = half_space(library_material("batio3-cofe2o4"), 9, Tri3(), 5.3e-3)
    offset = 1e-6 * np.random.default_rng(3).normal(size=system.offset.shape) * [1.0, 1.0, 1.0, 1e9, 1e6]
    return replace(system, offset=offset)


@pytest.mark.full
def test_reactions_balance_to_round_off(steel: DenseSystem, finer: DenseSystem) -> None:
    """Forces, charge, magnetic flux, and the moments of the load about all axes through the origin balance."""
    both = combine_bodies(steel, finer)
    load = np.random.default_rng(1).normal(size=steel.offset.shape)
    reaction = second_load(both, load)
    (force, fluxes), (other_force, other_fluxes) = resultant(steel, load), resultant(finer, reaction)
    np.testing.assert_allclose(other_force * TURN, -force, atol=1e-12 * np.abs(force).max())
    np.testing.assert_allclose(other_fluxes, -fluxes, atol=1e-12 * np.abs(fluxes).max())
    moments = []
    for system, values in ((steel, load), (finer, reaction)):
        mortar = find_mortar(system.points, system.cells, system.points * TURN, system.cells)
        densities = np.einsum("nai,na->ni", system.frames, values[:, :3])
        moments.append(np.cross(system.points, mortar.first @ densities).sum(axis=0))
    np.testing.assert_allclose(moments[1] * TURN, -moments[0], atol=1e-11 * np.abs(moments[0]).max())


@pytest.mark.full
def test_capabilities_with_different_divisions(steel: DenseSystem, finer: DenseSystem) -> None:
    for system in (combine_bodies(steel, finer), combine_bodies(steel, MatrixFree.of(finer))):
        transferred = system.terms[1].system
        for kind in (Multigrid, Restriction, EdgeResolution, Persistence, ApproximateInverse):
            assert system.capability(kind) is None, kind
            assert transferred.capability(kind) is None, kind
        assert system.capability(FieldwiseApply) is not None
        check_capabilities(system)


@pytest.mark.full
def test_with_and_without_matrices(steel: DenseSystem, finer: DenseSystem) -> None:
    whole, free = combine_bodies(steel, finer), combine_bodies(steel, MatrixFree.of(finer))
    load = np.random.default_rng(5).standard_normal(whole.offset.shape)
    assert whole.dense() is not None
    assert free.dense() is None
    copy = pickle.loads(pickle.dumps(whole.terms[1].system.transfer))
    assert np.array_equal(copy.project_load(load), whole.terms[1].system.transfer.project_load(load))
    np.testing.assert_allclose(free.apply(load), whole.apply(load), rtol=1e-9, atol=1e-25)
    np.testing.assert_array_equal(free.offset, whole.offset)
    exact = np.stack([whole.dense()[node, :, node, :] for node in range(len(load))])
    np.testing.assert_allclose(whole.diagonal_blocks(), exact, rtol=1e-12)
    diagonal, estimate = (np.einsum("naa->na", blocks) for blocks in (exact, free.diagonal_blocks()))
    assert (np.abs(estimate / diagonal - 1.0) < 0.3).all()
    alone = second_displacement(whole, load)
    np.testing.assert_allclose(whole.apply(load) + whole.offset, steel.apply(load) + steel.offset - alone, rtol=1e-9)


def test_reciprocity_is_preserved() -> None:
    """Bodies with reciprocal compliances give a reciprocal system: M C is symmetric with the mass matrix M."""
    systems = []
    random = np.random.default_rng(7)
    for (points, cells), turn in ((square(Quad4(), 4), 1.0), (square(Tri3(), 5), 1.0)):
        mass = find_mortar(points, cells, points * TURN, cells).first.toarray()
        n = len(points)
        root = random.normal(size=(5 * n, 5 * n))
        matrix = np.einsum("ab,bicj->aicj", np.eye(n), (root @ root.T).reshape(n, 5, n, 5))
        matrix = np.einsum("aibj,bc->aicj", matrix, mass)
        frames = np.tile(turn * np.eye(3), (n, 1, 1))
        systems.append(DenseSystem(points, frames, mass.sum(axis=1), cells, np.zeros((n, 5)), matrix, lambda _: None))
    both = combine_bodies(*systems)
    mass = find_mortar(systems[0].points, systems[0].cells, systems[0].points * TURN, systems[0].cells).first.toarray()
    energy = np.einsum("ab,bicj->aicj", mass, both.dense()).reshape(both.offset.size, -1)
    np.testing.assert_allclose(energy, energy.T, atol=1e-11 * np.abs(energy).max())


def test_inconsistent_weights_are_rejected(steel: DenseSystem, finer: DenseSystem) -> None:
    with pytest.raises(MeshError, match="formulation of the second body does not interpolate loads"):
        combine_bodies(steel, replace(finer, weights=np.full(len(finer.weights), finer.weights.mean())))


# contact


def column(modulus: float, divisions: int, element: SurfaceElement) -> DenseSystem:
    """Return a column with a bonded base that does not widen under pressure, with its top at zero."""
    mesh = box_mesh((COLUMN, COLUMN, COLUMN), (divisions, divisions, 2), element)
    mesh = replace(mesh, points=mesh.points - [0.0, 0.0, COLUMN / 2])
    base = tuple(BoundaryCondition("z-", field, "value") for field in range(5))
    system = DenseBEM().reduce(Body(Material.isotropic(modulus, 0.0).stiffness, mesh, base, "z+"))
    assert isinstance(system, DenseSystem)
    return system


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    ("first", "second"),
    [
        ((3, Quad4()), (3, Quad4())),
        ((3, Quad4()), (4, Quad4())),
        ((3, Quad4()), (4, Tri3())),
        ((4, Tri3()), (3, Quad9())),
    ],
)
def test_uniform_pressure(first: tuple[int, SurfaceElement], second: tuple[int, SurfaceElement]) -> None:
    """Patch test: columns that press on each other, to the accuracy of the integrals over their own elements."""
    both = combine_bodies(column(200e9, *first), column(70e9, *second))
    problem = indentation_problem(both, np.zeros(len(both.points)), APPROACH)
    load = solve(problem, Auto(), StoppingCriteria(tolerance=1e-12)).state.load
    pressure = APPROACH / (COLUMN / 200e9 + COLUMN / 70e9)
    np.testing.assert_allclose(-load[:, 2], pressure, rtol=1e-5)
    np.testing.assert_allclose(load[:, :2], 0.0, atol=1e-12 * pressure)


@pytest.mark.full
def test_hertz_with_different_divisions() -> None:
    """A steel sphere on a glass body; with equal divisions, errors are 0.95 % in the force and 2.9 % in the
    pressure."""
    first, second = half_space(STEEL, 8, Quad4()), half_space(GLASS, 14, Tri3(), 5.5e-3)
    both = combine_bodies(first, second)
    r = np.hypot(*both.points[:, :2].T)
    solution = solve(
        indentation_problem(both, r**2 / (2.0 * RADIUS), APPROACH), Auto(), StoppingCriteria(tolerance=1e-11)
    )
    assert solution.status is Status.CONVERGED, solution.message
    load = solution.state.load
    modulus = 1.0 / ((1.0 - 0.3**2) / 210e9 + (1.0 - 0.22**2) / 70e9)
    force, a = resultant(both, load)[0], np.sqrt(RADIUS * APPROACH)
    assert -force[2] == pytest.approx(4.0 / 3.0 * modulus * np.sqrt(RADIUS * APPROACH**3), rel=0.01)
    largest = 2.0 * modulus * a / (np.pi * RADIUS)
    pressure = largest * np.sqrt(np.maximum(1.0 - r**2 / a**2, 0.0))
    away = np.abs(r - a) > np.sqrt(2.0) * SIDE / 8
    assert np.abs(-load[:, 2] - pressure)[away].max() < 0.04 * largest
    reaction = resultant(second, second_load(both, load))[0]
    np.testing.assert_allclose(reaction * TURN, -force, atol=1e-13 * abs(force[2]))


@pytest.mark.full
def test_curved_zones() -> None:
    """On flat and on slightly curved zones, forces balance in global axes and results hardly differ."""
    flat, second = half_space(STEEL, 8, Quad4()), half_space(GLASS, 9, Quad4())
    points = second.points.copy()
    points[:, 2] -= 5.0 * (points[:, :2] ** 2).sum(axis=1) / 2.0
    normals = np.column_stack([5.0 * points[:, :2], np.ones(len(points))])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    weights = find_mortar(points, second.cells, points * TURN, second.cells).first.sum(axis=1)
    bent = replace(second, points=points, frames=local_frames(normals), weights=weights)
    both = combine_bodies(flat, bent)
    load = np.random.default_rng(2).normal(size=flat.offset.shape)
    reaction = second_load(both, load)
    force, (charge, flux) = resultant(flat, load)
    other, (other_charge, other_flux) = resultant(bent, reaction)
    np.testing.assert_allclose(other * TURN, -force, atol=1e-12 * np.abs(force).max())
    assert (other_charge, other_flux) == pytest.approx((-charge, -flux), rel=1e-11)


def test_uncovered_zone_names_the_bodies() -> None:
    wide = half_space(STEEL, 6, Quad4(), 6e-3)
    with pytest.raises(MeshError, match="of the 36 elements of the first do not lie opposite"):
        combine_bodies(wide, half_space(STEEL, 6, Quad4()))
    assert combine_bodies(half_space(STEEL, 6, Quad4()), wide).n_fields == 5
