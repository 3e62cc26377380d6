"""A further scalar field, defined here, crosses the whole framework: a decoupled potential obeying Laplace's equation.

Added to a magneto-electro-elastic body, it changes none of the other fields, and itself is what it is alone.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace

from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem, ContactState, Status
from meeframe.elements import Quad4
from meeframe.fields import MECHANICAL, MEE, POTENTIALS, Array, FieldSet, ScalarField
from meeframe.formulations.base import Formulation
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.laws import IsotropicCoulomb, Signorini, StepConductivity
from meeframe.material import Material, library_material
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.solvers import Auto, StoppingCriteria, solve
from meeframe.system.reduced import ReducedSystem

HEAT = ScalarField(
    name="thermal",
    value_name="temperature",
    value_unit="K",
    flux_name="heat_flux",
    flux_unit="W/m^2",
    resultant="heat",
    resultant_unit="W",
    coefficient="thermal_conductivity",
    coefficient_unit="W/m/K",
    conductance_unit="W/m^2/K",
    strength_unit="K/m",
)
CONDUCTIVITY = np.array([[3.0, 0.2, 0.0], [0.2, 2.5, 0.1], [0.0, 0.1, 3.5]])
LAWS = StepConductivity(1e-5), StepConductivity(0.4)
KAPPA = 700.0
POTENTIAL = 12.0
FORMULATIONS: dict[str, Formulation] = {
    "half-space": HalfSpace(matrix_up_to=0),
    "half-space with a matrix": HalfSpace(matrix_up_to=10_000),
    "dense-bem": DenseBEM(quadrature_tolerance=1e-8),
}
CRITERIA = StoppingCriteria(tolerance=1e-11)


def reduced(formulation: Formulation, stiffness: Array, fields: FieldSet) -> ReducedSystem:
    cells = 6 if isinstance(formulation, DenseBEM) else 15
    mesh = half_space_mesh((0.1, 0.1), (0.005, 0.005), (cells, cells), 3, Quad4())
    return formulation.reduce(Body(stiffness, mesh, (), "contact", fields))


def indentation(
    system: ReducedSystem, fields: FieldSet, laws: Any, potentials: Any, drag: float = 0.0
) -> ContactProblem:
    x, y = system.points[:, :2].T
    gap = (x**2 + y**2) / 0.2 - 2e-5
    law = IsotropicCoulomb(0.3) if drag else Signorini()
    slid = np.tile([drag, 0.0], (len(gap), 1))
    return ContactProblem(
        system, law, flux_channels(*laws, fields=fields), gap, slid, np.tile(potentials, (len(gap), 1))
    )


def solved(problem: ContactProblem) -> ContactState:
    solution = solve(problem, Auto(), CRITERIA)
    assert solution.status is Status.CONVERGED, solution.message
    return solution.state


def equal(one: Array, other: Array, tolerance: float = 1e-7) -> None:
    np.testing.assert_allclose(one, other, rtol=0.0, atol=tolerance * np.abs(other).max(initial=1e-300))


@pytest.mark.parametrize("drag", [0.0, 3e-6], ids=["frictionless", "friction"])
@pytest.mark.parametrize("name", FORMULATIONS)
def test_three_channels_are_two_and_a_scalar_alone(name: str, drag: float) -> None:
    """The scalar alone is the electric potential of a body without coupling and with its coefficient as permittivity.

    It crosses the contact that the coupled body makes: what is compared with has the gap and the law of that contact.
    """
    material = library_material("batio3-cofe2o4")
    warm, formulation = material.with_field(HEAT, CONDUCTIVITY), FORMULATIONS[name]
    fields = warm.fields
    assert fields == FieldSet((*MEE.scalars, HEAT))
    given = 2e3, -3.0
    two = solved(indentation(reduced(formulation, material.stiffness, MEE), MEE, LAWS, given, drag))
    system = reduced(formulation, warm.stiffness, fields)
    laws = (*LAWS, StepConductivity(KAPPA))
    three = solved(indentation(system, fields, laws, (*given, POTENTIAL), drag))
    for column in range(MEE.size):
        equal(three.load[:, column], two.load[:, column])
        equal(three.displacement[:, column], two.displacement[:, column])
    equal(three.contact_fraction, two.contact_fraction, 1e-5)
    closed = three.load[:, 2] < 0.0
    assert 5 < closed.sum() < len(closed)

    other = replace(Material.isotropic(2e11, 0.3), permittivity=CONDUCTIVITY)
    alone = reduced(formulation, other.stiffness, MEE)
    flux = np.zeros((len(closed), MEE.size))
    flux[:, 3] = three.load[:, -1]
    equal(three.displacement[:, -1], alone.offset[:, 3] + alone.apply(flux)[:, 3], 1e-8)
    drop = -three.displacement[:, -1] - POTENTIAL
    equal(three.load[:, -1], np.where(closed, KAPPA * drop, 0.0))
    assert np.abs(three.load[:, -1]).max() > 0.1 * KAPPA * POTENTIAL


@pytest.mark.parametrize("name", FORMULATIONS)
def test_a_field_set_may_have_one_scalar_alone(name: str) -> None:
    """Elastic contact that conducts heat: the same with the scalar after the two of the default set, which rest."""
    elastic = Material.isotropic(2e11, 0.3).with_field(HEAT, CONDUCTIVITY)
    columns = [0, 1, 2, 5]
    stiffness = np.ascontiguousarray(elastic.stiffness[:, columns][:, :, columns])
    fields, formulation = FieldSet((HEAT,)), FORMULATIONS[name]
    one = solved(indentation(reduced(formulation, stiffness, fields), fields, [StepConductivity(KAPPA)], (POTENTIAL,)))
    system = reduced(formulation, elastic.stiffness, elastic.fields)
    laws = [StepConductivity(kappa) for kappa in (0.0, 0.0, KAPPA)]
    three = solved(indentation(system, elastic.fields, laws, (0.0, 0.0, POTENTIAL)))
    equal(one.load, three.load[:, columns])
    equal(one.displacement[:, MECHANICAL], three.displacement[:, MECHANICAL])
    equal(one.displacement[:, POTENTIALS], three.displacement[:, 5:])
    assert one.load[:, 3].any()
