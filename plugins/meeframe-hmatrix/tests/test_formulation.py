"""Test the formulation against dense boundary elements: matrices, compliance, contact, contract, rejected input."""

import pickle
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from meeframe_hmatrix import HierarchicalBEM, cross_approximation, formulation
from meeframe_hmatrix import system as hierarchical
from meeframe_hmatrix.assembly import assemble
from meeframe_hmatrix.blocks import LowRank, count_entries, leaves, to_dense
from meeframe_hmatrix.cross_approximation import interpolation
from meeframe_hmatrix.packing import unpack
from meeframe_hmatrix.rows import near_rows
from meeframe_hmatrix.system import MAX_PRODUCTS, coupled_groups

from meeframe.common.errors import CaseError, MeshError
from meeframe.elements import Quad4, Quad8, Tri6
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.laws import IsotropicCoulomb
from meeframe.material import library_material, rotation_about
from meeframe.mesh import block_mesh, half_space_mesh
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.plugin.registry import Kind, load
from meeframe.results.systems import read_arrays, write_arrays
from meeframe.solvers import SemismoothNewton, solve
from meeframe.system.capabilities import apply_fields, apply_load
from meeframe.testing import check_formulation
from meeframe.testing.half_space import indentation_problem

TOLERANCES = (1e-3, 1e-5)


def relative(actual, expected):
    """Return the largest difference (n, ...) by field, relative to the largest value of the field."""
    return np.abs(actual - expected).max(axis=0) / np.abs(expected).max(axis=0)


def small_leaves(tolerance=1e-4):
    """Return the formulation with leaves of ten nodes, so that coarse meshes have far blocks."""
    return HierarchicalBEM(tolerance=tolerance, leaf_size=10)


@pytest.fixture(scope="module")
def dense(make_block):
    """Return dense boundary elements with integrals finer than those of any tolerance here."""
    return DenseBEM(quadrature_tolerance=1e-9).reduce(make_block(6))


@pytest.fixture(scope="module")
def systems(make_block):
    """Return the reduced systems by tolerance."""
    return {tolerance: small_leaves(tolerance).reduce(make_block(6)) for tolerance in TOLERANCES}


@pytest.mark.full
def test_compliance_converges_to_dense_with_tolerance(dense, systems, smooth_load):
    for tolerance, system in systems.items():
        matrix = system.boundary.system.matrix
        assert sum(isinstance(leaf, LowRank) for leaf in leaves(matrix)) > 50
        computed, expected = (s.apply(smooth_load(dense)) for s in (system, dense))
        assert (relative(computed, expected) < 5 * tolerance).all()
        scale = np.sqrt(np.einsum("naa->na", dense.diagonal_blocks()))
        difference = np.abs(system.diagonal_blocks() - dense.diagonal_blocks())
        assert (difference < 5 * tolerance * scale[:, :, None] * scale[:, None]).all()
        assert (relative(system.offset, dense.offset) < 5 * tolerance).all()
        computed, expected = (s.recover(smooth_load(dense)).values for s in (system, dense))
        assert (relative(computed, expected) < 5 * tolerance).all()
    sizes = [count_entries(systems[tolerance].boundary.system.matrix) for tolerance in TOLERANCES]
    assert sizes[0] < 0.9 * sizes[1]


def clusters(cluster):
    """Yield a cluster and all its descendants."""
    return [cluster, *(below for child in cluster.children for below in clusters(child))]


def first_source(sampled, source, tolerance):
    """Select useless equations."""
    indices = np.flatnonzero(source == 0)
    return np.zeros((len(sampled), len(indices))), indices


