"""Continuation of an increment that does not converge, through states of problems that are easier to solve."""

import re
from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import numpy as np
import pytest
from meeframe_laws.adhesive import DMT
from meeframe_laws.conductivity import AcrossGap
from meeframe_laws.friction import Tresca

from meeframe.contact.problem import ContactProblem, ContactState, Status
from meeframe.contact.scales import problem_scales
from meeframe.fields import Array, Indices
from meeframe.laws import IsotropicCoulomb, StepConductivity
from meeframe.laws.base import attraction, augmented_traction, fixed_point_map, is_adhesive
from meeframe.model.continuation import (
    solve_by_approach,
    solve_by_capped_friction,
    solve_by_continuation,
    solve_by_gradual_conduction,
    solve_persistently,
)
from meeframe.model.easier_laws import CappedLaw, Easing, GradualLaw
from meeframe.model.kinematics import Solution
from meeframe.testing.half_space import half_space_system, indentation_problem


class Increments:
    """Increments that are solved from a guess within some distance of their load, up to some load."""

    def __init__(self, step, radius: float, most: float) -> None:
        self._step, self._radius, self._most = step, radius, most
        self.fractions: list[float] = []

    def solve(self, fraction: float, start: float | None):
        self.fractions.append(fraction)
        solved = fraction - (start or 0.0) <= self._radius and fraction <= self._most
        result = replace(self._step, status=Status.CONVERGED if solved else Status.STALLED, iterations=7)
        return Solution(fraction, SimpleNamespace(state=fraction), result)


@pytest.mark.parametrize(
    ("radius", "fractions"),
    [
        (0.5, [0.5, 1.0]),
        (0.4, [0.5, 0.25, 0.5, 0.75, 1.0]),
        (0.07, [0.5, 0.25, 0.125, 0.0625]),
    ],
)
def test_load_is_raised_in_parts(synthetic, radius, fractions):
    increments = Increments(synthetic.step(1e-6), radius, 1.0)
    failed = increments.solve(1.0, None)
    increments.fractions.clear()
    (planned, end, result), _ = solve_by_continuation(increments.solve, failed)
    assert increments.fractions[: len(fractions)] == fractions
    assert increments.fractions[-1] == planned == end.state == 1.0
    assert result.status is Status.CONVERGED
    assert result.iterations == 7 * (1 + len(increments.fractions))  # those of the failed increment count, too


@pytest.mark.parametrize(("most", "reached"), [(0.0, "0"), (0.3, "0.25"), (0.99, "0.938")])
@pytest.mark.parametrize("returns_none", [False, True])
def test_a_failed_increment_states_the_part_of_the_load_that_was_reached(synthetic, most, reached, returns_none):
    increments = Increments(synthetic.step(1e-6), 1.0, most)
    failed = increments.solve(1.0, None)

    def solve(fraction, start):
        solution = increments.solve(fraction, start)
        return None if returns_none and solution.result.status is Status.STALLED else solution

    solution, words = solve_by_continuation(solve, failed)
    assert solution is None
    assert len(increments.fractions) < 20
    sentence = f"with {reached} of the change of the load there is a state, with more none was found"
    assert words == ("" if most == 0.0 else sentence)


def test_smaller_parts_reach_further(synthetic):
    increments = Increments(synthetic.step(1e-6), 0.02, 1.0)
    failed = increments.solve(1.0, None)
    assert solve_by_continuation(increments.solve, failed)[0] is None
    assert solve_by_continuation(increments.solve, failed, 1.0 / 64.0)[0].is_converged


@dataclass(frozen=True)
class Planned:
    """Increment with its problem, its force, and where its free motions count from."""

    problem: ContactProblem
    prescribed: dict[str, Array] = field(default_factory=dict)
    base: Array = field(default_factory=lambda: np.zeros(8))
    free: Indices = field(default_factory=lambda: np.zeros(1, np.intp))


def fraction(rise):
    """Return the fraction of a conductivity under the characteristic pressure."""
    return 1.0 / (1.0 + 1.0 / rise)


class Eased:
    """Increments under easier laws, solved from states whose friction ratio and rise are within a ratio of theirs.

    A rise counts as rise / (1 + rise), the fraction of the conductivities under the characteristic pressure.

    They are solved from the usual guess up to a product of both, and are not solved beyond another.
    """

    def __init__(self, step, problem, reach: float, alone: float, most: float = np.inf) -> None:
        self._step, self._problem, self._reach, self._alone, self._most = step, problem, reach, alone, most
        self.easings: list[Easing] = []

    def solve(self, start, easing: Easing):
        self.easings.append(easing)
        level = easing.ratio * fraction(easing.rise)
        from_level = self._alone if start is None else -start.load[0, 2] * self._reach
        solved = level <= min(from_level, self._most)
        load = np.zeros((25, 5))
        load[:, 2] = -level
        state = ContactState(load, np.zeros((25, 5)), np.zeros(25), np.zeros(0))
        result = replace(self._step, status=Status.CONVERGED if solved else Status.STALLED, iterations=7)
        return Solution(Planned(self._problem), SimpleNamespace(state=state), result)


