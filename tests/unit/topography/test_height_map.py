"""Height maps check their arrays, and functions on them their arguments; masked heights are missing."""

import numpy as np
import pytest

import meeframe
from meeframe import topography
from meeframe.common.errors import CaseError
from meeframe.indenters.topography import HeightMap, SurfaceStatistics

X, Y = np.arange(6.0), np.arange(5.0)
HEIGHTS = np.random.default_rng(4).standard_normal((6, 5))


def test_masked_heights_are_missing():
    mask = np.zeros((6, 5), bool)
    mask[2, 3] = mask[4, 0] = True
    values = HEIGHTS.copy()
    values[mask] = 1e6
    surface = HeightMap(X, Y, np.ma.masked_array(values, mask))
    np.testing.assert_array_equal(np.isnan(surface.heights), mask)
    assert surface.rms_height == pytest.approx(np.std(HEIGHTS[~mask]))
    assert topography.fill_missing(surface).heights.max() < 10.0
    with pytest.raises(CaseError, match="2 of 30 heights are missing"):
        SurfaceStatistics.of(surface)
    with pytest.raises(CaseError, match="2 of 30 heights are missing"):
        meeframe.rough(surface, "steel", ["1 MPa"])
    whole = np.ma.masked_array(np.arange(30).reshape(6, 5), mask)
    np.testing.assert_array_equal(np.isnan(HeightMap(X, Y, whole).heights), mask)


def test_lists_are_allowed_and_arrays_are_shared():
    assert HeightMap([0, 1], [0, 1, 2], [[1, 2, 3], [4, 5, 6]]).spacing == (1.0, 1.0)
    assert HeightMap(X, Y, HEIGHTS).heights is HEIGHTS


@pytest.mark.parametrize(
    ("x", "y", "heights", "message"),
    [
        (X, Y, HEIGHTS.T, r"shapes \(6,\), \(5,\) and \(5, 6\); allowed: \(nx,\)"),
        (X, Y, HEIGHTS[0], "shapes"),
        (X[:, None], Y, HEIGHTS, "shapes"),
        (X[::-1], Y, HEIGHTS, "coordinates along x; allowed: finite numbers that increase"),
        (X, np.array([0.0, 1.0, 1.0, 2.0, 3.0]), HEIGHTS, "coordinates along y"),
        (np.array([0.0, 1.0, 2.0, 3.0, 4.0, np.inf]), Y, HEIGHTS, "coordinates along x"),
        (X, np.array([np.nan, 1.0, 2.0, 3.0, 4.0]), HEIGHTS, "coordinates along y"),
        (X, Y, HEIGHTS.astype(complex), "heights: an array of complex128; allowed: real numbers"),
        (X, Y, HEIGHTS.astype(str), "heights: .*allowed: real numbers"),
        (X, Y, [[1.0], [1.0, 2.0]], "heights: "),
    ],
)
def test_invalid_arrays_are_refused(x, y, heights, message):
    with pytest.raises(CaseError, match=f"height map: .*{message}"):
        HeightMap(x, y, heights)


SURFACE = HeightMap(X, Y, HEIGHTS)


@pytest.mark.parametrize(
    ("compute", "message"),
    [
        (lambda: topography.resample(SURFACE, 64), r"shape = 64; allowed: two integers from 2, such as \(64, 64\)"),
        (lambda: topography.resample(SURFACE, (8.5, 8)), r"shape = \(8\.5, 8\)"),
        (lambda: topography.resample(SURFACE, (8, 8, 8)), r"shape = \(8, 8, 8\)"),
        (lambda: topography.remove_outliers(SURFACE, "a"), "limit = 'a'; allowed: numbers > 0"),
        (lambda: topography.profile_spectrum(SURFACE, -1), "axis = -1; allowed: 0, 1"),
        (lambda: topography.spectral_moment(SURFACE, -2), "power = -2; allowed: finite numbers >= 0"),
        (lambda: topography.spectral_moment(SURFACE, "2"), "power = '2'"),
    ],
)
def test_invalid_arguments_are_named(compute, message):
    with pytest.raises(CaseError, match=message):
        compute()
