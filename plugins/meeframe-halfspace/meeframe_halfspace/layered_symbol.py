"""Difference of the surface compliance of layers from that of their top material, as a series on panels of k."""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from meeframe.plugin import Array, Body, Indices, MaterialError, SurfaceSymbol
from meeframe_halfspace.directions import PlaneSymmetry
from meeframe_halfspace.entries import EntryLayout, entry_layout
from meeframe_halfspace.radial import RadialSeries, Terms, interpolate, no_series, panel_points
from meeframe_halfspace.response import PointResponse

TOLERANCE: Final = 1e-10
"""Accuracy of the difference, relative to its largest entry."""
MIN_DIFFERENCE: Final = 1e-3
"""Difference per compliance below which errors are relative to the latter, because of its round-off."""
NEGLIGIBLE: Final = 1e-12
"""Terms this small relative to the largest one are zero, as round-off of what symmetry forbids."""
GROWTH: Final = 2.0
"""Ratio of the ends of panels before they are halved."""
_FIRST_ANGLES, _MAX_ANGLES, _MEAN_ANGLES = 8, 256, 128
_SAMPLES: Final = 10
_MAX_WAVE: Final = 1e6
_NARROWEST: Final = 1e-9
Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class LayeredResponse:
    """Response of layers: that of a half space of the top material, and a difference that is smooth in space.

    Attributes
    ----------
    top
        Response of the half space of the top material, whose scaled fields are those of all results.
    difference
        Series of Y(k, m) - Y(m) of the top material in k [1/m] and the angle of m. Its real part has even harmonics
        and symmetric entries alone, the imaginary part odd ones and antisymmetric entries.
    body
        The body.
    frame
        Rows e1, e2, outward normal, (3, 3).
    """

    top: PointResponse
    difference: RadialSeries
    body: Body
    frame: Array

    @classmethod
    def of(cls, body: Body, frame: Array) -> "LayeredResponse":
        """Return the response of a body with layers. Raises MaterialError if a series does not converge."""
        layers = body.layers.layers
        top = PointResponse.of(layers[0].material.stiffness if layers else body.stiffness, frame)
        return cls(top, difference_series(body, frame), body, frame)

    @property
    def factors(self) -> Array:
        """Factors (fields,) of the scaled fields."""
        return self.top.factors

    @property
    def thickness(self) -> float:
        """Thickness of the top layer [m]."""
        return self.body.layers.top_thickness

    @cached_property
    def decay(self) -> float:
        """Slowest decay of waves in the top layer, per k z: the difference decays at least twice as fast."""
        angles = np.pi * np.arange(_FIRST_ANGLES) / _FIRST_ANGLES
        return float(surface_symbol(self.body, self.frame, angles).slowest_decays[0])

    @property
    def layout(self) -> EntryLayout:
        """Numbers of the entries."""
        return self.top.layout

    @property
    def numbers(self) -> list[int]:
        """Numbers of the nonzero entries."""
        return self._magnitudes.numbers

    @property
    def parities(self) -> Indices | None:
        """Parities of the entries, see PointResponse."""
        return self._magnitudes.parities

    def entry(self, number: int) -> tuple[Array, bool]:
        """Return magnitudes (n, 2) of the series of an entry, and True if its harmonics are odd."""
        return self._magnitudes.entry(number)

    @cached_property
    def _magnitudes(self) -> PointResponse:
        """Magnitudes of the terms of both parts, laid out as a response: nonzero where a term of one of them is."""
        terms, n_symmetric = self.difference.terms, self.layout.n_symmetric
        count = max(len(self.top.even), len(self.top.odd), int(terms.harmonics.max(initial=0)) // 2 + 1)
        even, odd = (np.zeros((count, *one.shape[1:])) for one in (self.top.even, self.top.odd))
        even[: len(self.top.even)], odd[: len(self.top.odd)] = np.abs(self.top.even), np.abs(self.top.odd)
        sizes = np.abs(self.difference.coefficients).max(axis=(0, 2), initial=0.0)
        is_odd = terms.entries >= n_symmetric
        for target, chosen, first in ((even, ~is_odd, 0), (odd, is_odd, n_symmetric)):
            index = terms.harmonics[chosen] // 2, terms.sines[chosen], terms.entries[chosen] - first
            np.add.at(target, index, sizes[chosen])
        return PointResponse(even, odd, self.factors)

    def uniform(self, length: float) -> Array:
        """Return the response (symmetric entries,) [m] to uniform periodic loads; see `uniform_response`."""
        _, compliances = uniform_response(self.body, self.frame, length)
        entries: Array = compliances[0][self.layout.upper]
        return entries


def uniform_response(body: Body, frame: Array, length: float) -> tuple[SurfaceSymbol, dict[int, Array]]:
    """Return a symbol of a body and its responses to uniform loads, see `SurfaceSymbol.uniform_compliances`.

    length: 1 / k of the wave that is taken where they have no limit [m].
    """
    directions = PlaneSymmetry.of(body, frame).directions(_MEAN_ANGLES)
    symbol = surface_symbol(body, frame, directions.angles)
    return symbol, symbol.uniform_compliances(1.0 / length, lambda y: directions.expand(y[None])[0].real.mean(axis=0))


def surface_symbol(body: Body, frame: Array, angles: Array) -> SurfaceSymbol:
    """Return the symbol of a body for waves at some angles."""
    return SurfaceSymbol.of(body.stiffness, body.layers, frame, angles, body.fields)


def difference_series(body: Body, frame: Array) -> RadialSeries:
    """Return the series of the difference of the surface compliance. Raises MaterialError without convergence."""
    depth = body.layers.thickness + (body.layers.base.thickness if body.layers.base is not None else 0.0)
    symmetry = PlaneSymmetry.of(body, frame)
    harmonics, scale = _highest_harmonic(body, frame, depth, symmetry)
    directions = symmetry.directions(harmonics + 2 + harmonics % 2)
    symbol = surface_symbol(body, frame, directions.angles)
    layout = entry_layout(body.fields.size)
    terms = _all_terms(layout, harmonics)
    edges = _edges(symbol, depth, 0.1 * TOLERANCE * scale)

    def values(low: Array, high: Array) -> Array:
        k = panel_points(low, high)
        return _coefficients(directions.expand(symbol.difference(k.ravel())), terms, layout).reshape(*k.shape, -1)

    if len(edges) == 1:
        return no_series(terms.select(np.empty(0, int)), 1.0)
    panels, coefficients, errors = interpolate(values, edges, TOLERANCE * scale, _NARROWEST / depth)
    sizes = np.abs(coefficients).max(axis=(0, 2))
    nonzero = np.flatnonzero(sizes > NEGLIGIBLE * scale)
    return RadialSeries(terms.select(nonzero), panels, np.ascontiguousarray(coefficients[:, nonzero]), errors)


def _highest_harmonic(body: Body, frame: Array, depth: float, symmetry: PlaneSymmetry) -> tuple[int, float]:
    """Return the highest multiple of the angle that is not negligible, from some wave numbers, and the scale of errors.

    The scale is the largest difference, unless that is small compared with the compliance and its round-off.
    """
    k, count = np.geomspace(1e-3, 3.0, _SAMPLES) / depth, _FIRST_ANGLES
    if body.layers.layers:
        k = np.append(k, 0.5 / body.layers.layers[0].thickness)
    while count <= _MAX_ANGLES:
        directions = symmetry.directions(count)
        symbol = surface_symbol(body, frame, directions.angles)
        waves = np.concatenate([part := directions.expand(symbol.difference(k)), part.conj()], axis=1)
        scale = max(float(np.abs(waves).max()), MIN_DIFFERENCE * float(np.abs(symbol.top).max()))
        sizes = np.abs(np.fft.fft(waves, axis=1)).max(axis=(0, 2, 3))[: count + 1] / (2 * count)
        highest = int(np.flatnonzero(sizes > TOLERANCE * scale).max(initial=0))
        if highest <= count // 2:
            return highest, scale
        count *= 2
    raise MaterialError(f"the response of the layers needs more than {_MAX_ANGLES} directions: nearly inadmissible")


def _edges(symbol: SurfaceSymbol, depth: float, negligible: float) -> Array:
    """Return ends of panels from zero to where the difference is negligible."""
    count = int(np.log(_MAX_WAVE) / np.log(GROWTH))
    edges = np.concatenate([[0.0], 0.25 / depth * GROWTH ** np.arange(count)])
    sizes = np.abs(symbol.difference(edges[1:])).max(axis=(1, 2, 3))
    return edges[: int(np.flatnonzero(sizes > negligible).max(initial=-2)) + 3]


def _all_terms(layout: EntryLayout, harmonics: int) -> Terms:
    """Return all terms up to a harmonic: even ones of symmetric entries, odd ones of the others."""
    rows = [
        (entry, n, sine)
        for n in range(harmonics + 1)
        for sine in ((0, 1) if n else (0,))
        for entry in (range(layout.n_symmetric) if n % 2 == 0 else range(layout.n_symmetric, layout.n_values))
    ]
    entries, multiples, sines = np.array(rows).T
    return Terms(entries, multiples, sines)


def _coefficients(waves: Complex, terms: Terms, layout: EntryLayout) -> Array:
    """Return the coefficients (n, t) of the terms from samples (n, directions, f, f) over half a circle."""
    circle = np.concatenate([waves, waves.conj()], axis=1)
    count = circle.shape[1]
    symmetric = np.fft.rfft(circle.real[:, :, *layout.upper], axis=1)
    antisymmetric = np.fft.rfft(circle.imag[:, :, *layout.strict], axis=1)
    both = np.concatenate([symmetric, antisymmetric], axis=2)[:, terms.harmonics, terms.entries]
    weights = np.where(terms.harmonics == 0, 1.0, 2.0) / count
    return np.asarray(np.where(terms.sines == 1, -both.imag, both.real) * weights)
