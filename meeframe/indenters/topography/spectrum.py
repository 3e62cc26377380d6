"""Power spectral densities of height maps.

The density of a surface over an area A is C(q) = |integral of h exp(-i q.x)|^2 / A [m^4]; that of profiles of a length
L along an axis is C(q) = |integral of h exp(-i q x)|^2 / L [m^3]. With q = 2 pi / wavelength, the mean square height is
the sum of C(q) / A over all waves, or the integral of C over the plane divided by 4 pi^2, or of profiles over q > 0
divided by pi. Source: Jacobs, Junge and Pastewka, Surf. Topogr.: Metrol. Prop. 5 (2017) 013001.
"""

from dataclasses import dataclass, replace
from numbers import Real

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.common.memoize import memoize_by_identity
from meeframe.fields import Array, Indices
from meeframe.indenters.topography.height_map import HeightMap
from meeframe.indenters.topography.preparation import check_full, detrend, window


@dataclass(frozen=True, eq=False)
class RadialSpectrum:
    """Power spectral density averaged over rings of waves.

    Attributes
    ----------
    wave_number : Array
        Mean wave number 2 pi / wavelength in each ring, (m,) [1/m].
    density : Array
        Mean density in each ring, (m,) [m^4].
    count : Indices
        Number of waves in each ring, (m,).
    """

    wave_number: Array
    density: Array
    count: Indices


@memoize_by_identity
def power_spectrum(surface: HeightMap) -> tuple[Array, Array, Array]:
    """Return the power spectral density of all waves of a map.

    A map that is not periodic is levelled and multiplied by a Hann window first.

    Parameters
    ----------
    surface : HeightMap
        A full map with equal spacings.

    Returns
    -------
    tuple of Array
        Wave numbers along x (nx,) and along y (ny,) [1/m], in the order of the discrete transform, and the density
        (nx, ny) [m^4], which is zero for the mean.

    Raises
    ------
    CaseError
        If heights are missing or spacings differ.
    """
    prepared = _prepared(surface, "power spectrum")
    (nx, ny), (dx, dy) = surface.shape, surface.spacing
    amplitudes = np.abs(np.fft.fft2(prepared.heights, norm="forward")) ** 2
    amplitudes[0, 0] = 0.0
    qx, qy = (np.asarray(2.0 * np.pi * np.fft.fftfreq(count, step), float) for count, step in ((nx, dx), (ny, dy)))
    spectrum = qx, qy, np.asarray(nx * dx * ny * dy * amplitudes)
    for values in spectrum:
        values.setflags(write=False)
    return spectrum


def profile_spectrum(surface: HeightMap, axis: int = 0) -> tuple[Array, Array]:
    """Return the power spectral density of profiles along an axis, averaged over all profiles of a map.

    Parameters
    ----------
    surface : HeightMap
        A full map with equal spacings.
    axis : int, optional
        0 for profiles along x, 1 along y.

    Returns
    -------
    tuple of Array
        Wave numbers, (m,) > 0 [1/m], and the density (m,) [m^3].

    Raises
    ------
    CaseError
        For another axis, and as `power_spectrum`.
    """
    if axis not in (0, 1):
        raise CaseError(f"profile_spectrum: axis = {axis!r}; allowed: 0, 1")
    prepared = _prepared(surface, "profile spectrum")
    count, length = surface.shape[axis], surface.size[axis]
    amplitudes = np.abs(np.fft.rfft(prepared.heights, axis=axis, norm="forward")) ** 2
    density = length * amplitudes.mean(axis=1 - axis)
    if count % 2 == 0:
        density[-1] /= 2.0  # the shortest wave is its own opposite
    return np.asarray(2.0 * np.pi / length * np.arange(1, len(density)), float), np.asarray(density[1:])


def radial_spectrum(surface: HeightMap) -> RadialSpectrum:
    """Return the power spectral density averaged over directions, in rings as wide as the smallest wave number.

    Parameters
    ----------
    surface : HeightMap
        A full map with equal spacings.

    Returns
    -------
    RadialSpectrum
        The rings with waves, up to the largest wave number along both axes.

    Raises
    ------
    CaseError
        As `power_spectrum`.
    """
    qx, qy, density = power_spectrum(surface)
    q = np.hypot(qx[:, None], qy[None, :])
    width = 2.0 * np.pi / min(surface.size)
    end = min(np.abs(qx).max(), np.abs(qy).max())
    ring = np.rint(q / width).astype(np.int64)
    inside = (q > 0.0) & (q <= end * (1.0 + 1e-9))
    counts = np.bincount(ring[inside])
    totals, numbers = (np.bincount(ring[inside], values[inside]) for values in (density, q))
    occupied = counts > 0
    counts = counts[occupied]
    return RadialSpectrum(numbers[occupied] / counts, totals[occupied] / counts, counts)


def spectral_moment(surface: HeightMap, power: float) -> float:
    """Return the mean square of the derivative of an order that follows from the spectrum.

    Parameters
    ----------
    surface : HeightMap
        A full map with equal spacings.
    power : float
        Power of the wave number: 0 for the mean square height [m^2], 2 for the mean square gradient, 4 for the mean
        square Laplacian [1/m^2].

    Returns
    -------
    float
        The sum of q^power C(q) over all waves, divided by the area.

    Raises
    ------
    CaseError
        For a negative power, and as `power_spectrum`.
    """
    if not isinstance(power, Real) or not 0.0 <= power < np.inf:
        raise CaseError(f"spectral_moment: power = {power!r}; allowed: finite numbers >= 0")
    qx, qy, density = power_spectrum(surface)
    lx, ly = surface.size
    q = np.hypot(qx[:, None], qy[None, :])
    weights = q**power if power else np.ones_like(q)
    return float((weights * density).sum() / (lx * ly))


def _prepared(surface: HeightMap, what: str) -> HeightMap:
    """Return the map that is transformed, with its mean removed."""
    check_full(surface, what)
    if surface.is_periodic:
        return replace(surface, heights=surface.heights - surface.heights.mean())
    levelled = detrend(surface, "plane")
    return replace(levelled, heights=levelled.heights * window(surface))
