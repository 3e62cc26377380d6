"""Self-affine random surfaces."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Final, final

import numpy as np
import scipy  # submodules are loaded on first use
from pydantic import Field

from meeframe.plugin import Array, CaseError, HeightMap, Indenter, Quantity, check_quantities, checked_arguments

SAMPLES_PER_WAVE: Final = 8
"""Default number of samples per shortest wavelength."""
MAX_SAMPLES: Final = 100_000
"""Largest number of samples along the period; more exceed any memory."""


@final
@checked_arguments
@dataclass(frozen=True)
class SelfAffine(Indenter):
    """A rigid periodic surface, a sum of waves with random phases and a self-affine spectrum.

    The power spectral density is constant for wavelengths from the period to the roll-off, falls like q^-2(1 + hurst)
    from there to the shortest wavelength, and is zero beyond. Either the root mean square height or the root mean
    square slope (of the modulus of the gradient) is given, and the surface has it exactly. Between samples the surface
    is a periodic cubic spline. Heights count from the lowest sample.

    Attributes
    ----------
    period : float
        Period along x and y.
    shortest : float
        Shortest wavelength.
    hurst : float
        Hurst exponent.
    rms_height, rms_slope : float or None
        Root mean square height or slope.
    roll_off : float or None
        Roll-off wavelength; by default the period.
    seed : int
        Seed of the phases. Waves are numbered from the longest on, so that a shorter cut-off adds waves and leaves the
        long ones unchanged.
    samples : int or None
        Samples along the period, at the midpoints of equal intervals; a contact zone of samples - 1 divisions, one
        interval shorter than the period, has its nodes there.
    """

    period: Annotated[float, Quantity("m", gt=0, lt=float("inf"))]
    shortest: Annotated[float, Quantity("m", gt=0, lt=float("inf"))]
    hurst: Annotated[float, Quantity("", gt=0, le=1)]
    rms_height: Annotated[float, Quantity("m", gt=0, lt=float("inf"))] | None = None
    rms_slope: Annotated[float, Quantity("", gt=0, lt=float("inf"))] | None = None
    roll_off: Annotated[float, Quantity("m", gt=0, lt=float("inf"))] | None = None
    seed: Annotated[int, Field(ge=0)] = 0
    samples: Annotated[int, Field(ge=4, le=MAX_SAMPLES)] | None = None

    def __post_init__(self) -> None:
        check_quantities(self)
        if (self.rms_height is None) == (self.rms_slope is None):
            raise CaseError("self-affine: give either rms_height or rms_slope")
        for name in ("rms_height", "rms_slope", "roll_off"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < float("inf"):
                raise CaseError(f"self-affine: {name} = {value!r}; allowed: finite numbers > 0")
        longest = self.period if self.roll_off is None else self.roll_off
        if not self.shortest <= longest <= self.period:
            raise CaseError(
                f"self-affine: shortest = {self.shortest!r} m, roll_off = {longest!r} m, period = {self.period!r} m; "
                "allowed: shortest <= roll_off <= period"
            )
        if self.period > MAX_SAMPLES / SAMPLES_PER_WAVE * self.shortest:
            raise CaseError(
                f"self-affine: shortest = {self.shortest!r} m, period = {self.period!r} m; allowed: at most "
                f"{MAX_SAMPLES // SAMPLES_PER_WAVE} shortest waves in the period"
            )
        minimum = 2 * _max_wave_number(self) + 1
        if self.samples is not None and self.samples < minimum:
            raise CaseError(f"self-affine: samples = {self.samples!r}; the shortest wave needs at least {minimum}")

    @property
    def grid_shape(self) -> tuple[int, int]:
        """Numbers of samples along x and y."""
        count = self.samples or SAMPLES_PER_WAVE * (_max_wave_number(self) + 1)
        return count, count

    def surface(self) -> Array:
        """Return the heights about their mean.

        Returns
        -------
        Array
            Heights, (samples, samples) [m], at x and y = (i + 1/2) period / samples - period / 2.
        """
        return _surface(self)

    def topography(self) -> HeightMap:
        """Return one period, with peaks up as they touch first, at its samples."""
        heights = self.surface()
        axis = (np.arange(len(heights)) + 0.5) * self.period / len(heights) - self.period / 2
        return HeightMap(axis, axis, -heights, is_periodic=True)

    def height(self, x: Array, y: Array) -> Array:
        """Return the height above the lowest sample.

        Parameters
        ----------
        x, y : Array
            Coordinates, (n,) each [m]; the surface is periodic.

        Returns
        -------
        Array
            Heights, (n,) >= 0 [m].
        """
        spline, lowest, count = _spline(self)
        positions = (np.array([x, y]) / self.period + 0.5) * count - 0.5
        heights: Array = (
            scipy.ndimage.map_coordinates(spline, positions, order=3, mode="grid-wrap", prefilter=False) - lowest
        )
        # a spline can undershoot the lowest sample
        return np.maximum(heights, 0.0)


def _max_wave_number(surface: SelfAffine) -> int:
    """Return the number of shortest waves along the period; round-off of the quotient must not remove one."""
    return int(surface.period / surface.shortest * (1 + 1e-12))


def _waves(surface: SelfAffine) -> tuple[Array, Array, Array]:
    """Return numbers (m, 2) of waves per period, one for each opposite pair, amplitudes (m,) [m] and phases (m,)."""
    limit = _max_wave_number(surface)
    numbers = np.indices((2 * limit + 1, 2 * limit + 1)).reshape(2, -1).T - limit
    square = (numbers**2).sum(axis=1)
    half_plane = (numbers[:, 0] > 0) | ((numbers[:, 0] == 0) & (numbers[:, 1] > 0))
    selected = half_plane & (square <= (surface.period / surface.shortest) ** 2 * (1 + 1e-12))
    numbers, square = numbers[selected], square[selected]
    order = np.lexsort((numbers[:, 1], numbers[:, 0], square))
    numbers, q = numbers[order], 2.0 * np.pi / surface.period * np.sqrt(square[order])
    knee = 2.0 * np.pi / (surface.roll_off or surface.period)
    amplitudes = np.maximum(q / knee, 1.0) ** -(1.0 + surface.hurst)
    if surface.rms_height is not None:
        amplitudes *= surface.rms_height / np.sqrt((amplitudes**2).sum() / 2.0)
    elif surface.rms_slope is not None:
        amplitudes *= surface.rms_slope / np.sqrt(((q * amplitudes) ** 2).sum() / 2.0)
    return numbers, amplitudes, np.random.default_rng(surface.seed).uniform(0.0, 2.0 * np.pi, len(q))


@lru_cache(maxsize=2)
def _surface(surface: SelfAffine) -> Array:
    numbers, amplitudes, phases = _waves(surface)
    count, _ = surface.grid_shape
    spectrum = np.zeros((count, count), complex)
    # phases refer to the corner of the period, half a sample before the first one
    waves = amplitudes / 2.0 * np.exp(1j * (phases + np.pi / count * numbers.sum(axis=1)))
    spectrum[tuple(numbers.T)] += waves
    spectrum[tuple(-numbers.T)] += np.conj(waves)
    heights: Array = np.fft.ifft2(spectrum, norm="forward").real
    heights.setflags(write=False)
    return heights


@lru_cache(maxsize=2)
def _spline(surface: SelfAffine) -> tuple[Array, float, int]:
    """Return the coefficients of the periodic cubic spline, its lowest sample, and the samples along a side."""
    heights = _surface(surface)
    return scipy.ndimage.spline_filter(heights, order=3, mode="grid-wrap"), float(heights.min()), len(heights)
