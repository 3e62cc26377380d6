"""Test projection with prescribed resultants: balance, uniqueness of the traction, friction limits."""

import numpy as np
import pytest
from meeframe_laws.directional import NonAssociatedCoulomb
from scipy.optimize import brentq

from meeframe.common.errors import CaseError
from meeframe.contact.channels import flux_channels
from meeframe.contact.free_motion import balanced_projection
from meeframe.contact.problem import ContactProblem, PrescribedResultant
from meeframe.laws import Insulating, IsotropicCoulomb, OrthotropicCoulomb, Signorini
from meeframe.testing.half_space import half_space_system

R = 2e13


def prescribe_resultant(system, mode, total):
    mode = np.broadcast_to(mode, (len(system.points), 5)).copy()
    return PrescribedResultant(mode, mode, system.weights, total)


def problem(law, *totals, cells=12):
    """Return a problem of a sphere in first contact, free along the axes given as (mode, total)."""
    system = half_space_system(2e-12 * np.eye(5)[:3, :3] / np.eye(5)[:3, :3].max(), 5e-3, cells)
    x, y, _ = system.points.T
    gap = (x**2 + y**2) / 0.2
    n = len(gap)
    free = tuple(prescribe_resultant(system, mode, total) for mode, total in totals)
    return ContactProblem(
        system, law, flux_channels(Insulating(), Insulating()), gap, np.zeros((n, 2)), np.zeros((n, 2)), free
    )


PRESS = np.array([0.0, 0.0, -1.0, 0.0, 0.0])
SLIDE = np.array([1.0, 0.0, 0.0, 0.0, 0.0])
SIDEWAYS = np.array([0.0, 1.0, 0.0, 0.0, 0.0])


def project_from_zero(case):
    gap = np.column_stack([np.zeros((len(case.gap), 2)), case.gap])
    return balanced_projection(case, np.zeros_like(gap), gap, (R, R))


def test_force_balance_and_depth_of_foundation():
    case = problem(Signorini(), (PRESS, 1e3))
    state = project_from_zero(case)
    assert -case.system.weights @ state.traction[:, 2] == pytest.approx(1e3, rel=1e-12)
    force = lambda depth: R * case.system.weights @ np.maximum(depth - case.gap, 0.0) - 1e3  # noqa: E731
    assert state.motion[0] == pytest.approx(brentq(force, 0.0, 1e-3, xtol=1e-18, rtol=1e-14), rel=1e-10)


@pytest.mark.parametrize("law", [IsotropicCoulomb(0.4), OrthotropicCoulomb(0.3, 0.6, 0.5)])
@pytest.mark.parametrize("share", [0.0, 0.5, 0.99])
def test_tangential_force_up_to_the_friction_limit(law, share):
    case = problem(law, (PRESS, 1e3), (SLIDE, share * 0.3e3))
    state = project_from_zero(case)
    assert case.system.weights @ state.traction[:, 0] == pytest.approx(share * 0.3e3, rel=1e-11, abs=1e-9)
    assert -case.system.weights @ state.traction[:, 2] == pytest.approx(1e3, rel=1e-12)


def test_force_above_friction_limit_remains_finite():
    case = problem(IsotropicCoulomb(0.4), (PRESS, 1e3), (SLIDE, 0.5e3))
    state = project_from_zero(case)
    assert np.isfinite(state.motion).all()
    assert (np.abs(state.traction[:, 0]) <= -0.4 * state.traction[:, 2] * (1 + 1e-12)).all()
    force = case.system.weights @ state.traction
    assert max(abs(force[0] - 0.5e3), abs(force[2] + 1e3)) > 1.0


def test_release_of_a_node_whose_slip_is_not_along_its_friction():
    """Random problem 52387: friction turned along its limit when the indenter moved against the force."""
    law = NonAssociatedCoulomb(0.2, 0.6, slip_ratio=0.4, slip_angle=0.65)
    case = problem(law, (SLIDE, 0.0), (SIDEWAYS, 0.0))
    gap = np.column_stack([np.zeros((len(case.gap), 2)), case.gap])
    touched = int(np.argmin(case.gap))
    gap[touched] = [-1e-6, 2e-6, -1e-8]
    assert law.resolve(R * gap[[touched]], gap[[touched]], (R, R))[0, 0] < 0.0
    state = balanced_projection(case, np.zeros_like(gap), gap, (R, R))
    assert state.traction[touched, 2] < 0.0
    assert np.abs(state.traction[:, :2]).max() <= 1e-9 * R * 1e-8


@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_solutions_do_not_depend_on_units(scale):
    plain = project_from_zero(problem(IsotropicCoulomb(0.4), (PRESS, 1e3), (SLIDE, 0.3e3)))
    case = problem(IsotropicCoulomb(0.4), (PRESS, scale * 1e3), (SLIDE, scale * 0.3e3))
    gap = np.column_stack([np.zeros((len(case.gap), 2)), case.gap])
    computed = balanced_projection(case, np.zeros_like(gap), gap, (scale * R, scale * R))
    np.testing.assert_allclose(computed.motion, plain.motion, rtol=1e-9)
    np.testing.assert_allclose(computed.traction, scale * plain.traction, rtol=1e-9, atol=1e-9 * scale * 1e6)


def test_modes_mixing_motion_and_potential_are_rejected():
    with pytest.raises(CaseError, match="either a motion or a potential"):
        PrescribedResultant(np.ones((4, 5)), np.ones((4, 5)), np.ones(4), 1.0)
    with pytest.raises(CaseError, match="not finite"):
        PrescribedResultant(np.eye(5), np.eye(5), np.ones(5), np.nan)
