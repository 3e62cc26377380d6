"""States with a polygon as limit of friction, against the laws of friction themselves."""

from dataclasses import replace

import numpy as np
import pytest
from meeframe_laws.adhesive import DMT
from meeframe_laws.compliant import Compliant
from meeframe_laws.friction import CappedCoulomb, Tresca

from meeframe.contact.problem import PrescribedResultant, Status, contact_gap, unbalance
from meeframe.contact.residual import law_residual
from meeframe.contact.scales import problem_scales
from meeframe.laws import IsotropicCoulomb
from meeframe.model.easier_laws import Easing
from meeframe.model.polyhedral_friction import polyhedral_state, solve_from_polyhedral_friction
from meeframe.solvers import Auto, solve
from meeframe.testing.half_space import half_space_system, indentation_problem

NEARLY = 1e-3
"""Residual of a state whose directions of friction are refined."""


def strongly_coupled(law, seed=0, slip=1.0, conductivity=(0.0, 0.0)):
    """Return a problem on 25 nodes in which shear lifts and presses nodes as much as pressure does.

    conductivity: electric and magnetic one in contact; fluxes then deform the surface as tractions do.
    """
    rng = np.random.default_rng(seed)
    system = half_space_system(-np.eye(3), 1.0, 5)
    fields = 5 if any(conductivity) else 3
    factor = rng.normal(size=(25 * fields, 25 * fields))
    matrix = system.matrix.copy()
    matrix[:, :fields, :, :fields] = (factor @ factor.T / len(factor) + 0.2 * np.eye(len(factor))).reshape(
        25, fields, 25, fields
    )
    matrix[:, :3, :, fields:], matrix[:, fields:, :, :3] = 0.0, 0.0
    potentials = (0.1, -0.1)
    problem = indentation_problem(
        replace(system, matrix=matrix), rng.uniform(0.0, 0.5, 25), 0.3, law, conductivity, potentials
    )
    return replace(problem, translation=slip * rng.normal(size=(25, 2)))


@pytest.mark.parametrize("ratio", [0.5, 10.0, 1e3])
@pytest.mark.parametrize("law", [IsotropicCoulomb(np.inf), IsotropicCoulomb(0.3), Tresca(0.4), CappedCoulomb(2.0, 0.2)])
def test_states_nearly_satisfy_the_capped_law(law, ratio):
    problem = strongly_coupled(law)
    eased = Easing(ratio).apply(problem)
    state = polyhedral_state(problem, law, ratio, None)
    assert state is not None
    assert law_residual(eased, state, problem_scales(eased)) < NEARLY
    np.testing.assert_allclose(state.displacement, problem.system.offset + problem.system.apply(state.load))


@pytest.mark.parametrize("is_known", [False, True])
@pytest.mark.parametrize(
    "law", [DMT(0.02, 1.0, mu=np.inf), Compliant(1.0, 0.1, 1.5, mu=np.inf), Compliant(1.0, 0.1, 3.0, mu=np.inf)]
)
def test_attraction_and_compliance_are_those_of_the_state(law, is_known):
    problem = strongly_coupled(law)
    eased = Easing(2.0).apply(problem)
    known = solve(eased, Auto())
    assert known.status is Status.CONVERGED
    state = polyhedral_state(problem, law, 2.0, known.state if is_known else None)
    assert state is not None
    assert law_residual(eased, state, problem_scales(eased)) < NEARLY
    assert (state.load[:, 2] > 0.0).any() == isinstance(law, DMT)


@pytest.mark.parametrize("conductivity", [(0.5, 0.0), (0.5, np.inf)])
def test_fluxes_are_those_of_the_state(conductivity):
    problem = strongly_coupled(IsotropicCoulomb(np.inf), 1, conductivity=conductivity)
    eased = Easing(2.0).apply(problem)
    state = polyhedral_state(problem, problem.contact_law, 2.0, None)
    assert state is not None
    assert law_residual(eased, state, problem_scales(eased)) < NEARLY
    assert state.load[:, 3:].any(axis=0).tolist() == [True, conductivity[1] > 0.0]


def test_a_prescribed_flux_is_conducted():
    problem = strongly_coupled(IsotropicCoulomb(np.inf), conductivity=(0.5, 0.0))
    mode = np.zeros((25, 5))
    mode[:, 3] = -1.0
    prescribed = PrescribedResultant(mode, mode, problem.system.weights, 0.02)
    eased = Easing(2.0).apply(replace(problem, prescribed_resultants=(prescribed,)))
    state = polyhedral_state(eased, problem.contact_law, 2.0, None)
    assert state is not None
    assert law_residual(eased, state, problem_scales(eased)) < NEARLY
    assert prescribed.of_load(state.load) == pytest.approx(0.02)


def test_a_prescribed_force_is_borne():
    problem = strongly_coupled(IsotropicCoulomb(np.inf))
    mode, density = np.zeros((25, 5)), np.zeros((25, 5))
    mode[:, 2], density[:, 2] = -1.0, -1.0
    total = 0.01
    problem = replace(
        problem, prescribed_resultants=(PrescribedResultant(mode, density, problem.system.weights, total),)
    )
    state = polyhedral_state(problem, problem.contact_law, 1e3, None)
    assert state is not None
    np.testing.assert_allclose(unbalance(problem, state.load), 0.0, atol=1e-6 * total)
    gap = contact_gap(problem, state.displacement, state.motion)[:, 2]
    assert gap.min() > -1e-6
    assert (np.abs(gap[state.load[:, 2] < 0.0]) < 1e-6).all()


def test_nodes_that_overlap_are_added():
    """Nodes that are far from contact in the known state touch in the new one."""
    problem = strongly_coupled(IsotropicCoulomb(np.inf))
    light = solve(replace(problem, gap=problem.gap + 0.25, translation=0.0 * problem.translation), Auto()).state
    far = replace(light, displacement=light.displacement - [0.0, 0.0, 10.0, 0.0, 0.0])
    state = polyhedral_state(problem, problem.contact_law, 1e2, far)
    gap = contact_gap(problem, state.displacement, state.motion)[:, 2]
    assert (state.load[:, 2] < 0.0).sum() > (light.load[:, 2] < 0.0).sum()
    assert gap.min() > -1e-6


def test_nothing_is_found_without_a_stored_matrix():
    problem = strongly_coupled(IsotropicCoulomb(np.inf))

    class Unstored(type(problem.system)):
        def dense(self):
            return None

    system = Unstored(**{name: getattr(problem.system, name) for name in problem.system.__dataclass_fields__})
    assert polyhedral_state(replace(problem, system=system), problem.contact_law, 1e2, None) is None


def test_nothing_is_found_where_nothing_may_touch():
    problem = strongly_coupled(IsotropicCoulomb(np.inf))
    nowhere = replace(problem, gap=np.full(25, np.inf))
    assert polyhedral_state(nowhere, problem.contact_law, 1e2, None) is None
    far = polyhedral_state(replace(problem, gap=np.full(25, 100.0)), problem.contact_law, 1e2, None)
    assert not far.load[:, 2].any()


@pytest.mark.full(except_for=3)
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("law", [IsotropicCoulomb(np.inf), Tresca(0.5)])
def test_increments_with_limits_that_jump_are_solved(increments, law, seed):
    problem = strongly_coupled(law, seed)
    solve_eased, failed = increments(problem)
    solution = solve_from_polyhedral_friction(solve_eased, failed, 1e-10)
    assert solution is not None
    assert law_residual(problem, solution.end.state, problem_scales(problem)) < 1e-10
    assert solution.increment.problem.contact_law is law
    assert solution.result.iterations > failed.result.iterations
