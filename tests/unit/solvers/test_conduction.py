"""The step law would switch nodes at the contact edge for ever; biactive nodes resolve it
(docs/explanation/solvers.md)."""

from dataclasses import dataclass, replace
from typing import ClassVar, final

import numpy as np
import pytest

from meeframe.contact import conduction
from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem, Status, contact_gap, resultant
from meeframe.fields import Array
from meeframe.laws import StepConductivity
from meeframe.laws.base import ConductivityLaw, contact_conductivity
from meeframe.material import library_material
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.solvers import Uzawa, residual, solve
from meeframe.testing.half_space import half_space_system, indentation_problem

XI = axisymmetric_compliance(library_material("batio3-cofe2o4").stiffness)
# piezomagnetic coupling as strong as in Table 3: perfect magnetic conduction reduces the force by 57 per cent
XI[0, 2] = XI[2, 0] = np.sqrt(1.326 * XI[0, 0] * -XI[2, 2])
CHARACTERISTIC = 1.0 / (-XI[2, 2] * np.sqrt(0.1 * 5e-5))


def problem(factor: float, cells: int = 16) -> ContactProblem:
    system = half_space_system(XI, 5e-3, cells)
    height = (system.points[:, 0] ** 2 + system.points[:, 1] ** 2) / 0.2
    return indentation_problem(system, height, 5e-5, conductivity=(0.0, factor * CHARACTERISTIC))


def test_edge_nodes_become_biactive() -> None:
    case = problem(1.0)
    solution = solve(case, Uzawa())
    state = solution.state
    assert solution.status is Status.CONVERGED
    assert residual(case, state) <= 1e-10
    biactive = (state.contact_fraction > 0.0) & (state.contact_fraction < 1.0)
    assert biactive.any()
    pressure = np.abs(state.load[:, 2]).max()
    assert np.abs(state.load[biactive, 2]).max() < 1e-9 * pressure
    assert np.abs(contact_gap(case, state.displacement)[biactive, 2]).max() < 1e-9 * 5e-5
    assert ((state.contact_fraction == 1.0) == (state.load[:, 2] < -1e-9 * pressure))[~biactive].all()


@pytest.mark.full
def test_force_decreases_monotonically_to_less_than_half() -> None:
    """All conductivities converge, including both limits."""
    forces = []
    for factor in (0.0, 1e-3, 1e-2, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0, np.inf):
        case = problem(factor, 12)
        solution = solve(case, Uzawa())
        assert solution.status is Status.CONVERGED, (factor, solution.message)
        forces.append(-resultant(case.system, solution.state.load)[0][2])
    assert (np.diff(forces) < 0.0).all()
    # closed form: P xi_eff is the same for both, with xi_eff = xi11 - xi13^2/xi33
    assert forces[-1] / forces[0] == pytest.approx(1.0 / 2.326, rel=1e-3)


@pytest.mark.full
def test_fractions_do_not_depend_on_the_path() -> None:
    case = problem(0.3)
    direct = solve(case, Uzawa())
    above = solve(case, Uzawa(), start=solve(problem(np.inf), Uzawa()).state)
    small_step = solve(case, Uzawa(step_normal=1e13))
    assert direct.status is above.status is small_step.status is Status.CONVERGED
    for other in (above, small_step):
        assert other.state.contact_fraction == pytest.approx(direct.state.contact_fraction, abs=1e-6)
        assert other.state.load == pytest.approx(direct.state.load, rel=1e-6, abs=10.0)


