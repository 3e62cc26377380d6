"""Test semi-infinite bodies with dense boundary elements."""

from dataclasses import replace

import numpy as np
import pytest

from meeframe.common.errors import MeshError
from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem, resultant
from meeframe.elements import Quad4, Quad8, Tri3
from meeframe.elements.quadrature import element_rule
from meeframe.fields import FieldScaling
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.formulations.dense_bem.half_space import exterior_terms
from meeframe.greens import LineIntegral
from meeframe.laws import Signorini, StepConductivity
from meeframe.material import library_material, rotation_about
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.mesh import Grading, check_mesh, half_space_mesh
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.solvers import StoppingCriteria, Uzawa, solve
from meeframe.testing.closed_forms import CONDITIONS, Sphere, indent

TRANSVERSELY_ISOTROPIC = library_material("batio3-cofe2o4")
TRICLINIC = library_material("orthotropic-mee").rotated(rotation_about((1.0, 2.0, 0.5), 0.8))


@pytest.mark.parametrize("element", [Quad4(), Quad8(), Tri3()], ids=lambda e: e.name)
def test_exterior_terms_differ_by_the_integral_between_outlines(element):
    """The traction kernel of the material does not vanish in the plane."""
    stiffness = TRICLINIC.stiffness
    kernel = LineIntegral().bind(FieldScaling.of(stiffness).scale_stiffness(stiffness))
    whole = half_space_mesh((3.0, 2.0), 1.0, 2, 2, element, Grading(2.0))
    block = whole.blocks[0]
    inner = block.connectivity[block.groups == 0]
    part = replace(whole, blocks=(replace(block, connectivity=inner, groups=block.groups[block.groups == 0]),))
    position = np.array([0.13, -0.07, 0.0])
    between = np.zeros((5, 5))
    for nodes in whole.points[block.connectivity[block.groups == 1]]:
        rule = element_rule(element, nodes, position, 1e-11)
        _, t = kernel.evaluate(rule.positions - position, rule.normals)
        between += np.einsum("m,mjk->jk", rule.measures, t)
    terms = [exterior_terms(kernel, mesh, position[None])[0].reshape(5, 5) for mesh in (part, whole)]
    assert np.abs(between).max() > 1e-3
    np.testing.assert_allclose(terms[1] - terms[0], between, atol=1e-9)


@pytest.fixture(scope="module")
def system():
    mesh = half_space_mesh(0.1, 0.005, 12, 6, Quad4())
    return DenseBEM().reduce(Body(TRANSVERSELY_ISOTROPIC.stiffness, mesh, (), "contact"))


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("condition", list(CONDITIONS))
def test_sphere_on_a_half_space(condition, system):
    electric, magnetic = (np.inf if potential is not None else 0.0 for potential in CONDITIONS[condition])
    gap = (system.points[:, 0] ** 2 + system.points[:, 1] ** 2) / 0.2 - 5e-5
    zero = np.zeros((len(gap), 2))
    laws = Signorini(), flux_channels(StepConductivity(electric), StepConductivity(magnetic))
    solution = solve(ContactProblem(system, *laws, gap, zero, zero), Uzawa(), StoppingCriteria())
    force, (charge, flux) = resultant(system, solution.state.load)
    exact = indent(axisymmetric_compliance(TRANSVERSELY_ISOTROPIC.stiffness), Sphere(0.1), 5e-5, *CONDITIONS[condition])
    assert -force[2] == pytest.approx(exact.force, rel=0.01)
    assert charge == pytest.approx(exact.charge, rel=0.01)
    assert flux == pytest.approx(exact.magnetic_flux, rel=0.01)


def test_traction_outside_the_zone_displaces_it():
    mesh = half_space_mesh(0.1, 0.005, 4, 4, Quad4())
    condition = BoundaryCondition("top", 0, "flux", 1e6)
    system = DenseBEM().reduce(Body(TRANSVERSELY_ISOTROPIC.stiffness, mesh, (condition,), "contact"))
    assert np.all(system.offset[:, 0] > 0), "a shear traction along x1 around the zone carries it along"
    mirrored = np.lexsort((-system.points[:, 1], system.points[:, 0])), np.lexsort(system.points.T[[1, 0]])
    np.testing.assert_allclose(
        system.offset[mirrored[0], 1], -system.offset[mirrored[1], 1], atol=1e-9 * system.offset[:, 0].max()
    )


def test_half_space_must_be_plane():
    mesh = half_space_mesh(0.1, 0.005, 4, 2, Quad4())
    check_mesh(mesh)
    bent = mesh.points.copy()
    bent[0, 2] += 1e-4
    with pytest.raises(MeshError, match="the boundary of a half space is not plane"):
        check_mesh(replace(mesh, points=bent))
    with pytest.raises(MeshError, match="not closed"):
        check_mesh(replace(mesh, semi_infinite=False))
