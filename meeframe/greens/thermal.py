"""Action of a heat source on the other fields of an infinite body, tabulated over all directions.

A source of one watt at the origin heats by theta* = 1 / (4 pi sqrt(det k) sqrt(x . k^-1 x)) and causes the displacement
and potentials W with C_iJKm W_K,mi = beta_iJ theta*,i. W is of degree 0 and odd,

    W_J(x) = 1 / (8 pi^2) int over z . x > 0 of g_J(z) dS,   g = (C_iJKm z_i z_m)^-1 beta_iJ z_i / (z . k z).

It also satisfies k_ij W_P,ij = beta_iJ U_JP,i with the fundamental solution U of the other fields, so that temperatures
inside a body act on these through temperatures and heat fluxes on its boundary alone:

    c u_P(x') + int T_JP u_J dS = int U_JP t_J dS + int W_P h + (nu . k grad W_P) theta dS.

In a kernel of all fields, these are the entries U_6P = W_P and T_6P = -nu . k grad W_P of the temperature.
"""

from dataclasses import dataclass
from typing import Final, final

import numpy as np

from meeframe.common.errors import MaterialError
from meeframe.fields import N_FIELDS, Array, Indices
from meeframe.greens._kernels.modulation import triads
from meeframe.greens._kernels.tabulated import DEGREE
from meeframe.greens._kernels.thermal import heat_source, heat_source_sums
from meeframe.greens.base import Kernel
from meeframe.greens.cells import (
    COARSE_CELLS,
    ERROR_MARGIN,
    MAX_CELLS,
    cell_points,
    finest_error,
    interpolation_points,
    polynomials,
)
from meeframe.greens.harmonics import OddHarmonics

TOLERANCE: Final = 1e-9
"""Largest error of the gradient of W in any direction, relative to its largest entry; W is more accurate."""
CELLS: Final = 16
LINE_POINTS, MAX_LINE_POINTS, LINE_CHANGE = 16, 1 << 12, 1e-7


@final
@dataclass(frozen=True, eq=False)
class HeatSource:
    """Displacement and potentials W of a heat source, in scaled fields.

    Attributes
    ----------
    conductivity : Array
        Scaled conductivity k', (3, 3).
    table : Array
        Coefficients of the polynomials, (3 cells^2, 720).
    cells : int
        Cells along each side of a face.
    """

    conductivity: Array
    table: Array
    cells: int

    @classmethod
    def of(cls, stiffness: Array, moduli: Array, conductivity: Array) -> "HeatSource":
        """Return the table of a material.

        Parameters
        ----------
        stiffness : Array
            Scaled extended stiffness of the other fields, (3, 5, 5, 3).
        moduli : Array
            Scaled thermal moduli, (3, 5).
        conductivity : Array
            Scaled conductivity, (3, 3), symmetric and positive definite.

        Raises
        ------
        MaterialError
            If the material is too anisotropic for the tolerance.

        Notes
        -----
        Values are those of spherical harmonics (formula of Funk and Hecke). All cells are checked against the gradient,
        a mean over the circle normal to each direction, and refined if one fails.
        """
        harmonics, cells = _harmonics(stiffness, moduli, conductivity), CELLS
        while True:
            source = cls(conductivity, _table(harmonics, cells), cells)
            excess = ERROR_MARGIN * _largest_error(source, stiffness, moduli) / TOLERANCE
            if excess <= 1.0:
                return source
            if cells == MAX_CELLS:
                raise MaterialError(
                    f"a table of {cells} cells for the response to a heat source exceeds the tolerance {TOLERANCE:g} "
                    f"by a factor {excess:.1e}: the material is too anisotropic or too close to incompressible"
                )
            cells = min(MAX_CELLS, max(cells + 2, round(cells * min(2.0, 1.05 * excess ** (1.0 / DEGREE)))))

    @classmethod
    def check(cls, stiffness: Array, moduli: Array, conductivity: Array) -> None:
        """Raise MaterialError if `of` does; see `Tabulated.check`."""
        harmonics = _harmonics(stiffness, moduli, conductivity)
        source = cls(conductivity, _table(harmonics, COARSE_CELLS), COARSE_CELLS)
        if finest_error(_largest_error(source, stiffness, moduli)) > TOLERANCE:
            cls.of(stiffness, moduli, conductivity)

    def evaluate(self, offset: Array, normal: Array) -> tuple[Array, Array]:
        """Return W and -nu . k grad W, (n, 5) each, for offsets and unit normals (n, 3)."""
        u, t = np.empty((2, len(offset), N_FIELDS))
        self.enter(offset, normal, 0, u, t)
        return u, t

    def enter(self, offset: Array, normal: Array, first: int, u: Array, t: Array) -> None:
        """Write the values of `evaluate` into the columns from `first` on of u and t, (n, .)."""
        direction = np.ascontiguousarray(normal @ self.conductivity)
        heat_source(self.table, self.cells, np.ascontiguousarray(offset, dtype=float), direction, first, u, t)

    def enter_sums(
        self, offset: Array, weights: Array, starts: Indices, normals: Array, first: int, u: Array, t: Array
    ) -> None:
        """Write weighted sums over plane pieces into columns of u and t, (m, k, .); see `Kernel.integrate`."""
        offset, weights = (np.ascontiguousarray(array, dtype=float) for array in (offset, weights))
        direction = np.ascontiguousarray(normals @ self.conductivity)
        heat_source_sums(self.table, self.cells, offset, direction, weights, starts, first, u, t)

    def gradient(self, offset: Array) -> Array:
        """Return W_P,q, (n, 5, 3), for offsets (n, 3)."""
        offset = np.ascontiguousarray(offset, dtype=float)
        slopes, w = np.empty((3, len(offset), N_FIELDS)), np.empty((len(offset), N_FIELDS))
        for axis, direction in enumerate(-np.eye(3)):
            heat_source(self.table, self.cells, offset, np.tile(direction, (len(offset), 1)), 0, w, slopes[axis])
        gradient: Array = np.moveaxis(slopes, 0, -1)
        return gradient


