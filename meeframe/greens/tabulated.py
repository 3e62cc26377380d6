"""The production kernel: a piecewise polynomial table of the fundamental solution over all directions."""

from dataclasses import dataclass
from typing import Annotated, final

import numpy as np
from numpy.polynomial.chebyshev import cheb2poly, chebpts1
from numpy.polynomial.polynomial import polyint

from meeframe.common.errors import CaseError, MaterialError
from meeframe.fields import Array, Indices
from meeframe.fields.units import Quantity, check_quantities
from meeframe.greens._kernels.modulation import triads
from meeframe.greens._kernels.tabulated import DEGREE, LINE, WIDTH, evaluate, gradient
from meeframe.greens._kernels.tabulated_sums import integrate
from meeframe.greens.base import FundamentalSolution, Kernel
from meeframe.greens.line_integral import LineIntegral, line_modulation
from meeframe.greens.modulated import checked_stiffness

MOST_CELLS = 64
# Doubles in a huge page of 2 MB.
HUGE_PAGE = 2**18
LINE_POINTS = 16
# The check sees a few directions of every cell and one normal of each; the worst of many is up to 2.2 times larger.
MARGIN = 2.5


@final
@dataclass(frozen=True, eq=False)
class TabulatedKernel(Kernel):
    """Kernel from a table (3 cells^2, 720); see meeframe.greens._kernels.tabulated.

    coefficients: (3, 225), the stiffness as [face, J, M, 3 k + i] = C_iJMl with l = face + k mod 3.
    """

    table: Array
    cells: int
    coefficients: Array

    def evaluate(self, offset: Array, normal: Array) -> tuple[Array, Array]:
        """Return U and T, each (n, 5, 5), for offset (n, 3) and unit normal (n, 3)."""
        offset = np.ascontiguousarray(offset, dtype=float)
        normal = np.ascontiguousarray(normal, dtype=float)
        u, t = _uninitialised(2 * len(offset) * 25).reshape(2, -1, 25)
        evaluate(self.table, self.cells, self.coefficients, offset, normal, u, t)
        return u.reshape(-1, 5, 5), t.reshape(-1, 5, 5)

    def integrate(self, offset: Array, weights: Array, starts: Indices, normals: Array) -> tuple[Array, Array]:
        """Return the weighted sums of U and T over the points of plane pieces; see Kernel."""
        offset, weights, normals = (np.ascontiguousarray(part, dtype=float) for part in (offset, weights, normals))
        u, t = np.empty((2, len(normals), weights.shape[1], 25))
        integrate(self.table, self.cells, self.coefficients, offset, weights, starts, normals, u, t)
        return u, t

    def gradient(self, offset: Array) -> Array:
        """Return U,q (n, 5, 5, 3) for offset (n, 3)."""
        result: Array = gradient(self.table, self.cells, np.ascontiguousarray(offset, dtype=float))
        return result


@final
@dataclass(frozen=True)
class Tabulated(FundamentalSolution):
    """The line integral tabulated over the faces of a cube, by polynomials of total degree 8 in each of its cells.

    tolerance: largest error of U and of T at any direction, relative to their largest entries. T, a derivative,
    decides; U comes out a hundred times better.
    cells: cells along a face at first, 1 to 64; bind checks every cell against the line integral and refines all
    of them if one fails. Raises CaseError if an option is out of bounds.
    Source: docs/theory.md, Fundamental solution.
    """

    tolerance: Annotated[float, Quantity("", gt=0, lt=1)] = 1e-8
    cells: int = 20

    def __post_init__(self) -> None:
        check_quantities(self)
        if not 1 <= self.cells <= MOST_CELLS:
            raise CaseError(f"Tabulated: cells = {self.cells!r}: allowed are 1 to {MOST_CELLS}")

    def bind(self, stiffness: Array) -> Kernel:
        """Return the kernel for a scaled stiffness (3, 5, 5, 3).

        Raises MaterialError if the stiffness is not symmetric or not elliptic, or too anisotropic for the tolerance.
        """
        checked = checked_stiffness(stiffness)
        reference = LineIntegral(LINE_POINTS).bind(checked)
        coefficients = _face_coefficients(checked)
        cells = self.cells
        while True:
            kernel = TabulatedKernel(_table(checked, cells), cells, coefficients)
            excess = MARGIN * _largest_error(kernel, reference) / self.tolerance
            if excess <= 1.0:
                return kernel
            if cells == MOST_CELLS:
                raise MaterialError(
                    f"a table of {cells} cells misses the tolerance {self.tolerance:g} by a factor {excess:.1e}: the "
                    "material is too anisotropic or too near to incompressible; allow a larger tolerance or choose the "
                    "fundamental solution line-integral, or isotropic for a material that is"
                )
            # The error of T falls with about the eighth power of the cell size.
            growth = min(2.0, 1.05 * excess ** (1.0 / DEGREE))
            cells = min(MOST_CELLS, max(cells + 2, round(cells * growth)))


