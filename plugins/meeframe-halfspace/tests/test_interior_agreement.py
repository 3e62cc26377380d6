"""Stress, D and B by FFT and by boundary elements agree with second order."""

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace

from meeframe.elements import Quad4
from meeframe.fields import FieldScaling
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.material import library_material
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.system.capabilities import InteriorFields

STIFFNESS = library_material("orthotropic-mee").stiffness
FACTORS = FieldScaling.of(STIFFNESS).factors
POINTS = np.array([[0.0, 0.0, -0.5], [0.4, -0.3, -0.7], [-0.8, 0.2, -1.2]])


def fluxes(formulation, divisions):
    """Return scaled stress, D and B at the points under a smooth load in all fields on a coupled half space."""
    body = Body(STIFFNESS, half_space_mesh(16.0, 2.4, divisions, 8, Quad4()), (), "contact")
    system = formulation.reduce(body)
    squared = (system.points[:, :2] ** 2).sum(axis=1)
    load = np.outer(np.maximum(1.0 - squared, 0.0) ** 1.5, [0.3, -0.2, -1.0, 0.5, -0.4]) / FACTORS
    return system.capability(InteriorFields).evaluate(load, POINTS).fluxes * FACTORS


@pytest.mark.full
def test_boundary_elements_converge_to_the_half_space():
    """Differences decrease with the square of the element size and nearly vanish after extrapolation."""
    coarse, fine = (fluxes(DenseBEM(), divisions) - fluxes(HalfSpace(), divisions) for divisions in (10, 16))
    size = np.abs(fluxes(HalfSpace(), 16)).max()
    assert np.abs(coarse).max() / np.abs(fine).max() > 2.1
    extrapolated = fine + (fine - coarse) / ((16 / 10) ** 2 - 1.0)
    assert np.abs(extrapolated).max() < 5e-3 * size
