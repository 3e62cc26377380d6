"""Difference of the point response of layers from that of their top material, in space.

The inverse transform of a term c(k) e^{i n phi} / k is that of a term of the homogeneous response with the integral of
c(k) J_n(k r) in place of c / r (meeframe_halfspace.response). The difference is smooth, because c decays exponentially,
and falls like 1/r far away.

Far from the source the integral ends long before c does, with a smooth cut-off: what it leaves out is as small as the
Fourier transform of the cut-off at r (Ooura and Mori, J. Comput. Appl. Math. 112 (1999) 229, on such truncations).
"""

from typing import Final

import numpy as np
import scipy  # submodules are loaded on first use

from meeframe.plugin import Array
from meeframe_halfspace.layered_symbol import GROWTH, TOLERANCE
from meeframe_halfspace.radial import RadialSeries, interpolate, no_series, panel_points
from meeframe_halfspace.response import harmonic_factor

_GAUSS: Final = 20
_MAX_PHASE: Final = 8.0
"""Largest phase k r of a Gauss rule with that many points."""
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
    edges = [0.0, min(thickness, distance)]
    while edges[-1] < distance:
        edges.append(min(edges[-1] * GROWTH, distance))
    scale = harmonic_factor(series.terms.harmonics) / (2.0 * np.pi)

    def values(low: Array, high: Array) -> Array:
        integrals = [_integrals(series, *ends) for ends in zip(low, high, strict=True)]
        return np.array(integrals) * scale

    # the largest difference is that at the source
    tolerance = TOLERANCE * float(np.abs(values(np.zeros(1), np.array(edges[1:2]))).max())
    panels, coefficients, errors = interpolate(values, np.array(edges), tolerance, _NARROWEST * thickness)
    in_k = float(series.errors @ np.diff(series.edges)) / (2.0 * np.pi)
    return RadialSeries(series.terms, panels, coefficients, errors + in_k / len(errors))


def _integrals(series: RadialSeries, low: float, high: float) -> Array:
    """Return the integrals (NODES, t) of all terms at the points of a panel of r."""
    r = panel_points(np.array([low]), np.array([high]))[0]
    k, weights = _rule(series.edges, low, high)
    terms = series.coefficients_at(k) * weights[:, None]
    phases = np.outer(r, k)
    result = np.empty((len(r), terms.shape[1]))
    for n, bessel in enumerate(_bessel_functions(int(series.terms.harmonics.max()), phases)):
        chosen = series.terms.harmonics == n
        if chosen.any():
            result[:, chosen] = bessel @ terms[:, chosen]
    return result


def _rule(edges: Array, low: float, high: float) -> tuple[Array, Array]:
    """Return nodes and weights in k for a panel of r, with the cut-off if it is below the last edge."""
    end = min(edges[-1], _CUT_OFF_END / low) if low > 0.0 else edges[-1]
    inside = np.append(edges[edges < end], end)
    counts = np.ceil(np.diff(inside) * high / _MAX_PHASE).astype(int)
    ends = np.concatenate(
        [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(inside, inside[1:], counts, strict=False)] + [[end]]
    )
    x, w = np.polynomial.legendre.leggauss(_GAUSS)
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
