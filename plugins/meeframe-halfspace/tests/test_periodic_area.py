"""Test contact on periodic surfaces: area, and edges between nodes, wherever the contact lies."""

from dataclasses import dataclass

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace

from meeframe.elements import Quad4
from meeframe.fields import Array
from meeframe.indenters.base import Indenter
from meeframe.laws import StepConductivity
from meeframe.material import library_material, rotation_about
from meeframe.material.half_space import surface_compliance
from meeframe.mesh import half_space_mesh
from meeframe.model.case import Case
from meeframe.model.solve import solve_case
from meeframe.model.step import Step
from meeframe.results.resultants import Resultants, resultants

PERIOD, AMPLITUDE, NODES = 1e-3, 1e-6, 32
MEDIUM = library_material("orthotropic-mee").rotated(rotation_about([1, 2, 3], 0.7))


@dataclass(frozen=True)
class Wave(Indenter):
    """Waves along x with a crest at `crest` [m]."""

    crest: float

    def height(self, x: Array, y: Array) -> Array:
        height: Array = AMPLITUDE * (1.0 - np.cos(2.0 * np.pi * (x - self.crest) / PERIOD))
        return height


def press(crest: float, force: float, edges: str) -> Resultants:
    mesh = half_space_mesh(8.0 * PERIOD, PERIOD * (1.0 - 1.0 / NODES), NODES - 1, 1, Quad4())
    formulation = HalfSpace(periodic=True, edges=edges)  # type: ignore[arg-type]
    case = Case(MEDIUM, mesh, (), Wave(crest), (Step(normal_force=force),), formulation=formulation)
    result = solve_case(case)
    return resultants(result.zone, result.steps[-1])


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("share", [0.2, 0.7, 1.01])
def test_westergaard_is_independent_of_position(share: float) -> None:
    """p/p* = sin^2(pi a/lambda), p* = pi E* amplitude/lambda, 1/E* = Re Y_33/2 for any medium, to one row of nodes."""
    modulus = 2.0 / surface_compliance(MEDIUM.stiffness, [0.0, 0.0, 1.0], [[1.0, 0.0, 0.0]])[0, 2, 2].real
    force = share * np.pi * modulus * AMPLITUDE / PERIOD * PERIOD**2
    exact = 2.0 / np.pi * np.arcsin(np.sqrt(min(share, 1.0)))
    areas = [press(shift * PERIOD / NODES, force, "nodes").contact_area / PERIOD**2 for shift in (0.0, 5.0, 15.0)]
    np.testing.assert_allclose(areas, areas[0], rtol=1e-12)
    assert areas[0] == pytest.approx(exact, abs=0.0 if share > 1.0 else 1.0 / NODES, rel=1e-12)


@dataclass(frozen=True)
class PeriodicSphere(Indenter):
    """A paraboloid in each period, centred at x, y [m] in the middle one."""

    x: float
    y: float

    def height(self, x: Array, y: Array) -> Array:
        near = [np.mod(along + PERIOD / 2.0, PERIOD) - PERIOD / 2.0 for along in (x - self.x, y - self.y)]
        height: Array = (near[0] ** 2 + near[1] ** 2) / 0.02
        return height


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("position", [(16, 0), (16, 16), (13, -5)])
def test_resolved_edges_cross_the_border_of_the_period(position: tuple[int, int]) -> None:
    """Charge and area equal those of the same contact in the middle of the zone."""
    (charge, area), computed = (
        (totals.charge, totals.contact_area)
        for totals in (conducting(PeriodicSphere(*(PERIOD / NODES * np.array(at)))) for at in ((0, 0), position))
    )
    assert computed == pytest.approx((charge, area), rel=1e-8)


@dataclass(frozen=True)
class PeriodicPunch(Indenter):
    """A flat disc of a radius [m] in each period, centred at x, y [m] in the middle one."""

    x: float
    y: float
    radius: float

    def height(self, x: Array, y: Array) -> Array:
        near = [np.mod(along + PERIOD / 2.0, PERIOD) - PERIOD / 2.0 for along in (x - self.x, y - self.y)]
        height: Array = np.where(near[0] ** 2 + near[1] ** 2 < self.radius**2, 0.0, np.inf)
        return height


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(("position", "radius"), [((16, 0), 7.4), ((7, 9), 7.4), ((7, 9), 8.1)])
def test_indenter_edges_cross_the_border_of_the_period(position: tuple[int, int], radius: float) -> None:
    """Charge and area equal those of the same punch in the middle of the zone."""
    spacing = PERIOD / NODES
    (charge, area), computed = (
        (totals.charge, totals.contact_area)
        for totals in (
            conducting(PeriodicPunch(*(spacing * np.array(at)), radius * spacing)) for at in ((0, 0), position)
        )
    )
    assert computed == pytest.approx((charge, area), rel=1e-8)


def conducting(indenter: Indenter) -> Resultants:
    mesh = half_space_mesh(8.0 * PERIOD, PERIOD * (1.0 - 1.0 / NODES), NODES - 1, 1, Quad4())
    case = Case(
        material=library_material("batio3-cofe2o4"),
        mesh=mesh,
        conditions=(),
        indenter=indenter,
        steps=(Step(normal_force=5.0, scalars={"electric_potential": 500.0}),),
        conductivity={"electric": StepConductivity(np.inf)},
        formulation=HalfSpace(periodic=True, edges="resolved"),
    )
    result = solve_case(case)
    return resultants(result.zone, result.steps[-1])