@pytest.fixture(scope="module")
def coupled():
    """Problem under friction without a limit, in which all that touches conducts."""
    system = half_space_system(-np.eye(3), 1.0, 5)
    return indentation_problem(system, np.zeros(25), 0.1, IsotropicCoulomb(np.inf), (1.0, 0.0))


def test_friction_is_raised_to_a_limit_that_jumps(synthetic, coupled):
    increments = Eased(synthetic.step(1e-6), coupled, np.inf, 10.0)
    failed = increments.solve(None, Easing())
    increments.easings.clear()
    solution, reached = solve_by_capped_friction(increments.solve, failed, 1e-10)
    assert reached == np.inf
    assert [easing.ratio for easing in increments.easings] == [10.0, 100.0, 1e3, 1e4, 1e5, 1e6, np.inf]
    assert solution.is_converged
    assert solution.result.iterations == 7 * 8
    assert "friction of at most 1e+06 times the pressure" in solution.result.message


@pytest.mark.parametrize(("reach", "is_found"), [(4.0, True), (2.5, True), (1.01, False)])
def test_friction_is_raised_in_smaller_steps_where_that_fails(synthetic, coupled, reach, is_found):
    increments = Eased(synthetic.step(1e-6), coupled, reach, 10.0)
    solve = lambda start, easing: increments.solve(start, replace(easing, ratio=min(easing.ratio, 1.001e6)))  # noqa: E731
    solution, reached = solve_by_capped_friction(solve, increments.solve(None, Easing()), 1e-10)
    ratios = [easing.ratio for easing in increments.easings[1:]]
    assert ratios[:2] == [10.0, 100.0]
    assert (ratios[-1] > 1e6) == is_found == (solution is not None)
    assert reached == (np.inf if is_found else 10.0)
    assert len(ratios) < 100


def test_an_unsolved_increment_names_the_friction_up_to_which_there_is_a_state(synthetic, coupled):
    increments = Eased(synthetic.step(1e-6), coupled, 10.0, 10.0, 50.0)
    solve = lambda attempt: increments.solve(attempt.start, attempt.easing)  # noqa: E731
    result = solve_persistently(solve, 10, has_large_friction=True, stores=False, tolerance=1e-10).result
    assert result.status is Status.STALLED
    words = re.search(r"friction of at most (\S+) times the pressure there is a state, with more none", result.message)
    assert words is not None
    assert float(words[1]) == pytest.approx(50.0, rel=0.1)


def test_an_unsolved_increment_names_the_conduction_up_to_which_there_is_a_state(synthetic, coupled):
    increments = Eased(synthetic.step(1e-6), coupled, 10.0, 1e-6, 0.05)
    solve = lambda attempt: increments.solve(attempt.start, replace(attempt.easing, ratio=1.0))  # noqa: E731
    result = solve_persistently(solve, 10, has_large_friction=False, stores=False, tolerance=1e-10).result
    assert result.status is Status.STALLED
    words = re.search(r"conductivities that rise over (\S+) Pa there is a state, over less none", result.message)
    assert words is not None
    rise = problem_scales(coupled).pressure / float(words[1])
    assert fraction(rise) == pytest.approx(0.05, rel=0.1)


def test_conduction_is_raised_first_where_even_little_friction_fails(synthetic, coupled):
    increments = Eased(synthetic.step(1e-6), coupled, 10.0, 1e-5, 10.0)
    failed = increments.solve(None, Easing())
    increments.easings.clear()
    assert solve_by_capped_friction(increments.solve, failed, 1e-10)[0] is None
    gradual = [number for number, easing in enumerate(increments.easings) if easing.rise < np.inf]
    raised = increments.easings[gradual[0] : gradual[-1] + 1]
    assert {easing.ratio for easing in raised} == {10.0}
    assert {easing.rise for easing in increments.easings[: gradual[0]]} == {np.inf}
    lowest = min(range(len(raised)), key=lambda number: raised[number].rise)
    assert raised[lowest].rise == pytest.approx(1e-6)
    assert raised[lowest + 1].rise == pytest.approx(1e-5)
    # from the state with the law of conductivity
    assert increments.easings[gradual[-1] + 1 : gradual[-1] + 3] == [Easing(10.0)] * 2


