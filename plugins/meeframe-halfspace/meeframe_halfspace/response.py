"""Response of the surface of an anisotropic half space to a point source, as a Fourier series in the angle.

With u^ = Y(m) t^ / k (meeframe.material.half_space) the response at a vector d = r (cos theta, sin theta) from the
source is K(theta)/r. Y is Hermitian and Y(-m) its conjugate, so that its real part has even harmonics alone, the
imaginary part odd ones, and the inverse transform of e^{i n alpha} / k is e^{i n theta} i^n / (2 pi r) for even n and
-i^{|n| - 1} e^{i n theta} / (2 pi r), from a principal value, for odd n where Y has i e^{i n alpha}. The odd part
couples normal and tangential fields, like the (1 - 2 nu) terms of Boussinesq and Cerruti.
Source: Gel'fand and Shilov, Generalized Functions 1 (1964), chapter II, section 3, on homogeneous functions.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import isqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from meeframe.plugin import (
    MECHANICAL,
    N_FIELDS,
    NORMAL,
    Array,
    FieldScaling,
    Indices,
    MaterialError,
    local_frames,
    surface_compliance,
)
from meeframe_halfspace.entries import EntryLayout, entries_to_matrix, entry_layout
from meeframe_halfspace.thermal import ThermalResponse

_FIRST_ANGLES, _MAX_ANGLES = 32, 2048
_NEGLIGIBLE = 1e-14  # of the largest coefficient, in scaled fields
_TOLERANCE = 1e-13


@dataclass(frozen=True, eq=False)
class PointResponse:
    """Response K(theta) to a point source in scaled fields; d from source to point in the axes e1, e2.

    Attributes
    ----------
    even : Array
        Cosine and sine coefficients of the harmonics 0, 2, ..., (n, 2, symmetric entries), see EntryLayout.
    odd : Array
        Those of the harmonics 1, 3, ..., (n, 2, antisymmetric entries).
    factors : Array
        Factors of the scaling, (fields,).
    thermal : ThermalResponse or None
        Response to heat; None unless it acts on other fields.
    """

    even: Array
    odd: Array
    factors: Array
    thermal: ThermalResponse | None = None

    @property
    def layout(self) -> EntryLayout:
        """Numbers of the entries."""
        return entry_layout(len(self.factors), None if self.thermal is None else self.thermal.source)

    @classmethod
    def of(cls, stiffness: Array, frame: Array) -> "PointResponse":
        """Return the response of a half space.

        Parameters
        ----------
        stiffness : Array
            Extended stiffness C_iJKm, (3, fields, fields, 3), SI units.
        frame : Array
            Rows e1, e2 and the outward normal, (3, 3).

        Returns
        -------
        PointResponse
            The response.

        Raises
        ------
        MaterialError
            If the series does not converge, as for a material close to inadmissible.
        """
        factors = FieldScaling.of(stiffness).factors
        count = _FIRST_ANGLES
        y = _over_half(stiffness, frame, count // 2, 0.0)
        while True:
            harmonics = _harmonics(np.concatenate([y, y.conj()]))
            size = np.abs(harmonics).max(axis=(1, 2))
            half = count // 2  # rows 0 .. half are the harmonics from zero on
            lost = np.finfo(float).eps * size.max()  # round-off of a compliance large compared with C, as of rubber
            if size[half // 2 : half + 1].max() <= max(_TOLERANCE, lost) * size.max():
                retained = int(np.flatnonzero(size[: half // 2] > max(_NEGLIGIBLE, lost) * size.max()).max())
                return cls(*_series(harmonics[: retained + 1]), factors)
            if count == _MAX_ANGLES:
                break
            y = np.stack([y, _over_half(stiffness, frame, half, 0.5)], axis=1).reshape(-1, *y.shape[1:])
            count *= 2
        raise MaterialError(
            f"the surface compliance needs more than {_MAX_ANGLES} directions: the material is nearly inadmissible"
        )

    def evaluate(self, offset: Array) -> Array:
        """Return displacement and potentials per unit of a point force, charge and flux.

        Parameters
        ----------
        offset : Array
            Offsets from the source along e1 and e2, (n, 2) [m].

        Returns
        -------
        Array
            Responses, (n, fields, fields), SI units. Rows (u.e1, u.e2, u.nu, phi, psi), columns (force along e1, e2,
            nu; total of q; total of s).
        """
        r, theta = np.hypot(*offset.T), np.arctan2(offset[:, 1], offset[:, 0])
        values = np.concatenate([_sum(self.even, 2 * theta, 0.0), _sum(self.odd, 2 * theta, theta)], axis=1)
        matrix: Array = entries_to_matrix(values / r[:, None]) * np.outer(self.factors, self.factors)
        return matrix

    def entry(self, number: int) -> tuple[Array, bool]:
        """Return the series of an entry without zeros at its end.

        Parameters
        ----------
        number : int
            Number of the entry in the layout.

        Returns
        -------
        Array
            Cosine and sine coefficients, (n, 2).
        bool
            True if the harmonics are odd.
        """
        if self.thermal is not None and number >= self.layout.n_hermitian:
            return self.thermal.entry(number - self.layout.n_hermitian)
        return series_entry(self.even, self.odd, number)

    @cached_property
    def numbers(self) -> list[int]:
        """Numbers of the nonzero entries."""
        return [number for number in range(self.layout.n_values) if len(self.entry(number)[0])]

    @cached_property
    def parities(self) -> Indices | None:
        """Parities of the entries: 1 for even, -1 for odd functions of the angle; None without mirror symmetry.

        The plane of symmetry contains the normal and the first axis.
        """
        result = np.array([mirror_parity(self.entry(number)[0]) for number in self.numbers])
        for signs in product((1, -1), repeat=self.layout.n_fields - 1):
            of_fields = np.outer((1, *signs), (1, *signs))
            acting = [] if self.layout.source is None else np.tile(of_fields[:N_FIELDS, self.layout.source], 2)
            parities = np.concatenate([of_fields[self.layout.upper], of_fields[self.layout.strict], acting])
            if (result == parities[self.numbers]).all():
                return parities.astype(np.int64)
        return None

    def wave_series(self) -> tuple[Array, Array]:
        """Return the series of Y(m) in the angle of m, laid out as `even` (real part) and `odd` (imaginary part)."""
        even, odd = (np.arange(len(coefficients)) for coefficients in (self.even, self.odd))
        to_even, to_odd = 2.0 * np.pi / harmonic_factor(2 * even), 2.0 * np.pi / harmonic_factor(2 * odd + 1)
        return self.even * to_even[:, None, None], self.odd * to_odd[:, None, None]


def series_entry(even: Array, odd: Array, number: int) -> tuple[Array, bool]:
    """Return one entry of a series laid out as that of PointResponse: see PointResponse.entry."""
    n_symmetric = even.shape[2]
    antisymmetric = number >= n_symmetric
    full = odd[:, :, number - n_symmetric] if antisymmetric else even[:, :, number]
    count = int(np.flatnonzero(full.any(axis=1)).max(initial=-1)) + 1
    return np.ascontiguousarray(full[:count]), antisymmetric


def mirror_parity(coefficients: Array) -> int:
    """Return 1 or -1 if a series (n, 2) is even or odd in the angle, as in media with planes of symmetry; else 0."""
    cosines, sines = coefficients.any(axis=0)
    return int(cosines) - int(sines)


def scaled_compliance(stiffness: Array, frame: Array, angles: Array) -> NDArray[np.complex128]:
    """Return the surface compliance Y(m), (n, fields, fields), Hermitian, scaled, in the axes of the frame (3, 3).

    m = cos(angle) e1 + sin(angle) e2.
    """
    axes = np.eye(stiffness.shape[1])
    axes[MECHANICAL, MECHANICAL] = frame
    factors = FieldScaling.of(stiffness).factors
    directions = np.outer(np.cos(angles), frame[0]) + np.outer(np.sin(angles), frame[1])
    y = surface_compliance(stiffness, frame[2], directions) / np.outer(factors, factors)
    local: NDArray[np.complex128] = axes @ y @ axes.T
    return local


def indentation_modulus(stiffness: Array, normal: ArrayLike = (0.0, 0.0, 1.0)) -> float:
    """Return the modulus of a frictionless insulating indenter on a half space.

    The normal point response, averaged over all directions, is that of an isotropic half space with M = E/(1 - nu^2). A
    round punch, sphere or cone meets M exactly where the response does not depend on direction, and to first order of
    its variation elsewhere.

    Parameters
    ----------
    stiffness : Array
        Extended stiffness C_iJKm, (3, fields, fields, 3), SI units.
    normal : array_like, optional
        Outward normal of the surface, (3,), of any length; along x3 by default.

    Returns
    -------
    float
        Modulus M [Pa].

    Raises
    ------
    MaterialError
        As `PointResponse.of`.

    References
    ----------
    Vlassak and Nix, Philos. Mag. A 67 (1993) 1045.
    """
    nu = np.asarray(normal, float) / np.linalg.norm(normal)
    response = PointResponse.of(stiffness, local_frames(nu[None])[0])
    mean = response.even[0, 0, response.layout.real[NORMAL, NORMAL]]
    return float(1.0 / (np.pi * mean * response.factors[NORMAL] ** 2))


def series_blocks(even: Array, angles: Array) -> Array:
    """Return symmetric matrices (n, fields, fields) of a series laid out as `even` of PointResponse, at angles (n,)."""
    values = _sum(even, 2 * angles, 0.0)
    n_symmetric = values.shape[1]
    n_antisymmetric = n_symmetric - (isqrt(8 * n_symmetric + 1) - 1) // 2
    return entries_to_matrix(np.concatenate([values, np.zeros((len(angles), n_antisymmetric))], axis=1))


def series_values(even: Array, odd: Array, angles: Array) -> tuple[Array, Array]:
    """Return symmetric and antisymmetric entries (n, ...) of a series laid out as PointResponse, at angles (n,)."""
    return _sum(even, 2 * angles, 0.0), _sum(odd, 2 * angles, angles)


def _over_half(stiffness: Array, frame: Array, count: int, start: float) -> NDArray[np.complex128]:
    """Return Y(m) at equal steps over half a circle from `start` steps beyond e1; the other half is conjugate."""
    return scaled_compliance(stiffness, frame, np.pi * (np.arange(count) + start) / count)


def _harmonics(y: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return complex coefficients of K(theta), harmonic n >= 0 in row n, from samples of Y over the circle."""
    count = len(y)
    n = np.arange(count // 2 + 1)
    # the real part has even harmonics alone, the imaginary part odd ones
    harmonics: NDArray[np.complex128] = np.where(
        (n % 2 == 0)[:, None, None], *(np.fft.rfft(samples, axis=0) for samples in (y.real, y.imag))
    )
    harmonics *= (harmonic_factor(n) / (2.0 * np.pi * count))[:, None, None]
    return harmonics


def harmonic_factor(n: Indices) -> Array:
    """Return i^n for the even harmonics n >= 0 of the real part, -i^(n - 1) for the odd ones of the imaginary part."""
    factor: Array = np.where(n % 2 == 0, 1.0, -1.0) * (-1.0) ** (n // 2)
    return factor


def _series(harmonics: NDArray[np.complex128]) -> tuple[Array, Array]:
    """Return cosine and sine coefficients of the even harmonics, (e, 2, symmetric), and of the odd ones."""
    layout = entry_layout(harmonics.shape[-1])
    waves = np.stack([2.0 * harmonics.real, -2.0 * harmonics.imag], axis=1)
    waves[0] /= 2.0
    waves[np.abs(waves) <= _NEGLIGIBLE * np.abs(waves).max()] = 0.0  # round-off of what symmetry forbids
    even, odd = waves[0::2][..., *layout.upper], waves[1::2][..., *layout.strict]
    return np.ascontiguousarray(even), np.ascontiguousarray(odd)


def _sum(coefficients: Array, step: Array, start: Array | float) -> Array:
    """Return the sums (p, entries) of series with coefficients (n, 2, entries) at phases start + n step, (p,) each."""
    phases = start + np.outer(np.arange(len(coefficients)), step)
    values: Array = np.cos(phases).T @ coefficients[:, 0] + np.sin(phases).T @ coefficients[:, 1]
    return values
