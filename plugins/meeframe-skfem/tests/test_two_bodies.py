"""Two blocks of finite elements whose faces in contact have different divisions, under uniform pressure."""

import numpy as np
from meeframe_skfem import FiniteElements

from meeframe.contact.problem import Status
from meeframe.elements import Quad4
from meeframe.material import Material
from meeframe.mesh import box_mesh
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.mesh.surface import SurfaceMesh
from meeframe.solvers import SemismoothNewton, StoppingCriteria, solve
from meeframe.system.dense import DenseSystem
from meeframe.system.two_body import combine_bodies, second_load
from meeframe.testing.half_space import indentation_problem

YOUNG = (210e9, 70e9)


def column(young: float, divisions: int) -> DenseSystem:
    """A clamped unit cube below z = 0, without lateral expansion: a uniform pressure is exact."""
    mesh = box_mesh((1.0, 1.0, 1.0), (divisions, divisions, divisions), Quad4())
    points = mesh.points - [0.0, 0.0, mesh.points[:, 2].max()]
    mesh = SurfaceMesh(points, mesh.blocks, mesh.group_names)
    conditions = tuple(BoundaryCondition("z-", field, "value") for field in range(5))
    system = FiniteElements(linear_solver="splu").reduce(
        Body(Material.isotropic(young, 0.0).stiffness, mesh, conditions, "z+")
    )
    assert isinstance(system, DenseSystem)
    return system


def test_uniform_pressure_is_exact() -> None:
    first, second = column(YOUNG[0], 2), column(YOUNG[1], 3)
    both = combine_bodies(first, second)
    approach = 1e-4
    problem = indentation_problem(both, np.zeros(len(both.points)), approach)
    solution = solve(problem, SemismoothNewton(), StoppingCriteria(tolerance=1e-13))
    assert solution.status is Status.CONVERGED, solution.message
    pressure = approach / sum(1.0 / young for young in YOUNG)
    np.testing.assert_allclose(-solution.state.load[:, 2], pressure, rtol=1e-9)
    reaction = second_load(both, solution.state.load)
    np.testing.assert_allclose(-reaction[:, 2], pressure, rtol=1e-9)
    assert np.abs(reaction[:, :2]).max() < 1e-9 * pressure
