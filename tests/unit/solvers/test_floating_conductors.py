"""Gradient iterations solve for potentials of floating conductors, alone and with prescribed forces."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.optimize import brentq

from meeframe.contact.conduction import potential_diagonal, resistances
from meeframe.contact.problem import ContactProblem, ContactState, Status
from meeframe.contact.scales import problem_scales
from meeframe.laws import IsotropicCoulomb, Signorini
from meeframe.material import library_material
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.solvers import BarzilaiBorwein, Nesterov, SemismoothNewton, StoppingCriteria, Uzawa, solve
from meeframe.solvers.conduction.elimination import Elimination
from meeframe.testing.closed_forms import Sphere, indent
from meeframe.testing.contact import rescaled
from meeframe.testing.contact_cases import APPROACH, RADIUS
from meeframe.testing.force_control import (
    MAGNETOMOTIVE,
    PRESS,
    SLIDE,
    VOLTAGE,
    balanced_solution,
    check_same,
    conducting_sphere,
    prescribe_resultant,
    released,
)
from meeframe.testing.half_space import half_space_system, indentation_problem
from meeframe.testing.matrix_free import MatrixFree

GRADIENT = [Uzawa(), BarzilaiBorwein(), Nesterov()]
ALL = [*GRADIENT, SemismoothNewton()]
KAPPA = {"finite": (1.0, 0.3), "mixed": (np.inf, 0.5), "perfect": (np.inf, np.inf)}
MU = 0.3
XI = axisymmetric_compliance(library_material("batio3-cofe2o4").stiffness)


@cache
def conducting(condition: str) -> tuple[ContactProblem, ContactState]:
    """Return a conducting sphere and its solution."""
    problem = conducting_sphere(Signorini(), KAPPA[condition])
    return problem, balanced_solution(problem, Uzawa()).state


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("prescribed", [("approach",), ("potentials",), ("approach", "potentials")], ids="-".join)
@pytest.mark.parametrize("condition", KAPPA)
def test_resultants_recover_the_motions(condition, prescribed) -> None:
    problem, expected = conducting(condition)
    free, motion = released(problem, expected, *prescribed)
    # a law that jumps may have two solutions; from a nearby start all solvers agree
    near = replace(expected, load=1.001 * expected.load)
    for solver in ALL:
        state = balanced_solution(free, solver, start=near).state
        check_same(state, expected)
        np.testing.assert_allclose(state.motion, motion, rtol=1e-8)


@pytest.mark.parametrize("kappa", [1.0, 1e-4, 1e-8])
def test_totals_are_measured_by_the_fluxes_of_a_poor_conductor(kappa) -> None:
    problem = conducting_sphere(Signorini(), (kappa, kappa))
    solution = balanced_solution(problem, SemismoothNewton()).state
    free, _ = released(problem, solution, "potentials")
    for resultant, unit in zip(free.prescribed_resultants, problem_scales(free).totals, strict=True):
        conducted = np.abs(resultant.measure * solution.load).sum()
        assert 0.1 * conducted < unit < 10.0 * conducted


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("solver", [BarzilaiBorwein(), SemismoothNewton()], ids=str)
@pytest.mark.parametrize("potential", [2e4, -1.5e4, None])
def test_floating_conductor_matches_closed_form(solver, potential) -> None:
    """Force and charge recover approach and potential; None means no charge. The flux is singular at the edge, which
    the grid resolves to first order only."""
    if potential is None:
        potential = brentq(lambda phi: indent(XI, Sphere(RADIUS), APPROACH, phi).charge, -1e5, 1e5)
    exact = indent(XI, Sphere(RADIUS), APPROACH, potential)
    system = half_space_system(XI, 5e-3, 20)
    free = prescribe_resultant(system, PRESS, exact.force), prescribe_resultant(system, VOLTAGE, exact.charge)
    height = (system.points**2).sum(axis=1) / (2.0 * RADIUS)
    touching = indentation_problem(system, height, approach=0.0, conductivity=(np.inf, 0.0))
    motion = balanced_solution(replace(touching, prescribed_resultants=free), solver, StoppingCriteria()).state.motion
    assert motion[0] == pytest.approx(APPROACH, rel=5e-3)
    assert motion[1] == pytest.approx(potential, rel=0.03)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("condition", KAPPA)
@pytest.mark.parametrize("charges", [(0.0, 0.0), (1e-7, -2e-7)], ids=["uncharged", "charged"])
def test_floating_conductor_equals_prescribed_potential(condition, charges) -> None:
    problem = conducting_sphere(Signorini(), KAPPA[condition], potentials=(0.0, 0.0))
    modes = zip((VOLTAGE, MAGNETOMOTIVE), charges, strict=True)
    floating = replace(
        problem, prescribed_resultants=tuple(prescribe_resultant(problem.system, mode, total) for mode, total in modes)
    )
    for solver in ALL:
        state = balanced_solution(floating, solver).state
        held = replace(problem, potentials=np.tile(state.motion, (len(problem.gap), 1)))
        again = balanced_solution(
            held, Uzawa(), start=replace(state, load=1.001 * state.load, motion=np.zeros(0))
        ).state
        check_same(state, again)
        totals = problem.system.weights @ again.load[:, 3:]
        assert (np.abs(totals - charges) <= 1e-8 * (problem.system.weights @ np.abs(again.load[:, 3:]))).all()


@pytest.mark.parametrize("condition", KAPPA)
def test_elimination_matches_bordered_system(condition) -> None:
    """For given tractions, fluxes and floating potentials solve one linear system."""
    problem = conducting_sphere(IsotropicCoulomb(MU), KAPPA[condition], cells=6)
    system, n = problem.system, len(problem.gap)
    free = (
        prescribe_resultant(system, VOLTAGE, 1e-8),
        prescribe_resultant(system, PRESS, 1.0),
        prescribe_resultant(system, MAGNETOMOTIVE, -3e-9),
    )
    problem = replace(problem, prescribed_resultants=free)
    random = np.random.default_rng(1)
    load = np.zeros((n, 5))
    load[:, :3] = 1e6 * random.normal(size=(n, 3))
    contact_fraction = (random.uniform(size=n) > 0.4).astype(float)
    resistance = resistances(problem, -np.ones(n), contact_fraction, potential_diagonal(problem))
    pairs = np.flatnonzero(np.column_stack([np.zeros((n, 3), bool), np.isfinite(resistance)]))
    matrix = system.dense().reshape(5 * n, 5 * n)
    scale = np.tile(np.diag(matrix)[:5] ** -0.5, n)[pairs]
    modes = np.stack([f.mode.ravel()[pairs] for f in (free[0], free[2])], axis=1)
    measures = np.stack([f.measure.ravel()[pairs] for f in (free[0], free[2])])
    unit = 1.0 / np.abs(scale[:, None] * modes).max(axis=0)
    k = len(pairs)
    whole = np.zeros((k + 2, k + 2))
    resist = np.diag(np.column_stack([np.zeros((n, 3)), resistance]).ravel()[pairs])
    whole[:k, :k] = scale[:, None] * (matrix[np.ix_(pairs, pairs)] + resist) * scale
    whole[:k, k:] = -scale[:, None] * modes * unit
    whole[k:, :k] = measures * scale / np.abs(measures * scale).max(axis=1, keepdims=True)
    potential = np.column_stack([np.zeros((n, 3)), -problem.potentials]).ravel() - matrix @ load.ravel()
    totals = np.array([free[0].total, free[2].total]) / np.abs(measures * scale).max(axis=1)
    unknown = np.linalg.solve(whole, np.concatenate([scale * potential[pairs], totals]))
    flux = np.zeros((n, 5))
    flux.flat[pairs] = scale * unknown[:k]
    for body in (system, MatrixFree.of(system)):
        elimination = Elimination.of(replace(problem, system=body))
        conductors = elimination.prepare(resistance, None)
        response = elimination.respond(load[:, :3], conductors, np.zeros((n, 2)))
        # a coarse solution does not replace a good initial guess
        near = conductors.without_floating(response.flux, response.potential)
        again = elimination.respond(load[:, :3], conductors, near, 1e-3)
        assert np.abs(again.flux - response.flux).max() <= 1e-9 * np.abs(response.flux).max()
        computed = elimination.state(load[:, :3], conductors, np.zeros((n, 2)), np.zeros(2))
        assert (np.abs(computed.flux - flux[:, 3:]).max(axis=0) <= 1e-9 * np.abs(flux[:, 3:]).max(axis=0)).all()
        assert computed.potential == pytest.approx(unit * unknown[k:], rel=1e-9)
        assert list(conductors.floating.numbers) == [0, 2]


@pytest.mark.parametrize("solver", ALL, ids=str)
def test_floating_potential_is_unchanged_without_conduction(solver) -> None:
    problem = conducting_sphere(Signorini())
    start = ContactState(np.zeros((64, 5)), np.zeros((64, 5)), np.zeros(64), np.array([123.0]))
    floating = replace(problem, prescribed_resultants=(prescribe_resultant(problem.system, VOLTAGE, 0.0),))
    assert balanced_solution(floating, solver, start=start).state.motion == [123.0]
    charged = replace(problem, prescribed_resultants=(prescribe_resultant(problem.system, VOLTAGE, 1e-7),))
    assert solve(charged, solver, StoppingCriteria(max_iterations=200), start).status is not Status.CONVERGED


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("solver", GRADIENT, ids=str)
def test_matrix_free_systems(solver) -> None:
    problem = conducting_sphere(IsotropicCoulomb(MU), KAPPA["finite"], cells=6)
    free = [prescribe_resultant(problem.system, PRESS, 800.0), prescribe_resultant(problem.system, VOLTAGE, 1e-7)]
    free.append(prescribe_resultant(problem.system, SLIDE, 100.0))
    problem = replace(problem, prescribed_resultants=tuple(free))
    dense = balanced_solution(problem, solver, StoppingCriteria())
    bare = balanced_solution(replace(problem, system=MatrixFree.of(problem.system)), solver, StoppingCriteria())
    assert abs(bare.iterations - dense.iterations) <= solver.check_interval
    np.testing.assert_allclose(bare.state.motion, dense.state.motion, rtol=1e-8)
    np.testing.assert_allclose(
        bare.state.load[:, :3], dense.state.load[:, :3], atol=1e-8 * np.abs(dense.state.load).max()
    )


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("solver", ALL, ids=str)
@pytest.mark.parametrize("potentials", [False, True], ids=["all", "potentials"])
def test_solutions_do_not_depend_on_units(solver, potentials) -> None:
    problem = conducting_sphere(IsotropicCoulomb(MU), KAPPA["finite"], cells=7)
    free = [prescribe_resultant(problem.system, PRESS, 800.0), prescribe_resultant(problem.system, VOLTAGE, 1e-7)]
    free.append(prescribe_resultant(problem.system, SLIDE, 100.0))
    problem = replace(problem, prescribed_resultants=tuple(free))
    changed = np.array([not potentials] * 3 + [True] * 2)
    displacement, load = (np.where(changed, factor, 1.0) for factor in (1e9, 1e-9))
    plain = balanced_solution(problem, solver, StoppingCriteria())
    other = solve(rescaled(problem, displacement, load), solver)
    assert other.status is Status.CONVERGED
    assert abs(other.iterations - plain.iterations) <= solver.check_interval
    size = np.abs(plain.state.load).max(axis=0)
    assert (np.abs(other.state.load / load - plain.state.load) <= 1e-8 * size).all()
    np.testing.assert_allclose(other.state.motion, plain.state.motion, rtol=1e-8)
