"""Surface topography: height maps, their preparation, spectra and statistics."""

from meeframe.indenters.topography.height_map import HeightMap, SampledSurface, topography_of
from meeframe.indenters.topography.preparation import (
    detrend,
    fill_missing,
    remove_outliers,
    resample,
    window,
)
from meeframe.indenters.topography.spectrum import (
    RadialSpectrum,
    power_spectrum,
    profile_spectrum,
    radial_spectrum,
    spectral_moment,
)
from meeframe.indenters.topography.statistics import (
    SurfaceStatistics,
    bearing_curve,
    bearing_ratio,
    scale_dependent_slope,
)

__all__ = [
    "HeightMap",
    "RadialSpectrum",
    "SampledSurface",
    "SurfaceStatistics",
    "bearing_curve",
    "bearing_ratio",
    "detrend",
    "fill_missing",
    "power_spectrum",
    "profile_spectrum",
    "radial_spectrum",
    "remove_outliers",
    "resample",
    "scale_dependent_slope",
    "spectral_moment",
    "topography_of",
    "window",
]
