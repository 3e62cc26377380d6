"""Tresca, capped and regularised Coulomb friction agree with their formulas and with closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from meeframe_laws.friction import CappedCoulomb, RegularisedCoulomb, Tresca

from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem, Status
from meeframe.laws import Insulating, IsotropicCoulomb, Signorini
from meeframe.solvers import SemismoothNewton, solve
from meeframe.testing.closed_forms_friction import HertzContact
from meeframe.testing.elastic_half_space import elastic_half_space
from meeframe.testing.force_control import TIGHT_CRITERIA

SIDE, CELLS, YOUNG = 2e-2, 20, 1e11


def make_problem(law, height, approach, translation, cells=CELLS, goodman=True):
    """Return a problem of an indenter on an elastic half space; without coupling of normal and tangential response
    unless `goodman` is False."""
    system = elastic_half_space(YOUNG, 0.3, SIDE, cells, goodman)
    n = len(system.points)
    gap = height(*system.points[:, :2].T) - approach
    return ContactProblem(
        system, law, flux_channels(Insulating(), Insulating()), gap, np.tile(translation, (n, 1)), np.zeros((n, 2))
    )


def solution(problem):
    computed = solve(problem, SemismoothNewton(), TIGHT_CRITERIA)
    assert computed.status is Status.CONVERGED, computed.message
    return computed.state


def sphere(x, y):
    return (x**2 + y**2) / 2.0


def test_tresca_computed_values():
    trial = np.array([[3.0, 4.0, -1e-3], [0.3, 0.4, -7.0], [3.0, 4.0, 0.0], [3.0, 4.0, np.inf]])
    expected = [[1.5, 2.0, -1e-3], [0.3, 0.4, -7.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    np.testing.assert_allclose(Tresca(2.5).project(trial), expected, rtol=1e-14)


def test_capped_computed_values():
    trial = np.array([[3.0, 4.0, -2.0], [3.0, 4.0, -200.0], [0.3, 0.4, -2.0], [3.0, 4.0, 1.0], [3.0, 4.0, np.inf]])
    expected = [[0.6, 0.8, -2.0], [1.5, 2.0, -200.0], [0.3, 0.4, -2.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    np.testing.assert_allclose(CappedCoulomb(0.5, 2.5).project(trial), expected, rtol=1e-14)


def test_tresca_force_on_sliding_punch():
    """In full slip of a square punch the shear traction is uniform, so T = limit * side^2 exactly."""
    half = SIDE / 4

    def punch(x, y):
        return np.where(np.maximum(abs(x), abs(y)) < half, 0.0, np.inf)

    state = solution(problem := make_problem(Tresca(2e7), punch, 5e-6, [4e-4, 3e-4]))
    force = problem.system.weights @ state.load[:, :2]
    np.testing.assert_allclose(force, 2e7 * (2 * half) ** 2 * np.array([0.8, 0.6]), rtol=2e-3)
    inside = state.load[:, 2] < 0.0
    assert inside.sum() == (CELLS // 2) ** 2
    np.testing.assert_allclose(np.linalg.norm(state.load[inside, :2], axis=1), 2e7, rtol=1e-12)


@pytest.mark.full
def test_capped_sliding_sphere():
    """In full slip, T = limit pi c^2 + mu P (1 - c^2/a^2)^1.5 with the cap reached on a core of radius c."""
    hertz = HertzContact(YOUNG, 0.3, 1.0, 2.5e-5)
    law = CappedCoulomb(0.4, 0.2 * hertz.peak_pressure)
    state = solution(problem := make_problem(law, sphere, hertz.approach, [3e-4, 0.0], 32))
    shear, pressure = np.linalg.norm(state.load[:, :2], axis=1), -state.load[:, 2]
    core = 0.4 * pressure > law.limit
    assert core.any()
    np.testing.assert_allclose(shear[core], law.limit, rtol=1e-12)
    np.testing.assert_allclose(shear[~core], 0.4 * pressure[~core], rtol=1e-10, atol=1e-3)
    rest = 0.25  # 1 - c^2/a^2 = (0.2/0.4)^2
    exact = law.limit * np.pi * (1 - rest) * hertz.contact_radius**2 + 0.4 * hertz.force * rest**1.5
    assert problem.system.weights @ state.load[:, 0] == pytest.approx(exact, rel=1e-2)


NUMBER = st.floats(-8.0, 8.0)


@settings(deadline=None, max_examples=200)
@given(NUMBER, NUMBER, NUMBER, st.floats(0.0, 6.0), st.floats(0.01, 10.0))
def test_regularised_resolvent_inverts_the_formula(slip, step, pressure, angle, mu):
    """The resolvent recovers the traction of the formula from traction + r slip, for every r."""
    p, r, length = 10.0**pressure, 10.0**step, 1e-3
    g = length * 10.0**slip * np.array([np.cos(angle), np.sin(angle)])
    traction = np.append(mu * p * g / np.sqrt(g @ g + length**2), -p)
    trial = traction + np.append(r * g, 0.0)
    computed = RegularisedCoulomb(mu, length).resolve(trial[None], np.zeros((1, 3)), (1.0, r))[0]
    assert np.abs(computed - traction).max() <= 1e-14 * np.abs(trial).max()


def test_regularised_where_open_or_without_slip():
    law = RegularisedCoulomb(0.3, 1e-6)
    trial = np.array([[3.0, 4.0, 0.0], [3.0, 4.0, np.inf], [0.0, 0.0, -2.0], [3.0, 4.0, -1e-300]])
    expected = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, -2.0], [0.0, 0.0, -1e-300]]
    np.testing.assert_allclose(law.resolve(trial, np.zeros((4, 3)), (1e12, 1e12)), expected, atol=1e-200)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(("translation", "order"), [(4e-6, 1.0), (1e-3, 2.0)], ids=["partial slip", "full slip"])
def test_regularised_tends_to_coulomb(translation, order):
    """The difference is of first order in the slip length where nodes stick and of second order in full slip."""
    problem = make_problem(IsotropicCoulomb(0.3), sphere, 2.5e-5, [translation, 0.0], goodman=False)
    exact = solution(problem).load
    lengths = (1e-5 if order == 1.0 else 1e-3) * translation * np.array([4.0, 2.0, 1.0])
    errors = []
    for length in lengths:
        load = solution(replace(problem, contact_law=RegularisedCoulomb(0.3, length))).load
        errors.append(np.abs(problem.system.weights @ (load - exact)[:, :3]).max())
    observed = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(observed, order, atol=0.1)


def test_regularised_with_large_slip_length_is_linear():
    """For slips far below the slip length, t = mu p g / slip_length with the frictionless slip, to first order."""
    problem = make_problem(RegularisedCoulomb(0.3, 1.0), sphere, 2.5e-5, [1e-4, 0.0])
    state = solution(problem)
    smooth = solution(replace(problem, contact_law=Signorini()))
    np.testing.assert_allclose(state.load[:, 0], 0.3 * -smooth.load[:, 2] * 1e-4, rtol=1e-4, atol=1e-6)
