"""Functions of a radius and an angle: Fourier series whose coefficients are polynomials on panels of the radius."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.plugin import Array, Indices, MaterialError

NODES: Final = 16
"""Chebyshev points in each panel."""
MAX_PANELS: Final = 400
"""Largest number of panels, far more than smooth functions need."""
_POINTS: Final = np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)
_TO_COEFFICIENTS: Final = np.cos(np.outer(np.arange(NODES), np.arccos(_POINTS))) * (2.0 / NODES)
_TO_COEFFICIENTS[0] /= 2.0


@dataclass(frozen=True, eq=False)
class Terms:
    """The terms of a series: which entry, cosine or sine, and multiple of the angle each one is.

    Attributes
    ----------
    entries
        Number (t,) of the entry that a term belongs to; see EntryLayout.
    harmonics
        Multiple (t,) of the angle.
    sines
        (t,) 1 for a sine, 0 for a cosine.
    """

    entries: Indices
    harmonics: Indices
    sines: Indices

    def select(self, chosen: Indices) -> "Terms":
        """Return some of the terms."""
        return Terms(self.entries[chosen], self.harmonics[chosen], self.sines[chosen])


@dataclass(frozen=True, eq=False)
class RadialSeries:
    """A series in the angle with coefficients that depend on the radius.

    Attributes
    ----------
    terms
        The terms.
    edges
        Ends (p + 1,) of the panels, from zero or the smallest radius of interest; the series is zero beyond the last.
    coefficients
        Chebyshev coefficients (p, t, NODES).
    errors
        Estimates (p,) of the error on each panel: the largest of the last two coefficients.
    """

    terms: Terms
    edges: Array
    coefficients: Array
    errors: Array

    @property
    def error(self) -> float:
        """Estimate of the absolute error, which bounded the error in all tests."""
        return float(self.errors.sum())

    def coefficients_at(self, radius: Array) -> Array:
        """Return the coefficients (n, t) of the terms at radii (n,)."""
        panels = np.clip(np.searchsorted(self.edges, radius, side="right") - 1, 0, len(self.edges) - 2)
        low, high = self.edges[panels], self.edges[panels + 1]
        x = (2.0 * radius - low - high) / (high - low)
        result = np.empty((len(radius), self.coefficients.shape[1]))
        for panel in np.unique(panels):
            chosen = panels == panel
            basis = np.polynomial.chebyshev.chebvander(x[chosen], NODES - 1)
            result[chosen] = basis @ self.coefficients[panel].T
        result[radius > self.edges[-1]] = 0.0
        return result


def no_series(terms: Terms, end: float) -> RadialSeries:
    """Return a series that is zero up to a radius, without any terms."""
    return RadialSeries(terms, np.array([0.0, end]), np.zeros((1, 0, NODES)), np.zeros(1))


def panel_points(low: Array, high: Array) -> Array:
    """Return the Chebyshev points (p, NODES) of panels (p,)."""
    return 0.5 * (low + high)[:, None] + 0.5 * (high - low)[:, None] * _POINTS


def interpolate(
    function: Callable[[Array, Array], Array], edges: Array, tolerance: float, narrowest: float
) -> tuple[Array, Array, Array]:
    """Return panels, coefficients and errors of a function of the radius with values (..., t), as of RadialSeries.

    Panels are halved until the last two coefficients are negligible.

    Parameters
    ----------
    function
        Function of ends (p,), (p,) of panels that returns values at panel_points, (p, NODES, t).
    edges
        Ends of the first panels, increasing.
    tolerance
        Largest last coefficients.
    narrowest
        Width of the narrowest panel.

    Raises
    ------
    MaterialError
        If this takes too many panels.
    """
    low, high = edges[:-1], edges[1:]
    done: list[tuple[Array, Array, Array, Array]] = []
    while len(low):
        values = function(low, high)
        coefficients = np.einsum("cn,pnt->ptc", _TO_COEFFICIENTS, values)
        last = np.abs(coefficients[:, :, -2:]).max(axis=(1, 2))
        accepted = (last <= tolerance) | (high - low <= narrowest)
        done.append((low[accepted], high[accepted], coefficients[accepted], last[accepted]))
        low, high = low[~accepted], high[~accepted]
        middle = 0.5 * (low + high)
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
        if sum(len(one) for one, *_ in done) + len(low) > MAX_PANELS:
            raise MaterialError(f"the response of the layers needs more than {MAX_PANELS} panels")
    starts, ends, series, errors = (np.concatenate(arrays) for arrays in zip(*done, strict=True))
    order = np.argsort(starts)
    return np.append(starts[order], ends.max()), series[order], errors[order]
