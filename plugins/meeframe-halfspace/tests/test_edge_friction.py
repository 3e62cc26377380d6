"""The work of friction is correct under an indenter whose edge lies between the nodes."""

import pytest
from meeframe_halfspace import HalfSpace

from meeframe.elements import Quad4
from meeframe.indenters import FlatPunch
from meeframe.laws import IsotropicCoulomb
from meeframe.material import library_material
from meeframe.mesh import half_space_mesh
from meeframe.model.case import Case
from meeframe.model.solve import solve_case
from meeframe.model.step import Step
from meeframe.results.resultants import resultants

FORCE, FRICTION, WAY = 100.0, 0.3, 1e-3


@pytest.mark.parametrize("edges", ["resolved", "nodes"])
def test_sliding_punch_dissipates_friction_times_distance(edges):
    """In full slip the deformation is constant; nodes outside the indenter edge that carry pressure contribute to the
    work."""
    mesh = half_space_mesh(1.6e-2, 4e-3, 23, 1, Quad4())
    material = library_material("isotropic", young_modulus=210e9, poisson_ratio=0.3)
    slides = (Step(normal_force=FORCE), Step(translation=(WAY, 0.0)), Step(translation=(2.0 * WAY, 0.0)))
    rules = {"contact_law": IsotropicCoulomb(FRICTION), "formulation": HalfSpace(edges=edges)}
    result = solve_case(Case(material, mesh, (), FlatPunch(1e-3), slides, **rules))
    totals = [resultants(result.zone, step) for step in result.steps]
    assert totals[1].dissipated_energy < FRICTION * FORCE * WAY
    assert totals[2].dissipated_energy == pytest.approx(FRICTION * FORCE * WAY, rel=1e-6)
