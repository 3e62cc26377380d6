"""The compliant interface agrees with springs, an elastic foundation, and Signorini's contact."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from meeframe_laws.interface import Compliant
from scipy.optimize import brentq

from meeframe.contact.problem import Status
from meeframe.laws import IsotropicCoulomb
from meeframe.laws.base import ContactLaw
from meeframe.solvers import SemismoothNewton, solve
from meeframe.solvers.gradient.accelerated import BarzilaiBorwein
from meeframe.system.dense import DenseSystem
from meeframe.testing.closed_forms_adhesion import quarter_half_space
from meeframe.testing.elastic_half_space import elastic_half_space
from meeframe.testing.force_control import balanced_solution, check_same
from meeframe.testing.half_space import indentation_problem

RADIUS, APPROACH = 0.1, 5e-5


def pressures(problem, solver=None):
    solution = solve(problem, solver or SemismoothNewton())
    assert solution.status is Status.CONVERGED, solution.message
    return -solution.state.load[:, 2]


@settings(deadline=None, max_examples=100)
@given(st.floats(-12.0, 12.0), st.floats(-12.0, 12.0), st.floats(0.05, 20.0))
def test_resolvent_satisfies_the_closure_law(load, spring, exponent):
    law = Compliant(2e6, 3e-6, exponent)
    r = 10.0**spring * 2e6 / 3e-6
    trial = np.array([[0.0, 0.0, -2e6 * 10.0**load], [0.0, 0.0, 1.0], [1.0, 2.0, np.inf]])
    traction = law.resolve(trial, np.zeros((3, 3)), (r, r))
    pressure = -traction[0, 2]
    assume(pressure > np.finfo(float).tiny)  # below, numbers have fewer digits than the tolerance
    closure = 3e-6 * (pressure / 2e6) ** (1.0 / exponent)
    assert pressure + r * closure == pytest.approx(2e6 * 10.0**load, rel=1e-12)
    assert not traction[1:].any()


def test_tangents_match_finite_differences():
    law, random = Compliant(1e6, 1e-6, 2.5, mu=0.3), np.random.default_rng(1)
    trial = 1e6 * random.normal(size=(200, 3))
    r = (2e11, 2e11)
    exact, plain = (
        law.tangents(trial, np.zeros_like(trial), r),
        ContactLaw.tangents(law, trial, np.zeros_like(trial), r),
    )
    smooth = np.abs(trial[:, 2]) > 1e3
    np.testing.assert_allclose(exact[0][smooth], plain[0][smooth], atol=1e-6)
    assert not exact[1].any()


@pytest.mark.parametrize("exponent", [0.5, 1.0, 3.3])
@pytest.mark.parametrize("solver", [SemismoothNewton(), BarzilaiBorwein()], ids=["newton", "uzawa-bb"])
def test_interface_and_body_are_springs_in_series(exponent, solver):
    """delta(p) + C p = approach at each node in contact, and p = 0 elsewhere."""
    approach, softness = np.array([5e-6, 4e-5, -1e-6]), 2e-14
    matrix = np.zeros((3, 5, 3, 5))
    matrix[range(3), :, range(3), :] = softness * np.eye(5)
    points, frames = np.zeros((3, 3)), np.tile(np.eye(3), (3, 1, 1))
    system = DenseSystem(points, frames, np.ones(3), (), np.zeros((3, 5)), matrix, None)
    law = Compliant(1e9, 2e-6, exponent)
    computed = pressures(indentation_problem(system, -approach, 0.0, law), solver)
    for overlap, pressure in zip(approach[:2], computed, strict=False):
        exact = brentq(
            lambda p, d=overlap: 2e-6 * (p / 1e9) ** (1.0 / exponent) + softness * p - d,
            0.0,
            1e12,
            xtol=1e-3,
            rtol=1e-14,
        )
        assert pressure == pytest.approx(exact, rel=1e-9)
    assert computed[2] == 0.0


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("exponent", [0.5, 1.0, 2.0])
def test_rigid_body_gives_an_elastic_foundation(exponent):
    """P = 2 pi R p_0 d_0^-m g^(m + 1) / (m + 1) under a paraboloid, up to the error of the sum over cells."""
    law = Compliant(1e6, 1e-6, exponent)
    exact = 2.0 * np.pi * RADIUS * 1e6 * 1e-6**-exponent * APPROACH ** (exponent + 1.0) / (exponent + 1.0)
    radius = np.sqrt(2.0 * RADIUS * APPROACH)
    rigid = 1e9 * 1e6 * (APPROACH / 1e-6) ** exponent * radius / APPROACH
    errors = []
    for cells in (6, 24):
        system = quarter_half_space(rigid, 1.1 * radius, cells)
        height = (system.points**2).sum(axis=1) / (2.0 * RADIUS)
        force = system.weights @ pressures(indentation_problem(system, height, APPROACH, law))
        errors.append(abs(force / exact - 1.0))
    assert errors[1] < 2e-4
    assert errors[1] < errors[0] / 4.0


def test_tends_to_signorini_and_coulomb():
    system = elastic_half_space(1e11, 0.3, 5e-3, 10)
    height = (system.points**2).sum(axis=1) / (2.0 * RADIUS)
    dragged = {"translation": (8e-6, 0.0)}
    hard = balanced_solution(
        indentation_problem(system, height, APPROACH, IsotropicCoulomb(0.3), **dragged), SemismoothNewton()
    )
    size = np.abs(hard.state.load).max()
    errors = []
    for closure in (1e-9, 5e-10, 2.5e-10):
        law = Compliant(1e9, closure, 1.5, mu=0.3)
        state = balanced_solution(
            indentation_problem(system, height, APPROACH, law, **dragged), SemismoothNewton()
        ).state
        errors.append(np.abs(state.load - hard.state.load).max() / size)
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 1.0, atol=0.1)
    # closures far below the round-off of the gap have no effect
    none = indentation_problem(system, height, APPROACH, Compliant(1e9, 1e-22, 1.5, mu=0.3), **dragged)
    off = np.abs(balanced_solution(none, SemismoothNewton()).state.load - hard.state.load).max()
    assert off <= 1e-9 * size


def test_friction_limit_follows_the_pressure():
    system = elastic_half_space(1e11, 0.3, 5e-3, 10)
    height = (system.points**2).sum(axis=1) / (2.0 * RADIUS)
    problem = indentation_problem(system, height, APPROACH, Compliant(1e9, 5e-6, mu=0.3), translation=(1e-3, 0.0))
    states = [balanced_solution(problem, solver).state for solver in (SemismoothNewton(), BarzilaiBorwein())]
    check_same(*states)
    load = states[0].load
    np.testing.assert_allclose(np.linalg.norm(load[:, :2], axis=1), -0.3 * load[:, 2], atol=1e-9 * np.abs(load).max())
    assert load[:, 0].max() > 0.0
