"""Dense boundary elements reproduce exact fields."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meeframe.common.errors import CaseError, MaterialError, MeshError
from meeframe.elements import Quad4, Quad8, Quad9, Tri3, Tri6
from meeframe.elements.base import SurfaceElement
from meeframe.fields import Array
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.formulations.dense_bem.patches import find_patches
from meeframe.greens import Isotropic, LineIntegral, Tabulated
from meeframe.greens.base import FundamentalSolution, Kernel
from meeframe.greens.tabulated import TabulatedKernel
from meeframe.material import library_material, rotation_about
from meeframe.mesh import block_mesh, box_mesh, half_space_mesh
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.system.reduced import ReducedSystem
from meeframe.testing import check_formulation
from meeframe.testing.manufactured import LinearField, prescribe, relative_errors
from meeframe.testing.strategies import materials

ORTHOTROPIC = library_material("orthotropic-mee")
TRICLINIC = ORTHOTROPIC.rotated(rotation_about((1.0, 2.0, 0.5), 0.8))
TIGHT = DenseBEM(LineIntegral(), quadrature_tolerance=1e-13)
MIXED = {"x-": "vvvvv", "x+": "vfffv", "y-": "fffvf", "y+": "fvvff", "z-": "vvvvv", "z+": "fffff"}
"""Mechanical, electric and magnetic partitions that differ, with corners where three clamped faces meet."""


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("element", [Quad4(), Quad8(), Quad9(), Tri3(), Tri6()], ids=lambda e: e.name)
def test_linear_fields_are_exact(element):
    mesh = box_mesh((1.0, 1.5, 0.8), (1, 2, 1), element)
    field = LinearField.random(TRICLINIC.stiffness, seed=5)
    computed = TIGHT.boundary_fields(prescribe(mesh, field, TRICLINIC.stiffness, MIXED))
    assert max(relative_errors(mesh, field, computed)) < 1e-8


def test_linear_fields_are_exact_in_any_unit_of_length():
    mesh = box_mesh((1e-6, 2e-6, 1e-6), (1, 2, 1), Quad4())
    field = LinearField.random(TRICLINIC.stiffness, seed=6)
    field = LinearField(field.stiffness, field.gradient, 1e-6 * field.constant)
    computed = TIGHT.boundary_fields(prescribe(mesh, field, TRICLINIC.stiffness, MIXED))
    assert max(relative_errors(mesh, field, computed)) < 1e-8


@pytest.mark.full
@settings(max_examples=4, deadline=None)
@given(materials(spread=0.5, coupling=0.5), st.integers(0, 1000))
def test_linear_fields_are_exact_for_random_triclinic_materials(material, seed):
    mesh = box_mesh((1.0, 1.0, 1.0), (1, 1, 1), Quad4())
    field = LinearField.random(material.stiffness, seed)
    computed = TIGHT.boundary_fields(prescribe(mesh, field, material.stiffness, MIXED))
    assert max(relative_errors(mesh, field, computed)) < 1e-8


@pytest.mark.full
def test_linear_fields_with_default_options():
    """With default kernel and quadrature, the error is far below any discretisation error."""
    mesh = box_mesh((1.0, 1.5, 0.8), (2, 3, 2), Quad4())
    field = LinearField.random(TRICLINIC.stiffness, seed=5)
    values, fluxes = relative_errors(
        mesh, field, DenseBEM().boundary_fields(prescribe(mesh, field, TRICLINIC.stiffness, MIXED))
    )
    assert values < 1e-5
    assert fluxes < 1e-4


def test_plane_elements_are_integrated_like_others(monkeypatch):
    """Integration by sums over plane elements gives the same reduced system as pairs U and T at every point."""
    body = small_block()
    planes = DenseBEM().reduce(body).dense()
    monkeypatch.setattr(TabulatedKernel, "integrate", Kernel.integrate)
    pairs = DenseBEM().reduce(body).dense()
    scale = np.abs(pairs).max(axis=(0, 2))
    assert (np.abs(planes - pairs).max(axis=(0, 2)) < 1e-10 * scale).all()


BASE = tuple(BoundaryCondition("base", field, "value") for field in range(5))


def small_block(divisions: int = 4) -> Body:
    mesh = block_mesh(0.05, 0.12, 0.005, divisions, 3, 3, Quad4())
    return Body(library_material("batio3-cofe2o4").stiffness, mesh, BASE, "contact")


@pytest.fixture(scope="module")
def reduced_system() -> ReducedSystem:
    return DenseBEM(Tabulated(), quadrature_tolerance=1e-8).reduce(small_block())


def pressure(system: ReducedSystem) -> Array:
    load = np.zeros((len(system.points), 5))
    load[:, 2] = -1e8 * (1 + system.points[:, 0] / 0.005)
    return load


def test_compliance_is_nearly_symmetric_and_positive_definite(reduced_system):
    n = len(reduced_system.points)
    matrix = reduced_system.dense().reshape(5 * n, 5 * n)
    weighted = matrix * np.repeat(reduced_system.weights, 5)[:, None]
    scale = 1 / np.sqrt(np.diag(weighted))
    scaled = weighted * scale[:, None] * scale
    assert np.linalg.eigvalsh(scaled + scaled.T).min() > 0


def test_contact_load_equals_prescribed_traction(reduced_system):
    """The reduced system agrees with a plain boundary value problem on the same mesh."""
    body = small_block()
    load = pressure(reduced_system)
    fluxes = tuple(BoundaryCondition("contact", field, "flux", load[:, field]) for field in range(5))
    plain = DenseBEM(Tabulated(), quadrature_tolerance=1e-8).boundary_fields(
        Body(body.stiffness, body.mesh, body.conditions + fluxes, None)
    )
    recovered = reduced_system.recover(load)
    scale = np.abs(plain.values).max(axis=0)
    order = [np.lexsort(fields.points.T) for fields in (plain, recovered)]
    np.testing.assert_allclose(recovered.points[order[1]], plain.points[order[0]])
    np.testing.assert_allclose(recovered.values[order[1]] / scale, plain.values[order[0]] / scale, atol=1e-9)


def test_recovered_fields_agree_with_the_compliance(reduced_system):
    load = pressure(reduced_system)
    displacement = reduced_system.offset + reduced_system.apply(load)
    fields = reduced_system.recover(load)
    for point, values in zip(reduced_system.points, displacement, strict=True):
        same = np.flatnonzero(np.all(np.isclose(fields.points, point, atol=1e-12), axis=1))
        np.testing.assert_allclose(fields.values[same[0], :3], values[:3], rtol=1e-12, atol=1e-20)
        np.testing.assert_allclose(fields.values[same[0], 3:], -values[3:], rtol=1e-12)


def test_patches_that_meet_in_the_zone_share_their_load():
    """The normals of a bulge differ by 0.05 from element to element; it is meshed as one patch and as many."""
    flat = small_block()
    points = flat.mesh.points.copy()
    top = points[:, 2] > points[:, 2].max() - 1e-9
    points[top, 2] -= 20.0 * np.minimum((points[top, :2] ** 2).sum(axis=1), 5e-5)
    body = replace(flat, mesh=replace(flat.mesh, points=points))
    smooth, angular = DenseBEM(), DenseBEM(edge_angle=0.02)
    assert len(find_patches(body.mesh, 0.02).point) > len(find_patches(body.mesh, smooth.edge_angle).point) + 30
    whole, divided = smooth.reduce(body).dense(), angular.reduce(body).dense()
    scale = np.abs(whole).max(axis=(0, 2))
    assert (np.abs(divided - whole).max(axis=(0, 2)) < 1e-12 * scale).all()


def imbalance(divisions: int, layers: int) -> float:
    """Return the resultant of the normal tractions over the whole surface, relative to the force on the zone."""
    mesh = block_mesh(0.05, 0.12, 0.05, divisions, 3, layers, Quad4())
    system = DenseBEM().reduce(Body(library_material("batio3-cofe2o4").stiffness, mesh, BASE, "contact"))
    load = pressure(system)
    fields = system.recover(load)
    total = 0.0
    for _, cells in fields.cells:
        a, b, c, d = (fields.points[cells[:, k]] for k in range(4))
        area = np.linalg.norm(np.cross(c - a, d - b), axis=1) / 2
        total += float(area @ fields.fluxes[cells, 2].mean(axis=1))
    return abs(total / (system.weights @ load[:, 2]))


@pytest.mark.full
def test_reaction_of_the_base_converges_to_the_load():
    coarse, fine = imbalance(4, 3), imbalance(8, 6)
    assert coarse < 0.1
    assert fine < 0.6 * coarse


# fluxes (i, J) as a function of gradients of values (K, l), with shear strains counted once and potentials last
GRADIENTS = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1), *((i, J) for J in (3, 4) for i in range(3))]


def deflection(
    size: tuple[float, float, float], divisions: tuple[int, int, int], element: SurfaceElement, field: int
) -> float:
    """Return the mean displacement of the end of a rod, clamped and grounded at the other end, due to a traction of
    1 MPa."""
    along = "xyz"[int(np.argmax(size))]
    clamps = tuple(BoundaryCondition(f"{along}-", field, "value") for field in range(5))
    mesh = box_mesh(size, divisions, element)
    system = DenseBEM().reduce(Body(ORTHOTROPIC.stiffness, mesh, clamps, f"{along}+"))
    load = np.zeros((len(system.points), 5))
    load[:, field] = 1e6
    return float(system.weights @ system.apply(load)[:, field] / system.weights.sum())


def compliance(n: int) -> Array:
    """Return the compliance of stresses where D = B = 0 (n = 12), or where E = H = 0 (n = 6)."""
    moduli = [[ORTHOTROPIC.stiffness[i, J, K, m] for m, K in GRADIENTS[:n]] for i, J in GRADIENTS[:n]]
    return np.linalg.inv(np.array(moduli))


@pytest.mark.full
@pytest.mark.parametrize(
    ("size", "divisions", "tolerance"),
    [
        ((1.0, 1.0, 100.0), (2, 2, 40), 0.02),
        ((1.0, 1.0, 1000.0), (1, 1, 20), 0.005),
        ((1e3, 1.0, 1.0), (40, 1, 1), 0.005),
        ((1.0, 1.0, 1e4), (1, 1, 20), 0.005),
    ],
)
def test_slender_rods_under_pressure(size, divisions, tolerance):
    """The strain is that of uniaxial stress without D and B."""
    along = int(np.argmax(size))
    strain = 1e6 * compliance(12)[along, along]
    assert deflection(size, divisions, Quad4(), 2) == pytest.approx(size[along] * strain, rel=tolerance)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("field", [0, 1])
def test_rods_bent_by_a_force_at_the_end(field):
    """Timoshenko's beam, ten times as long as wide: the axial stress changes sign across the section, so E and H
    nearly vanish.

    For rods of 100 widths, such meshes give deflections between half and twice the exact one.
    """
    length, inertia, shear_factor, s = 10.0, 1 / 12, 5 / 6, compliance(6)
    expected = 1e6 * (s[2, 2] * length**3 / (3 * inertia) + s[4 - field, 4 - field] * length / shear_factor)
    assert deflection((1.0, 1.0, length), (1, 1, 10), Quad9(), field) == pytest.approx(expected, rel=0.01)


def test_unsupported_bodies_are_rejected_early(monkeypatch):
    body = small_block()
    with pytest.raises(MaterialError, match="isotropic"):
        DenseBEM(Isotropic()).check(body)
    half_space = half_space_mesh(1.0, 0.1, 12, 4, Quad4())
    monkeypatch.setattr("os.sysconf", lambda _: 1000)
    reported = r"this process may use 0\.001 GB: use a coarser mesh, or the formulation '{}'"
    with pytest.raises(MeshError, match=reported.format("hmatrix-bem")):
        DenseBEM().check(body)
    with pytest.raises(MeshError, match=reported.format("half-space")):
        DenseBEM().check(replace(body, mesh=half_space, conditions=()))


@pytest.mark.parametrize(
    ("condition", "message"),
    [
        (BoundaryCondition("top", 2, "force", 1.0), "kind = 'force'; allowed: 'value', 'flux'"),
        (BoundaryCondition("top", 9, "flux", 1.0), "field = 9; allowed: 0 to 4"),
        (BoundaryCondition("top", 2, "flux", np.ones(3)), r"data has shape \(3,\); allowed: one number or shape \("),
        (BoundaryCondition("top", 2, "flux", np.nan), "must be finite"),
        (BoundaryCondition("base", 2, "flux", 1.0), "prescribe displacement_3 or traction_3 twice"),
    ],
)
def test_incomplete_conditions_are_rejected(condition, message):
    body = small_block()
    with pytest.raises(CaseError, match=message):
        DenseBEM().check(replace(body, conditions=(*body.conditions, condition)))


def test_open_meshes_and_missing_zones_are_rejected():
    body = small_block()
    with pytest.raises(CaseError, match="no contact zone"):
        DenseBEM().reduce(Body(body.stiffness, body.mesh, body.conditions, None))
    with pytest.raises(MeshError, match="no face group 'nowhere'"):
        DenseBEM().reduce(Body(body.stiffness, body.mesh, body.conditions, "nowhere"))


@pytest.mark.parametrize("is_accepted", [True, False])
def test_a_material_is_checked_without_a_kernel(is_accepted):
    @dataclass(frozen=True)
    class Unbound(FundamentalSolution):
        def check(self, stiffness: Array) -> None:
            if not is_accepted:
                raise MaterialError("not for this material")

        def bind(self, stiffness: Array) -> Kernel:
            raise AssertionError("bound")

    if is_accepted:
        DenseBEM(Unbound()).check(small_block())
    else:
        with pytest.raises(MaterialError, match="not for this material"):
            DenseBEM(Unbound()).check(small_block())


@pytest.mark.full
def test_conformance():
    check_formulation(DenseBEM(Tabulated()))
