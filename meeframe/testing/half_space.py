"""A half space as a reduced system in closed form, without boundary elements.

Densities are constant on the cells of a square grid, displacements are taken at the centres of the cells. The
point-source response xi_JK/r is integrated over a rectangle exactly (Love, Phil. Trans. R. Soc. A 228 (1929) 377).
"""

import numpy as np

from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem
from meeframe.fields import Array
from meeframe.laws import Signorini, StepConductivity
from meeframe.laws.base import ContactLaw
from meeframe.system.dense import DenseSystem
from meeframe.system.reduced import ReducedSystem
from meeframe.testing.cells import cell_centres, cell_system

_SIGNS = np.array([1.0, 1.0, 1.0, -1.0, -1.0])


def half_space_system(xi: Array, side: float, cells: int, offset: Array | None = None) -> DenseSystem:
    """Return the reduced system of square cells on the surface of a half space.

    Parameters
    ----------
    xi : Array
        Point-source response u_J = xi_JK t_K / r, (5, 5) over (u1, u2, u3, phi, psi), or (3, 3) over (u3, phi, psi)
        without tangential response.
    side : float
        Side of the square |x|, |y| < side/2 [m].
    cells : int
        Number of cells along a side.
    offset : Array, optional
        Offset (n, 5) as in ReducedSystem; zero by default.

    Returns
    -------
    DenseSystem
        The system of n = cells^2 nodes.
    """
    full = np.zeros((5, 5))
    full[-len(xi) :, -len(xi) :] = xi
    x, y = cell_centres(side, cells)
    potential = inverse_distance_integral(x[:, None] - x, y[:, None] - y, side / cells / 2)
    matrix = np.einsum("mn,JK->mJnK", potential, full * _SIGNS[:, None])
    return cell_system(matrix, side, offset)


def indentation_problem(
    system: ReducedSystem,
    height: Array,
    approach: float,
    contact_law: ContactLaw | None = None,
    conductivity: tuple[float, float] = (0.0, 0.0),
    potentials: tuple[float, float] = (0.0, 0.0),
    translation: tuple[float, float] = (0.0, 0.0),
) -> ContactProblem:
    """Return the contact problem of an indenter.

    Parameters
    ----------
    system : ReducedSystem
        The reduced system, of n nodes.
    height : Array
        Height of the indenter above its lowest point, (n,) [m].
    approach : float
        Approach [m].
    contact_law : ContactLaw, optional
        Contact law; by default Signorini.
    conductivity : tuple of float, optional
        Conductivities of the electric and the magnetic step law [F/m^2], [H/m^2].
    potentials : tuple of float, optional
        Electric and magnetic potential of the indenter [V], [A].
    translation : tuple of float, optional
        Tangential displacement of the indenter along e1 and e2 [m].

    Returns
    -------
    ContactProblem
        The problem.
    """
    n = len(height)
    return ContactProblem(
        system,
        contact_law or Signorini(),
        flux_channels(*map(StepConductivity, conductivity)),
        height - approach,
        np.tile(np.array(translation, float), (n, 1)),
        np.tile(np.array(potentials, float), (n, 1)),
    )


def inverse_distance_integral(x: Array, y: Array, half: float) -> Array:
    """Return the integral of 1/distance over the square |x'|, |y'| < half.

    Parameters
    ----------
    x, y : Array
        Coordinates of points in the plane of the square [m].
    half : float
        Half the side of the square [m].

    Returns
    -------
    Array
        Integrals [m], of the shape of the coordinates.
    """
    total = np.zeros(np.broadcast(x, y).shape)
    for sx in (1.0, -1.0):
        for sy in (1.0, -1.0):
            a, b = x + sx * half, y + sy * half
            total += sx * sy * (a * _arcsinh(b, a) + b * _arcsinh(a, b))
    return total


def _arcsinh(b: Array, a: Array) -> Array:
    """Return arcsinh(b/|a|); zero where its factor a is zero."""
    safe = np.where(a == 0.0, 1.0, np.abs(a))
    return np.where(a == 0.0, 0.0, np.arcsinh(b / safe))
