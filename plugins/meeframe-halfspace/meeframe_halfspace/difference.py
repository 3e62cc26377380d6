"""Difference of the point response of layers from that of their top material, in space.

The inverse transform of a term c(k) e^{i n phi} / k is that of a term of the homogeneous response with the integral of
c(k) J_n(k r) in place of c / r (meeframe_halfspace.response). The difference is smooth, because c decays exponentially,
and falls like 1/r far away.

Far from the source the integral ends long before c does, with a smooth cut-off: what it leaves out is as small as the
Fourier transform of the cut-off at r (Ooura and Mori, J. Comput. Appl. Math. 112 (1999) 229, on such truncations).

The response to heat has 1 / k^2 in place of 1 / k, so that the mean over all directions, n = 0, needs a level: with
c_0(0) exp(-b k) taken out of c_0(k), the rest is integrable, and what was taken out is -c_0(0) ln((b + s) / 2 b) with
s^2 = b^2 + r^2. At a reference radius R the mean of the response vanishes if that of both terms does.
"""

from collections.abc import Callable
from functools import cache
from typing import Final

import numpy as np
import scipy  # submodules are loaded on first use

from meeframe.plugin import Array
from meeframe_halfspace.layered_symbol import GROWTH, TOLERANCE
from meeframe_halfspace.radial import RadialSeries, Terms, interpolate, no_series, panel_points
from meeframe_halfspace.response import harmonic_factor

_GAUSS: Final = np.polynomial.legendre.leggauss(20)
_MAX_PHASE: Final = 8.0
"""Largest phase k r of one Gauss rule."""
_CUT_OFF, _CUT_OFF_WIDTH = 120.0, 21.0
"""Phase at which the cut-off is one half, and its width: it leaves out exp(-width^2 / 4)."""
_CUT_OFF_END: Final = _CUT_OFF + 5.5 * _CUT_OFF_WIDTH
_NARROWEST: Final = 1e-6


def point_difference(series: RadialSeries, thickness: float, distance: float) -> RadialSeries:
    """Return the difference D of the point response, in scaled fields, laid out as the terms of `PointResponse`.

    Parameters
    ----------
    series
        Difference of the surface compliance on panels of the wave number [1/m].
    thickness
        Thickness of the top layer [m].
    distance
        Largest distance from the source [m].

    Raises
    ------
    MaterialError
        If it needs too many panels.
    """
    if not len(series.terms.entries):
        return no_series(series.terms, distance)
    scale = harmonic_factor(series.terms.harmonics) / (2.0 * np.pi)

    def values(r: Array, low: float, high: float) -> Array:
        k, weights = _rule(series.edges, low, high)
        return _integrals(series.terms, series.coefficients_at(k) * weights[:, None], np.outer(r, k)) * scale

    in_k = float(series.errors @ np.diff(series.edges)) / (2.0 * np.pi)
    return _in_space(series.terms, values, thickness, distance, in_k)


