"""Interpolation over all directions by polynomials in cells on the faces of a cube; see _kernels.tabulated."""

from typing import Final

import numpy as np
from numpy.polynomial.chebyshev import cheb2poly, chebpts1
from numpy.polynomial.polynomial import polyint

from meeframe.fields import Array
from meeframe.greens._kernels.tabulated import CACHE_LINE, DEGREE, WIDTH

COUNT = DEGREE + 1
MAX_CELLS: Final = 64
ERROR_MARGIN: Final = 2.5
"""Bound of the ratio of the largest error of a table to that at its test points, of which cells have a few each."""
COARSE_CELLS: Final = 6
"""Cells of the table from which a bound of the error of the finest one follows."""
_MIN_ORDER: Final = 5
"""Order of convergence that the bound assumes; tables converge with an order of 7."""
_ROUND_OFF: Final = 1e-9
"""Bound of the error of the finest table by round-off."""


def finest_error(error: float) -> float:
    """Return a bound of the error of a table of MAX_CELLS, from the one of COARSE_CELLS at its test points."""
    return max(ERROR_MARGIN * error * (COARSE_CELLS / MAX_CELLS) ** _MIN_ORDER, _ROUND_OFF)


def cell_points(cells: int, s: Array, t: Array) -> Array:
    """Return the points x with x_a = 1 at local coordinates s, t (k,) of every cell, (3, cells, cells, k, 3)."""
    corner = 2.0 * np.arange(cells) + 1.0 - cells
    x = np.ones((3, cells, cells, len(s), 3))
    for face in range(3):
        x[face, ..., (face + 1) % 3] = (corner[:, None, None] + s) / cells
        x[face, ..., (face + 2) % 3] = (corner[None, :, None] + t) / cells
    return x


def interpolation_points(cells: int) -> Array:
    """Return the points of all cells at which a function is interpolated, ((3 cells^2) 81, 3), cell by cell."""
    nodes = chebpts1(COUNT)
    return cell_points(cells, np.repeat(nodes, COUNT), np.tile(nodes, COUNT)).reshape(-1, 3)


def polynomials(values: Array, cells: int) -> Array:
    """Return the table of a function with values at the interpolation points, truncated at the total degree.

    Parameters
    ----------
    values : Array
        Values, ((3 cells^2) 81, k), k at most WIDTH.
    cells : int
        Cells along each side of a face.

    Returns
    -------
    Array
        Coefficients, (3 cells^2, 720).
    """
    nodes, powers = chebpts1(COUNT), _basis(COUNT)
    in_basis = np.linalg.inv(np.vander(nodes, increasing=True) @ powers)
    degree_row, column = np.tril_indices(COUNT)
    rows = COUNT * (DEGREE - degree_row) + degree_row - column
    # In two steps: round-off of the first step is a Chebyshev polynomial and stays small inside the cell.
    to_series, to_powers = np.kron(in_basis, in_basis)[rows], np.kron(powers, powers)[np.ix_(rows, rows)]
    n_cells = 3 * cells**2
    table = _zeros_on_lines(n_cells * len(degree_row) * WIDTH).reshape(n_cells, len(degree_row), WIDTH)
    table[..., : values.shape[1]] = to_powers @ (to_series @ values.reshape(n_cells, COUNT**2, -1))
    return table.reshape(n_cells, -1)


def _basis(count: int) -> Array:
    """Return the monomial coefficients, column by column, of 1 and of the integrals of Chebyshev polynomials.

    Truncation in this basis removes Chebyshev polynomials from the derivative, the smallest of all on the interval, and
    not derivatives of these, which grow at its ends. Tractions need derivatives and determine the size of the table.
    """
    basis = np.eye(count)
    for k in range(1, count):
        basis[: k + 1, k] = polyint(cheb2poly(np.eye(k)[k - 1]))
    return basis


def _zeros_on_lines(count: int) -> Array:
    """Return zeros that begin at a cache line, so that no vector of eight crosses the border of two lines."""
    return from_boundary(np.zeros(count + CACHE_LINE), CACHE_LINE)[:count]


def from_boundary(buffer: Array, unit: int) -> Array:
    """Return the end of an array that begins at the first address that is a multiple of `unit` doubles."""
    return buffer[-(buffer.ctypes.data // buffer.itemsize) % unit :]
