"""Conducting contact without friction on seeded grids, whenever its conduction follows: what Newton's method finds."""

from dataclasses import replace

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace

from meeframe.core.body import Body
from meeframe.core.contact import ContactProblem, Status
from meeframe.elements import Quad4
from meeframe.geometry import half_space_mesh
from meeframe.laws import Signorini
from meeframe.materials import library_material
from meeframe.solvers import Limits, ProjectedCG, SemismoothNewton, normal_response, solve
from meeframe.testing.force_control import PRESS, freedom
from meeframe.testing.half_space import indentation_problem

WIDTH, RADIUS = 1e-2, 0.1
POTENTIALS = [(0, 0), (5, 1), (50, 5), (0, 30), (-50, -5), (2e3, 0), (-2e3, 0), (20, -3), (0, -30)]


def seeded(seed: int) -> ContactProblem:
    """Free or periodic, square or not, odd or even, from one node in contact to nearly all, held or pressed on."""
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
    place, squeezed = random.uniform(-1e-3, 1e-3, 2), random.uniform(0.4, 1.0)
    x, y = (system.points[:, :2] - place).T
    size = min(width) * (0.3 / min(nx, ny) if seed % 7 == 0 else 1.0) * random.uniform(0.05, 0.4)
    kappa, potentials = random.choice([np.inf, np.inf, 1e-5]), POTENTIALS[random.integers(len(POTENTIALS))]
    height, approach = (x**2 + squeezed * y**2) / (2.0 * RADIUS), size**2 / RADIUS
    problem = indentation_problem(system, height, approach, Signorini(), (kappa, kappa), potentials)
    if random.random() < 0.65:
        return problem
    insulated = solve(indentation_problem(system, height, approach), ProjectedCG(), Limits(tolerance=1e-6))
    force = -float(system.weights @ insulated.state.load[:, 2])
    return replace(problem, gap=height, freedoms=(freedom(system, PRESS, force),))


@pytest.mark.parametrize("seed", [3, 6, 9, 12, 18, 19, 25, 31, 42, 57])
def test_it_is_the_contact_of_newtons_method(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """At any conduction that follows a violation a hundred or a thousand times smaller, or at once."""
    problem, limits = seeded(seed), Limits(tolerance=1e-10, max_iterations=200)
    newton = solve(problem, SemismoothNewton(), limits)
    assert newton.status is Status.CONVERGED
    largest = np.abs(newton.state.load).max(axis=0) + np.finfo(float).tiny
    for following in (1e-3, 3e-3, 1e-2, 3e-2):
        monkeypatch.setattr(normal_response, "FOLLOWING", following)
        found = solve(problem, ProjectedCG(), limits)
        assert found.status is Status.CONVERGED, (following, found.message)
        difference = float((np.abs(found.state.load - newton.state.load) / largest)[:, 2:].max())
        assert difference < 1e-6, (following, difference)
