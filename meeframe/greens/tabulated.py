"""The default kernel, a piecewise polynomial table of the fundamental solution over all directions."""

from dataclasses import dataclass
from typing import Annotated, final

import numpy as np

from meeframe.common.errors import CaseError, MaterialError
from meeframe.fields import N_FIELDS, Array, Indices
from meeframe.fields.units import Quantity, check_quantities
from meeframe.greens._kernels.modulation import N_PAIRS, triads
from meeframe.greens._kernels.tabulated import DEGREE, evaluate, gradient
from meeframe.greens._kernels.tabulated_sums import integrate
from meeframe.greens.base import FundamentalSolution, Kernel
from meeframe.greens.cells import (
    COARSE_CELLS,
    ERROR_MARGIN,
    MAX_CELLS,
    cell_points,
    finest_error,
    from_boundary,
    interpolation_points,
    polynomials,
)
from meeframe.greens.line_integral import LineIntegral, line_modulation
from meeframe.greens.modulated import validate_stiffness

# Number of doubles in a huge page of 2 MB.
HUGE_PAGE = 2**18
LINE_POINTS = 16


@final
@dataclass(frozen=True, eq=False)
class TabulatedKernel(Kernel):
    """A kernel that interpolates in a table; see meeframe.greens._kernels.tabulated.

    Attributes
    ----------
    table : Array
        Coefficients of the polynomials, (3 cells^2, 720).
    cells : int
        Cells along each side of a face.
    coefficients : Array
        Stiffness, (3, 225), as [face, J, M, 3 k + i] = C_iJMl with l = face + k mod 3.
    """

    table: Array
    cells: int
    coefficients: Array

    def evaluate(self, offset: Array, normal: Array) -> tuple[Array, Array]:
        """Return U and T, (n, 5, 5) each, for offsets (n, 3) and unit normals (n, 3)."""
        offset = np.ascontiguousarray(offset, dtype=float)
        normal = np.ascontiguousarray(normal, dtype=float)
        u, t = _uninitialised(2 * len(offset) * N_PAIRS).reshape(2, -1, N_PAIRS)
        evaluate(self.table, self.cells, self.coefficients, offset, normal, u, t)
        return u.reshape(-1, N_FIELDS, N_FIELDS), t.reshape(-1, N_FIELDS, N_FIELDS)

    def integrate(self, offset: Array, weights: Array, starts: Indices, normals: Array) -> tuple[Array, Array]:
        """Return weighted sums of U and T over the points of plane pieces; see `Kernel.integrate`."""
        offset, weights, normals = (np.ascontiguousarray(array, dtype=float) for array in (offset, weights, normals))
        u, t = np.empty((2, len(normals), weights.shape[1], N_PAIRS))
        integrate(self.table, self.cells, self.coefficients, offset, weights, starts, normals, u, t)
        return u, t

    def gradient(self, offset: Array) -> Array:
        """Return U,q, (n, 5, 5, 3), for offsets (n, 3)."""
        result: Array = gradient(self.table, self.cells, np.ascontiguousarray(offset, dtype=float))
        return result