def heat_difference(
    series: RadialSeries, thickness: float, depth: float, distance: float, reference_radii: Array
) -> RadialSeries:
    """Return the difference of the response to heat through a point, laid out as ThermalResponse.point_entry.

    Parameters
    ----------
    series, thickness, distance
        As for `point_difference`, the series that of y_h(k, m).
    depth
        Thickness of all layers [m].
    reference_radii
        Radii (fields,) [m] at which the mean over all directions vanishes, for a difference from a response with the
        same radii. NaN for fields without an undetermined level, as those on a rigid base: their response vanishes far
        away, and is the difference from that of the top material with `level_radius` of the depth.

    Raises
    ------
    MaterialError
        If it needs too many panels.
    """
    terms = series.terms
    if not len(terms.entries):
        return no_series(terms, distance)
    is_mean, decay = terms.harmonics == 0, 2.0 * depth
    is_odd = terms.harmonics % 2
    scale = (-1.0) ** ((terms.harmonics + is_odd) // 2) / (2.0 * np.pi)
    limit = np.where(is_mean, series.coefficients_at(np.zeros(1))[0], 0.0)

    def integrals(r: Array, low: float, high: float) -> Array:
        k, weights = _rule(series.edges, low, high)
        rest = series.coefficients_at(k) - limit * np.exp(-decay * k)[:, None]
        level = -np.log((decay + np.hypot(decay, r)) / (2.0 * decay))
        return _integrals(terms, rest * (weights / k)[:, None], np.outer(r, k)) + limit * level[:, None]

    level = np.zeros(len(limit))
    radii = reference_radii[terms.entries % len(reference_radii)]
    for radius in np.unique(radii[np.isfinite(radii)]).tolist():
        chosen = is_mean & (radii == radius)
        level[chosen] = integrals(np.array([radius]), radius, radius)[0, chosen]

    def values(r: Array, low: float, high: float) -> Array:
        return (integrals(r, low, high) - level) * scale

    return _in_space(terms, values, thickness, distance, float(series.errors.sum()) / (2.0 * np.pi))


def level_radius(depth: float) -> float:
    """Return the radius [m] of the top material that `heat_difference` completes where no level is undetermined.

    The integral of (J_0(k r) - exp(-b k)) / k vanishes at r = 2 b; b is twice the thickness of all layers.
    """
    return 4.0 * depth


def _in_space(
    terms: Terms,
    values: Callable[[Array, float, float], Array],
    thickness: float,
    distance: float,
    error: float,
) -> RadialSeries:
    """Return the series of a function of radii, with the ends of their panel, whose values have an error already."""
    edges = [0.0, min(thickness, distance)]
    while edges[-1] < distance:
        edges.append(min(edges[-1] * GROWTH, distance))

    @cache
    def on_panel(low: float, high: float) -> Array:
        return values(panel_points(np.array([low]), np.array([high]))[0], low, high)

    def on_panels(low: Array, high: Array) -> Array:
        return np.array([on_panel(*ends) for ends in zip(low.tolist(), high.tolist(), strict=True)])

    # the largest difference is that at the source, or far away if it grows like a logarithm
    largest = (np.abs(on_panels(*(np.array([end]) for end in ends))).max() for ends in (edges[:2], edges[-2:]))
    tolerance = TOLERANCE * float(max(largest))
    panels, coefficients, errors = interpolate(on_panels, np.array(edges), tolerance, _NARROWEST * thickness)
    return RadialSeries(terms, panels, coefficients, errors + error / len(errors))


def _integrals(terms: Terms, values: Array, phases: Array) -> Array:
    """Return the integrals (r, t) of all terms, with values (k, t) that include weights, for phases k r (r, k)."""
    result = np.empty((len(phases), values.shape[1]))
    for n, bessel in enumerate(_bessel_functions(int(terms.harmonics.max()), phases)):
        chosen = terms.harmonics == n
        if chosen.any():
            result[:, chosen] = bessel @ values[:, chosen]
    return result


def _rule(edges: Array, low: float, high: float) -> tuple[Array, Array]:
    """Return nodes and weights in k for a panel of r, with the cut-off if it is below the last edge."""
    end = min(edges[-1], _CUT_OFF_END / low) if low > 0.0 else edges[-1]
    inside = np.append(edges[edges < end], end)
    counts = np.ceil(np.diff(inside) * high / _MAX_PHASE).astype(int)
    ends = np.concatenate(
        [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(inside, inside[1:], counts, strict=False)] + [[end]]
    )
    x, w = _GAUSS
    half = 0.5 * np.diff(ends)
    k = (ends[:-1, None] + half[:, None] * (1.0 + x)).ravel()
    weights = (half[:, None] * w).ravel()
    if end < edges[-1]:
        weights *= 0.5 * scipy.special.erfc((k * low - _CUT_OFF) / _CUT_OFF_WIDTH)
    return k, weights


def _bessel_functions(highest: int, x: Array) -> list[Array]:
    """Return J_0 to J_highest at x, by the recurrence upwards where it is stable, downwards for small x."""
    result = [scipy.special.j0(x), scipy.special.j1(x)]
    small = np.nonzero(x <= highest)
    below = _by_backward_recurrence(highest, x[small])
    with np.errstate(divide="ignore", invalid="ignore"):
        reciprocal = 2.0 / x
        for n in range(1, highest):
            result.append(n * reciprocal * result[n] - result[n - 1])
            result[-1][small] = below[n + 1]
    return result[: highest + 1]


def _by_backward_recurrence(highest: int, x: Array) -> Array:
    """Return J_0 to J_highest, (highest + 1, n), at x <= highest by Miller's algorithm."""
    first = highest + 20 + 2 * int(np.sqrt(40.0 * max(highest, 1)))
    x = np.maximum(x, 1e-30)  # J_n of zero but for n = 0
    result = np.empty((highest + 1, len(x)))
    upper, current, total = np.zeros_like(x), np.full_like(x, 1e-280), np.zeros_like(x)
    for n in range(first, -1, -1):
        if n <= highest:
            result[n] = current
        if n % 2 == 0:
            total += current if n == 0 else 2.0 * current
        if n > 0:
            upper, current = current, 2.0 * n / x * current - upper
            large = np.abs(current) > 1e200
            if large.any():
                scale = np.where(large, 1e-200, 1.0)
                upper, current, total = upper * scale, current * scale, total * scale
                result[min(n, highest + 1) :] *= scale
    return result / total
