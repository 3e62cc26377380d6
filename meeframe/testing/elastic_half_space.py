"""An isotropic elastic half space as a reduced system in closed form, with coupled normal and tangential loads.

The half space lies at x3 < 0 below its surface x3 = 0; the outward normal is +x3. Densities are constant on the cells
of a square grid, displacements are taken at the centres of the cells, and the point solutions of Boussinesq (normal
load) and Cerruti (tangential load) are integrated over a cell exactly.

References
----------
Point solutions: Johnson, Contact Mechanics (1985), eqs. (3.18) and (3.75), whose x3 axis points inwards.
"""

import numpy as np

from meeframe.common.errors import MeeframeError
from meeframe.fields import ELECTRIC, MAGNETIC, Array
from meeframe.material.material import VACUUM_PERMEABILITY, VACUUM_PERMITTIVITY
from meeframe.system.dense import DenseSystem
from meeframe.testing.cells import cell_system


def elastic_half_space(young: float, poisson: float, side: float, cells: int, goodman: bool = False) -> DenseSystem:
    """Return the reduced system of square cells on the surface of an elastic half space, nodes along x first.

    Potentials are decoupled, with the constants of vacuum, as in Material.isotropic.

    Parameters
    ----------
    young : float
        Young's modulus > 0 [Pa].
    poisson : float
        Poisson's ratio in (-1, 1/2]; at 1/2 normal and tangential loads are uncoupled.
    side : float
        Side of the square |x|, |y| < side/2 [m].
    cells : int
        Number of cells along a side.
    goodman : bool, optional
        Whether to neglect normal displacements due to tangential loads and vice versa (Goodman, J. Appl. Mech. 29
        (1962) 515).

    Returns
    -------
    DenseSystem
        The system of cells^2 nodes.

    Raises
    ------
    MeeframeError
        For elastic constants out of bounds.
    """
    if not (0.0 < young < np.inf and -1.0 < poisson <= 0.5):
        raise MeeframeError(
            f"elastic half space with young = {young} Pa, poisson = {poisson}: allowed: young > 0, -1 < poisson <= 1/2"
        )
    h = side / cells
    steps = np.arange(1 - cells, cells)
    shift_y, shift_x = np.meshgrid(steps * h, steps * h, indexing="ij")
    kernel = cell_response(young, poisson, shift_x, shift_y, h / 2)
    if goodman:
        kernel[..., 2, :2] = kernel[..., :2, 2] = 0.0
    row, column = (grid.ravel() for grid in np.meshgrid(range(cells), range(cells), indexing="ij"))
    n = cells**2
    # the response depends only on the shift in rows and columns, counted from -(cells - 1)
    across_rows, across_columns = row[:, None] - row + cells - 1, column[:, None] - column + cells - 1
    matrix = np.zeros((n, 5, n, 5))
    for field, load in np.argwhere(np.abs(kernel).max(axis=(0, 1)) > 0.0):
        matrix[:, field, :, load] = kernel[across_rows, across_columns, field, load]
    return cell_system(matrix, side)


def cell_response(young: float, poisson: float, x: Array, y: Array, half: float) -> Array:
    """Return the surface displacement per unit load on a square cell.

    Parameters
    ----------
    young, poisson : float
        Elastic constants, Young's modulus in Pa.
    x, y : Array
        Coordinates of the points relative to the centre of the cell [m].
    half : float
        Half the side of the cell [m].

    Returns
    -------
    Array
        (..., field, load), with fields, loads and signs as in ReducedSystem and e1, e2, nu along x1, x2, x3.
    """
    inverse, xx, xy, x_only, y_only = _cell_integrals(x, y, half)
    shear = young / (2.0 * (1.0 + poisson))
    response = np.zeros((*np.shape(x), 5, 5))
    radial = (1.0 - poisson) * inverse
    response[..., 0, 0] = radial + poisson * xx
    response[..., 1, 1] = radial + poisson * (inverse - xx)
    response[..., 0, 1] = response[..., 1, 0] = poisson * xy
    response[..., 2, 2] = radial
    # a normal pull moves the surface apart; a tangential load lifts it behind and lowers it in front
    for axis, odd in enumerate((x_only, y_only)):
        response[..., axis, 2] = (0.5 - poisson) * odd
        response[..., 2, axis] = -(0.5 - poisson) * odd
    response /= 2.0 * np.pi * shear
    response[..., ELECTRIC, ELECTRIC] = inverse / (2.0 * np.pi * VACUUM_PERMITTIVITY)
    response[..., MAGNETIC, MAGNETIC] = inverse / (2.0 * np.pi * VACUUM_PERMEABILITY)
    return response


def _cell_integrals(x: Array, y: Array, half: float) -> tuple[Array, Array, Array, Array, Array]:
    """Return the integrals of 1/r, x^2/r^3, x y/r^3, x/r^2, y/r^2 over a square cell.

    The vector points from the cell to (x, y). Each is the sum over the corners, with alternating signs, of a function
    whose mixed derivative is the integrand.
    """
    totals = [np.zeros(np.broadcast(x, y).shape) for _ in range(5)]
    for sx in (1.0, -1.0):
        for sy in (1.0, -1.0):
            a, b = x + sx * half, y + sy * half
            r = np.hypot(a, b)
            along_x, along_y = b * np.arcsinh(a / np.abs(b)), a * np.arcsinh(b / np.abs(a))
            log = np.log(r)
            # x^2/r^3 is -x d(1/r)/dx: the first term of the integral of 1/r
            corner = (along_x + along_y, along_x, -r, b * log + a * np.arctan(b / a), a * log + b * np.arctan(a / b))
            for total, value in zip(totals, corner, strict=True):
                total += sx * sy * value
    inverse, xx, xy, x_only, y_only = totals
    return inverse, xx, xy, x_only, y_only
