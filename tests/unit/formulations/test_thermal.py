"""Dense boundary elements with heat: exact fields of heated bodies, their reduced system, and refusals."""

from dataclasses import replace

import numpy as np
import pytest

from meeframe.common.errors import CaseError
from meeframe.elements import Quad4, Quad9
from meeframe.elements.anisotropy import anisotropy
from meeframe.elements.base import SurfaceElement
from meeframe.formulations.base import Formulation, check_body
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.formulations.dense_bem._kernels.assembly import Accuracy
from meeframe.formulations.dense_bem.assembly import assemble
from meeframe.formulations.dense_bem.collocation import collocate
from meeframe.formulations.dense_bem.fundamental import bind_body
from meeframe.formulations.dense_bem.layout import boundary_fields, lay_out
from meeframe.formulations.dense_bem.patches import find_patches
from meeframe.formulations.dense_bem.units import Units
from meeframe.greens import Tabulated
from meeframe.material import library_material, rotation_about
from meeframe.mesh import block_mesh, box_mesh, half_space_mesh
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.system.capabilities import InteriorFields
from meeframe.system.reduced import silent
from meeframe.testing.capabilities import check_capabilities
from meeframe.testing.formulation import check_exact
from meeframe.testing.manufactured import HeatSourceField, ThermalField, prescribe, relative_errors, with_heat

MATERIAL = (
    library_material("orthotropic-mee")
    .with_heat(
        np.array([[3.0, 0.4, -0.2], [0.4, 2.5, 0.5], [-0.2, 0.5, 4.0]]),
        [1.2e-5, 2e-5, 0.8e-5],
        None,
        [2e-5, -1e-5, -7e-5],
        [1e-4, 2e-4, -3e-4],
        "strain",
    )
    .rotated(rotation_about([1.0, 2.0, 3.0], 0.7))
)
TIGHT = DenseBEM(quadrature_tolerance=1e-10)
MIXED = {"x-": "vvvvvv", "x+": "vfffvf", "y-": "fffvfv", "y+": "fvffvf", "z-": "vvvvvv", "z+": "ffffff"}
"""Partitions that differ between all fields; temperatures and heat fluxes are prescribed on three faces each."""
INSIDE = np.array([[0.05, 0.1, -0.3], [-0.2, 0.15, -0.05], [0.3, -0.3, -0.45], [0.0, 0.0, -0.02]])
"""Points inside the blocks [m], the last one below an element of the contact zone."""
SIDES = ("top", "side_x-", "side_x+", "side_y-", "side_y+")


def block(field: ThermalField, kinds: dict[str, str], element: SurfaceElement) -> Body:
    """Return a block with a contact zone, prescribed to have a field as solution."""
    mesh = block_mesh(0.5, 0.8, 0.5, 2, 1, 2, element)
    return replace(with_heat(prescribe(mesh, field, MATERIAL.stiffness, kinds), MATERIAL), contact_group="contact")


@pytest.mark.full
@pytest.mark.parametrize("size", [1e-6, pytest.param(1.0, marks=pytest.mark.full)])
def test_linear_temperature_is_exact_with_quadratic_elements(size):
    """Quadratic displacements and potentials without contact zone, in any unit of length."""
    mesh = box_mesh(size * np.array([1.0, 1.5, 0.8]), (1, 1, 1), Quad9())
    field = ThermalField(MATERIAL, 20.0, np.array([30.0, -40.0, 25.0]) / size)
    computed = TIGHT.boundary_fields(with_heat(prescribe(mesh, field, MATERIAL.stiffness, MIXED), MATERIAL))
    assert max(relative_errors(mesh, field, computed)) < 1e-8


@pytest.mark.full
def test_heated_block_expands_and_polarises_freely():
    """Uniform heating with every face but the base free: linear fields, exact, without stress and fluxes."""
    field = ThermalField(MATERIAL, 50.0, np.zeros(3))
    system = TIGHT.reduce(block(field, {"base": "vvvvvv", **dict.fromkeys(SIDES, "ffffff")}, Quad4()))
    exact = field.values(system.points)
    assert (np.abs(exact).max(axis=0) > 0.0).all()
    signs = np.array([1.0, 1.0, 1.0, -1.0, -1.0, -1.0])
    local = np.column_stack([np.einsum("nai,ni->na", system.frames, exact[:, :3]), exact[:, 3:]]) * signs
    assert (np.abs(system.offset - local).max(axis=0) <= 1e-8 * np.abs(exact).max(axis=0)).all()
    recovered = system.recover(np.zeros_like(system.offset))
    size = np.abs(MATERIAL.thermal_moduli).max(axis=0) * 50.0
    assert (np.abs(recovered.fluxes[:, :5]).max(axis=0) <= 1e-7 * size).all()
    check_capabilities(system)
    fields = system.capability(InteriorFields).evaluate(np.zeros_like(system.offset), INSIDE)
    assert (np.abs(fields.values - field.values(INSIDE)).max(axis=0) <= 2e-6 * np.abs(exact).max(axis=0)).all()
    assert (np.abs(fields.fluxes[..., :5]).max(axis=(0, 1)) <= 2e-5 * size).all()


