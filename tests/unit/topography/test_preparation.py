"""Trends, missing heights, outliers and resampling of height maps."""

import numpy as np
import pytest

from meeframe import topography
from meeframe.common.errors import CaseError
from meeframe.indenters.topography import HeightMap

X, Y = np.linspace(0.0, 2e-3, 33), np.linspace(-1e-3, 1e-3, 25)


def surface(function, is_periodic=False):
    return HeightMap(X, Y, function(X[:, None], Y[None, :]) + np.zeros((33, 25)), is_periodic)


@pytest.mark.parametrize(
    ("trend", "function"),
    [
        ("mean", lambda x, y: 3e-6),
        ("plane", lambda x, y: 1e-6 + 2e-3 * x - 1e-3 * y),
        ("quadratic", lambda x, y: 1e-6 + 2e-3 * x + 5.0 * x**2 - 3.0 * x * y + 2.0 * y**2),
    ],
)
def test_trends_are_removed_exactly(trend, function):
    waves = surface(lambda x, y: 1e-6 * np.sin(9e3 * x) * np.cos(7e3 * y))
    tilted = HeightMap(X, Y, waves.heights + function(X[:, None], Y[None, :]))
    np.testing.assert_allclose(
        topography.detrend(tilted, trend).heights, topography.detrend(waves, trend).heights, atol=1e-18
    )
    np.testing.assert_allclose(topography.detrend(surface(function), trend).heights, 0.0, atol=1e-18)


def test_missing_heights_do_not_affect_the_trend():
    tilted = surface(lambda x, y: 2e-3 * x - 1e-3 * y)
    tilted.heights[4:9, 3] = np.nan
    levelled = topography.detrend(tilted).heights
    assert np.isnan(levelled).sum() == 5
    np.testing.assert_allclose(np.nan_to_num(levelled), 0.0, atol=1e-18)


def test_harmonic_filling_recovers_harmonic_surfaces():
    """The five-point Laplacian is exact for x^2 - y^2, whatever the spacings."""
    exact = surface(lambda x, y: x**2 - y**2 + 1e-3 * x)
    holed = HeightMap(X, Y, exact.heights.copy())
    holed.heights[5:12, 6:10] = holed.heights[20, 17] = np.nan
    np.testing.assert_allclose(topography.fill_missing(holed, "harmonic").heights, exact.heights, atol=1e-17)
    # without a neighbour beyond the border a constant remains a constant
    flat = surface(lambda x, y: 2e-6)
    flat.heights[:3, :4] = np.nan
    np.testing.assert_allclose(topography.fill_missing(flat, "harmonic").heights, 2e-6, rtol=1e-12)


def test_harmonic_filling_of_a_period():
    """Holes across the border of the period have neighbours on the other side."""
    n = 16
    axis = np.arange(n) / n
    wave = np.cos(2 * np.pi * axis)[:, None] + np.zeros((n, n))
    shifted = np.roll(wave, 8, axis=0)
    holed, inner = wave.copy(), shifted.copy()
    holed[[0, 1, -1]] = np.nan
    inner[[8, 9, 7]] = np.nan
    filled, reference = (
        topography.fill_missing(HeightMap(axis, axis, heights, True), "harmonic").heights for heights in (holed, inner)
    )
    np.testing.assert_allclose(np.roll(filled, 8, axis=0), reference, atol=1e-14)


def test_nearest_filling():
    holed = surface(lambda x, y: x + 0.0 * y)
    holed.heights[10, 10] = np.nan
    filled = topography.fill_missing(holed).heights
    # the spacing along x is smaller
    assert filled[10, 10] in (X[9], X[11])
    assert topography.fill_missing(topography.fill_missing(holed)) is not None
    holed.heights[:] = np.nan
    with pytest.raises(CaseError, match="no height"):
        topography.fill_missing(holed)


def test_outliers_are_removed_and_nothing_else():
    smooth = surface(lambda x, y: 1e-6 * np.sin(3e3 * x) * np.cos(2e3 * y))
    noisy = smooth.heights + 1e-9 * np.random.default_rng(1).standard_normal(smooth.heights.shape)
    noisy[7, 8] += 1e-6
    noisy[20, 3] -= 1e-6
    found = np.argwhere(~np.isfinite(topography.remove_outliers(HeightMap(X, Y, noisy), 20.0).heights))
    np.testing.assert_array_equal(found, [[7, 8], [20, 3]])
    with pytest.raises(CaseError, match="limit = 0"):
        topography.remove_outliers(smooth, 0)