@pytest.mark.full
@pytest.mark.parametrize(
    ("tolerance", "selection"),
    [(1e-3, interpolation), (1e-5, interpolation), (1e-3, first_source)],
    ids=["1e-3", "1e-5", "bad selection"],
)
def test_far_blocks_match_integrals_of_all_equations(make_block, monkeypatch, tolerance, selection):
    monkeypatch.setattr(cross_approximation, "interpolation", selection)
    calls = []
    monkeypatch.setattr(formulation, "assemble", lambda *arguments: calls.append(arguments) or assemble(*arguments))
    boundary = small_leaves(tolerance).boundary(make_block(6))
    ((integrals, block_tolerance, _),) = calls
    every = clusters(integrals.tree.root)
    rows = {(one.unknowns.start, one.unknowns.stop): one for one in every}
    loaded = {(one.loads.start, one.loads.stop): one for one in every if one.loads.start < one.loads.stop}
    for matrix, columns, kind, least in (
        (boundary.system.matrix, rows, "unknown", 50),
        (boundary.system.load_matrix, loaded, "load", 20),
    ):
        checked = 0
        for leaf in leaves(matrix):
            if isinstance(leaf, LowRank):
                row, column = rows[leaf.rows.start, leaf.rows.stop], columns[leaf.columns.start, leaf.columns.stop]
                expected = getattr(near_rows(integrals, row, [column]), kind)
                assert error(to_dense(leaf), expected) < 5 * block_tolerance
                checked += 1
        assert checked > least


def test_boundary_fields_match_dense(dense, systems, smooth_load):
    computed, expected = (s.recover(smooth_load(dense)) for s in (systems[1e-5], dense))
    assert np.array_equal(computed.points, expected.points)
    assert (relative(computed.values, expected.values) < 1e-4).all()
    assert (relative(computed.fluxes, expected.fluxes) < 1e-4).all()


def test_frictional_contact_matches_dense(dense, systems):
    x, y, _ = dense.points.T
    loads = []
    for system in (dense, systems[1e-5], systems[1e-3]):
        law = IsotropicCoulomb(mu=0.3)
        problem = indentation_problem(system, (x**2 + y**2) / 0.2, 2e-5, law, (1e3, 0.0), (10.0, 0.0), (2e-6, 0.0))
        loads.append(solve(problem, SemismoothNewton()).state.load)
    totals = np.array([dense.weights @ load for load in loads])[:, [0, 2, 3]]  # tangential, normal force, charge
    assert (np.abs(totals[1] / totals[0] - 1) < 1e-4).all()
    assert (np.abs(totals[2] / totals[0] - 1) < 5e-3).all()


@pytest.mark.full
@pytest.mark.parametrize(("element", "divisions"), [(Quad8(), 3), (Tri6(), 2)], ids=["quad8", "tri6"])
def test_other_elements(make_block, smooth_load, element, divisions):
    body = make_block(divisions, element)
    system, dense = small_leaves(1e-5).reduce(body), DenseBEM().reduce(body)
    computed, expected = (s.apply(smooth_load(dense)) for s in (system, dense))
    assert (relative(computed, expected) < 5e-5).all()


@pytest.mark.full
def test_half_space(smooth_load):
    mesh = half_space_mesh(0.02, 0.005, 8, 5, Quad4())
    body = Body(library_material("batio3-cofe2o4").stiffness, mesh, (), "contact")
    system, dense = small_leaves(1e-5).reduce(body), DenseBEM().reduce(body)
    assert any(isinstance(leaf, LowRank) for leaf in leaves(system.boundary.system.matrix))
    computed, expected = (s.apply(smooth_load(dense)) for s in (system, dense))
    assert (relative(computed, expected) < 5e-5).all()


@pytest.mark.full
def test_conformance():
    check_formulation(small_leaves(1e-5), tolerance=1e-3)


@pytest.mark.full
def test_results_are_deterministic(make_block, smooth_load, systems):
    again = small_leaves(1e-3).reduce(make_block(6))
    assert np.array_equal(again.apply(smooth_load(again)), systems[1e-3].apply(smooth_load(again)))


def test_memory_of_stored_products(systems, smooth_load):
    system = systems[1e-3]
    load = smooth_load(system)
    displacement = system.apply(load)
    for subset in combinations(range(5), 3):
        masked = np.zeros_like(load)
        masked[:, subset] = load[:, subset]
        remainder = np.where(masked == 0.0, load, 0.0)
        assert (
            relative(apply_load(system, masked, range(5)) + apply_load(system, remainder, range(5)), displacement)
            < 1e-12
        ).all()
        assert len(system.products) <= MAX_PRODUCTS
    system.approximate_inverse((2,))
    copied = pickle.loads(pickle.dumps(system))
    assert not copied.products
    assert not copied.inverses
    assert np.array_equal(copied.apply(load), displacement)


