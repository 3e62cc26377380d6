"""The feasibility check of prescribed resultants agrees with the statics of rigid bodies."""

from dataclasses import replace

import numpy as np
import pytest

from meeframe.contact.feasibility import infeasibility
from meeframe.contact.problem import PrescribedResultant
from meeframe.contact.scales import problem_scales
from meeframe.laws import IsotropicCoulomb, OrthotropicCoulomb, Signorini
from meeframe.testing.half_space import half_space_system, indentation_problem

PRESS, X, Y = np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])


def is_feasible(law, *resultants, cells=6) -> bool:
    """Return True if resultants (mode (3,) or (n, 3), total) are feasible."""
    system = half_space_system(2e-12 * np.eye(3), 5e-3, cells)
    problem = indentation_problem(system, np.zeros(cells**2), 0.0, law)
    prescribed_resultants = []
    for motion, total in resultants:
        mode = np.zeros((cells**2, 5))
        mode[:, :3] = motion(system.points) if callable(motion) else motion
        prescribed_resultants.append(PrescribedResultant(mode, mode, system.weights, total))
    problem = replace(problem, prescribed_resultants=tuple(prescribed_resultants))
    return infeasibility(problem, problem_scales(problem)) is None


def pitch(points):
    return np.column_stack([0.0 * points[:, :2], -points[:, 0]])


def twist(points):
    return np.column_stack([-points[:, 1], points[:, 0], 0.0 * points[:, 0]])


@pytest.mark.parametrize("force", [1e-9, 1.0, 1e9])
def test_direction_of_a_force(force) -> None:
    assert is_feasible(Signorini(), (PRESS, force))
    assert is_feasible(Signorini(), (PRESS, 0.0))
    assert not is_feasible(Signorini(), (PRESS, -force))
    assert not is_feasible(Signorini(), (PRESS, force), (X, 0.01 * force))


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("angle", [0.0, 0.7, 2.0])
def test_friction_ellipse(angle) -> None:
    law = OrthotropicCoulomb(0.2, 0.7, angle)
    axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    for direction in np.linspace(0.0, 6.0, 7):
        limit = np.array([0.2 * np.cos(direction), 0.7 * np.sin(direction)]) @ axes
        for share, expected in ((0.999, True), (1.001, False)):
            force = share * limit
            assert is_feasible(law, (PRESS, 1.0), (X, force[0]), (Y, force[1])) == expected


def test_full_stick_carries_any_tangential_force_under_pressure() -> None:
    assert is_feasible(IsotropicCoulomb(np.inf), (PRESS, 1.0), (X, 1e3))


def test_moments_within_the_base() -> None:
    """The line of action must pass through the base; the largest torque has all pressure at the corners."""
    edge = 2.5e-3 * 5 / 6
    assert is_feasible(Signorini(), (PRESS, 1.0), (pitch, 0.999 * edge))
    assert not is_feasible(Signorini(), (PRESS, 1.0), (pitch, 1.001 * edge))
    corner = np.sqrt(2.0) * edge
    assert is_feasible(IsotropicCoulomb(0.3), (PRESS, 1.0), (twist, 0.999 * 0.3 * corner))
    assert not is_feasible(IsotropicCoulomb(0.3), (PRESS, 1.0), (twist, 1.001 * 0.3 * corner))
