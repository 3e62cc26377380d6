"""Contact on a power-law graded half space: pressure, radius and force of a sphere in closed form."""

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace

import meeframe
from meeframe.testing.closed_forms_layers import SphereOnPowerLaw

UM = 1e-6


@pytest.mark.full
def test_sphere_on_a_power_law_half_space():
    """Radius and pressure of the contact, and the exponents of force and pressure.

    The layer is forty times as thick as the contact is wide.
    """
    k, radius, approaches = 0.4, 10 * UM, np.array([10e-9, 20e-9])
    glass = {"name": "isotropic", "young_modulus": "70 GPa", "poisson_ratio": 0.3}
    grading = {"law": "power", "exponent": k, "tolerance": 3e-3}
    result = meeframe.Case(
        material=glass,
        layers=[meeframe.Layer(glass, 20 * UM, grading=grading)],
        mesh=meeframe.mesh.half_space(1.2 * UM, 24),
        formulation=HalfSpace(matrix_up_to=0),
        indenter=meeframe.Sphere(radius),
        steps=[meeframe.Step(approach=float(approach)) for approach in approaches],
    ).solve(progress=False)
    first, second = totals = [meeframe.resultants(result.zone, step) for step in result]
    exact = [SphereOnPowerLaw(k, radius, float(approach)) for approach in approaches]
    contact_radii = np.array([one.contact_radius for one in exact])
    np.testing.assert_allclose([np.sqrt(one.contact_area / np.pi) for one in totals], contact_radii, rtol=0.01)
    exponent = np.log(second.normal_force / first.normal_force) / np.log(contact_radii[1] / contact_radii[0])
    assert exponent == pytest.approx(3.0 + k, abs=0.02)
    r = np.hypot(*result.zone.points[:, :2].T)
    inside = 1.0 - (r / contact_radii[1]) ** 2
    chosen = inside > 0.1
    pressure = -result[-1].traction[chosen, 2]
    slope, _ = np.polyfit(np.log(inside[chosen]), np.log(pressure), 1)
    assert slope == pytest.approx(0.5 * (1.0 + k), abs=0.02)
    expected = exact[1].pressure(r, second.normal_force)
    np.testing.assert_allclose(pressure, expected[chosen], atol=0.02 * expected.max())