@pytest.mark.parametrize(("reach", "is_found"), [(10.1, True), (3.2, True), (1.5, False)])
def test_conduction_is_raised_to_its_law(synthetic, coupled, reach, is_found):
    increments = Eased(synthetic.step(1e-6), coupled, reach, 1e-6)
    solve = lambda start, easing: increments.solve(start, replace(easing, ratio=1.0))  # noqa: E731
    failed = solve(None, Easing())
    solution, reached = solve_by_gradual_conduction(solve, failed)
    assert (solution is not None) == is_found == (reached == 0.0)
    assert reached < np.inf
    if is_found:
        assert increments.easings[-1].rise == np.inf
        assert solution.result.iterations == 7 * len(increments.easings)


def test_conduction_is_raised_at_nodes_and_then_at_the_edge_found_there(synthetic, coupled):
    increments = Eased(synthetic.step(1e-6), replace(coupled, area_fraction=np.ones(25)), 10.1, 1e-6)

    def solve(start, easing):
        level = 1.0 if easing.at_nodes or easing.edge_of else np.inf  # an edge that moves is too difficult
        return increments.solve(start, replace(easing, ratio=level))

    solution, reached = solve_by_gradual_conduction(solve, solve(None, Easing()))
    assert solution is not None
    assert reached == 0.0
    at_nodes = [easing.rise for easing in increments.easings if easing.at_nodes]
    at_edge = [easing for easing in increments.easings if easing.edge_of]
    assert at_nodes[-1] == at_edge[-1].rise == np.inf
    assert {easing.edge_of.load[0, 2] for easing in at_edge} == {-1.0}  # of the state under the whole conductivity
    assert at_edge[0].rise < 1.0
    assert solution.result.iterations == 7 * len(increments.easings)


class Approached:
    """Increments under a force of 3 N, solved from states with nearly that force, or with an approach.

    The force is a function of the approach in units of the displacement that the load causes; NaN where there is no
    state. Conductivities must be raised from the first rise, and then from one to the next.
    """

    def __init__(self, step, problem, force, first_rise: float = np.inf) -> None:
        self._step, self._force, self._rise = step, force, first_rise
        self._planned = Planned(problem, {"normal_force": np.array([3.0])})
        self.unit = problem_scales(problem).displacement[2]
        self.approaches: list[float | None] = []

    def solve(self, start, easing: Easing, approach=None):
        self.approaches.append(approach)
        at = (start.motion[0] if start else np.inf) if approach is None else approach
        force = self._force(at / self.unit)
        if approach is None:
            solved = abs(force - 3.0) < 0.5 and easing == Easing()
        else:
            solved = np.isfinite(force) and easing.at_nodes and (start is not None or easing.rise <= self._rise)
        motion, resultants = np.zeros(8), np.zeros(8)
        motion[0], resultants[0] = at, force
        state = ContactState(np.zeros((25, 5)), np.zeros((25, 5)), np.zeros(25), np.array([at]))
        result = replace(self._step, status=Status.CONVERGED if solved else Status.STALLED, iterations=7)
        return Solution(self._planned, SimpleNamespace(state=state, motion=motion, resultants=resultants), result)

    def search(self):
        return solve_by_approach(self.solve, self.solve(None, Easing()))


@pytest.mark.parametrize("first_rise", [np.inf, 1e-3])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_force_is_found_between_approaches(synthetic, coupled, first_rise, sign):
    """Also where the first force is too large, and after conductivities are raised."""
    increments = Approached(synthetic.step(1e-6), coupled, lambda a: 3.0 - sign + a * abs(a), first_rise)
    solution, words = increments.search()
    assert words == ""
    assert solution.is_converged
    assert increments.approaches[-1] is None
    assert solution.end.resultants[0] == pytest.approx(3.0, abs=0.5)
    assert solution.result.iterations == 7 * len(increments.approaches)
    assert "from a state with a prescribed approach" in solution.result.message


def test_a_force_that_the_states_jump_over_is_reported(synthetic, coupled):
    increments = Approached(synthetic.step(1e-6), coupled, lambda a: 2.0 + a if a < 0.4 else 4.0 + a)
    solution, words = increments.search()
    assert solution is None
    numbers = re.fullmatch(
        r"with an approach of (\S+) m there is a state under a normal force of (\S+) N, "
        r"with (\S+) m under (\S+) N, none between",
        words,
    )
    below, force_below, above, force_above = map(float, numbers.groups())
    assert below < 0.4 * increments.unit <= above
    assert above - below < increments.unit / 1000.0
    assert (force_below, force_above) == pytest.approx((2.4, 4.4), abs=0.01)


def test_the_last_force_is_reported_where_the_states_end(synthetic, coupled):
    increments = Approached(synthetic.step(1e-6), coupled, lambda a: 1.0 + a if a < 0.7 else np.nan)
    solution, words = increments.search()
    assert solution is None
    numbers = re.fullmatch(
        r"with an approach of (\S+) m there is a state under a normal force of (\S+) N, none beyond", words
    )
    assert float(numbers[1]) == pytest.approx(0.7 * increments.unit, rel=1e-2)
    assert float(numbers[2]) == pytest.approx(1.7, rel=1e-2)
    assert len(increments.approaches) < 40


