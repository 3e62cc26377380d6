"""The direct check of contact conditions is correct for manufactured states, on a body with uncoupled tangential
tractions."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem, ContactState, Status
from meeframe.fields import Array
from meeframe.laws import IsotropicCoulomb, OrthotropicCoulomb, Signorini
from meeframe.laws.base import ContactLaw, StepLengths
from meeframe.solvers import Uzawa, residual, solve
from meeframe.testing.contact import violations
from meeframe.testing.half_space import half_space_system, indentation_problem
from meeframe.testing.interfaces import GapConductivity, SoftAttractedContact

FAR = 1e-3
"""Farther than friction takes the body along [m]."""


def dragged(law: ContactLaw, translation: tuple[float, float]) -> tuple[ContactProblem, Array]:
    """Return a problem of a sphere on a half space with uncoupled displacements, and the normal tractions (n,)."""
    xi = 2e-12 * np.eye(5)
    system = half_space_system(xi, 5e-3, 8)
    height = (system.points[:, :2] ** 2).sum(axis=1) / 0.2
    solution = solve(indentation_problem(system, height, 5e-5), Uzawa())
    assert solution.status is Status.CONVERGED
    return indentation_problem(system, height, 5e-5, law, translation=translation), solution.state.load[:, 2]


def state_of(problem: ContactProblem, normal: Array, share: Array) -> ContactState:
    """Return a state whose tangential tractions are multiples of the pressure, (2,) or (n, 2)."""
    load = np.zeros((len(normal), 5))
    load[:, 2], load[:, :2] = normal, -normal[:, None] * share
    return ContactState(load, problem.system.apply(load), (normal < 0.0).astype(float))


def slip_violation(problem: ContactProblem, normal: Array, share: Array, associated: bool = True) -> float:
    """Return the violation of the slip condition, where all others hold."""
    computed = violations(problem, state_of(problem, normal, share), associated)
    assert max(value for name, value in computed.items() if name != "slip") < 1e-8
    return computed["slip"]


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("ratio", [1.0, 30.0, 999.0])
def test_full_sliding_across_unequal_coefficients(ratio: float) -> None:
    """A small traction is correct where mu2 is small: M^2 scales the slip by the squared ratio."""
    mu2 = 0.3
    problem, normal = dragged(OrthotropicCoulomb(ratio * mu2, mu2), (0.0, FAR))
    assert slip_violation(problem, normal, np.array([0.0, mu2])) < 1e-12
    for wrong in ([0.0, 0.0], [0.0, 1e-4], [0.0, -mu2], [ratio * mu2, 0.0], [0.0, 0.9 * mu2]):
        assert slip_violation(problem, normal, np.array(wrong)) > 0.02, wrong


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("mu", [(0.1, 0.6), (3.0, 0.05), (0.3, 0.3)])
def test_slip_along_the_normal_of_the_limit(mu: tuple[float, float]) -> None:
    """Eq. (12) requires M^2 g / |M g|, which is neither parallel to the slip nor the radial return."""
    drag = np.array([1.0, 1.0]) * FAR
    problem, normal = dragged(OrthotropicCoulomb(*mu), (drag[0], drag[1]))
    share = np.zeros((len(normal), 2))
    for _ in range(200):  # the slip depends weakly on the traction
        slip = drag - state_of(problem, normal, share).displacement[:, :2]
        share = slip * np.square(mu) / np.linalg.norm(slip * mu, axis=1, keepdims=True)
    assert slip_violation(problem, normal, share) < 1e-8
    radial = slip / np.linalg.norm(slip / mu, axis=1, keepdims=True)
    assert (slip_violation(problem, normal, radial) > 1e-2) == (mu[0] != mu[1])
    assert slip_violation(problem, normal, 0.9 * share) > 1e-2
    assert slip_violation(problem, normal, -share) > 1e-2


@pytest.mark.parametrize("law", [IsotropicCoulomb(np.inf), IsotropicCoulomb(50.0), OrthotropicCoulomb(50.0, 3.0, 0.4)])
def test_stick(law: ContactLaw) -> None:
    """Only the tractions that move the nodes in contact with the indenter satisfy the conditions."""
    problem, normal = dragged(law, (3e-8, -2e-8))
    contact_fraction = normal < 0.0
    matrix = problem.system.matrix[:, 0, :, 0][np.ix_(contact_fraction, contact_fraction)]
    share = np.zeros((len(normal), 2))
    share[contact_fraction] = (
        np.linalg.solve(matrix, problem.translation[contact_fraction]) / -normal[contact_fraction, None]
    )
    assert slip_violation(problem, normal, share) < 1e-8
    assert slip_violation(problem, normal, 0.5 * share) > 1e-5


def test_without_friction_everything_slips() -> None:
    for law in (Signorini(), IsotropicCoulomb(0.0)):
        problem, normal = dragged(law, (FAR, 0.0))
        assert slip_violation(problem, normal, np.zeros(2)) < 1e-12


@dataclass(frozen=True)
class AlongSlip(ContactLaw):
    """Radial return to an ellipse without its metric: tractions are parallel to the slip and do not maximise
    dissipation."""

    ellipse: OrthotropicCoulomb

    def project(self, trial: Array) -> Array:
        return self.ellipse.project(trial)

    def tangential_scaling(self) -> Array:
        return np.eye(2)


def test_non_associated_laws() -> None:
    mu, drag = np.array([0.1, 0.6]), np.array([1.0, 1.0]) * FAR
    problem, normal = dragged(AlongSlip(OrthotropicCoulomb(*mu)), (drag[0], drag[1]))
    share = np.array([1.0, 1.0]) / np.linalg.norm(1.0 / mu)
    assert slip_violation(problem, normal, share) > 1e-2
    assert slip_violation(problem, normal, share, associated=False) < 1e-9
    for wrong in (np.zeros(2), 0.9 * share, -share):
        assert slip_violation(problem, normal, wrong, associated=False) > 1e-2
    assert slip_violation(replace(problem, contact_law=Signorini()), normal, np.zeros(2), associated=False) < 1e-9


SOFT = SoftAttractedContact(pressure=1e9, closure=5e-6, mu=0.4, pull=0.3)
ACROSS = (GapConductivity(2e-11, 2e-6, 5e3), GapConductivity(8e-7, 2e-6, 10.0))


def manufactured() -> tuple[ContactProblem, ContactState]:
    """Return a manufactured state of overlaps, gaps, slips and drops, and the problem that it solves."""
    random = np.random.default_rng(7)
    system = half_space_system(np.diag([2.4e-12, 2.2e-12, 2e-12, -2e7, -1e3]), 5e-3, 6)
    n = len(system.points)
    gap = SOFT.closure * random.uniform(-2.0, 2.0, n)
    slip = SOFT.closure * random.normal(size=(n, 2))
    drop = random.normal(size=(n, 2)) * [8e3, 20.0]
    pressed = SOFT.pressure * np.maximum(-gap, 0.0) / SOFT.closure
    size = np.linalg.norm(slip, axis=1)
    limit = SOFT.mu * (0.5 + 0.5 * np.exp(-size / SOFT.closure)) * pressed
    load = np.zeros((n, 5))
    load[:, :2] = (limit / size)[:, None] * slip
    load[:, 2] = SOFT.pull * SOFT.pressure * np.exp(-np.maximum(gap, 0.0) / SOFT.closure) - pressed
    for k, law in enumerate(ACROSS):
        square = (drop[:, k] / law.strength) ** 2
        distance = np.maximum(gap, 0.0) + law.residual
        load[:, 3 + k] = law.constant / distance * (1.0 + 2.0 * square) / (1.0 + square) * drop[:, k]
    displacement = system.apply(load)
    position = displacement + np.column_stack([slip, gap, drop])
    problem = ContactProblem(system, SOFT, flux_channels(*ACROSS), position[:, 2], position[:, :2], -position[:, 3:])
    return problem, ContactState(load, displacement, (gap < 0.0).astype(float))


def test_compliant_attractive_and_conducting_surfaces() -> None:
    """The manufactured state satisfies the conditions, and violates them if a law changes by one per cent."""
    problem, state = manufactured()
    computed = violations(problem, state)
    assert max(computed.values()) < 1e-9, computed
    assert residual(problem, state) < 1e-9
    for change, worse in (
        ({"pressure": 1.01e9}, {"pressure or gap", "penetration", "friction limit", "slip"}),
        ({"mu": 0.404}, {"slip"}),
        ({"mu": 0.396}, {"friction limit"}),
        ({"pull": 0.303}, {"pressure or gap", "penetration", "friction limit", "slip", "tension"}),
    ):
        other = violations(replace(problem, contact_law=replace(SOFT, **change)), state)
        wrong = {name for name, value in other.items() if value > 1e-6}
        assert wrong & worse, change
        assert wrong <= worse | {"closed fraction"}, change
    for k, name in enumerate(("electric", "magnetic")):
        for change in ({"constant": 1.01}, {"residual": 1.01}, {"strength": 1.01}):
            law = replace(ACROSS[k], **{key: value * getattr(ACROSS[k], key) for key, value in change.items()})
            other = violations(problem.with_laws(**{name: law}), state)
            assert {key for key, value in other.items() if value > 1e-6} == {f"{name} flux"}


@dataclass(frozen=True)
class SpringStick(ContactLaw):
    """A law that sticks by springs."""

    def project(self, trial: Array) -> Array:
        return IsotropicCoulomb(0.3).project(trial)

    def tangential_scaling(self) -> Array:
        return np.eye(2)

    def resolve(self, trial: Array, gap: Array, r: StepLengths) -> Array:
        return self.project(trial / [1.0 + r[1] * 1e-12, 1.0 + r[1] * 1e-12, 1.0])


def test_states_without_a_residual_are_rejected() -> None:
    problem, normal = dragged(SpringStick(), (FAR, 0.0))
    with pytest.raises(
        ValueError, match="violations cannot be computed for SpringStick, which has tangential compliance"
    ):
        violations(problem, state_of(problem, normal, np.array([0.3, 0.0])))
