"""The second judge: states made by hand, right and wrong, on a body whose tangential tractions move nothing else."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from meeframe.core.contact import ContactProblem, ContactState, Status
from meeframe.core.fields import Array
from meeframe.core.law import ContactLaw
from meeframe.laws import IsotropicCoulomb, OrthotropicCoulomb, Signorini
from meeframe.solvers import Uzawa, solve
from meeframe.testing.contact import violations
from meeframe.testing.half_space import half_space_system, indentation_problem

FAR = 1e-3
"""Farther than friction takes the body along [m]."""


def dragged(law: ContactLaw, translation: tuple[float, float]) -> tuple[ContactProblem, Array]:
    """Sphere on a half space without coupling of its displacements, and the normal tractions there (n,)."""
    xi = 2e-12 * np.eye(5)
    system = half_space_system(xi, 5e-3, 8)
    height = (system.points[:, :2] ** 2).sum(axis=1) / 0.2
    solution = solve(indentation_problem(system, height, 5e-5), Uzawa())
    assert solution.status is Status.CONVERGED
    return indentation_problem(system, height, 5e-5, law, translation=translation), solution.state.load[:, 2]


def state_of(problem: ContactProblem, normal: Array, share: Array) -> ContactState:
    """State whose tangential tractions are so many times the pressure, (2,) or (n, 2)."""
    load = np.zeros((len(normal), 5))
    load[:, 2], load[:, :2] = normal, -normal[:, None] * share
    return ContactState(load, problem.system.apply(load), (normal < 0.0).astype(float))


def slip_violation(problem: ContactProblem, normal: Array, share: Array, associated: bool = True) -> float:
    """Violation of the slip condition, where all others hold."""
    found = violations(problem, state_of(problem, normal, share), associated)
    assert max(value for name, value in found.items() if name != "slip") < 1e-8
    return found["slip"]


@pytest.mark.parametrize("ratio", [1.0, 30.0, 999.0])
def test_full_sliding_across_unequal_coefficients(ratio: float) -> None:
    """A traction of nearly nothing where mu2 is the answer: M^2 scales that slip by the ratio squared."""
    mu2 = 0.3
    problem, normal = dragged(OrthotropicCoulomb(ratio * mu2, mu2), (0.0, FAR))
    assert slip_violation(problem, normal, np.array([0.0, mu2])) < 1e-12
    for wrong in ([0.0, 0.0], [0.0, 1e-4], [0.0, -mu2], [ratio * mu2, 0.0], [0.0, 0.9 * mu2]):
        assert slip_violation(problem, normal, np.array(wrong)) > 0.02, wrong


@pytest.mark.parametrize("mu", [(0.1, 0.6), (3.0, 0.05), (0.3, 0.3)])
def test_slip_along_the_normal_of_the_limit(mu: tuple[float, float]) -> None:
    """Eq. (12): traction M^2 g / |M g|; neither along the slip nor by radial return."""
    drag = np.array([1.0, 1.0]) * FAR
    problem, normal = dragged(OrthotropicCoulomb(*mu), (drag[0], drag[1]))
    share = np.zeros((len(normal), 2))
    for _ in range(200):  # the slip depends on the traction, weakly
        slip = drag - state_of(problem, normal, share).displacement[:, :2]
        share = slip * np.square(mu) / np.linalg.norm(slip * mu, axis=1, keepdims=True)
    assert slip_violation(problem, normal, share) < 1e-8
    radial = slip / np.linalg.norm(slip / mu, axis=1, keepdims=True)
    assert (slip_violation(problem, normal, radial) > 1e-2) == (mu[0] != mu[1])
    assert slip_violation(problem, normal, 0.9 * share) > 1e-2
    assert slip_violation(problem, normal, -share) > 1e-2


@pytest.mark.parametrize("law", [IsotropicCoulomb(np.inf), IsotropicCoulomb(50.0), OrthotropicCoulomb(50.0, 3.0, 0.4)])
def test_stick(law: ContactLaw) -> None:
    """The tractions that drag the nodes in contact along are right, and no others."""
    problem, normal = dragged(law, (3e-8, -2e-8))
    closed = normal < 0.0
    matrix = problem.system.matrix[:, 0, :, 0][np.ix_(closed, closed)]
    share = np.zeros((len(normal), 2))
    share[closed] = np.linalg.solve(matrix, problem.translation[closed]) / -normal[closed, None]
    assert slip_violation(problem, normal, share) < 1e-8
    assert slip_violation(problem, normal, 0.5 * share) > 1e-5


def test_without_friction_everything_slips() -> None:
    for law in (Signorini(), IsotropicCoulomb(0.0)):
        problem, normal = dragged(law, (FAR, 0.0))
        assert slip_violation(problem, normal, np.zeros(2)) < 1e-12


@dataclass(frozen=True)
class AlongSlip(ContactLaw):
    """Radial return to an ellipse without its metric: tractions point along the slip, not where they work the most."""

    ellipse: OrthotropicCoulomb

    def project(self, trial: Array) -> Array:
        return self.ellipse.project(trial)

    def tangential_scaling(self) -> Array:
        return np.eye(2)


def test_laws_that_are_not_associated() -> None:
    mu, drag = np.array([0.1, 0.6]), np.array([1.0, 1.0]) * FAR
    problem, normal = dragged(AlongSlip(OrthotropicCoulomb(*mu)), (drag[0], drag[1]))
    share = np.array([1.0, 1.0]) / np.linalg.norm(1.0 / mu)
    assert slip_violation(problem, normal, share) > 1e-2
    assert slip_violation(problem, normal, share, associated=False) < 1e-9
    for wrong in (np.zeros(2), 0.9 * share, -share):
        assert slip_violation(problem, normal, wrong, associated=False) > 1e-2
    assert slip_violation(replace(problem, contact_law=Signorini()), normal, np.zeros(2), associated=False) < 1e-9
