"""Finite elements with heat: exact fields, recovery, and the heated indentation of a half space."""

from dataclasses import replace

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace
from meeframe_hmatrix import HierarchicalBEM
from meeframe_skfem import FiniteElements
from meeframe_skfem.interior import FiniteElementInterior

from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem, ContactState, PrescribedResultant, Status
from meeframe.elements import Quad4, Quad9
from meeframe.fields import FieldSet
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.laws import Insulating, Signorini, StepConductivity
from meeframe.material import Material, library_material, rotation_about
from meeframe.mesh import block_mesh, half_space_mesh
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.solvers import Auto, StoppingCriteria, solve
from meeframe.system.reduced import ReducedSystem
from meeframe.testing.capabilities import check_capabilities
from meeframe.testing.manufactured import ThermalField, prescribe, with_heat

CONDUCTIVITY = np.array([[3.0, 0.4, -0.2], [0.4, 2.5, 0.5], [-0.2, 0.5, 4.0]])
MATERIAL = (
    library_material("orthotropic-mee")
    .with_heat(CONDUCTIVITY, [1.2e-5, 2e-5, 0.8e-5], None, [2e-5, -1e-5, -7e-5], [1e-4, 2e-4, -3e-4], "strain")
    .rotated(rotation_about([1.0, 2.0, 3.0], 0.7))
)
SIDES = ("top", "side_x-", "side_x+", "side_y-", "side_y+")


def test_heated_block_expands_freely() -> None:
    """Uniform heating with every face but the base free: linear fields, exact, without stress and fluxes."""
    field = ThermalField(MATERIAL, 50.0, np.zeros(3))
    assert np.abs(field.fluxes(np.zeros((1, 3)), np.eye(3)[:1])).max(axis=0)[:3].max() < 1e-4
    mesh = block_mesh(0.5, 0.8, 0.5, 2, 1, 2, Quad4())
    body = prescribe(mesh, field, MATERIAL.stiffness, {"base": "vvvvvv", **dict.fromkeys(SIDES, "ffffff")})
    body = replace(with_heat(body, MATERIAL), contact_group="contact")
    system = FiniteElements().reduce(body)
    exact = field.values(system.points)
    signs = np.array([1.0, 1.0, 1.0, -1.0, -1.0, -1.0])
    local = np.column_stack([np.einsum("nai,ni->na", system.frames, exact[:, :3]), exact[:, 3:]]) * signs
    assert (np.abs(system.offset - local).max(axis=0) <= 1e-8 * np.abs(exact).max(axis=0)).all()
    recovered = system.recover(np.zeros_like(system.offset))
    size = np.abs(MATERIAL.thermal_moduli).max(axis=0) * 50.0
    assert (np.abs(recovered.fluxes[:, :5]).max(axis=0) <= 1e-7 * size).all()
    # a load on the zone adds its own response, of all fields
    load = np.random.default_rng(1).normal(size=system.offset.shape) * np.array([1e6, 1e6, 1e6, 1e-3, 1e-3, 1e3])
    whole = system.recover(load)
    zone = np.array([np.abs(whole.points - point).sum(axis=1).argmin() for point in system.points])
    response = system.offset + system.apply(load)
    local = (
        np.column_stack([np.einsum("nai,ni->na", system.frames, whole.values[zone, :3]), whole.values[zone, 3:]])
        * signs
    )
    assert (np.abs(local - response).max(axis=0) <= 1e-8 * np.abs(response).max(axis=0)).all()
    check_capabilities(system)


