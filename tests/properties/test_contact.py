"""Properties of solutions of contact problems hold for random bodies, indenters and laws."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meeframe.contact.problem import ContactProblem, ContactSolution, Solver, Status, contact_gap
from meeframe.fields import Array
from meeframe.laws import OrthotropicCoulomb
from meeframe.solvers import Auto, SemismoothNewton, Uzawa, solve
from meeframe.testing.contact import exact_pressure, rescaled
from meeframe.testing.half_space import half_space_system, indentation_problem

SETTINGS = settings(max_examples=5, deadline=None)
SIDE, CELLS = 2.0, 7
GRID = half_space_system(np.eye(5), SIDE, CELLS).points[:, :2]


@st.composite
def bodies(draw: st.DrawFn) -> Array:
    """Generate point responses (5, 5) of order one with the signs of an admissible body."""
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    mechanical = np.diag(random.uniform(0.8, 1.3, 3))
    mechanical[:2, 2] = mechanical[2, :2] = random.uniform(-0.3, 0.3, 2)
    root = random.normal(size=(2, 2))
    xi = np.zeros((5, 5))
    xi[:3, :3] = mechanical
    xi[3:, 3:] = -(root @ root.T + 0.3 * np.eye(2))
    xi[2, 3:] = xi[3:, 2] = draw(st.floats(0.0, 0.8)) * random.normal(size=2)
    return xi


@st.composite
def heights(draw: st.DrawFn) -> Array:
    """Generate tilted paraboloids with slight roughness, (n,), without indenter above some points."""
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    curvature = random.uniform(0.3, 1.5, 2)
    height = 0.5 * GRID**2 @ curvature + GRID @ random.uniform(-0.1, 0.1, 2) + 0.02 * random.uniform(size=len(GRID))
    return np.where(random.uniform(size=len(GRID)) < 0.05, np.inf, height - height.min())


UZAWA = Uzawa()
KAPPA = st.one_of(st.just(0.0), st.floats(0.01, 10.0), st.just(np.inf))
MU = st.floats(0.05, 1.0)


def solve_problem(problem: ContactProblem, solver: Solver = UZAWA) -> ContactSolution:
    solution = solve(problem, solver)
    assert solution.status is Status.CONVERGED, solution.message
    return solution


@SETTINGS
@given(bodies(), heights(), st.floats(0.05, 0.6))
def test_frictionless_pressure_matches_least_squares(xi: Array, height: Array, approach: float) -> None:
    problem = indentation_problem(half_space_system(xi, SIDE, CELLS), height, approach)
    exact = exact_pressure(problem)
    assert np.abs(solve_problem(problem).state.load[:, 2] + exact).max() < 1e-8 * max(exact.max(), 1e-12)


@SETTINGS
@given(bodies(), heights(), MU, MU, KAPPA, KAPPA)
def test_solutions_satisfy_the_contact_conditions(
    xi: Array, height: Array, mu1: float, mu2: float, electric: float, magnetic: float
) -> None:
    """Eqs. (10), (12), (17), (18) are tested directly, not as projections."""
    law = OrthotropicCoulomb(mu1, mu2)
    potentials, translation = (0.1, -0.1), (0.05, 0.02)
    system = half_space_system(xi, SIDE, CELLS)
    problem = indentation_problem(system, height, 0.3, law, (electric, magnetic), potentials, translation)
    state = solve_problem(problem).state
    load, gap = state.load, contact_gap(problem, state.displacement)
    pressure, small = -load[:, 2], 1e-8
    assert pressure.min() >= 0.0
    assert gap[:, 2].min() > -small
    assert np.abs(np.minimum(gap[:, 2], 1e3) * pressure).max() < small
    ratio = np.hypot(load[:, 0] / mu1, load[:, 1] / mu2)
    assert (ratio <= pressure * (1.0 + small) + small).all()
    sliding = (np.hypot(gap[:, 0], gap[:, 1]) > 1e-5) & (pressure > 1e-4)
    slip = gap[sliding, :2] * [mu1**2, mu2**2]
    traction = load[sliding, :2]
    assert (ratio[sliding] > pressure[sliding] * (1.0 - 1e-4)).all()
    assert (np.einsum("na,na->n", traction, slip) > 0.0).all()
    assert np.abs(traction[:, 0] * slip[:, 1] - traction[:, 1] * slip[:, 0]).max(initial=0.0) < small
    drop = -state.displacement[:, 3:] - problem.potentials  # phi - phi_o
    for field, kappa in enumerate((electric, magnetic)):
        flux, firm, open_ = load[:, 3 + field], pressure > 1e-7, state.contact_fraction == 0.0
        assert np.abs(flux[open_]).max(initial=0.0) < small
        violation = drop[firm, field] if np.isinf(kappa) else flux[firm] - kappa * drop[firm, field]
        assert np.abs(violation).max(initial=0.0) < 1e-7
        assert (flux * drop[:, field] > -small).all()


@pytest.mark.full
@SETTINGS
@given(bodies(), heights(), MU, KAPPA, st.lists(st.integers(-14, 14), min_size=6, max_size=6))
def test_solutions_do_not_depend_on_units(xi: Array, height: Array, mu: float, kappa: float, powers: list[int]) -> None:
    law = OrthotropicCoulomb(mu, 0.4, 0.3)
    system = half_space_system(xi, SIDE, CELLS)
    problem = indentation_problem(system, height, 0.3, law, (0.0, kappa), (0.0, 0.05), (0.02, 0.01))
    factors = 4.0 ** np.array(powers)  # up to 1e-8 ... 1e8, squares of which the roots are exact
    displacement, load = factors[[0, 0, 0, 1, 2]], factors[[3, 3, 3, 4, 5]]
    plain, other = solve_problem(problem), solve_problem(rescaled(problem, displacement, load))
    assert other.iterations == plain.iterations
    assert np.abs(other.state.load / load - plain.state.load).max() < 1e-9
    assert abs(other.residual - plain.residual) < 1e-12


SOLVERS = st.sampled_from([SemismoothNewton(), Auto()])
ANGLE = st.floats(-3.0, 3.0)


@SETTINGS
@given(bodies(), heights(), MU, MU, ANGLE, KAPPA, SOLVERS)
def test_exchange_of_the_axes(
    xi: Array, height: Array, mu1: float, mu2: float, angle: float, kappa: float, solver: Solver
) -> None:
    """Exchanging x with y and mu1 with mu2, and reversing the angle, exchanges the tangential tractions."""
    axes = [1, 0, 2, 3, 4]
    body, other_body = (half_space_system(x, SIDE, CELLS) for x in (xi, xi[np.ix_(axes, axes)]))
    swap = np.arange(CELLS**2).reshape(CELLS, CELLS).T.ravel()
    fields = (0.0, kappa), (0.0, 0.05)
    one = indentation_problem(body, height, 0.3, OrthotropicCoulomb(mu1, mu2, angle), *fields, (0.04, 0.01))
    law = OrthotropicCoulomb(mu2, mu1, -angle)
    two = indentation_problem(other_body, height[swap], 0.3, law, *fields, (0.01, 0.04))
    expected = solve_problem(one, solver).state.load[swap][:, axes]
    assert np.abs(solve_problem(two, solver).state.load - expected).max() < 1e-7


@SETTINGS
@given(bodies(), heights(), MU, MU, KAPPA, st.lists(st.floats(-0.2, 0.2), min_size=8, max_size=8), SOLVERS)
def test_common_motion_of_body_and_indenter_has_no_effect(
    xi: Array, height: Array, mu1: float, mu2: float, kappa: float, motion: list[float], solver: Solver
) -> None:
    """Any small rigid motion and any shift of the potentials is tested."""
    still = half_space_system(xi, SIDE, CELLS)
    rigid = np.tile([*motion[:3], *motion[6:]], (CELLS**2, 1))
    rigid[:, :3] += np.cross([motion[3], motion[4], motion[5]], still.points)
    moved = replace(still, offset=rigid)
    law = OrthotropicCoulomb(mu1, mu2, 0.4)
    one = indentation_problem(still, height, 0.3, law, (kappa, np.inf), (0.05, -0.1), (0.04, 0.01))
    two = replace(
        one,
        system=moved,
        gap=one.gap + rigid[:, 2],
        translation=one.translation + rigid[:, :2],
        potentials=one.potentials - rigid[:, 3:],
    )
    expected, computed = solve_problem(one, solver).state, solve_problem(two, solver).state
    assert np.abs(computed.load - expected.load).max() < 1e-7
    assert np.abs(computed.displacement - expected.displacement - rigid).max() < 1e-7