@final
@dataclass(frozen=True)
class Tabulated(FundamentalSolution):
    """The line integral tabulated over the faces of a cube, by polynomials of total degree 8 in each cell.

    Attributes
    ----------
    tolerance : float
        Largest error of U and T in any direction, relative to their largest entries. T, a derivative, is decisive; U is
        about a hundred times more accurate.
    cells : int
        Initial number of cells along each side of a face, 1 to 64. `bind` checks all cells against the line integral
        and refines them all if one fails.

    Raises
    ------
    CaseError
        If an option is out of bounds.

    References
    ----------
    docs/explanation/theory.md, Fundamental solution.
    """

    tolerance: Annotated[float, Quantity("", gt=0, lt=1)] = 1e-8
    cells: int = 20

    def __post_init__(self) -> None:
        check_quantities(self)
        if not 1 <= self.cells <= MAX_CELLS:
            raise CaseError(f"Tabulated: cells = {self.cells!r}; allowed: 1 to {MAX_CELLS}")

    def check(self, stiffness: Array) -> None:
        """Check that `bind` accepts a material.

        Parameters
        ----------
        stiffness : Array
            Scaled extended stiffness C'_iJKm, (3, 5, 5, 3).

        Raises
        ------
        MaterialError
            If `bind` raises it.

        Notes
        -----
        A coarse table is compared with the line integral, a fine one only if the errors of the coarse one are large.
        """
        stiffness = validate_stiffness(stiffness)
        if finest_error(_largest_error(_kernel(stiffness, COARSE_CELLS), _reference(stiffness))) > self.tolerance:
            self.bind(stiffness)

    def bind(self, stiffness: Array) -> Kernel:
        """Return the kernel of a material.

        Parameters
        ----------
        stiffness : Array
            Scaled extended stiffness, (3, 5, 5, 3).

        Returns
        -------
        Kernel
            The kernel.

        Raises
        ------
        MaterialError
            If the stiffness is not symmetric, not elliptic, or too anisotropic for the tolerance.
        """
        stiffness = validate_stiffness(stiffness)
        reference = _reference(stiffness)
        cells = self.cells
        while True:
            kernel = _kernel(stiffness, cells)
            excess = ERROR_MARGIN * _largest_error(kernel, reference) / self.tolerance
            if excess <= 1.0:
                return kernel
            if cells == MAX_CELLS:
                raise MaterialError(
                    f"a table of {cells} cells exceeds the tolerance {self.tolerance:g} by a factor {excess:.1e}: the "
                    "material is too anisotropic or too close to incompressible; use a larger tolerance, or the "
                    "fundamental solution line-integral, or isotropic for an isotropic material"
                )
            # The error of T decreases with about the eighth power of the cell size.
            growth = min(2.0, 1.05 * excess ** (1.0 / DEGREE))
            cells = min(MAX_CELLS, max(cells + 2, round(cells * growth)))


def _reference(stiffness: Array) -> Kernel:
    """Return the kernel by which tables are checked."""
    return LineIntegral(LINE_POINTS).bind(stiffness)


def _kernel(stiffness: Array, cells: int) -> TabulatedKernel:
    return TabulatedKernel(_table(stiffness, cells), cells, _face_coefficients(stiffness))


def _face_coefficients(stiffness: Array) -> Array:
    faces = [np.roll(stiffness, -face, axis=3).transpose(1, 2, 3, 0).ravel() for face in range(3)]
    return np.ascontiguousarray(faces)


def _table(stiffness: Array, cells: int) -> Array:
    """Return G = H / |x| interpolated in every cell, (3 cells^2, 720)."""
    offset = interpolation_points(cells)
    distance, triad = triads(offset)
    modulation = line_modulation(stiffness, LINE_POINTS, triad, with_tangents=False)
    return polynomials(modulation[:, 0] / distance[:, None], cells)


def _uninitialised(count: int) -> Array:
    """Return an uninitialised array (count,), a large one aligned to huge pages.

    NumPy requests huge pages for large arrays, which the system provides fastest. The array begins with such a page,
    and the rest of its last page is left unused.
    """
    if count < HUGE_PAGE:
        return np.empty(count)
    return from_boundary(np.empty(count + 2 * HUGE_PAGE), HUGE_PAGE)[:count]


def _largest_error(kernel: TabulatedKernel, reference: Kernel) -> float:
    """Return the larger of the errors of U and T, at test points of all cells.

    Derivatives of an interpolant are least accurate at the ends of a cell, which are therefore among the test points.
    """
    inside = 1.0 - 1e-9
    along = np.array([-inside, -0.4, 0.3, inside])
    offset = cell_points(kernel.cells, np.repeat(along, 4), np.tile(along, 4)).reshape(-1, 3)
    normal = np.random.default_rng(0).normal(size=offset.shape)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    u, t_kernel = kernel.evaluate(offset, normal)
    u_exact, t_exact = reference.evaluate(offset, normal)
    return max(_relative(u, u_exact), _relative(t_kernel, t_exact))


def _relative(value: Array, exact: Array) -> float:
    error = np.abs(value - exact).max(axis=(1, 2)) / np.abs(exact).max(axis=(1, 2))
    return float(error.max())
