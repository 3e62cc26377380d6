"""Statistics and spectra of height maps agree with closed forms of waves, planes, paraboloids and random surfaces."""

import numpy as np
import pytest

from meeframe import topography
from meeframe.common.errors import CaseError
from meeframe.indenters.topography import HeightMap, SurfaceStatistics

LX, LY, NX, NY = 3e-3, 2e-3, 96, 80
AMPLITUDE = 2e-6


def wave(nx=NX, ny=NY, waves=(3, 2)):
    """Return a periodic map of one wave with its wave vector."""
    x, y = LX * np.arange(nx) / nx, LY * np.arange(ny) / ny
    q = 2.0 * np.pi * np.array([waves[0] / LX, waves[1] / LY])
    return HeightMap(x, y, AMPLITUDE * np.cos(q[0] * x[:, None] + q[1] * y + 0.3), is_periodic=True), q


def test_sinusoid():
    surface, q = wave()
    statistics = SurfaceStatistics.of(surface)
    rms, size = AMPLITUDE / np.sqrt(2.0), np.hypot(*q)
    assert statistics.rms_height == pytest.approx(rms, rel=1e-12)
    assert statistics.skewness == pytest.approx(0.0, abs=1e-12)
    assert statistics.kurtosis == pytest.approx(1.5, rel=1e-12)
    assert statistics.rms_slope_spectrum == pytest.approx(rms * size, rel=1e-12)
    assert statistics.rms_curvature_spectrum == pytest.approx(rms * size**2 / 2.0, rel=1e-12)
    # differences multiply each wave by sines of its phase between neighbours
    half = q * surface.spacing / 2.0
    effective = q * np.sin(half) / half
    assert statistics.rms_slope == pytest.approx(rms * np.hypot(*effective), rel=1e-12)
    assert statistics.rms_curvature == pytest.approx(rms * np.hypot(*effective) ** 2 / 2.0, rel=1e-11)


def test_differences_converge_to_the_spectrum_with_second_order():
    errors = []
    for factor in (1, 2, 4):
        statistics = SurfaceStatistics.of(wave(NX * factor, NY * factor)[0])
        errors.append(
            [
                statistics.rms_slope / statistics.rms_slope_spectrum - 1.0,
                statistics.rms_curvature / statistics.rms_curvature_spectrum - 1.0,
            ]
        )
    orders = np.log2(np.abs(np.array(errors[:-1]) / np.array(errors[1:])))
    np.testing.assert_allclose(orders, 2.0, atol=0.02)


def test_scale_dependent_slope_of_a_wave():
    surface, q = wave()
    distances, slopes = topography.scale_dependent_slope(surface)
    along_y = np.rint(distances / surface.spacing[1]).clip(1) * surface.spacing[1]
    expected = (
        np.sqrt(2.0) * AMPLITUDE * np.hypot(*(np.sin(q[i] * d / 2) / d for i, d in enumerate((distances, along_y))))
    )
    np.testing.assert_allclose(slopes, expected, rtol=1e-10)
    assert slopes[0] == pytest.approx(surface.rms_slope, rel=1e-12)


def test_paraboloid():
    """Second differences of a paraboloid are exact; moments of its heights follow from those of x and y."""
    radius, n = 5e-3, 201
    x = y = np.linspace(-1e-3, 1e-3, n)
    surface = HeightMap(x, y, -(x[:, None] ** 2 + y**2) / (2.0 * radius))
    statistics = SurfaceStatistics.of(surface)
    assert statistics.rms_curvature == pytest.approx(1.0 / radius, rel=1e-9)
    assert statistics.peak_to_valley == pytest.approx(1e-6 / radius, rel=1e-12)
    half = 1e-3
    variance = 2.0 * half**4 * (1 / 5 - 1 / 9)  # of x^2 + y^2, uniform over the square
    third = 2.0 * half**6 * (1 / 7 - 3 / 5 / 3 + 2 / 27)
    assert statistics.rms_height == pytest.approx(np.sqrt(variance) / (2.0 * radius), rel=0.02)
    assert statistics.skewness == pytest.approx(-third / variance**1.5, rel=0.05)
    slope = np.sqrt(2.0 * half**2 / 3.0) / radius
    assert statistics.rms_slope == pytest.approx(slope, rel=0.01)


