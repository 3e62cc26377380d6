"""Problems shared by the tests of Newton's method and of the accelerated iterations."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace

from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem, Status
from meeframe.elements import Quad4
from meeframe.fields import Array
from meeframe.laws import Insulating, Signorini, StepConductivity
from meeframe.laws.base import ConductivityLaw, ContactLaw
from meeframe.material import library_material
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.solvers import SemismoothNewton, StoppingCriteria, solve
from meeframe.solvers.newton.residual import ContactResidual, ResidualState
from meeframe.system.dense import DenseSystem
from meeframe.system.reduced import ReducedSystem
from meeframe.testing.contact_cases import SphereCase
from meeframe.testing.half_space import indentation_problem
from meeframe.testing.matrix_free import MatrixFree

MATERIALS = {"transverse": library_material("batio3-cofe2o4"), "orthotropic": library_material("orthotropic-mee")}
WIDTH, RADIUS = 7e-3, 0.1
PERFECT = StepConductivity(np.inf)


@final
@dataclass(frozen=True)
class Growing(ConductivityLaw):
    """kappa (|p| / pressure)^exponent: no jump, and a unique solution."""

    kappa: float
    pressure: float
    exponent: float

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        return self.kappa * (np.maximum(-normal_traction, 0.0) / self.pressure) ** self.exponent


@pytest.fixture(scope="session")
def growing() -> type[ConductivityLaw]:
    return Growing


@pytest.fixture(scope="session")
def matrixless() -> Callable[[DenseSystem], ReducedSystem]:
    return MatrixFree.of


@pytest.fixture(scope="session")
def sphere() -> Callable[..., ContactProblem]:
    """Return a function that creates sphere problems; `kappa` is electric and magnetic, relative to the inverse
    nodal compliance."""

    def make(material: str, law: ContactLaw, kappa: tuple[float, float] = (0.0, 0.0), **options: Any) -> ContactProblem:
        medium = MATERIALS[material]
        plain = SphereCase(medium, law, Insulating(), Insulating(), **options)
        compliance = np.abs(np.diag(plain.problem().system.diagonal_blocks()[0]))[3:]
        laws = [StepConductivity(float(k / o)) if k else Insulating() for k, o in zip(kappa, compliance, strict=True)]
        return SphereCase(medium, law, *laws, **options).problem()

    return make


@pytest.fixture(scope="session")
def conducting() -> Callable[..., ContactProblem]:
    """Return a function that creates problems of a sphere on n x n nodes without a matrix; `contact` is the radius
    [widths] of the overlap, `dragged` the translation [m]."""

    def make(
        n: int,
        contact: float,
        law: ContactLaw | None = None,
        flux: ConductivityLaw = PERFECT,
        material: str = "orthotropic-mee",
        dragged: tuple[float, float] = (0.0, 0.0),
    ) -> ContactProblem:
        mesh = half_space_mesh(10.0 * WIDTH, WIDTH, n - 1, 1, Quad4())
        system = HalfSpace(matrix_up_to=0).reduce(Body(library_material(material).stiffness, mesh, (), "contact"))
        height = ((system.points[:, :2] - [1e-4, 2e-4]) ** 2).sum(axis=1) / (2.0 * RADIUS)
        depth, given = (contact * WIDTH) ** 2 / RADIUS, ((np.inf, np.inf), (5.0, 1.0), dragged)
        problem = indentation_problem(system, height, depth, law or Signorini(), *given)
        return replace(problem, channels=flux_channels(flux, flux))

    return make


@pytest.fixture(scope="session")
def at() -> Callable[[ContactProblem, Array, Array], ResidualState]:
    """Return a function that evaluates the contact residual at a load and contact fractions; intermediate nodes are
    biactive."""

    def make(problem: ContactProblem, load: Array, contact_fraction: Array) -> ResidualState:
        return ContactResidual.of(problem).at(
            load, contact_fraction, (contact_fraction > 0.0) & (contact_fraction < 1.0), np.zeros(0)
        )

    return make


@pytest.fixture(scope="session")
def at_solution(at: Callable[..., ResidualState]) -> Callable[[ContactProblem], ResidualState]:
    """Return a function that evaluates the contact residual at the solution; intermediate nodes are biactive."""

    def make(problem: ContactProblem) -> ResidualState:
        solution = solve(problem, SemismoothNewton(), StoppingCriteria(tolerance=1e-11))
        assert solution.status is Status.CONVERGED, solution.message
        return at(problem, solution.state.load, solution.state.contact_fraction)

    return make