def test_resistances() -> None:
    case = problem(2.0, cells=4)
    n = 16
    compliance = conduction.potential_diagonal(case)
    traction = np.full(n, -1.0)
    kappa = contact_conductivity(case.law_of("magnetic"), traction)[0]
    contact_fraction = np.linspace(0.0, 1.0, n)
    resistance = conduction.resistances(case, traction, contact_fraction, compliance)
    assert np.isinf(resistance[:, 0]).all()
    assert np.isinf(resistance[0, 1])
    assert resistance[-1, 1] == 1.0 / kappa
    assert (np.diff(resistance[1:, 1]) < 0.0).all()
    assert resistance[1:, 1] == pytest.approx(
        (1.0 / kappa + compliance[1:, 1]) / contact_fraction[1:] - compliance[1:, 1]
    )
    perfect = conduction.resistances(problem(np.inf, cells=4), traction, contact_fraction, compliance)
    assert perfect[-1, 1] == 0.0
    assert perfect[1:, 1] == pytest.approx((1.0 / contact_fraction[1:] - 1.0) * compliance[1:, 1])


def test_graph_as_a_fixed_point() -> None:
    """The fraction is one under pressure, zero across a gap and arbitrary at biactive nodes, whatever its initial
    value."""
    for before, trial, after in ((1.0, -2.0, 1.0), (0.3, -2.0, 1.0), (0.3, 2.0, 0.0), (0.0, 2.0, 0.0), (0.4, 0.0, 0.4)):
        assert conduction.switch(np.array([before]), np.array([trial]), 1.0)[0] == after


def test_law_without_conductivity_across_the_gap_insulates_open_nodes() -> None:
    assert contact_conductivity(StepConductivity(np.inf), np.array([conduction.MIN_TRACTION, 0.0])).tolist() == [
        np.inf,
        0.0,
    ]


@pytest.mark.full(except_for=3)
@pytest.mark.parametrize("potential", [0.1, 0.3, 0.5])
@pytest.mark.parametrize("coupling", [0.8, 1.6])
def test_potential_that_opens_the_contact(potential: float, coupling: float) -> None:
    """The potential repels the surface where it conducts, so at first the whole contact opens and closes."""
    xi = np.diag([1.0, 1.0, 1.0, -0.5, -0.5])
    xi[2, 4] = xi[4, 2] = coupling
    system = half_space_system(xi, 2.0, 7)
    height = 0.5 * (system.points[:, 0] ** 2 + system.points[:, 1] ** 2)
    case = indentation_problem(system, height, 0.3, conductivity=(0.0, np.inf), potentials=(0.0, potential))
    solver = Uzawa()
    iterate = solver.init(case, None)
    loaded = []
    for _ in range(12):
        iterate = solver.step(case, iterate)
        loaded.append(bool((iterate.load[:, 2] < 0.0).any()))
    assert not all(loaded)
    solution = solve(case, solver)
    assert solution.status is Status.CONVERGED, solution.message
    assert solution.state.load[:, 2].min() < 0.0


@final
@dataclass(frozen=True)
class Discharge(ConductivityLaw):
    """kappa is `low`, and `high` for the part of the drop above one."""

    across_gap: ClassVar[bool] = True

    low: float
    high: float

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        size = np.abs(drop)
        excess = np.maximum(size - 1.0, 0.0)
        return self.low + self.high * np.divide(excess, size, out=np.zeros_like(size), where=size > 0.0)


@pytest.mark.parametrize("steepness", [1.0, 1e3, 1e6, 1e9])
def test_drop_and_conductivity_are_solved_together(steepness: float) -> None:
    """The law conducts weakly below a drop and strongly above; the root of each piece has a closed form."""
    case = problem(0.0, cells=8)
    n, compliance = len(case.gap), conduction.potential_diagonal(case)
    laws = [Discharge(0.3 / size, steepness / size) for size in compliance[0]]
    case = replace(case, channels=flux_channels(laws[0], laws[1]), gap=np.full(n, 1e-6))
    alone = np.logspace(-3, 5, n)
    relative_displacement = np.zeros((n, 5))
    relative_displacement[:, 3:] = alone[:, None]
    resistance = conduction.resistances(case, np.zeros(n), np.zeros(n), compliance, relative_displacement) / compliance
    left = np.where(alone < 1.3, alone / 1.3, (alone + steepness) / (1.3 + steepness))
    for column in resistance.T:
        np.testing.assert_allclose(alone * column / (1.0 + column), left, rtol=1e-9)