def _face_coefficients(stiffness: Array) -> Array:
    faces = [np.roll(stiffness, -face, axis=3).transpose(1, 2, 3, 0).ravel() for face in range(3)]
    return np.ascontiguousarray(faces)


def _directions(cells: int, s: Array, t: Array) -> Array:
    """Return the points x with x_a = 1 at local coordinates s, t (k,) of every cell, (3, cells, cells, k, 3)."""
    corner = 2.0 * np.arange(cells) + 1.0 - cells
    x = np.ones((3, cells, cells, len(s), 3))
    for face in range(3):
        x[face, ..., (face + 1) % 3] = (corner[:, None, None] + s) / cells
        x[face, ..., (face + 2) % 3] = (corner[None, :, None] + t) / cells
    return x


def _basis(count: int) -> Array:
    """Return the powers (count, count), one column each, of 1 and the integrals of the Chebyshev polynomials T_0, T_1,
    ...

    Cut off in this basis, a derivative loses Chebyshev polynomials, the smallest of all on the interval, and not their
    derivatives, which grow at its ends. Tractions need derivatives and decide the size of the table.
    """
    basis = np.eye(count)
    for k in range(1, count):
        basis[: k + 1, k] = polyint(cheb2poly(np.eye(k)[k - 1]))
    return basis


def _table(stiffness: Array, cells: int) -> Array:
    """Return G = H / |x| interpolated in every cell and cut off at the total degree, (3 cells^2, 720)."""
    count = DEGREE + 1
    nodes = chebpts1(count)
    offset = _directions(cells, np.repeat(nodes, count), np.tile(nodes, count)).reshape(-1, 3)
    distance, triad = triads(offset)
    modulation = line_modulation(stiffness, LINE_POINTS, triad, with_tangents=False)
    values = modulation[:, 0] / distance[:, None]
    powers = _basis(count)
    in_basis = np.linalg.inv(np.vander(nodes, increasing=True) @ powers)
    row, place = np.tril_indices(count)
    rows = count * (DEGREE - row) + row - place
    # Two steps: a round-off in the first is a Chebyshev polynomial and stays small inside the cell.
    to_series, to_powers = np.kron(in_basis, in_basis)[rows], np.kron(powers, powers)[np.ix_(rows, rows)]
    n_cells = 3 * cells**2
    table = _zeros_on_lines(n_cells * len(row) * WIDTH).reshape(n_cells, len(row), WIDTH)
    table[..., : values.shape[1]] = to_powers @ (to_series @ values.reshape(n_cells, count**2, -1))
    return table.reshape(n_cells, -1)


def _zeros_on_lines(count: int) -> Array:
    """Return the zeros that begin with a line of the caches: no vector of eight is spread over two, as it would be
    else."""
    return _from_boundary(np.zeros(count + LINE), LINE)[:count]


def _uninitialised(count: int) -> Array:
    """Return an array (count,), a large one in whole huge pages, which NumPy asks for and the system hands over
    fastest.

    It begins with such a page and has the rest of its last one behind it.
    """
    if count < HUGE_PAGE:
        return np.empty(count)
    return _from_boundary(np.empty(count + 2 * HUGE_PAGE), HUGE_PAGE)[:count]


def _from_boundary(room: Array, unit: int) -> Array:
    """Return what is left of an array from the first address on that is a multiple of so many doubles."""
    return room[-(room.ctypes.data // room.itemsize) % unit :]


def _largest_error(kernel: TabulatedKernel, reference: Kernel) -> float:
    """Return the larger one of the errors of U and T, at corners and inside of all cells.

    Derivatives of an interpolant are worst at the ends of a cell, so its ends are among the test points.
    """
    inside = 1.0 - 1e-9
    along = np.array([-inside, -0.4, 0.3, inside])
    offset = _directions(kernel.cells, np.repeat(along, 4), np.tile(along, 4)).reshape(-1, 3)
    normal = np.random.default_rng(0).normal(size=offset.shape)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    u, t_kernel = kernel.evaluate(offset, normal)
    u_exact, t_exact = reference.evaluate(offset, normal)
    return max(_relative(u, u_exact), _relative(t_kernel, t_exact))


def _relative(value: Array, exact: Array) -> float:
    error = np.abs(value - exact).max(axis=(1, 2)) / np.abs(exact).max(axis=(1, 2))
    return float(error.max())
