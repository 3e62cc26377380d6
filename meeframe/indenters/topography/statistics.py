"""Statistics of height maps: heights, slopes, curvatures, the bearing ratio, and slopes by scale."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.fields import Array, Indices
from meeframe.indenters.topography.height_map import HeightMap
from meeframe.indenters.topography.preparation import check_full
from meeframe.indenters.topography.spectrum import spectral_moment

_SCALES: Final = 24
"""Largest number of scales of the scale-dependent slope, in equal ratios."""


@dataclass(frozen=True)
class SurfaceStatistics:
    """Statistics of a height map.

    Values by differences use neighbouring points and depend on the spacing; values by the spectrum belong to the
    Fourier series through the points. They agree on a periodic surface that its grid resolves. The spectrum of another
    map is that of the levelled map times a Hann window, whose slope and curvature differ by tens of per cent.

    Attributes
    ----------
    rms_height : float
        Root mean square height about the mean [m].
    skewness, kurtosis : float
        Third and fourth moment of the heights about their mean, divided by powers of rms_height; 0 and 3 for a normal
        distribution.
    peak_to_valley : float
        Difference of the highest and the lowest height [m].
    rms_slope, rms_slope_spectrum : float
        Root mean square modulus of the gradient, by differences and by the spectrum.
    rms_curvature, rms_curvature_spectrum : float
        Root mean square mean curvature, half the Laplacian, by differences and by the spectrum [1/m].
    """

    rms_height: float
    skewness: float
    kurtosis: float
    peak_to_valley: float
    rms_slope: float
    rms_slope_spectrum: float
    rms_curvature: float
    rms_curvature_spectrum: float

    @classmethod
    def of(cls, surface: HeightMap) -> "SurfaceStatistics":
        """Compute the statistics of a full map with equal spacings.

        Parameters
        ----------
        surface : HeightMap
            The map.

        Returns
        -------
        SurfaceStatistics
            Its statistics; skewness and kurtosis are nan for a plane, and rms_curvature for a map without inner points.

        Raises
        ------
        CaseError
            If heights are missing or spacings differ.
        """
        check_full(surface, "statistics")
        heights = surface.heights - surface.heights.mean()
        rms = float(np.sqrt(np.mean(heights**2)))
        curvature = mean_curvature(surface)
        third, fourth = (float(np.mean(heights**power)) for power in (3, 4))
        return cls(
            rms_height=rms,
            skewness=third / rms**3 if rms > 0.0 else np.nan,
            kurtosis=fourth / rms**4 if rms > 0.0 else np.nan,
            peak_to_valley=float(np.ptp(heights)),
            rms_slope=surface.rms_slope,
            rms_slope_spectrum=float(np.sqrt(spectral_moment(surface, 2))),
            rms_curvature=float(np.sqrt(np.mean(curvature**2))) if curvature.size else np.nan,
            rms_curvature_spectrum=float(np.sqrt(spectral_moment(surface, 4)) / 2.0),
        )


def mean_curvature(surface: HeightMap) -> Array:
    """Return half the Laplacian by second differences.

    Parameters
    ----------
    surface : HeightMap
        A full map with equal spacings.

    Returns
    -------
    Array
        Mean curvature [1/m] at all points if the map is periodic, else at inner points.
    """
    heights = np.pad(surface.heights, 1, mode="wrap") if surface.is_periodic else surface.heights
    dx, dy = surface.spacing
    along_x = (heights[2:] - 2.0 * heights[1:-1] + heights[:-2])[:, 1:-1] / dx**2
    along_y = (heights[:, 2:] - 2.0 * heights[:, 1:-1] + heights[:, :-2])[1:-1] / dy**2
    return np.asarray((along_x + along_y) / 2.0)


def bearing_ratio(surface: HeightMap, levels: Array) -> Array:
    """Return the fractions of the surface at or above some heights (Abbott's curve).

    Parameters
    ----------
    surface : HeightMap
        A full map.
    levels : Array
        Heights, (m,) [m].

    Returns
    -------
    Array
        Fractions, (m,), between 0 and 1.

    Raises
    ------
    CaseError
        If heights are missing.
    """
    check_full(surface, "bearing ratio")
    ordered = np.sort(surface.heights, axis=None)
    return np.asarray(1.0 - np.searchsorted(ordered, levels, side="left") / len(ordered))


def bearing_curve(surface: HeightMap, count: int = 101) -> tuple[Array, Array]:
    """Return Abbott's curve at equally spaced fractions.

    Parameters
    ----------
    surface : HeightMap
        A full map.
    count : int, optional
        Number of fractions from 0 to 1.

    Returns
    -------
    tuple of Array
        Fractions (count,), and the heights above which these fractions of the surface lie, (count,) [m].

    Raises
    ------
    CaseError
        If heights are missing.
    """
    check_full(surface, "bearing curve")
    fractions = np.linspace(0.0, 1.0, count)
    return fractions, np.asarray(np.quantile(surface.heights, 1.0 - fractions))


def scale_dependent_slope(surface: HeightMap) -> tuple[Array, Array]:
    """Return the root mean square slope by scale.

    Parameters
    ----------
    surface : HeightMap
        A full map with equal spacings.

    Returns
    -------
    tuple of Array
        Distances (m,) [m], from the spacing to half the length along x, and the root mean square slopes between points
        at these distances, along x and y combined like a gradient, (m,).

    Raises
    ------
    CaseError
        If heights are missing or spacings differ.

    References
    ----------
    Sanner, Noehring, Thimons, Jacobs & Pastewka, Appl. Surf. Sci. Adv. 7 (2022) 100190.
    """
    check_full(surface, "scale-dependent slope")
    dx, dy = surface.spacing
    limit = max(1, min(surface.shape[0], int(surface.size[1] / dx)) // 2)
    steps: Indices = np.unique(np.rint(np.geomspace(1, limit, _SCALES)).astype(np.int64))
    squares = []
    for step in steps:
        along_y = min(max(1, round(step * dx / dy)), surface.shape[1] - 1)
        slopes = surface.slopes(int(step))[0], surface.slopes(along_y)[1]
        squares.append(sum(float(np.mean(slope**2)) for slope in slopes))
    return np.asarray(dx * steps, float), np.sqrt(squares)
