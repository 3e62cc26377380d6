"""Laws with more than a projection (compliant, slip-dependent, attractive): linearisation and solvers."""

from dataclasses import dataclass, replace
from typing import final

import numpy as np
import pytest

from meeframe.contact.problem import AT_REST, PrescribedResultant, contact_gap
from meeframe.contact.scales import problem_scales
from meeframe.fields import Array
from meeframe.laws import IsotropicCoulomb, Signorini
from meeframe.laws.base import (
    ConductivityLaw,
    ContactLaw,
    StepLengths,
    augmented_traction,
    contact_traction,
    fixed_point_map,
)
from meeframe.solvers import BarzilaiBorwein, Nesterov, SemismoothNewton, Uzawa, solve
from meeframe.solvers.newton.residual import ContactResidual
from meeframe.testing.matrix_free import MatrixFree

RANDOM = np.random.default_rng(4)
SOLVERS = (Uzawa(), BarzilaiBorwein(), Nesterov())


@final
@dataclass(frozen=True)
class Compliant(ContactLaw):
    """A law whose overlap is `closing` times the pressure [m/Pa]."""

    closing: float

    def project(self, trial: Array) -> Array:
        return Signorini().project(trial)

    def tangential_scaling(self) -> Array:
        return np.zeros((2, 2))

    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        return Signorini().project(trial) / (1.0 + r[0] * self.closing)


@final
@dataclass(frozen=True)
class Weakening(ContactLaw):
    """A law with the friction coefficient least + (mu - least) exp(-slip / distance)."""

    mu: float
    least: float
    distance: float

    def project(self, trial: Array) -> Array:
        return IsotropicCoulomb(self.mu).project(trial)

    def tangential_scaling(self) -> Array:
        return np.eye(2)

    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        slip = np.linalg.norm(gap[:, :2], axis=1)
        mu = self.least + (self.mu - self.least) * np.exp(-slip / self.distance)
        traction = np.column_stack([trial[:, :2], np.minimum(trial[:, 2], 0.0)])
        size = np.linalg.norm(trial[:, :2], axis=1)
        limit = -mu * traction[:, 2]
        traction[:, :2] *= np.divide(limit, size, out=np.ones_like(size), where=size > limit)[:, None]
        return traction


@final
@dataclass(frozen=True)
class Attractive(ContactLaw):
    """Coulomb friction with the attraction strength exp(-gap / distance)."""

    mu: float
    strength: float
    distance: float

    def project(self, trial: Array) -> Array:
        return IsotropicCoulomb(self.mu).project(trial)

    def tangential_scaling(self) -> Array:
        return IsotropicCoulomb(self.mu).tangential_scaling()

    def adhesion(self, gap: Array) -> Array:
        return self.strength * np.exp(-gap / self.distance)


def laws(problem) -> dict[str, ContactLaw]:
    """Return one law of each kind, with the magnitudes of a problem."""
    scales = problem_scales(problem)
    depth = scales.pressure * scales.normal_compliance
    return {
        "soft": Compliant(0.3 * scales.normal_compliance),
        "weakening": Weakening(0.4, 0.3, 0.5 * depth),
        "sticky": Attractive(0.3, 0.1 * scales.pressure, depth),
    }


@pytest.fixture
def problem(sphere, growing):
    plain = sphere("orthotropic", Signorini(), (0.0, 0.0), cells=12)
    equation = ContactResidual.of(plain)
    law = growing(1.0 / equation.self_compliance[0, 0], equation.scales.pressure, 0.5)
    return replace(plain.with_laws(electric=law), potentials=np.tile([1e3, 0.0], (len(plain.gap), 1)))


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("kind", ["soft", "weakening", "sticky"])
def test_linearisation_is_the_derivative_of_the_residual(problem, kind) -> None:
    problem = replace(problem, contact_law=laws(problem)[kind])
    equation = ContactResidual.of(problem)
    n = len(problem.gap)
    open_nodes = np.zeros(n, bool)
    load = 0.5 * equation.scales.load * RANDOM.normal(size=(n, 5))
    load[:, 2] = -np.abs(load[:, 2])
    step = np.column_stack([equation.scales.load * RANDOM.normal(size=(n, 5)), np.zeros(n)])
    width = 1e-6
    here = equation.at(load, np.zeros(n), open_nodes, AT_REST)
    forward, backward = (
        equation.at(load + sign * width * step[:, :5], np.zeros(n), open_nodes, AT_REST) for sign in (1.0, -1.0)
    )
    smooth = np.sign(forward.trial[:, 2]) == np.sign(backward.trial[:, 2])
    smooth &= np.sign(forward.relative_displacement[:, 2]) == np.sign(backward.relative_displacement[:, 2])
    blocks = here.linearise()
    moved = problem.system.apply(step[:, :5])
    got = np.einsum("nij,nj->ni", blocks.a.dense(6), step) + np.einsum("nij,nj->ni", blocks.b.dense(5), moved)
    expected = (forward.residual - backward.residual) / (2.0 * width)
    error = np.abs(got - expected)[smooth, :5] / np.abs(expected).max()
    assert smooth.sum() > n // 2
    # a node or two may cross a kink of friction within the step of the difference
    assert np.sort(error.max(axis=1))[: -2 if kind != "soft" else None].max() < 2e-5


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("kind", ["soft", "weakening", "sticky"])
@pytest.mark.parametrize("free", [False, True])
def test_solvers_agree(problem, kind, free) -> None:
    problem = replace(problem, contact_law=laws(problem)[kind])
    if free:
        weights = problem.system.weights
        mode = np.tile([0.0, 0.0, -1.0, 0.0, 0.0], (len(problem.gap), 1))
        total = 0.4 * problem_scales(problem).pressure * weights.sum()
        problem = replace(problem, prescribed_resultants=(PrescribedResultant(mode, mode, weights, total),))
    newton = solve(problem, SemismoothNewton())
    assert newton.status == "converged", newton.message
    force = problem.system.weights @ newton.state.load
    for solver in SOLVERS:
        other = solve(problem, solver)
        assert other.status == "converged", (solver, other.message)
        np.testing.assert_allclose(problem.system.weights @ other.state.load, force, atol=1e-8 * np.abs(force[2]))
    hidden = solve(replace(problem, system=MatrixFree.of(problem.system)), SemismoothNewton())
    assert hidden.status == "converged", hidden.message
    np.testing.assert_allclose(problem.system.weights @ hidden.state.load, force, atol=1e-8 * np.abs(force[2]))