@pytest.mark.parametrize("force", [np.nan, 1.0])
def test_no_force_is_reported_where_states_neither_begin_nor_end(synthetic, coupled, force):
    increments = Approached(synthetic.step(1e-6), coupled, lambda a: force)
    assert increments.search() == (None, "")
    assert len(increments.approaches) < 50


def test_capped_friction_is_that_of_a_finite_coefficient():
    trial = np.random.default_rng(1).normal(size=(50, 3)) * [5.0, 5.0, 1.0]
    finite = IsotropicCoulomb(2.0)
    np.testing.assert_allclose(CappedLaw(IsotropicCoulomb(np.inf), 2.0).project(trial), finite.project(trial))
    traction = CappedLaw(Tresca(0.5), 2.0).project(trial)
    np.testing.assert_allclose(traction[:, 2], np.minimum(trial[:, 2], 0.0))
    size = np.linalg.norm(traction[:, :2], axis=1)
    np.testing.assert_allclose(
        size, np.minimum(np.linalg.norm(trial[:, :2], axis=1), np.minimum(0.5, -2.0 * traction[:, 2])), atol=1e-15
    )


def test_solutions_of_the_capped_law_are_those_of_a_finite_coefficient():
    rng, mu, r = np.random.default_rng(2), 2.0, (3.0, 0.5)
    pressure, angle, share, slip = rng.uniform([0.1, 0.0, 0.0, 0.1], [1.0, 6.0, 1.0, 1.0], (50, 4)).T
    along = np.column_stack([np.cos(angle), np.sin(angle)])
    sticks = np.arange(50) < 25
    traction = np.column_stack([(mu * pressure * np.where(sticks, share, 1.0))[:, None] * along, -pressure])
    gap = np.column_stack([np.where(sticks, 0.0, slip)[:, None] * along, np.zeros(50)])
    capped = CappedLaw(IsotropicCoulomb(np.inf), mu)
    trial = augmented_traction(capped, traction, gap, r)
    np.testing.assert_allclose(fixed_point_map(capped, trial, gap, r), traction, atol=1e-14)
    for wrong in (traction * [1.01, 1.01, 1.0], traction * [0.99, 0.99, 1.0]):
        trial = augmented_traction(capped, wrong, gap, r)
        off = np.abs(fixed_point_map(capped, trial, gap, r) - wrong).max(axis=1)
        assert (off[~sticks] > 1e-3).all()
    overlapping = gap - [0.0, 0.0, 0.1]
    trial = augmented_traction(capped, traction, overlapping, r)
    assert (np.abs(fixed_point_map(capped, trial, overlapping, r) - traction).max(axis=1) > 0.1).all()


def test_capped_laws_have_the_capabilities_of_their_law():
    gap = np.array([0.0, 0.1, 1.0])
    law = DMT(0.05, 1.0, mu=np.inf)
    assert is_adhesive(CappedLaw(law, 10.0))
    np.testing.assert_array_equal(attraction(CappedLaw(law, 10.0), gap), attraction(law, gap))
    assert not is_adhesive(CappedLaw(Tresca(1.0), 10.0))


def test_easing_changes_conductors_alone(coupled):
    eased = Easing(rise=0.25).apply(coupled)
    assert eased.contact_law is coupled.contact_law
    assert eased.channels[1] is coupled.channels[1]
    pressure = problem_scales(coupled).pressure * np.array([0.0, 1e-300, 1e-3, 4.0, 1e3])
    kappa = eased.channels[0].law.conductivity(-pressure, np.zeros(5), np.zeros(5))
    np.testing.assert_allclose(kappa, [0.0, 0.0, 1.0 / 4001.0, 0.5, 1.0 / 1.004], atol=1e-15)


def test_perfect_conductors_and_those_across_gaps_are_eased_as_far_as_possible():
    perfect, zero = GradualLaw(StepConductivity(np.inf), 1.0), np.zeros(2)
    np.testing.assert_array_equal(perfect.conductivity(np.array([-1.0, 0.0]), zero, zero), [np.inf, 0.0])
    system = half_space_system(-np.eye(3), 1.0, 5)
    problem = indentation_problem(system, np.zeros(25), 0.1, IsotropicCoulomb(0.3))
    across = AcrossGap(2.0, 1.0, 1.0)
    eased = Easing(rise=0.25).apply(problem.with_laws(electric=across))
    at_gaps = zero, np.array([0.0, 1.0]), zero
    assert eased.channels[0].law.across_gap
    np.testing.assert_allclose(eased.channels[0].law.conductivity(*at_gaps), 0.2 * across.conductivity(*at_gaps))
