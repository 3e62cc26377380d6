"""Spherical harmonics of odd degree, by which integrals of odd functions over half spheres are computed."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from meeframe.common.errors import MaterialError
from meeframe.fields import Array
from meeframe.greens._kernels.harmonics import odd_sums

MIN_DEGREE: Final = 23
MAX_DEGREE: Final = 8 * (MIN_DEGREE + 1) - 1


@final
@dataclass(frozen=True, eq=False)
class OddHarmonics:
    """A sum of real spherical harmonics of odd degrees l.

    Attributes
    ----------
    cosines, sines : Array
        Coefficients of the normalised functions P_lm(cos theta) cos(m phi) and sin(m phi), (orders, degrees, k).
    """

    cosines: Array
    sines: Array

    @classmethod
    def half_sphere_integrals(cls, function: Callable[[Array], Array], tolerance: float) -> "OddHarmonics":
        """Return the integral of an odd function over the half sphere about each direction.

        Parameters
        ----------
        function : callable
            Function of unit vectors (n, 3) with k values (n, k).
        tolerance : float
            Size of the gradient of the last third of all degrees, relative to that of all. Degrees beyond the last one
            whose gradient exceeds a tenth of it are dropped.

        Raises
        ------
        MaterialError
            If the series of MAX_DEGREE is not accurate enough.

        Notes
        -----
        The integral of a harmonic of odd degree l over the half sphere about e is its value at e times
        2 pi (-1)^((l - 1) / 2) (l - 2)!! / (l + 1)!! (Funk and Hecke). An even degree gives zero.
        """
        degree = MIN_DEGREE
        while True:
            cosines, sines = _analyse(function, degree)
            factors = 2.0 * np.pi * _half_sphere_factors(degree)
            cosines, sines = cosines * factors[:, None], sines * factors[:, None]
            slopes = np.sqrt((cosines**2 + sines**2).sum(axis=(0, 2))) * np.arange(degree + 1)
            if slopes[-(degree // 3) :].max() <= tolerance * slopes.max():
                needed = np.flatnonzero(slopes > 0.1 * tolerance * slopes.max()).max(initial=1) + 1
                return cls(*(np.ascontiguousarray(each[:needed, :needed]) for each in (cosines, sines)))
            if degree >= MAX_DEGREE:
                raise MaterialError(
                    f"the response to a heat source needs spherical harmonics beyond degree {MAX_DEGREE}: the material "
                    "is too anisotropic or too close to losing ellipticity"
                )
            degree = 2 * degree + 1

    def evaluate(self, directions: Array) -> Array:
        """Return the sums at unit vectors (n, 3), (n, k)."""
        result = np.empty((len(directions), self.cosines.shape[2]))
        odd_sums(self.cosines, self.sines, np.ascontiguousarray(directions, dtype=float), result)
        return result


def _half_sphere_factors(degree: int) -> Array:
    """Return the integrals of the Legendre polynomials from 0 to 1, zero for even degrees, (degree + 1,)."""
    factors = np.zeros(degree + 1)
    factors[1] = 0.5
    for n in range(3, degree + 1, 2):
        factors[n] = -factors[n - 2] * (n - 2) / (n + 1)
    return factors


def _analyse(function: Callable[[Array], Array], degree: int) -> tuple[Array, Array]:
    """Return the coefficients of a function, (degree + 1, degree + 1, k) each, by Gauss and trapezoidal rules."""
    heights, weights = np.polynomial.legendre.leggauss(degree + 1)
    count = 2 * (degree + 1)
    azimuth = 2.0 * np.pi * np.arange(count) / count
    radius = np.sqrt(1.0 - heights**2)
    z = np.empty((len(heights), count, 3))
    z[..., 0], z[..., 1] = radius[:, None] * np.cos(azimuth), radius[:, None] * np.sin(azimuth)
    z[..., 2] = heights[:, None]
    values = function(z.reshape(-1, 3)).reshape(len(heights), count, -1)
    spectrum = np.fft.rfft(values, axis=1)[:, : degree + 1] * (2.0 * np.pi / count * weights)[:, None, None]
    coefficients = np.zeros((degree + 1, degree + 1, values.shape[2]), complex)
    for order, functions in enumerate(_legendre(heights, degree)):
        coefficients[order, order:] = functions @ spectrum[:, order]
    return coefficients.real, -coefficients.imag


def _legendre(heights: Array, degree: int) -> Iterator[Array]:
    """Yield for m = 0, ..., degree the functions P_lm(height) of l = m, ..., degree, (degree - m + 1, n).

    See meeframe.greens._kernels.harmonics.
    """
    radius = np.sqrt(1.0 - heights**2)
    sectoral = np.full_like(heights, 1.0 / np.sqrt(4.0 * np.pi))
    for m in range(degree + 1):
        if m > 0:
            sectoral = sectoral * radius * np.sqrt((2 * m + 1) / (2 * m) * (2.0 if m == 1 else 1.0))
        functions = np.empty((degree - m + 1, len(heights)))
        functions[0] = sectoral
        for n in range(m + 1, degree + 1):
            a = np.sqrt((2 * n - 1) * (2 * n + 1) / ((n - m) * (n + m)))
            functions[n - m] = a * heights * functions[n - m - 1]
            if n > m + 1:
                b = np.sqrt((2 * n + 1) * (n + m - 1) * (n - m - 1) / ((n - m) * (n + m) * (2 * n - 3)))
                functions[n - m] -= b * functions[n - m - 2]
        yield functions
