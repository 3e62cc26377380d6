"""Elimination of potentials agrees with the monolithic system (30), by factorisation and by a Krylov method."""

from dataclasses import replace

import numpy as np
import pytest

from meeframe.common.errors import MeeframeError
from meeframe.contact.channels import flux_channels
from meeframe.contact.conduction import potential_diagonal, resistances
from meeframe.contact.problem import ContactProblem, contact_gap
from meeframe.fields import Array
from meeframe.laws import IsotropicCoulomb, StepConductivity
from meeframe.solvers import Uzawa, residual, solve
from meeframe.solvers.conduction.elimination import Elimination
from meeframe.system.dense import DenseSystem
from meeframe.system.reduced import NodalFields
from meeframe.testing.matrix_free import MatrixFree

N = 12


def refuse(_load: Array) -> NodalFields:
    raise MeeframeError("nothing to recover")


def random_problem(seed: int, kappa: tuple[float, float] = (3.0, 0.2)) -> ContactProblem:
    """Return a problem with a random compliance of the correct structure, unsymmetric as from collocation."""
    random = np.random.default_rng(seed)
    root = random.normal(size=(5 * N, 5 * N))
    matrix = root @ root.T / (5 * N) + np.eye(5 * N)
    electric = np.tile([False, False, False, True, True], N)
    matrix[np.ix_(electric, ~electric)] *= -1.0  # reciprocity with negated potentials: skew coupling
    matrix += 0.02 * random.normal(size=matrix.shape)
    system = DenseSystem(
        points=random.normal(size=(N, 3)),
        frames=np.tile(np.eye(3), (N, 1, 1)),
        weights=np.ones(N),
        cells=(),
        offset=0.1 * random.normal(size=(N, 5)),
        matrix=matrix.reshape(N, 5, N, 5),
        recovery=refuse,
    )
    gap = -random.uniform(0.5, 1.5, N)
    gap[3] = np.inf
    laws = IsotropicCoulomb(0.3), flux_channels(*map(StepConductivity, kappa))
    return ContactProblem(system, *laws, gap, 0.3 * random.normal(size=(N, 2)), random.normal(size=(N, 2)))


@pytest.mark.parametrize("kappa", [(3.0, 0.2), (np.inf, 0.2), (0.0, np.inf), (np.inf, np.inf), (0.0, 0.0)])
def test_elimination_matches_monolithic_system(kappa: tuple[float, float]) -> None:
    """The monolithic system has all displacements, potentials and fluxes as unknowns, and includes the flux law."""
    problem = random_problem(1, kappa)
    random = np.random.default_rng(2)
    traction = random.normal(size=(N, 3))
    traction[:, 2] = -np.abs(traction[:, 2])
    traction[[3, 5]] = 0.0
    contact_fraction = (traction[:, 2] < 0.0).astype(float)
    system = problem.system
    matrix = system.dense().reshape(5 * N, 5 * N)
    potential = np.flatnonzero(np.tile([False, False, False, True, True], N))
    # unknowns (displacement 5N, flux 2N); equations: compliance, then K (-phi + phi_o) + q = 0, or -phi + phi_o =
    # 0 for inf
    left = np.zeros((7 * N, 7 * N))
    right = np.zeros(7 * N)
    left[: 5 * N, : 5 * N] = np.eye(5 * N)
    left[: 5 * N, 5 * N :] = -matrix[:, potential]
    load = np.zeros((N, 5))
    load[:, :3] = traction
    right[: 5 * N] = system.offset.ravel() + matrix @ load.ravel()
    for row, (node, field) in enumerate((node, field) for node in range(N) for field in range(2)):
        conductivity = kappa[field] * contact_fraction[node] if contact_fraction[node] else 0.0
        perfect = np.isinf(conductivity)
        left[5 * N + row, 5 * node + 3 + field] = 1.0 if perfect else conductivity
        left[5 * N + row, 5 * N + row] = 0.0 if perfect else 1.0
        right[5 * N + row] = -(1.0 if perfect else conductivity) * problem.potentials[node, field]
    monolithic = np.linalg.solve(left, right)

    elimination = Elimination.of(problem)
    conductors = elimination.prepare(
        resistances(problem, traction[:, 2], contact_fraction, potential_diagonal(problem)), None
    )
    state = elimination.state(traction, conductors, np.zeros((N, 2)), np.zeros(0))
    above = np.isfinite(problem.gap)
    assert state.flux.ravel() == pytest.approx(monolithic[5 * N :], rel=1e-12, abs=1e-12)
    expected = monolithic[: 5 * N].reshape(N, 5)
    assert state.displacement[above] == pytest.approx(expected[above, :3], rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("kappa", [(3.0, 0.2), (np.inf, 0.0), (np.inf, np.inf)])
def test_krylov_matches_factorisation(kappa: tuple[float, float]) -> None:
    problem = random_problem(3, kappa)
    random = np.random.default_rng(4)
    dense = Elimination.of(problem)
    krylov = Elimination.of(replace(problem, system=MatrixFree.of(problem.system)))
    factors = iterative = None
    for contact_fraction in (
        random.uniform(size=N),
        np.ones(N),
        np.zeros(N),
        (random.uniform(size=N) > 0.5).astype(float),
    ):
        traction = random.normal(size=(N, 3))
        traction[3] = 0.0
        resistance = resistances(problem, -np.ones(N), contact_fraction, potential_diagonal(problem))
        factors, iterative = dense.prepare(resistance, factors), krylov.prepare(resistance, iterative)
        above = np.isfinite(problem.gap)
        nothing, none = np.zeros((N, 2)), np.zeros(0)
        by_factors, by_krylov = dense.respond(traction, factors, nothing), krylov.respond(traction, iterative, nothing)
        whole = dense.state(traction, factors, nothing, none), krylov.state(traction, iterative, nothing, none)
        for one, other in ((by_factors, by_krylov), whole):
            assert one.flux[above] == pytest.approx(other.flux[above], rel=1e-9, abs=1e-10)
            assert one.displacement[above] == pytest.approx(other.displacement[above], rel=1e-9, abs=1e-10)


def test_factors_are_reused() -> None:
    problem = random_problem(5)
    elimination = Elimination.of(problem)
    resistance = resistances(problem, -np.ones(N), np.ones(N), potential_diagonal(problem))
    first = elimination.prepare(resistance, None)
    assert elimination.prepare(resistance.copy(), first) is first
    assert elimination.prepare(2.0 * resistance, first) is not first


def test_solution_without_a_matrix() -> None:
    problem = random_problem(6, (np.inf, 0.2))
    system = problem.system
    assert isinstance(system, DenseSystem)
    without = replace(problem, system=MatrixFree.of(system))
    dense, krylov = solve(problem, Uzawa()), solve(without, Uzawa())
    assert dense.status == krylov.status == "converged"
    assert krylov.state.load == pytest.approx(dense.state.load, rel=1e-7, abs=1e-8)
    assert residual(problem, krylov.state) < 1e-9
    gap = contact_gap(problem, krylov.state.displacement)
    assert gap[np.isfinite(problem.gap), 2].min() > -1e-9