@pytest.mark.parametrize("cluster", ["plus", "bar", "random"])
def test_clusters_of_five_outliers_are_removed_and_nothing_else(cluster):
    smooth = surface(lambda x, y: 1e-6 * np.sin(3e3 * x) * np.cos(2e3 * y))
    random = np.random.default_rng(2)
    noisy = smooth.heights + 1e-9 * random.standard_normal(smooth.heights.shape)
    points = {
        "plus": [(15, 12), (14, 12), (16, 12), (15, 11), (15, 13)],
        "bar": [(15, j) for j in range(10, 15)],
        "random": [(13 + n // 5, 10 + n % 5) for n in random.choice(25, 5, replace=False)],
    }[cluster]
    for i, j in points:
        noisy[i, j] += 1e-6
    found = np.argwhere(~np.isfinite(topography.remove_outliers(HeightMap(X, Y, noisy), 20.0).heights))
    np.testing.assert_array_equal(found, sorted(points))


@pytest.mark.parametrize("shape", [(48, 40), (20, 25), (33, 17), (16, 12), (15, 13)])
def test_resampling_of_periodic_maps_is_exact_for_resolved_waves(shape):
    def wave(nx, ny):
        x, y = np.arange(nx) / nx, np.arange(ny) / ny
        phase = 2 * np.pi * (3 * x[:, None] - 2 * y) + 0.4
        return HeightMap(x, y, np.cos(phase) + 0.2 * np.sin(2 * np.pi * 5 * x)[:, None], True)

    resampled = topography.resample(wave(24, 18), shape)
    np.testing.assert_allclose(resampled.heights, wave(*shape).heights, atol=1e-13)
    np.testing.assert_allclose(resampled.x, wave(*shape).x)


def test_shortest_wave_of_an_even_grid_survives_refinement():
    coarse = HeightMap(np.arange(4.0), np.arange(4.0), np.array([1.0, -1.0, 1.0, -1.0])[:, None] * np.ones(4), True)
    fine = topography.resample(coarse, (8, 4)).heights[:, 0]
    np.testing.assert_allclose(fine, [1, 0, -1, 0, 1, 0, -1, 0], atol=1e-14)
    np.testing.assert_allclose(topography.resample(coarse, (4, 4)).heights, coarse.heights, atol=1e-14)


@pytest.mark.parametrize("axis", [0, 1])
def test_coarser_maps_between_borders_do_not_alias(axis):
    """Waves as long as the new spacing vanish inside, long ones and planes stay."""
    fine, coarse = np.linspace(0.0, 1.0, 401), np.linspace(0.0, 1.0, 26)
    across = np.linspace(0.0, 1.0, 30)

    def profile(phase, x):
        return np.cos(2 * np.pi * (len(coarse) - 1) * x + phase)

    def of(values):
        grid = HeightMap(fine, across, np.outer(values, np.ones(30)))
        turn = HeightMap(across, fine, grid.heights.T)
        shape = (len(coarse), 30) if axis == 0 else (30, len(coarse))
        resampled = topography.resample(grid if axis == 0 else turn, shape).heights
        return resampled[:, 0] if axis == 0 else resampled[0]

    for phase in (0.0, 0.7, np.pi / 2):
        assert np.abs(of(profile(phase, fine))[1:-1]).max() < 1e-3
    np.testing.assert_allclose(of(3.0 * fine - 1.0), 3.0 * coarse - 1.0, atol=1e-12)
    # the mean of a wave over a cell is the value at its middle times sin(z) / z
    inside, factor = slice(1, -1), np.sinc(2.0 / 25.0)
    waves = of(np.sin(4 * np.pi * fine))
    np.testing.assert_allclose(waves[inside], factor * np.sin(4 * np.pi * coarse)[inside], atol=1e-3)


@pytest.mark.parametrize("shape", [(65, 65), (33, 257)])
def test_averages_of_a_curved_map_are_as_accurate_at_its_border(shape):
    """A parabola rises over a cell by a twelfth of the square of half its width times the curvature, on average."""
    axis = np.linspace(-1.0, 1.0, 257)
    fine = HeightMap(axis, axis, -(axis[:, None] ** 2) - axis**2)
    coarse = topography.resample(fine, shape)
    error = coarse.heights + coarse.x[:, None] ** 2 + coarse.y**2
    bound = sum((spacing**2 / 12.0 if spacing > 2.0 / 256 else 0.0) + 2.0 / 256**2 for spacing in coarse.spacing)
    assert np.abs(error).max() <= bound


def test_resampling_between_borders_is_exact_for_cubics():
    exact = surface(lambda x, y: (x / 1e-3) ** 3 - (x / 1e-3) * (y / 1e-3) ** 2)
    resampled = topography.resample(exact, (50, 41))
    expected = (resampled.x[:, None] / 1e-3) ** 3 - resampled.x[:, None] / 1e-3 * (resampled.y / 1e-3) ** 2
    np.testing.assert_allclose(resampled.heights, expected, atol=1e-12)
    with pytest.raises(CaseError, match="shape"):
        topography.resample(exact, (1, 5))


def test_unknown_names():
    flat = surface(lambda x, y: 0.0)
    with pytest.raises(CaseError, match="cubic"):
        topography.detrend(flat, "cubic")
    with pytest.raises(CaseError, match="linear"):
        topography.fill_missing(flat, "linear")
