"""Fixtures: load steps on an elastic half space with all couplings."""

from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import numpy as np
import pytest

from meeframe.contact.problem import ContactProblem, Status
from meeframe.indenters import Sphere
from meeframe.indenters.base import RESULTANTS
from meeframe.laws import IsotropicCoulomb
from meeframe.model.kinematics import Solution
from meeframe.model.load import load_case
from meeframe.model.solve import solve_steps
from meeframe.results.records import Zone
from meeframe.results.resultants import resultants
from meeframe.solvers import Auto, StoppingCriteria, solve
from meeframe.testing.elastic_half_space import elastic_half_space

YOUNG, POISSON, RADIUS, SIDE = 100e9, 0.3, 0.1, 4e-3


def half_space(cells=10, poisson=POISSON):
    """Return a half space whose grid of cells is also the mesh of the zone."""
    corner = (np.arange(cells - 1)[:, None] * cells + np.arange(cells - 1)).ravel()
    quads = np.stack([corner, corner + 1, corner + cells + 1, corner + cells], axis=1)
    return replace(elastic_half_space(YOUNG, poisson, SIDE, cells), cells=(("quad", quads),))


@pytest.fixture(scope="session")
def system():
    return half_space()


@pytest.fixture(scope="session")
def bed():
    """Return the half space: its factory, Young's modulus [Pa], Poisson's ratio, side [m], radius of the sphere [m],
    and a function that solves paths."""
    return SimpleNamespace(half_space=half_space, young=YOUNG, poisson=POISSON, side=SIDE, radius=RADIUS, follow=Path)


@pytest.fixture
def frictional(write_case, registry):
    """Return a frictional sphere in place of that of the tiny case, for another reduced system."""
    return replace(load_case(write_case(), registry), indenter=Sphere(RADIUS), contact_law=IsotropicCoulomb(0.3))


@dataclass(frozen=True)
class Planned:
    """Increment with nothing but its problem."""

    problem: ContactProblem
    prescribed: dict[str, float] = field(default_factory=dict)


@pytest.fixture
def increments(synthetic):
    """Return a function that returns solve(start, easing) of a problem, and its increment before it converges."""

    def of(problem):
        def solve_eased(start, easing):
            eased = easing.apply(problem)
            solution = solve(eased, Auto(), StoppingCriteria(stall_window=10), start)
            result = replace(
                synthetic.step(1e-6),
                status=solution.status,
                residual=solution.residual,
                iterations=solution.iterations,
                message=solution.message,
            )
            return Solution(Planned(eased), SimpleNamespace(state=solution.state), result)

        stalled = replace(synthetic.step(1e-6), status=Status.STALLED, iterations=7)
        return solve_eased, Solution(Planned(problem), SimpleNamespace(state=None), stalled)

    return of


class Path:
    """The results of the load steps of a case on a reduced system."""

    def __init__(self, case, system, *steps, **changes):
        self.case = replace(case, steps=steps, **changes)
        self.zone = Zone(system.points, system.frames, system.weights, system.cells)
        self.steps = list(solve_steps(self.case, system, boundary=False))
        assert [step.status for step in self.steps] == [Status.CONVERGED] * len(self.steps)
        self.motion = np.array([step.loading.motion for step in self.steps])
        self.totals = [resultants(self.zone, step) for step in self.steps]
        self.resultants = np.array(
            [np.concatenate([np.atleast_1d(getattr(t, key)) for key in RESULTANTS]) for t in self.totals]
        )

    def total(self, key, number=-1):
        """Return a resultant in the form that a step prescribes."""
        value = getattr(self.totals[number], key)
        return value if isinstance(value, float) else tuple(value.tolist())
