"""Response of the surface of a half space to heat, as a Fourier series in the angle.

With u^ = y_h(m) h^ / k^2 (meeframe.material.thermal_half_space) and y_h = sum of y_n e^{i n a} over the angle a of m,
the response at d = r (cos theta, sin theta) from a unit outward heat flux at a point is

    K_J = -y_0J / (2 pi) ln(r / R) + sum over n != 0 of i^|n| y_nJ / (2 pi |n|) e^{i n theta}.

As y_h(-m) is the conjugate of y_h(m), the real part has even harmonics alone, the imaginary part odd ones. The level of
the response is not determined; R is the radius at which its mean over the angle vanishes.
Source: Gel'fand and Shilov, Generalized Functions 1 (1964), chapter II, section 3, on homogeneous functions.
"""

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from meeframe.plugin import (
    MECHANICAL,
    N_FIELDS,
    Array,
    FieldScaling,
    MaterialError,
    thermal_response,
)

_FIRST_ANGLES, _MAX_ANGLES = 32, 2048
_NEGLIGIBLE = 1e-14
_TOLERANCE = 1e-13
ENTRIES: Final = 2 * N_FIELDS
"""Number of entries: even and odd functions of the offset, for each field on which heat acts."""


@dataclass(frozen=True, eq=False)
class ThermalResponse:
    """Series of y_h in the angle of m, in scaled fields.

    Attributes
    ----------
    even
        (n, 2, N_FIELDS) cosine and sine coefficients of the harmonics 0, 2, ... of the real part.
    odd
        (n, 2, N_FIELDS) of the harmonics 1, 3, ... of the imaginary part.
    source
        Column of the temperature.
    cells
        Integrals over cells that are known, see `heat_table`.
    """

    even: Array
    odd: Array
    source: int
    cells: dict[tuple[int, float, str], Array] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of(cls, stiffness: Array, moduli: Array, source: int, frame: Array) -> "ThermalResponse":
        """Return the response of a half space.

        Parameters
        ----------
        stiffness
            C_iJKm (3, fields, fields, 3) [SI].
        moduli
            Thermal moduli (3, N_FIELDS) [SI].
        source
            Column of the temperature.
        frame
            (3, 3), rows e1, e2, outward normal.

        Raises
        ------
        MaterialError
            If the series does not converge, as for a material close to inadmissible.
        """
        count = _FIRST_ANGLES
        while count <= _MAX_ANGLES:
            angles = np.arange(count) * (2.0 * np.pi / count)
            y = scaled_thermal_response(stiffness, moduli, source, frame, angles)
            even, odd = (np.fft.rfft(values, axis=0) / count for values in (y.real, y.imag))
            size = np.maximum(np.abs(even), np.abs(odd)).max(axis=1)
            half = count // 2
            if size[half // 2 :].max() <= _TOLERANCE * size.max():
                retained = int(np.flatnonzero(size[: half // 2] > _NEGLIGIBLE * size.max()).max(initial=0)) + 1
                return cls(_series(even[:retained:2], 0), _series(odd[1:retained:2], 1), source)
            count *= 2
        raise MaterialError(f"the thermal response needs more than {_MAX_ANGLES} directions: nearly inadmissible")

    def entry(self, number: int) -> tuple[Array, bool]:
        """Return the series (n, 2) of an entry of ENTRIES without zeros at its end; True if its harmonics are odd."""
        is_odd, column = divmod(number, N_FIELDS)
        full = (self.odd if is_odd else self.even)[:, :, column]
        count = int(np.flatnonzero(full.any(axis=1)).max(initial=-1)) + 1
        return np.ascontiguousarray(full[:count]), bool(is_odd)

    def point_entry(self, number: int) -> tuple[Array, bool]:
        """Return the series (n, 2) of an entry in the angle of the offset; that of harmonic 0 multiplies ln(r / R)."""
        wave, is_odd = self.entry(number)
        harmonics = 2 * np.arange(len(wave)) + is_odd
        # i^n of even harmonics, i^(n + 1) of odd ones, whose series is that of the imaginary part
        signs = (-1.0) ** ((harmonics + is_odd) // 2)
        factors = np.where(harmonics == 0, -1.0, signs / np.maximum(harmonics, 1)) / (2.0 * np.pi)
        return wave * factors[:, None], is_odd

    @property
    def level(self) -> Array:
        """Mean of y_h over all directions, (N_FIELDS,): levels of these fields are not determined unless it is zero."""
        result: Array = self.even[0, 0]
        return result


def scaled_thermal_response(
    stiffness: Array, moduli: Array, source: int, frame: Array, angles: Array
) -> NDArray[np.complex128]:
    """Return y_h(m), (n, N_FIELDS), scaled, in the axes of the frame (3, 3), for m = cos(angle) e1 + sin(angle) e2."""
    factors = FieldScaling.of(stiffness).factors
    directions = np.outer(np.cos(angles), frame[0]) + np.outer(np.sin(angles), frame[1])
    coupled, conductivity = stiffness[:, :N_FIELDS, :N_FIELDS], -stiffness[:, source, source]
    y, _ = thermal_response(coupled, moduli, conductivity, frame[2], directions)
    y[:, MECHANICAL] = y[:, MECHANICAL] @ frame.T
    scaled: NDArray[np.complex128] = y / (factors[:N_FIELDS] * factors[source])
    return scaled


def _series(harmonics: NDArray[np.complex128], first: int) -> Array:
    """Return coefficients (n, 2, fields) of cosines and sines, from complex ones (n, fields) of harmonics from zero."""
    waves = np.stack([2.0 * harmonics.real, -2.0 * harmonics.imag], axis=1)
    if first == 0:
        waves[0] /= 2.0
    waves[np.abs(waves) <= _NEGLIGIBLE * np.abs(waves).max(initial=0.0)] = 0.0  # round-off of what symmetry forbids
    return np.ascontiguousarray(waves)
