"""Newton's method and gradient steps agree on random grids with frictionless conducting contact."""

from dataclasses import replace

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace

from meeframe.contact.problem import ContactProblem, ContactState, Status, indenter_position
from meeframe.elements import Quad4
from meeframe.laws import Signorini
from meeframe.material import library_material
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.solvers import Nesterov, ProjectedCG, SemismoothNewton, StoppingCriteria, solve
from meeframe.testing.force_control import PRESS, prescribe_resultant
from meeframe.testing.half_space import indentation_problem

WIDTH, RADIUS = 1e-2, 0.1
POTENTIALS = [(0, 0), (5, 1), (50, 5), (0, 30), (-50, -5), (2e3, 0), (-2e3, 0), (20, -3), (0, -30)]


def random_problem(seed: int) -> ContactProblem:
    """Return a problem on a free or periodic, odd or even grid, with one to nearly all nodes in contact and
    prescribed motion or force."""
    random = np.random.default_rng(seed)
    nx = int(random.integers(14, 60))
    ny = int(random.integers(14, 60)) if random.random() < 0.5 else nx
    periodic = random.random() < 0.3
    material = ("batio3-cofe2o4", "orthotropic-mee")[int(random.random() < 0.75)]
    width = (WIDTH, WIDTH * ny / nx if random.random() < 0.7 else WIDTH)
    divisions = (nx, ny) if periodic else (nx - 1, ny - 1)
    mesh = half_space_mesh(4.0 * max(width), width, divisions, 1, Quad4())
    formulation = HalfSpace("trigonometric" if periodic else "constant", periodic=periodic, matrix_up_to=0)
    system = formulation.reduce(Body(library_material(material).stiffness, mesh, (), "contact"))
    position, squeezed = random.uniform(-1e-3, 1e-3, 2), random.uniform(0.4, 1.0)
    x, y = (system.points[:, :2] - position).T
    size = min(width) * (0.3 / min(nx, ny) if seed % 7 == 0 else 1.0) * random.uniform(0.05, 0.4)
    kappa, potentials = random.choice([np.inf, np.inf, 1e-5]), POTENTIALS[random.integers(len(POTENTIALS))]
    height, approach = (x**2 + squeezed * y**2) / (2.0 * RADIUS), size**2 / RADIUS
    problem = indentation_problem(system, height, approach, Signorini(), (kappa, kappa), potentials)
    if random.random() < 0.65:
        return problem
    insulated = solve(indentation_problem(system, height, approach), ProjectedCG(), StoppingCriteria(tolerance=1e-6))
    force = -float(system.weights @ insulated.state.load[:, 2])
    return replace(problem, gap=height, prescribed_resultants=(prescribe_resultant(system, PRESS, force),))


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("seed", [3, 9, 25, 57])
def test_newton_and_gradient_steps_agree(seed: int) -> None:
    problem, criteria = random_problem(seed), StoppingCriteria(tolerance=1e-9)
    newton, gradient = (solve(problem, solver, criteria) for solver in (SemismoothNewton(), Nesterov()))
    assert newton.status is gradient.status is Status.CONVERGED, gradient.message
    assert_same_load(gradient.state, newton.state)


@pytest.mark.parametrize("seed", [24, 54])
def test_attractive_conduction(seed: int) -> None:
    """Some nodes could be either in contact or open; those of the solution satisfy the laws by a margin."""
    problem, criteria = random_problem(seed), StoppingCriteria(tolerance=1e-10)
    solution = solve(problem, SemismoothNewton(), criteria)
    assert solution.status is Status.CONVERGED, solution.message
    assert_laws_hold_strictly(problem, solution.state)


def assert_laws_hold_strictly(problem: ContactProblem, state: ContactState) -> None:
    """Assert that each node is either in contact at the indenter's potentials, or open and unloaded, by a margin."""
    relative_displacement = (
        indenter_position(problem, state.motion) - problem.system.offset - problem.system.apply(state.load)
    )
    largest, touching = np.abs(state.load).max(axis=0), state.contact_fraction == 1.0
    pressed, separated = state.load[touching, 2], relative_displacement[~touching, 2]
    assert (pressed < -1e-3 * largest[2]).all()
    assert (separated > 1e-3 * np.abs(state.displacement[:, 2]).max()).all()
    off = np.abs(relative_displacement[touching, 2:]) / np.abs(state.displacement[:, 2:]).max(axis=0)
    assert off.max() < 1e-8
    assert not state.load[~touching].any()


def assert_same_load(computed: ContactState, other: ContactState) -> None:
    """Assert that pressures and fluxes agree to 1e-6 of the largest."""
    largest = np.abs(other.load).max(axis=0) + np.finfo(float).tiny
    assert float((np.abs(computed.load - other.load) / largest)[:, 2:].max()) < 1e-6
