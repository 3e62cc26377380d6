"""Conductivities that depend on gap and drop: the linearisation agrees with differences, and solvers agree."""

from dataclasses import dataclass, replace
from typing import ClassVar, final

import numpy as np
import pytest

from meeframe.contact.channels import flux_channels
from meeframe.contact.conduction import potential_diagonal
from meeframe.contact.problem import AT_REST, ContactProblem, Status
from meeframe.fields import Array
from meeframe.laws import IsotropicCoulomb, Signorini
from meeframe.laws.base import ConductivityLaw
from meeframe.solvers import BarzilaiBorwein, Nesterov, SemismoothNewton, solve
from meeframe.solvers.newton.residual import ContactResidual
from meeframe.testing.force_control import balanced_solution, check_same, released

RANDOM = np.random.default_rng(11)
CELLS = 8


@final
@dataclass(frozen=True)
class Plates(ConductivityLaw):
    """kappa / (1 + gap / distance) (1 + (drop / strength)^2), smooth with slopes of both signs.

    `pressed` adds (kappa (|p| / pressure)^0.5) or 0.
    """

    across_gap: ClassVar[bool] = True

    kappa: float
    distance: float
    strength: float
    pressed: float = 0.0
    pressure: float = 1.0

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        pressure = np.maximum(-normal_traction, 0.0) / self.pressure
        across = self.kappa / (1.0 + gap / self.distance) * (1.0 + (drop / self.strength) ** 2)
        return across + self.pressed * np.sqrt(pressure)


@pytest.fixture
def across(sphere):
    """Return a function that creates sphere problems; `kappa` of the closed gap and field `strength` are in
    characteristic units."""

    def make(law, kappa: float, strength: float, pressed: float = 1.0, **options) -> ContactProblem:
        problem = sphere("orthotropic", law, (1.0, 1.0), cells=CELLS, potentials=(2e4, -15.0), **options)
        compliance, scales = potential_diagonal(problem)[0], ContactResidual.of(problem).scales
        laws = [
            Plates(kappa / o, 0.1 * scales.displacement[2], strength * s, pressed * kappa / o, scales.pressure)
            for o, s in zip(compliance, scales.displacement[3:], strict=True)
        ]
        return replace(problem, channels=flux_channels(laws[0], laws[1]))

    return make


@pytest.mark.parametrize("biactive", [False, True])
@pytest.mark.parametrize("kappa", [0.3, 100.0])
def test_linearisation_is_the_derivative_of_the_residual(across, kappa, biactive) -> None:
    """Nodes are open, in contact and partially conducting; directions are random loads, equation by equation."""
    problem = across(IsotropicCoulomb(0.3), kappa, 0.5)
    equation = ContactResidual.of(problem)
    n = len(problem.gap)
    # loads small enough that some nodes remain open
    load = 0.2 * equation.scales.load * RANDOM.normal(size=(n, 5))
    load[:, 2] = -np.abs(load[:, 2]) * np.where(problem.gap < 0.0, 1.0, 0.01)
    mask = np.zeros(n, bool)
    mask[::3] = biactive
    contact_fraction = np.full(n, 0.5)
    here = equation.at(load, contact_fraction, mask, AT_REST)
    opened, width = here.relative_displacement[:, 2], 1e-6
    assert (opened > 0.1 * problem.law_of("electric").distance).sum() > 5
    step = np.column_stack(
        [equation.scales.load * RANDOM.normal(size=(n, 5)), np.where(mask, RANDOM.normal(size=n), 0.0)]
    )
    forward, backward = (
        equation.at(load + h * step[:, :5], here.contact_fraction + h * step[:, 5], mask, AT_REST)
        for h in (width, -width)
    )
    expected = (forward.residual - backward.residual)[:, 3:5] / (2.0 * width)
    blocks = here.linearise()
    moved = problem.system.apply(step[:, :5])
    got = (np.einsum("nij,nj->ni", blocks.a.dense(6), step) + np.einsum("nij,nj->ni", blocks.b.dense(5), moved))[:, 3:5]
    # the conductivity has a kink at zero gap, and the contact fraction jumps where the trial changes sign
    smooth = (opened * forward.relative_displacement[:, 2] > 0.0) & (
        opened * backward.relative_displacement[:, 2] > 0.0
    )
    smooth &= np.sign(forward.trial[:, 2]) == np.sign(backward.trial[:, 2])
    assert smooth.sum() > n // 2
    np.testing.assert_allclose(got[smooth], expected[smooth], atol=1e-5 * np.abs(expected).max())


def test_slopes_are_resolved_for_small_drops(across) -> None:
    """The law varies on a millionth of the characteristic potential, so finite differences need that resolution."""
    problem = across(Signorini(), 1.0, 1e-6)
    equation = ContactResidual.of(problem)
    law, n = problem.law_of("electric"), len(problem.gap)
    gap = law.distance * 10.0 ** RANDOM.uniform(-6.0, 1.0, n)
    drop, compliance = law.strength * RANDOM.uniform(0.1, 2.0, n), equation.self_compliance[:, 0]
    kappa = law.conductivity(np.zeros(n), gap, drop)
    steeper = kappa + law.kappa / (1.0 + gap / law.distance) * 2.0 * (drop / law.strength) ** 2
    relative_displacement = np.zeros((n, 5))
    # without its flux, a node has the drop (1 + c kappa) v, of which v remains
    relative_displacement[:, 2], relative_displacement[:, 3] = gap, (1.0 + compliance * kappa) * drop
    by_gap, by_drop = equation.transmissivity.gap_slopes(np.zeros(n), relative_displacement, np.zeros(n))
    left = 1.0 / (1.0 + compliance * steeper)
    change = -compliance * left / (1.0 + compliance * kappa)
    np.testing.assert_allclose(by_gap[:, 0], change * kappa / (law.distance + gap), rtol=1e-6)
    np.testing.assert_allclose(
        by_drop[:, 0], (drop / relative_displacement[:, 3] - left) / relative_displacement[:, 3], rtol=1e-6
    )


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(("kappa", "strength"), [(0.1, 1.0), (1.0, 0.1), (30.0, 0.3)])
@pytest.mark.parametrize("law", [Signorini(), IsotropicCoulomb(0.4)], ids=str)
def test_solvers_agree(across, law, kappa, strength) -> None:
    problem = across(law, kappa, strength, drag=0.3)
    newton = solve(problem, SemismoothNewton())
    assert newton.status is Status.CONVERGED, newton.message
    for solver in (BarzilaiBorwein(), Nesterov()):
        other = solve(problem, solver)
        assert other.status is Status.CONVERGED, other.message
        check_same(other.state, newton.state)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("prescribed", [("approach",), ("potentials",), ("approach", "translation", "potentials")])
@pytest.mark.parametrize("solver", [SemismoothNewton(), BarzilaiBorwein()], ids=lambda solver: type(solver).__name__)
def test_prescribed_forces_and_charges(across, solver, prescribed) -> None:
    problem = across(IsotropicCoulomb(0.4), 1.0, 0.3, drag=0.3)
    held = solve(problem, SemismoothNewton())
    free, motion = released(problem, held.state, *prescribed)
    solution = balanced_solution(free, solver)
    check_same(solution.state, held.state)
    np.testing.assert_allclose(solution.state.motion, motion, rtol=1e-7)


def test_newtons_method_converges_quadratically(across) -> None:
    solution = solve(across(Signorini(), 3.0, 0.2), SemismoothNewton())
    last = solution.history[-4:, 1]
    assert last[-1] <= 100.0 * last[-2] ** 2 or last[-1] < 1e-13