@final
@dataclass(frozen=True, eq=False)
class ThermalKernel(Kernel):
    """Kernel of fields on one of which, the temperature, the first N_FIELDS depend.

    Attributes
    ----------
    uncoupled : Kernel
        Kernel without that dependence.
    size : int
        Number of fields.
    column : int
        Column of the temperature.
    source : HeatSource
        Response of the other fields to a heat source.
    """

    uncoupled: Kernel
    size: int
    column: int
    source: HeatSource

    def evaluate(self, offset: Array, normal: Array) -> tuple[Array, Array]:
        """Return U and T, (n, fields, fields) each; see `Kernel.evaluate`. U is not symmetric."""
        u, t = self.uncoupled.evaluate(offset, normal)
        self.source.enter(offset, normal, self._first, u.reshape(len(u), -1), t.reshape(len(t), -1))
        return u, t

    def integrate(self, offset: Array, weights: Array, starts: Indices, normals: Array) -> tuple[Array, Array] | None:
        """Return weighted sums of U and T over the points of plane pieces; see `Kernel.integrate`."""
        sums = self.uncoupled.integrate(offset, weights, starts, normals)
        if sums is None:
            return None
        u, t = sums
        self.source.enter_sums(offset, weights, starts, normals, self._first, u, t)
        return u, t

    def gradient(self, offset: Array) -> Array:
        """Return U,q, (n, fields, fields, 3), for offsets (n, 3)."""
        gradient = self.uncoupled.gradient(offset)
        gradient[:, self.column, :N_FIELDS] = self.source.gradient(offset)
        return gradient

    def weakly_singular(self) -> Indices:
        """Return the entries that heat adds; see `Kernel.weakly_singular`."""
        return self._first + np.arange(N_FIELDS)

    @property
    def _first(self) -> int:
        """Number of the first entry that heat adds, in rows of fields^2 entries."""
        return self.column * self.size


def source_gradient(stiffness: Array, moduli: Array, conductivity: Array, offset: Array) -> Array:
    """Return W_P,q, (n, 5, 3), as means over the circles normal to offsets (n, 3); the arguments are scaled.

    4 pi |x| W_J,q is the mean of z_q g_J(z) over directions z normal to x, by the trapezoidal rule.

    Raises
    ------
    MaterialError
        If the rule does not converge.
    """
    distance, triad = triads(np.ascontiguousarray(offset, dtype=float))

    def mean(count: int, shift: float) -> Array:
        angle = (np.arange(count) + shift) * np.pi / count
        z = np.cos(angle)[:, None] * triad[:, None, 0] + np.sin(angle)[:, None] * triad[:, None, 1]
        values = _density(stiffness, moduli, conductivity, z.reshape(-1, 3)).reshape(*z.shape[:2], -1)
        return np.asarray(np.einsum("naJ,naq->nJq", values, z, optimize=True) / count)

    count, total = LINE_POINTS, mean(LINE_POINTS, 0.0)
    while count <= MAX_LINE_POINTS:
        between = mean(count, 0.5)
        change = np.abs(between - total).max() / np.abs(total).max()
        count, total = 2 * count, 0.5 * (total + between)
        # The rule converges geometrically, so that the error is about the square of the last change.
        if change <= LINE_CHANGE:
            result: Array = total / (4.0 * np.pi * distance)[:, None, None]
            return result
    raise MaterialError(f"the response to a heat source does not converge with {MAX_LINE_POINTS} points on a circle")


def _harmonics(stiffness: Array, moduli: Array, conductivity: Array) -> OddHarmonics:
    """Return 8 pi^2 W as a function of the direction."""
    return OddHarmonics.half_sphere_integrals(lambda z: _density(stiffness, moduli, conductivity, z), 0.1 * TOLERANCE)


def _table(harmonics: OddHarmonics, cells: int) -> Array:
    """Return W interpolated in every cell, (3 cells^2, 720)."""
    points = interpolation_points(cells)
    directions = points / np.linalg.norm(points, axis=1, keepdims=True)
    return polynomials(harmonics.evaluate(directions) / (8.0 * np.pi**2), cells)


def _density(stiffness: Array, moduli: Array, conductivity: Array, z: Array) -> Array:
    """Return g(z), (n, 5), at unit vectors z (n, 3)."""
    acoustic = np.einsum("ni,iJKm,nm->nJK", z, stiffness, z, optimize=True)
    conduction = np.einsum("ni,ij,nj->n", z, conductivity, z, optimize=True)
    density: Array = np.linalg.solve(acoustic, (z @ moduli)[:, :, None])[:, :, 0] / conduction[:, None]
    return density


def _largest_error(source: HeatSource, stiffness: Array, moduli: Array) -> float:
    """Return the largest error of the gradient relative to its largest entry in all directions.

    It is found at the corners of each cell, where the gradient is least accurate. In some directions it may vanish.
    """
    ends = (1.0 - 1e-9) * np.array([-1.0, 1.0])
    offset = cell_points(source.cells, np.repeat(ends, 2), np.tile(ends, 2)).reshape(-1, 3)
    exact = source_gradient(stiffness, moduli, source.conductivity, offset)
    distance = np.linalg.norm(offset, axis=1)[:, None, None]
    return float((distance * np.abs(source.gradient(offset) - exact)).max() / (distance * np.abs(exact)).max())
