"""Friction of nodes that touch without pressure, where its limit jumps, against closed forms of a single node."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from meeframe_laws.adhesive import DMT
from meeframe_laws.compliant import Compliant
from meeframe_laws.friction import CappedCoulomb, Tresca

from meeframe.contact.problem import ContactState, Status, contact_gap
from meeframe.contact.residual import NEGLIGIBLE_PRESSURE, friction_exceeds, law_residual, limit_jumps
from meeframe.contact.scales import problem_scales
from meeframe.laws import IsotropicCoulomb
from meeframe.laws.base import attraction
from meeframe.model.biactive_friction import solve_from_biactive_friction
from meeframe.model.continuation import solve_by_capped_friction, solve_persistently
from meeframe.testing.half_space import half_space_system, indentation_problem

NODE = 12
LIMIT, SLIP = 1.0, -10.0
COUPLING = 0.5
"""Normal displacement under unit friction, by which friction at its limit lifts the node by LIMIT * COUPLING."""
OVERLAP = 0.9 * LIMIT * COUPLING
"""Overlap that friction of nine tenths of the limit undoes: then the node touches without pressure."""


def single_node(law, slip=SLIP, kappa=0.0):
    """Return a problem in which a single node, with a spring of its own, overlaps the indenter and slips.

    kappa: conductivity in contact, the flux of which moves no surface.
    """
    system = half_space_system(-np.eye(3), 1.0, 5)
    matrix = np.zeros_like(system.matrix)
    for node in range(25):
        matrix[node, :, node, :] = np.eye(5)
        matrix[node, 0, node, 2] = matrix[node, 2, node, 0] = COUPLING
    problem = indentation_problem(replace(system, matrix=matrix), np.zeros(25), 0.1, law, (kappa, 0.0), (-1.0, 0.0))
    gap, translation = np.full(25, np.inf), np.zeros((25, 2))
    gap[NODE], translation[NODE, 0] = -OVERLAP, slip
    return replace(problem, gap=gap, translation=translation)


def state_of(problem, traction):
    """Return the state in which the node bears a traction (3,)."""
    load = np.zeros((25, 5))
    load[NODE, :3] = traction
    displacement = problem.system.offset + problem.system.apply(load)
    return ContactState(load, displacement, (load[:, 2] < 0.0).astype(float), np.zeros(0))


@pytest.mark.parametrize("law", [Tresca(LIMIT), IsotropicCoulomb(np.inf)])
@pytest.mark.parametrize(
    ("traction", "is_solution"),
    [
        ((-0.9 * LIMIT, 0.0, 0.0), True),
        ((-0.8 * LIMIT, 0.0, 0.0), False),  # it overlaps
        ((-0.95 * LIMIT, 0.0, 0.0), False),  # it is open
        ((-0.9 * LIMIT, 0.1 * LIMIT, 0.0), False),  # friction is not along the slip
    ],
)
def test_friction_without_pressure_opposes_slip(law, traction, is_solution):
    problem = single_node(law)
    residual = law_residual(problem, state_of(problem, traction), problem_scales(problem))
    assert (residual < 1e-12) == is_solution
    assert residual < 1e-12 or residual > 1e-2


def test_friction_against_the_slip_or_beyond_the_limit_is_no_solution():
    for law, slip in ((Tresca(LIMIT), -SLIP), (Tresca(0.8 * LIMIT), SLIP), (CappedCoulomb(10.0, LIMIT), SLIP)):
        problem = single_node(law, slip)
        state = state_of(problem, (-0.9 * LIMIT, 0.0, 0.0))
        assert contact_gap(problem, state.displacement)[NODE, 2] == pytest.approx(0.0, abs=1e-12)
        assert law_residual(problem, state, problem_scales(problem)) > 1e-3


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("kappa", [0.0, 1.0])
@pytest.mark.parametrize(
    ("law", "friction"),
    [
        (Tresca(LIMIT), 0.9 * LIMIT),
        (Tresca(2.0 * LIMIT), 0.9 * LIMIT),
        (IsotropicCoulomb(np.inf), 0.9 * LIMIT),
        (Compliant(LIMIT, COUPLING, 3.0, mu=np.inf), 0.9 * LIMIT),  # it yields steeply under hardly any pressure
    ],
)
def test_a_node_between_open_and_closed_is_found(increments, law, friction, kappa):
    problem = single_node(law, kappa=kappa)

    solve_eased, failed = increments(problem)
    solution, _ = solve_by_capped_friction(solve_eased, failed, 1e-10)
    assert solution is not None
    planned, end, result = solution
    assert planned.problem.contact_law is law
    assert planned.problem.channels is problem.channels
    assert result.status is Status.CONVERGED
    assert result.residual < 1e-10
    assert "1 node touches without pressure around (0, 0, 0) m" in result.message
    np.testing.assert_allclose(end.state.load[NODE, :3], [-friction, 0.0, 0.0], atol=1e-8)
    expected = kappa / (1.0 + kappa)  # the flux through the contact and the spring of the node
    np.testing.assert_allclose(np.abs(end.state.load[NODE, 3]), expected, atol=1e-8)


def test_biactive_friction_is_found_from_a_smaller_multiple_where_pressures_are_too_small(increments):
    problem = single_node(Tresca(LIMIT))
    solve_eased, failed = increments(problem)
    ratios = []

    def attempt(start, easing):
        if easing.pull is not None:
            ratios.append(easing.ratio)
        fails = easing.ratio == np.inf or (easing.pull is not None and not 1e4 < easing.ratio < 9e5)
        solution = solve_eased(start, easing)
        return solution.with_result(status=Status.STALLED) if fails else solution

    solution, reached = solve_by_capped_friction(attempt, failed, 1e-10)
    assert solution is not None
    assert ratios[0] == reached == 1e6
    assert 1e4 < ratios[-1] < 1e6
    np.testing.assert_allclose(solution.end.state.load[NODE, :3], [-0.9 * LIMIT, 0.0, 0.0], atol=1e-8)


def test_round_off_grows_with_the_multiple_of_the_pressure(increments):
    """A smaller multiple is more accurate, from the state nearby."""
    problem = single_node(Tresca(LIMIT))
    solve_eased, failed = increments(problem)
    ratios = []

    def attempt(start, easing):
        solution = solve_eased(start, easing)
        if easing.ratio == np.inf:
            return solution.with_result(status=Status.STALLED)
        if easing.pull is not None:
            ratios.append(easing.ratio)
            displacement = solution.end.state.displacement + 1e-14 * easing.ratio
            solution = solution._replace(
                end=SimpleNamespace(state=replace(solution.end.state, displacement=displacement))
            )
        return solution

    solution, _ = solve_by_capped_friction(attempt, failed, 1e-10)
    assert solution is not None
    assert solution.result.residual < 1e-10
    assert ratios[0] == 1e6
    assert ratios[-1] <= 1e4
    np.testing.assert_allclose(solution.end.state.load[NODE, :3], [-0.9 * LIMIT, 0.0, 0.0], atol=1e-8)


@pytest.mark.parametrize("law", [Tresca(LIMIT), IsotropicCoulomb(np.inf), DMT(0.05, 1.0, mu=np.inf)])
def test_biactive_friction_follows_the_load(increments, law):
    """From a state with three quarters of the friction, without the path of smaller multiples of the pressure."""
    problem = single_node(law)

    solve_eased, _ = increments(problem)
    adhesion = attraction(law, np.zeros(25))[NODE]
    start = state_of(problem, (-0.75 * LIMIT, 0.0, adhesion))
    solution = solve_from_biactive_friction(solve_eased, start, start, problem, 1e-10)
    assert solution is not None
    planned, end, result = solution
    assert planned.problem.contact_law is law
    assert result.status is Status.CONVERGED
    assert law_residual(problem, end.state, problem_scales(problem)) < 1e-10
    friction = (OVERLAP + adhesion) / COUPLING
    np.testing.assert_allclose(end.state.load[NODE, :3], [-friction, 0.0, adhesion], atol=1e-8)
    stalled = solution.with_result(status=Status.STALLED)
    assert solve_from_biactive_friction(lambda *_: stalled, start, start, problem, 1e-10) is None


@pytest.mark.full
def test_friction_that_jumps_is_sought_from_parts_of_the_load(increments):
    """States under smaller multiples of the pressure end before the whole load, too."""
    whole, reached = single_node(IsotropicCoulomb(np.inf)), [0.0]

    def attempt(attempt):
        problem = replace(whole, gap=attempt.fraction * whole.gap)
        solve_eased, _ = increments(problem)
        solution = solve_eased(attempt.start, attempt.easing)
        is_near = attempt.easing.ratio < np.inf and attempt.fraction <= reached[-1] + 0.2
        status = solution.result.status if is_near else Status.STALLED
        if status is Status.CONVERGED and law_residual(problem, solution.end.state, problem_scales(problem)) < 1e-10:
            reached.append(attempt.fraction)
        return solution.with_result(status=status, area_fraction=None)

    before = state_of(whole, np.zeros(3))
    _, end, result = solve_persistently(attempt, 10, True, False, 1e-10, before)
    assert result.status is Status.CONVERGED
    assert "1 node touches without pressure" in result.message
    assert "from a state with a part of the load" in result.message
    np.testing.assert_allclose(end.state.load[NODE, :3], [-0.9 * LIMIT, 0.0, 0.0], atol=1e-8)
    assert reached[-1] == 1.0
    assert len(reached) > 4


@pytest.mark.parametrize(
    ("law", "jumps", "largest"),
    [
        (Tresca(LIMIT), True, LIMIT),
        (Tresca(1e-3 * LIMIT), True, 1e-3 * LIMIT),
        (DMT(0.05, 1.0, mu=np.inf), True, np.inf),
        (CappedCoulomb(10.0, LIMIT), False, LIMIT),
        (IsotropicCoulomb(50.0), False, 50.0),
        (IsotropicCoulomb(0.0), False, 0.0),
    ],
)
def test_limits_that_jump(law, jumps, largest):
    assert limit_jumps(law, 25) == jumps
    assert not jumps or friction_exceeds(law, 25, 10.0, NEGLIGIBLE_PRESSURE)
    assert not friction_exceeds(law, 25, 1.01 * largest, 1.0)
    assert largest == 0.0 or friction_exceeds(law, 25, min(0.99 * largest, 1e3), 1.0)
