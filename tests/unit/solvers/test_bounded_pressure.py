"""Test conjugate gradients with a largest pressure against the conditions of the solution, written with the matrix."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from meeframe.contact.problem import Status
from meeframe.fields import Array
from meeframe.laws import Signorini
from meeframe.material import library_material
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.solvers import ProjectedCG, StoppingCriteria, solve
from meeframe.testing.force_control import prescribe_resultant
from meeframe.testing.half_space import half_space_system, indentation_problem
from meeframe.testing.matrix_free import MatrixFree

SIDE, CELLS, BOUND = 1e-3, 14, 2e8
SYSTEM = half_space_system(axisymmetric_compliance(library_material("batio3-cofe2o4").stiffness), SIDE, CELLS)
SEEDS = pytest.mark.parametrize("seed", range(4))
CAPABLE = pytest.mark.parametrize("system", [SYSTEM, MatrixFree.of(SYSTEM)], ids=["matrix", "products"])


@dataclass(frozen=True)
class Capped(Signorini):
    """A law that limits the pressure."""

    def project(self, trial: Array) -> Array:
        return np.maximum(super().project(trial), -BOUND)


def rough_gap(seed: int) -> Array:
    """Return the gap (n,) of independent heights [m], which is closed by pressures larger than the bound."""
    return 4e-6 * np.random.default_rng(seed).random(len(SYSTEM.points))


def check_solution(pressure: Array, gap: Array, motion: Array, modes: Array) -> None:
    """Check the complementarity of pressures (n,) and of the gaps that they leave, on the scale of both."""
    opening = gap + SYSTEM.dense()[:, 2, :, 2] @ pressure - motion @ modes
    scale = np.abs(np.diagonal(SYSTEM.dense()[:, 2, :, 2])).max() * BOUND
    assert (np.clip(pressure, 0.0, BOUND) == pressure).all()
    free, yielded = (pressure > 0.0) & (pressure < BOUND), pressure == BOUND
    assert free.any()
    assert yielded.any()
    assert np.abs(opening[free]).max() <= 1e-9 * scale
    assert opening[pressure == 0.0].min(initial=0.0) >= -1e-9 * scale
    assert opening[yielded].max() <= 1e-9 * scale


@pytest.mark.full(except_for=16)
@SEEDS
@CAPABLE
@pytest.mark.parametrize("share", [0.05, 0.5, 0.9, 0.99])
def test_force_and_moments(system, share: float, seed: int) -> None:
    """An eccentric force of up to 99 % of the largest one tilts the indenter."""
    n, gap = len(SYSTEM.points), rough_gap(seed)
    shapes = np.stack([np.ones(n), *SYSTEM.points[:, :2].T])
    # resultants of random admissible pressures are feasible
    random = np.clip(np.random.default_rng(100 + seed).normal(share, 0.3, n), 0.0, 1.0)
    random *= min(1.0, share / random.mean())
    totals = BOUND * (SYSTEM.weights * shapes) @ random
    free = tuple(
        prescribe_resultant(SYSTEM, np.outer(shape, [0.0, 0.0, -1.0, 0.0, 0.0]), total)
        for shape, total in zip(shapes, totals, strict=True)
    )
    problem = replace(indentation_problem(SYSTEM, gap, 0.0, Capped()), system=system, prescribed_resultants=free)
    solution = solve(problem, ProjectedCG(), StoppingCriteria(tolerance=1e-10, max_iterations=500))
    assert solution.status is Status.CONVERGED, solution.message
    pressure = -solution.state.load[:, 2]
    check_solution(pressure, gap, solution.state.motion, shapes)
    np.testing.assert_allclose((SYSTEM.weights * shapes) @ pressure, totals, atol=1e-10 * totals[0] * SIDE)


@SEEDS
@CAPABLE
@pytest.mark.parametrize("approach", [2e-6, 4e-6])
def test_prescribed_approach(system, approach: float, seed: int) -> None:
    gap = rough_gap(seed)
    problem = replace(indentation_problem(SYSTEM, gap, approach, Capped()), system=system)
    solution = solve(problem, ProjectedCG(), StoppingCriteria(tolerance=1e-10, max_iterations=500))
    assert solution.status is Status.CONVERGED, solution.message
    check_solution(-solution.state.load[:, 2], gap, np.array([approach]), np.ones((1, len(gap))))


@pytest.mark.full(except_for=16)
@SEEDS
@CAPABLE
@pytest.mark.parametrize("share", [0.92, 0.95, 0.99, 0.999])
def test_force_from_a_start_without_pressure(system, share: float, seed: int) -> None:
    """No node is within its bounds at first: a step may not end with all nodes at the largest pressure."""
    n, gap = len(SYSTEM.points), rough_gap(seed)
    total = share * BOUND * SYSTEM.weights.sum()
    free = (prescribe_resultant(SYSTEM, np.outer(np.ones(n), [0.0, 0.0, -1.0, 0.0, 0.0]), total),)
    problem = replace(indentation_problem(SYSTEM, gap, 0.0, Capped()), system=system, prescribed_resultants=free)
    solution = solve(problem, ProjectedCG(), StoppingCriteria(tolerance=1e-10, max_iterations=500))
    assert solution.status is Status.CONVERGED, solution.message
    pressure = -solution.state.load[:, 2]
    check_solution(pressure, gap, solution.state.motion, np.ones((1, n)))
    assert SYSTEM.weights @ pressure == pytest.approx(total, rel=1e-10)