@pytest.mark.full
def test_loads_and_heat_on_the_zone_give_the_exact_field():
    """A linear temperature by the reduced system: its heat, tractions and fluxes on the zone cause its values there."""
    field = ThermalField(MATERIAL, 20.0, np.array([30.0, -40.0, 25.0]))
    kinds = {"base": "vvvvvv", "top": "ffffff", "side_x-": "fffffv", "side_x+": "vvvvvf"}
    kinds |= {"side_y-": "vvvvvf", "side_y+": "ffffff"}
    system = TIGHT.reduce(block(field, kinds, Quad9()))
    check_exact(system, field, 1e-8)
    load = field.fluxes(system.points, system.frames[:, 2])
    load[:, :3] = np.einsum("nai,ni->na", system.frames, load[:, :3])
    fields = system.capability(InteriorFields).evaluate(load, INSIDE)
    exact = field.values(INSIDE)
    assert (np.abs(fields.values - exact).max(axis=0) <= 2e-6 * np.abs(exact).max(axis=0)).all()
    normals = np.eye(3)
    for axis in range(3):
        exact = field.fluxes(INSIDE, np.tile(normals[axis], (len(INSIDE), 1)))
        size = np.abs(MATERIAL.thermal_moduli).max(axis=0) * 40.0
        assert (np.abs(fields.fluxes[:, axis, :5] - exact[:, :5]).max(axis=0) <= 2e-5 * size).all()
        np.testing.assert_allclose(fields.fluxes[:, axis, 5], exact[:, 5], rtol=2e-5)


@pytest.mark.full
def test_fields_inside_of_a_heat_source_outside():
    """Stress, D, B and heat flux inside a block with a source outside, of elements as wide as half of its distance."""
    field = HeatSourceField(MATERIAL, np.array([0.2, 0.1, 0.5]))
    kinds = {"base": "vvvvvv", **dict.fromkeys(SIDES, "ffffff")}
    system = DenseBEM().reduce(block(field, kinds, Quad9()))
    load = field.fluxes(system.points, system.frames[:, 2])
    load[:, :3] = np.einsum("nai,ni->na", system.frames, load[:, :3])
    fields, exact = system.capability(InteriorFields).evaluate(load, INSIDE[:3]), field.values(INSIDE[:3])
    assert (np.abs(fields.values - exact).max(axis=0) <= 0.01 * np.abs(exact).max(axis=0)).all()
    stress = np.stack([field.fluxes(INSIDE[:3], np.tile(normal, (3, 1))) for normal in np.eye(3)], axis=1)
    assert (np.abs(fields.fluxes - stress).max(axis=(0, 1)) <= 0.02 * np.abs(stress).max(axis=(0, 1))).all()


@pytest.mark.full
def test_default_accuracy_of_a_heated_body():
    mesh = box_mesh((1.0, 1.5, 0.8), (2, 2, 2), Quad9())
    field = ThermalField(MATERIAL, 20.0, np.array([30.0, -40.0, 25.0]))
    body = with_heat(prescribe(mesh, field, MATERIAL.stiffness, MIXED), MATERIAL)
    values, fluxes = relative_errors(mesh, field, DenseBEM().boundary_fields(body))
    assert values < 1e-5
    assert fluxes < 2e-4


def test_formulations_and_bodies_without_action_of_heat_are_refused():
    body = Body.of(MATERIAL, half_space_mesh(0.1, 0.02, (4, 4), 1, Quad4()), (), "contact")
    check_body(DenseBEM(), body)

    class IgnoresHeat(Formulation):
        def check(self, body):
            """Accept all bodies."""

        def reduce(self, body, progress=silent):
            raise NotImplementedError

    with pytest.raises(CaseError, match="IgnoresHeat does not support thermal expansion"):
        check_body(IgnoresHeat(), body)
    with pytest.raises(CaseError, match="semi-infinite"):
        DenseBEM().check(body)


def test_temperature_must_be_determined():
    base = tuple(BoundaryCondition("base", field, "value") for field in range(5))
    mesh = block_mesh(0.5, 0.8, 0.5, 2, 1, 2, Quad4())
    with pytest.raises(CaseError, match="temperature"):
        DenseBEM().check(Body.of(MATERIAL, mesh, base, "contact"))


def test_heat_first_gives_the_solution_of_the_whole_system():
    """The matrix of all fields, in the order of its points and solved at once, has the same solution."""
    mesh = block_mesh(0.5, 0.8, 0.5, 2, 1, 1, Quad4())
    base = tuple(BoundaryCondition("base", field, "value", 30.0 if field == 5 else 0.0) for field in range(6))
    body = Body.of(MATERIAL, mesh, (*base, BoundaryCondition("side_x+", 5, "flux", -80.0)), "contact")
    system, units = DenseBEM().reduce(body), Units.of(body)
    layout = lay_out(body, find_patches(mesh, np.pi / 6), units)
    assert layout.independent is None
    scaled = replace(mesh, points=mesh.points / units.length)
    accuracy = Accuracy(1e-5, anisotropy(units.scaling.scale_stiffness(body.stiffness)))
    kernel = bind_body(Tabulated(), body)
    whole = assemble(scaled, layout, collocate(scaled, layout), kernel, accuracy, silent)
    assert np.abs(system.frames - np.eye(3)).max() < 1e-12
    load = np.random.default_rng(4).normal(size=system.offset.shape) * np.array([1e7, 1e7, 1e7, 1e-3, 1e-3, 1e3])
    loads = units.fluxes(load).ravel()
    unknowns = np.linalg.solve(whole.matrix, whole.load_matrix @ loads + whole.rhs)
    exact, computed = boundary_fields(layout, units, mesh, unknowns, unknowns, loads), system.recover(load)
    for one, other in ((computed.values, exact.values), (computed.fluxes, exact.fluxes)):
        assert (np.abs(one - other).max(axis=0) <= 1e-9 * np.abs(other).max(axis=0)).all()