def test_compliant_overlap_is_proportional_to_pressure(problem) -> None:
    law = laws(problem)["soft"]
    problem = replace(problem, contact_law=law)
    state = solve(problem, SemismoothNewton()).state
    gap = contact_gap(problem, state.displacement)[:, 2]
    pressed = state.load[:, 2] < 0.0
    assert pressed.sum() > 10
    depth = np.abs(gap[pressed]).max()
    np.testing.assert_allclose(gap[pressed], law.closing * state.load[pressed, 2], atol=1e-9 * depth)


def test_attraction_adds_to_contact_traction(problem) -> None:
    """Open nodes carry the attraction only, nodes in contact also their pressure, which limits friction."""
    law = laws(problem)["sticky"]
    problem = replace(problem, contact_law=law)
    state = solve(problem, SemismoothNewton()).state
    gap = contact_gap(problem, state.displacement)
    pressing = contact_traction(law, state.load[:, 2], gap[:, 2])
    touching = pressing < -1e-6 * law.strength
    assert touching.sum() > 10
    assert (state.load[touching, 2] > 0.0).any(), "some touching nodes are pulled"
    depth = law.distance
    assert np.abs(gap[touching, 2]).max() < 1e-9 * depth
    assert (gap[~touching, 2] > -1e-9 * depth).all()
    pulled = law.strength * np.exp(-gap[~touching, 2] / law.distance)
    np.testing.assert_allclose(state.load[~touching, 2], pulled, rtol=1e-6)
    friction = np.linalg.norm(state.load[:, :2], axis=1)
    assert (friction <= 0.3 * np.maximum(-pressing, 0.0) * (1 + 1e-9) + 1e-9 * law.strength).all()
    np.testing.assert_array_equal(state.contact_fraction > 0.5, touching)


@pytest.mark.parametrize("kind", ["soft", "weakening", "sticky"])
def test_solutions_do_not_depend_on_the_step_length(problem, kind) -> None:
    law = laws(problem)[kind]
    problem = replace(problem, contact_law=law)
    state = solve(problem, SemismoothNewton()).state
    scales = problem_scales(problem)
    gap = contact_gap(problem, state.displacement)
    for length in (0.01, 1.0, 100.0):
        r = (length / scales.normal_compliance, 2.0 * length / scales.normal_compliance)
        trial = augmented_traction(law, state.load[:, :3], gap, r)
        again = fixed_point_map(law, trial, gap, r)
        np.testing.assert_allclose(again, state.load[:, :3], atol=max(length, 1.0) * 1e-8 * scales.pressure)


@final
@dataclass(frozen=True)
class BeyondPressure(ConductivityLaw):
    """kappa above a pressure, reached linearly over an interval of the same size."""

    kappa: float
    pressure: float

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        return self.kappa * np.clip(-normal_traction / self.pressure - 1.0, 0.0, 1.0)


def test_charge_with_conduction_at_highest_pressure_only(problem) -> None:
    """The law insulates at the characteristic pressure of the problem."""
    equation = ContactResidual.of(problem)
    law = BeyondPressure(1.0 / equation.self_compliance[0, 0], 1.1 * equation.scales.pressure)
    problem = replace(problem.with_laws(electric=law), potentials=np.tile([1e3, 0.0], (len(problem.gap), 1)))
    reference = solve(problem, SemismoothNewton())
    charge = problem.system.weights @ reference.state.load[:, 3]
    assert reference.status == "converged"
    assert abs(charge) > 0.0
    mode = np.tile([0.0, 0.0, 0.0, -1.0, 0.0], (len(problem.gap), 1))
    resultant = PrescribedResultant(mode, -mode, problem.system.weights, charge)
    free = replace(problem, potentials=np.zeros_like(problem.potentials), prescribed_resultants=(resultant,))
    for solver in (SemismoothNewton(), BarzilaiBorwein()):
        solution = solve(free, solver)
        assert solution.status == "converged", solution.message
        assert solution.state.motion[0] == pytest.approx(1e3, rel=1e-6)