def test_bearing_ratio_of_ramp_and_wave():
    x, y = np.arange(1000) * 1e-6, np.arange(4) * 1e-6
    ramp = HeightMap(x, y, np.broadcast_to(x[:, None], (1000, 4)))
    fractions, heights = topography.bearing_curve(ramp)
    np.testing.assert_allclose(heights, (1.0 - fractions) * x[-1], rtol=1e-9, atol=1e-12)
    surface, _ = wave(2000, 4, (1, 0))
    levels = AMPLITUDE * np.array([-0.9, -0.3, 0.2, 0.7])
    np.testing.assert_allclose(
        topography.bearing_ratio(surface, levels), np.arccos(levels / AMPLITUDE) / np.pi, atol=2e-3
    )
    assert topography.bearing_ratio(ramp, np.array([-1.0, 1.0])).tolist() == [1.0, 0.0]


def random_surface(density, n=64, seed=3):
    """Return a map with a power spectral density exactly that of a function, and random phases, with all waves."""
    area = LX * LY
    q = [2.0 * np.pi * np.fft.fftfreq(n, length / n) for length in (LX, LY)]
    size = np.hypot(q[0][:, None], q[1])
    noise = np.fft.fft2(np.random.default_rng(seed).standard_normal((n, n)))
    target = np.where(size > 0.0, density(np.where(size > 0.0, size, 1.0)), 0.0)
    waves = noise / np.abs(noise) * np.sqrt(target / area)
    heights = np.fft.ifft2(waves, norm="forward").real
    axes = (LX * np.arange(n) / n, LY * np.arange(n) / n)
    return HeightMap(*axes, heights, is_periodic=True), q, target


def test_power_spectrum_of_random_phases():
    surface, (qx, qy), target = random_surface(lambda q: 1e-20 * (q / 1e4) ** -3.6)
    found_x, found_y, density = topography.power_spectrum(surface)
    np.testing.assert_allclose(found_x, qx)
    np.testing.assert_allclose(found_y, qy)
    np.testing.assert_allclose(density, target, rtol=1e-9, atol=1e-30)
    area = LX * LY
    assert np.var(surface.heights) == pytest.approx(density.sum() / area, rel=1e-12)  # Parseval
    rings = topography.radial_spectrum(surface)
    np.testing.assert_allclose(rings.density[3:], 1e-20 * (rings.wave_number[3:] / 1e4) ** -3.6, rtol=0.15)
    assert rings.count.sum() < density.size


def test_profile_spectra_give_the_variance_of_profiles():
    surface, _, _ = random_surface(lambda q: 1e-20 * (q / 1e4) ** -3.0)
    for axis in (0, 1):
        q, density = topography.profile_spectrum(surface, axis)
        profiles = surface.heights - surface.heights.mean(axis=axis, keepdims=True)
        assert density.sum() * (q[1] - q[0]) / np.pi == pytest.approx(np.mean(profiles**2), rel=1e-12)
    single, wave_vector = wave(waves=(5, 0))
    q, density = topography.profile_spectrum(single)
    assert q[4] == pytest.approx(wave_vector[0])
    assert density[4] == pytest.approx(LX * AMPLITUDE**2 / 4.0)
    assert np.delete(density, 4).max() < 1e-20 * density[4]


def test_window_finds_the_spectrum_of_a_surface_that_is_not_periodic():
    """A quarter of a long random surface has the same density, within the scatter of its rings."""
    density = lambda q: 1e-20 * (1.0 + (q / 3e4) ** 2) ** -1.8  # noqa: E731
    surface, _, _ = random_surface(density, 512)
    cut = HeightMap(surface.x[:256], surface.y[:256], surface.heights[:256, :256])
    rings = topography.radial_spectrum(cut)
    ratio = rings.density[5:] / density(rings.wave_number[5:])
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.05)
    assert np.mean(topography.window(cut) ** 2) == pytest.approx(1.0, rel=1e-12)
    assert (topography.window(surface) == 1.0).all()


def test_missing_heights_are_refused():
    surface, _ = wave()
    heights = surface.heights.copy()
    heights[3, 4] = np.nan
    holed = HeightMap(surface.x, surface.y, heights, True)
    for compute in (SurfaceStatistics.of, topography.power_spectrum, topography.bearing_curve):
        with pytest.raises(CaseError, match="1 of 7680 heights are missing"):
            compute(holed)
    with pytest.raises(CaseError, match="equal spacings"):
        topography.power_spectrum(HeightMap(surface.x**2, surface.y, surface.heights, True))