def test_stored_arrays_give_the_same_system_and_fields(make_block, smooth_load, systems, tmp_path):
    system, body, formulation = systems[1e-3], make_block(6), small_leaves(1e-3)
    write_arrays(tmp_path / "system.h5", "its key", system.to_arrays())
    again = formulation.from_arrays(body, read_arrays(tmp_path / "system.h5", "its key"))
    load = smooth_load(system)
    assert np.array_equal(again.apply(load), system.apply(load))
    assert np.array_equal(again.offset, system.offset)
    inverses = (one.approximate_inverse((0, 1, 2))(load[:, :3]) for one in (again, system))
    assert np.array_equal(*inverses)
    assert not again.boundary_system.cache
    assert np.array_equal(again.recover(load).values, system.recover(load).values)


def test_invalid_arrays_are_rejected(make_block, systems):
    arrays = systems[1e-3].to_arrays()
    with pytest.raises(ValueError, match="reshape"):
        unpack(arrays["table"], arrays["numbers"][:-1])
    with pytest.raises(ValueError, match="7 columns"):
        unpack(arrays["table"][:, :5], arrays["numbers"])
    for table, numbers, message in (
        (arrays["table"][:-1], arrays["numbers"], "incomplete"),
        (arrays["table"][:0], arrays["numbers"], "incomplete"),
        (arrays["table"], np.append(arrays["numbers"], 0.0), "one tree"),
        (np.append(arrays["table"], arrays["table"][-1:], axis=0), arrays["numbers"], "one tree"),
    ):
        with pytest.raises(ValueError, match=message):
            unpack(table, numbers)
    for changes in (
        {"more": arrays["node_compliance"]},
        {"numbers": arrays["numbers"][1:]},
        {"offset": arrays["offset"][:2]},
    ):
        changed = {**arrays, **changes}
        with pytest.raises(ValueError, match=r"arrays|reshape"):
            HierarchicalBEM().from_arrays(make_block(6), changed)


@pytest.mark.full
@pytest.mark.parametrize("leaf_size", [10, 36], ids=["divided", "one leaf"])
def test_truncated_inverse_of_slender_rod_is_accurate_or_absent(leaf_size):
    divisions = {10: 8, 36: 4}[leaf_size]
    clamped = tuple(BoundaryCondition("base", field, "value", 0.0) for field in range(5))
    mesh = block_mesh(0.01, 10.0, 0.01, divisions, 2, 6, Quad4())
    system = HierarchicalBEM(leaf_size=leaf_size).reduce(
        Body(library_material("batio3-cofe2o4").stiffness, mesh, clamped, "contact")
    )
    for fields, divided in (((2,), True), ((0, 1, 2), False)):
        inverse = system.approximate_inverse(fields)
        if leaf_size == 10 and not divided:  # truncation loses everything but the bending
            assert inverse is None
            continue
        load = np.random.default_rng(1).normal(size=(len(system.points), len(fields)))
        assert error(inverse(apply_fields(system, load, fields, fields)), load) < 0.1


def error(actual, expected):
    return np.linalg.norm(actual - expected) / np.linalg.norm(expected)


def test_registration_and_keys():
    registry = load()
    assert next(e for e in registry.entries if e.record.name == "hmatrix-bem").provider.name == "meeframe-hmatrix"
    made = registry.create(Kind.FORMULATION, {"name": "hmatrix-bem", "tolerance": 1e-3})
    assert made == HierarchicalBEM(tolerance=1e-3)
    for value in (0.0, 0.5, -1.0, 1e-9):
        with pytest.raises(CaseError, match="tolerance"):
            HierarchicalBEM(tolerance=value)