def test_linear_temperature_is_exact_with_quadratic_elements() -> None:
    """Quadratic displacements and potentials, with temperatures or heat fluxes prescribed on the sides."""
    field = ThermalField(MATERIAL, 20.0, np.array([30.0, -40.0, 25.0]))
    kinds = {"base": "vvvvvv", "top": "ffffff", "side_x-": "fffffv", "side_x+": "vvvvvf"}
    kinds |= {"side_y-": "vvvvvf", "side_y+": "ffffff"}
    mesh = block_mesh(0.5, 0.8, 0.5, 2, 1, 2, Quad9())
    body = prescribe(mesh, field, MATERIAL.stiffness, kinds)
    body = replace(with_heat(body, MATERIAL), contact_group="contact")
    solution = FiniteElements().solve(body)
    zone, points = solution.matched.zone, solution.matched.volume.points
    load = field.fluxes(zone.points, np.tile([0.0, 0.0, 1.0], (len(zone.points), 1)))
    computed, exact = solution.values(load), field.values(points)
    assert (np.abs(computed - exact).max(axis=0) <= 1e-8 * np.abs(exact).max(axis=0)).all()
    inside = np.array([[0.05, 0.1, -0.3], [-0.2, 0.15, -0.05]])
    stress = FiniteElementInterior(solution).evaluate(load, inside).fluxes[:, 2, :5]
    exact = field.fluxes(inside, np.tile([0.0, 0.0, 1.0], (2, 1)))[:, :5]
    size = np.abs(MATERIAL.thermal_moduli).max(axis=0) * 40.0
    assert (np.abs(stress - exact).max(axis=0) <= 1e-8 * size).all()


@pytest.mark.full
def test_hot_sphere_on_a_large_block_and_a_half_space() -> None:
    """Under a prescribed force, pressure and heat of a block much larger than the contact are those of a half space.

    Its finite size changes them by about the ratio of the contact radius to its size; the level is its own. Finite and
    boundary elements agree about the motion of the sphere due to its heat, too, and hierarchical matrices with dense
    ones.
    """
    material = Material.isotropic(2e11, 0.3).with_heat(40.0, 1.2e-5)
    width, count, size, force = 2.6e-3, 8, 15e-3, 1.2e3
    block = block_mesh(size, size, width, (count, count), 4, 6, Quad4())
    grounded = tuple(BoundaryCondition("base", field, "value") for field in range(6))
    bodies = {
        HalfSpace(): Body.of(material, half_space_mesh(0.1, width, (count, count), 1, Quad4()), (), "contact"),
        FiniteElements(growth=1.8): Body.of(material, block, grounded, "contact"),
        DenseBEM(): Body.of(material, block, grounded, "contact"),
        HierarchicalBEM(): Body.of(material, block, grounded, "contact"),
    }
    pressures, heats, growths = [], [], []
    for formulation, body in bodies.items():
        system = formulation.reduce(body)
        hot, cold = (indentation(system, material.fields, 0.1, force, temperature) for temperature in (300.0, 0.0))
        pressures.append(-hot.load[:, 2].min())
        heats.append(hot.load[:, 5] @ system.weights)
        growths.append(cold.motion[0] - hot.motion[0])
    exact, finite, boundary, hierarchical = range(4)
    assert heats[finite] == pytest.approx(heats[exact], rel=0.02)
    assert heats[boundary] == pytest.approx(heats[exact], rel=0.01)
    assert heats[boundary] == pytest.approx(heats[finite], rel=0.015)
    assert pressures[finite] == pytest.approx(pressures[exact], rel=0.01)
    assert pressures[boundary] == pytest.approx(pressures[exact], rel=0.005)
    assert growths[boundary] == pytest.approx(growths[finite], rel=0.03)
    for values in (heats, pressures, growths):
        assert values[hierarchical] == pytest.approx(values[boundary], rel=1e-3)
    hertz = 1.5 * force / (np.pi * (0.75 * force * 0.1 / (2e11 / 0.91)) ** (2.0 / 3.0))
    assert pressures[exact] > 1.02 * hertz  # heat matters


def indentation(
    system: ReducedSystem, fields: FieldSet, radius: float, force: float, temperature: float
) -> ContactState:
    """Return the state under a sphere of a temperature that is pressed on a body by a force, with good conductance."""
    gap = (system.points[:, :2] ** 2).sum(axis=1) / (2.0 * radius)
    mode = np.zeros_like(system.offset)
    mode[:, 2] = -1.0
    pressed = PrescribedResultant(mode, mode, system.weights, force)
    laws = flux_channels(Insulating(), Insulating(), StepConductivity(1e5), fields=fields)
    given = np.tile([0.0, 0.0, temperature], (len(gap), 1))
    problem = ContactProblem(system, Signorini(), laws, gap, np.zeros((len(gap), 2)), given, (pressed,))
    solution = solve(problem, Auto(), StoppingCriteria(tolerance=1e-9))
    assert solution.status is Status.CONVERGED, solution.message
    return solution.state
