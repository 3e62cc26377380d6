"""Press rigid indenters on half spaces by fast Fourier transforms; shared by most cases of this folder."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from meeframe_halfspace import HalfSpace

from meeframe.contact.problem import ContactSolution, Solver, Status
from meeframe.elements import Quad4
from meeframe.fields import Array
from meeframe.indenters import find_indenter_edge
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.solvers import Auto, ProjectedCG, StoppingCriteria, solve_to_edges
from meeframe.system.capabilities import IndenterEdge
from meeframe.system.reduced import ReducedSystem
from meeframe.testing.half_space import indentation_problem

Height = Callable[[Array, Array], Array]
"""Height of the indenter above its lowest point [m] at x, y (n,) [m], inf where there is no indenter."""


EdgeOption = Literal["nodes", "resolved"]


def half_space(
    stiffness: Array, width: tuple[float, float], divisions: int, matrix_up_to: int = 0, edges: EdgeOption = "nodes"
) -> ReducedSystem:
    """Return a rectangular zone on a half space with the given divisions along x and y."""
    mesh = half_space_mesh(10.0 * max(width), width, divisions, 1, Quad4())
    return HalfSpace(matrix_up_to=matrix_up_to, edges=edges).reduce(Body(stiffness, mesh, (), "contact"))


@dataclass(frozen=True, eq=False)
class Pressed:
    """Solved indentation. load, displacement: (n, 5) as in ReducedSystem; spacing: along x [m]."""

    system: ReducedSystem
    load: Array
    displacement: Array
    spacing: float

    @property
    def r(self) -> Array:
        """Distance of the nodes from the axis, (n,) [m]."""
        return np.hypot(self.system.points[:, 0], self.system.points[:, 1])

    @property
    def totals(self) -> Array:
        """Pressing force [N], charge [C], magnetic flux [Wb]."""
        result = self.system.weights @ self.load[:, 2:]
        return np.asarray(result * [-1.0, 1.0, 1.0])

    @property
    def force(self) -> float:
        """Pressing force of the indenter [N]."""
        return float(self.totals[0])

    @property
    def pressure(self) -> Array:
        """Contact pressure (n,) [Pa]."""
        return 0.0 - self.load[:, 2]

    @property
    def contact_area(self) -> float:
        """Area of the nodes under pressure [m^2]."""
        return float(self.system.weights @ (self.pressure > 0.0))

    def section(self) -> tuple[Array, Array]:
        """Return the nodes on the line through the centre along x, in order, and their x (m,) [m]."""
        x, y, _ = self.system.points.T
        line = np.flatnonzero(y == y[np.abs(y).argmin()])
        line = line[np.argsort(x[line])]
        return line, x[line]


def press(
    stiffness: Array,
    height: Height,
    approach: float,
    contact_width: float | tuple[float, float],
    cells: float,
    conductivity: tuple[float, float] = (0.0, 0.0),
    potentials: tuple[float, float] = (0.0, 0.0),
    divisions: int | None = None,
    edges: EdgeOption = "nodes",
) -> Pressed:
    """Press without friction; cells: number in the contact width (or widths along x and y); edges: see HalfSpace.

    Raises RuntimeError if the iteration does not converge.
    """
    spacing, across = np.broadcast_to(np.asarray(contact_width) / cells, (2,)).tolist()
    divisions = divisions or 2 * round(0.6 * cells)
    system = half_space(stiffness, (divisions * spacing, divisions * across), divisions, edges=edges)
    x, y, _ = system.points.T
    problem = indentation_problem(system, height(x, y), approach, None, conductivity, potentials)
    solver: Solver = Auto() if any(conductivity) else ProjectedCG()

    def gaps(points: Array, _frames: Array) -> Array:
        return height(points[:, 0], points[:, 1]) - approach

    def rim() -> IndenterEdge | None:
        return find_indenter_edge(gaps, system.points, system.frames, 2.0 * max(spacing, across))

    solution, _ = solve_to_edges(problem, solver, StoppingCriteria(tolerance=1e-8), indenter_edge=rim)
    converged(solution)
    return Pressed(system, solution.state.load, solution.state.displacement, spacing)


def converged(solution: ContactSolution) -> ContactSolution:
    """Return the solution if it has converged, else raise RuntimeError."""
    if solution.status is not Status.CONVERGED:
        raise RuntimeError(f"{solution.status}: {solution.message}")
    return solution


def on_grid(points: Array, values: Array) -> tuple[Array, Array, Array]:
    """Return nodes of a full grid, x (nx,) and y (ny,), and the values (ny, nx)."""
    places = np.round(points[:, :2] / np.ptp(points[:, 0]), 9)  # round-off must not separate nodes of a line
    order = np.lexsort((places[:, 0], places[:, 1]))
    count = len(np.unique(places[:, 0]))
    table = values[order].reshape(-1, count)
    return points[order[:count], 0], points[order[::count], 1], table


def observed_order(cells: list[float], errors: list[float]) -> float:
    """Return the slope of the absolute errors over the spacing, by least squares in logarithms."""
    slope, _ = np.polyfit(np.log(cells), np.log(np.abs(errors)), 1)
    return float(-slope)