def test_unsupported_bodies_are_rejected(make_block, monkeypatch):
    body = make_block(4)
    with pytest.raises(CaseError, match="no contact zone"):
        HierarchicalBEM().check(replace(body, contact_group=None))
    (block,) = body.mesh.blocks
    opened = replace(body.mesh, blocks=(replace(block, connectivity=block.connectivity[1:], groups=block.groups[1:]),))
    with pytest.raises(MeshError, match="closed"):
        HierarchicalBEM().check(replace(body, mesh=opened))
    other = BoundaryCondition("side_y+", 2, "value", 1.0)
    with pytest.raises(CaseError, match="contradict"):
        HierarchicalBEM().check(replace(body, conditions=(*body.conditions, other)))
    monkeypatch.setattr(formulation, "usable_memory", lambda: 1e6)
    with pytest.raises(CaseError, match=r"unknowns need about .* GB; this process may use 0.001"):
        HierarchicalBEM().check(body)


def test_nonfinite_solution_is_rejected(systems, monkeypatch):
    system = systems[1e-3]
    monkeypatch.setattr(hierarchical, "apply_inverse", lambda factors, x: np.full_like(x, np.nan))
    with pytest.raises(CaseError, match="not solved after"):
        system.boundary.unknowns(np.ones(5 * len(system.points)))


def test_nonfinite_loads_are_rejected(systems):
    with pytest.raises(CaseError, match=r"right-hand sides .* are not finite numbers"):
        systems[1e-3].boundary.unknowns(np.full(5 * len(systems[1e-3].points), np.nan))


@pytest.mark.parametrize(
    ("name", "groups"),
    [
        ("isotropic", ((0, 1, 2), (3,), (4,))),
        ("pzt-4", ((4,), (0, 1, 2, 3))),
        ("cofe2o4", ((3,), (0, 1, 2, 4))),
        ("batio3-cofe2o4", ((0, 1, 2, 3, 4),)),
    ],
)
def test_fields_are_grouped_by_coupling(name, groups):
    options = {"young_modulus": 1e9, "poisson_ratio": 0.3} if name == "isotropic" else {}
    material = library_material(name, **options).rotated(rotation_about((1.0, 2.0, 0.5), 0.8))
    mesh = block_mesh(0.5, 0.8, 0.2, 2, 1, 1, Quad4())
    assert set(coupled_groups(Body.of(material, mesh, (), None))) == {(group, group) for group in groups}
    # a temperature acts on fields that do not act on it
    hot = Body.of(material.with_heat(40.0, 1e-5), mesh, (), None)
    expected = {(group, (*group, 5) if 0 in group else group) for group in groups} | {((5,), (5,))}
    assert set(coupled_groups(hot)) == expected


def test_uncoupled_fields_are_exactly_zero(make_block, smooth_load):
    """Truncation must not transfer a mechanical load to the magnetic field of a piezoelectric body, nor back."""
    body = make_block(4)
    conditions = tuple(replace(each, data=0.0) if each.field == 4 else each for each in body.conditions)
    body = replace(body, stiffness=library_material("pzt-4").stiffness, conditions=conditions)
    system = small_leaves(1e-3).reduce(body)
    load = smooth_load(system)
    mechanical, magnetic = load * [1, 1, 1, 1, 0], load * [0, 0, 0, 0, 1]
    assert not system.offset[:, 4].any()
    assert system.offset[:, :4].any()
    assert not system.apply(mechanical)[:, 4].any()
    assert not system.apply(magnetic)[:, :4].any()
    assert not system.diagonal_blocks()[:, 4, :4].any()
    assert not system.apply_fields(magnetic[:, [4]], [4], [0, 2]).any()
    summed = system.apply(mechanical) + system.apply(magnetic)
    np.testing.assert_allclose(system.apply(load), summed, rtol=1e-12, atol=0)
    again = small_leaves(1e-3).from_arrays(body, system.to_arrays())
    np.testing.assert_array_equal(again.apply(load), system.apply(load))
    exact = DenseBEM().reduce(body).apply(load)
    for field in range(5):
        largest = np.abs(exact[:, field]).max()
        np.testing.assert_allclose(system.apply(load)[:, field], exact[:, field], rtol=0, atol=0.01 * largest)
