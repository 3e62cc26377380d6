"""Difference of the surface compliance of layers from that of their top material, as a series on panels of k."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from meeframe.plugin import N_FIELDS, THERMAL_FIELD, Array, Body, Indices, MaterialError, Medium, SurfaceSymbol
from meeframe_halfspace.directions import Directions, PlaneSymmetry
from meeframe_halfspace.entries import EntryLayout, entry_layout
from meeframe_halfspace.radial import RadialSeries, Terms, interpolate, no_series, panel_points
from meeframe_halfspace.response import PointResponse
from meeframe_halfspace.thermal import ThermalResponse

TOLERANCE: Final = 1e-10
"""Accuracy of the difference, relative to its largest entry."""
MIN_DIFFERENCE: Final = 1e-3
"""Difference per compliance below which errors are relative to the latter, because of its round-off."""
NEGLIGIBLE: Final = 1e-12
"""Terms this small relative to the largest one are zero, as round-off of what symmetry forbids."""
GROWTH: Final = 2.0
"""Ratio of the ends of panels before they are halved."""
_FIRST_ANGLES, _MAX_ANGLES, _MEAN_ANGLES = 16, 256, 128
_LONG_WAVES: Final = (1e-6, 1e-7)
"""Wave numbers times the thickness of all layers, of waves that see the material below them alone."""
_SAMPLES: Final = 10
_FIRST_EDGE, _MAX_WAVE = 0.125, 1e6
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
    heat_difference
        Series of y_h(k, m) - y_h(m) of the top material, whose entries are numbered as those of ThermalResponse; None
        unless heat acts on other fields.
    """

    top: PointResponse
    difference: RadialSeries
    body: Body
    frame: Array
    heat_difference: RadialSeries | None = None

    @classmethod
    def of(cls, body: Body, frame: Array, longest: float = np.inf) -> "LayeredResponse":
        """Return the response of a body with layers to waves up to the longest one [m].

        Without ground, potentials grow with the length of waves, which then must be finite. Raises MaterialError if a
        series does not converge.
        """
        stiffness = _top_stiffness(body)
        lowest = 0.999 * 2.0 * np.pi / longest if _is_without_ground(body) else 0.0
        top, difference = PointResponse.of(stiffness, frame), difference_series(Sampling(body, frame, lowest=lowest))
        if not body.expands:
            return cls(top, difference, body, frame)
        moduli = np.zeros((3, N_FIELDS)) if body.all_moduli[0] is None else body.all_moduli[0]
        thermal = ThermalResponse.of(stiffness, moduli, body.fields.index(THERMAL_FIELD.name), frame)
        return cls(
            replace(top, thermal=thermal),
            difference,
            body,
            frame,
            difference_series(Sampling(body, frame, True, lowest)),
        )

    @property
    def factors(self) -> Array:
        """Factors (fields,) of the scaled fields."""
        return self.top.factors

    @property
    def thickness(self) -> float:
        """Thickness of the top layer [m]."""
        return self.body.layers.top_thickness

    @property
    def depth(self) -> float:
        """Thickness of all layers [m]."""
        return _depth(self.body)

    @cached_property
    def decay(self) -> float:
        """Slowest decay of waves in the top layer, per k z: the difference decays at least twice as fast."""
        angles = np.pi * np.arange(_FIRST_ANGLES) / _FIRST_ANGLES
        return Medium.of(_top_stiffness(self.body), self.frame, angles).slowest_decay

    @cached_property
    def heat_decay(self) -> float:
        """Slowest decay of waves of heat in the top layer, per k z."""
        angles = np.pi * np.arange(_FIRST_ANGLES) / _FIRST_ANGLES
        return Sampling(self.body, self.frame, is_heat=True).symbol(angles).media[0].slowest_decay

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
        return PointResponse(even, odd, self.factors, self._heat_magnitudes)

    @cached_property
    def _heat_magnitudes(self) -> ThermalResponse | None:
        """Magnitudes of the terms of the response to heat, as `_magnitudes`."""
        thermal, series = self.top.thermal, self.heat_difference
        if thermal is None or series is None:
            return None
        terms, sizes = series.terms, np.abs(series.coefficients).max(axis=(0, 2), initial=0.0)
        count = max(len(thermal.even), len(thermal.odd), int(terms.harmonics.max(initial=0)) // 2 + 1)
        both = np.zeros((2, count, 2, N_FIELDS))
        for target, known in zip(both, (thermal.even, thermal.odd), strict=True):
            target[: len(known)] = np.abs(known)
        is_odd, fields = np.divmod(terms.entries, N_FIELDS)
        np.add.at(both, (is_odd, terms.harmonics // 2, terms.sines, fields), sizes)
        return ThermalResponse(*both, thermal.source)

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


def uniform_heat(body: Body, frame: Array, length: float) -> Array:
    """Return the response (N_FIELDS,) [m^2] to a uniform heat flux on a periodic surface, scaled.

    It is finite on a rigid base that grounds all fields. Elsewhere it is that to a wave, as for uniform loads, averaged
    over all directions, and zero for fields whose level is undetermined.

    length: 1 / k of that wave [m].
    """
    sampling = Sampling(body, frame, is_heat=True)
    directions = sampling.symmetry.directions(_MEAN_ANGLES)
    symbol = sampling.symbol(directions.angles)
    uniform = symbol.uniform_heat_response()
    if uniform is not None:
        return np.asarray(uniform[:N_FIELDS])
    means = sampling.means(symbol, directions, np.array([1.0 / length])) * length**2
    means[0, undetermined_levels(body, frame)] = 0.0
    return np.asarray(means[0])


def undetermined_levels(body: Body, frame: Array) -> Indices:
    """Return the columns of the fields of an expanding body whose level depends on a reference radius.

    These are the fields whose mean response to heat, times k^2, does not vanish in the limit of long waves.
    """
    sampling = Sampling(body, frame, is_heat=True)
    directions = sampling.symmetry.directions(_MEAN_ANGLES)
    symbol = sampling.symbol(directions.angles)
    scale = np.abs(sampling.difference(symbol, directions, np.array([1.0 / _depth(body)]))).max() + sampling.top(symbol)
    longer, longest = np.abs(sampling.means(symbol, directions, np.array(_LONG_WAVES) / _depth(body)))
    return np.flatnonzero((longest > 0.5 * longer) & (longest > NEGLIGIBLE * scale))


def surface_symbol(body: Body, frame: Array, angles: Array) -> SurfaceSymbol:
    """Return the symbol of a body for waves at some angles, without the action of heat on other fields."""
    return SurfaceSymbol.of(body.stiffness, body.layers, frame, angles, body.fields)


def _top_stiffness(body: Body) -> Array:
    """Return the stiffness of the material at the surface."""
    layers = body.layers.layers
    return layers[0].material.stiffness if layers else body.stiffness


def _is_without_ground(body: Body) -> bool:
    """Return True if the base insulates a field."""
    return body.layers.base is not None and bool(body.layers.base.insulating)


def _depth(body: Body) -> float:
    """Return the thickness of all layers [m], that on a rigid base included."""
    return body.layers.thickness + (body.layers.base.thickness if body.layers.base is not None else 0.0)


@dataclass(frozen=True, eq=False)
class Sampling:
    """Samples of the surface compliance of a body, or of its response to heat, and the entries they determine.

    Attributes
    ----------
    body
        The body.
    frame
        Rows e1, e2, outward normal, (3, 3).
    is_heat
        Whether the samples are y_h, (..., N_FIELDS, 1), in place of Y, (..., fields, fields).
    lowest
        Smallest wave number for which they are needed [1/m].
    """

    body: Body
    frame: Array
    is_heat: bool = False
    lowest: float = 0.0

    @cached_property
    def symmetry(self) -> PlaneSymmetry:
        """Symmetries of the body in the plane of its surface."""
        return PlaneSymmetry.of(self.body, self.frame)

    def symbol(self, angles: Array) -> SurfaceSymbol:
        """Return the symbol for waves at some angles."""
        if not self.is_heat:
            return surface_symbol(self.body, self.frame, angles)
        body = self.body
        return SurfaceSymbol.of(body.stiffness, body.layers, self.frame, angles, body.fields, moduli=body.all_moduli)

    def difference(self, symbol: SurfaceSymbol, directions: Directions, k: Array) -> Complex:
        """Return the difference from the top material for wave numbers (n,) in all directions, (n, count, ...)."""
        return self._picked(directions.expand(symbol.difference(k)))

    def means(self, symbol: SurfaceSymbol, directions: Directions, k: Array) -> Array:
        """Return y_h for wave numbers (n,), averaged over all directions, (n, N_FIELDS)."""
        means: Array = self._picked(directions.expand(symbol.evaluate(k))).real.mean(axis=1)[..., 0]
        return means

    def top(self, symbol: SurfaceSymbol) -> float:
        """Return the largest entry for the top material."""
        return float(np.abs(self._picked(symbol.top)).max())

    def entries(self, waves: Complex) -> tuple[Array, Array]:
        """Return the even and the odd entries (n, count, entries) of samples (n, count, ...)."""
        if self.is_heat:
            return waves[..., 0].real, waves[..., 0].imag
        layout = self.layout
        return waves.real[..., *layout.upper], waves.imag[..., *layout.strict]

    @property
    def layout(self) -> EntryLayout:
        """Numbers of the entries of the surface compliance."""
        return entry_layout(self.body.fields.size)

    @property
    def counts(self) -> tuple[int, int]:
        """Numbers of even and odd entries."""
        if self.is_heat:
            return N_FIELDS, N_FIELDS
        return self.layout.n_symmetric, self.layout.n_values - self.layout.n_symmetric

    def _picked(self, compliance: Complex) -> Complex:
        if not self.is_heat:
            return compliance
        source = self.body.fields.index(THERMAL_FIELD.name)
        return compliance[..., :N_FIELDS, source : source + 1]


def difference_series(sampling: Sampling) -> RadialSeries:
    """Return the series of the difference of what is sampled. Raises MaterialError without convergence."""
    depth = _depth(sampling.body)
    harmonics, scale = _highest_harmonic(sampling, depth)
    directions = sampling.symmetry.directions(harmonics + 2 + harmonics % 2)
    symbol = sampling.symbol(directions.angles)
    terms = _all_terms(sampling.counts, harmonics)
    edges = _edges(sampling, symbol, directions, depth, 0.1 * TOLERANCE * scale)

    def values(low: Array, high: Array) -> Array:
        k = panel_points(low, high)
        samples = sampling.difference(symbol, directions, k.ravel())
        return _coefficients(sampling, samples, terms).reshape(*k.shape, -1)

    if len(edges) == 1:
        return no_series(terms.select(np.empty(0, int)), 1.0)
    panels, coefficients, errors = interpolate(values, edges, TOLERANCE * scale, _NARROWEST / depth)
    sizes = np.abs(coefficients).max(axis=(0, 2))
    nonzero = np.flatnonzero(sizes > NEGLIGIBLE * scale)
    return RadialSeries(terms.select(nonzero), panels, np.ascontiguousarray(coefficients[:, nonzero]), errors)


def _highest_harmonic(sampling: Sampling, depth: float) -> tuple[int, float]:
    """Return the highest multiple of the angle that is not negligible, from some wave numbers, and the scale of errors.

    The scale is the largest difference, unless that is small compared with the compliance and its round-off.
    """
    k, count, layers = np.geomspace(1e-3, 3.0, _SAMPLES) / depth, _FIRST_ANGLES, sampling.body.layers.layers
    if layers:
        k = np.append(k, 0.5 / layers[0].thickness)
    k = np.maximum(k, sampling.lowest)

    def sampled(is_between: bool) -> tuple[Complex, float]:
        directions = sampling.symmetry.directions(count, is_between)
        symbol = sampling.symbol(directions.angles)
        return sampling.difference(symbol, directions, k), sampling.top(symbol)

    waves, top = sampled(False)
    while True:
        circle = np.concatenate([waves, waves.conj()], axis=1)
        scale = max(float(np.abs(waves).max()), MIN_DIFFERENCE * top)
        sizes = np.abs(np.fft.fft(circle, axis=1)).max(axis=(0, 2, 3))[: count + 1] / (2 * count)
        highest = int(np.flatnonzero(sizes > TOLERANCE * scale).max(initial=0))
        if highest <= 3 * count // 4:
            return highest, scale
        if count == _MAX_ANGLES:
            break
        between, other_top = sampled(True)
        waves, top = np.stack([waves, between], axis=2).reshape(len(k), -1, *waves.shape[2:]), max(top, other_top)
        count *= 2
    raise MaterialError(
        f"the response of the layers needs more than {_MAX_ANGLES} directions: a material is nearly inadmissible"
    )


def _edges(sampling: Sampling, symbol: SurfaceSymbol, directions: Directions, depth: float, negligible: float) -> Array:
    """Return ends of panels from the lowest wave number to where the difference is negligible."""
    first = _FIRST_EDGE / depth if sampling.lowest == 0.0 else GROWTH * sampling.lowest
    count = max(1, int(np.log(_MAX_WAVE / (first * depth)) / np.log(GROWTH)))
    edges = np.concatenate([[sampling.lowest], first * GROWTH ** np.arange(count)])
    sizes = np.abs(sampling.difference(symbol, directions, edges[1:])).max(axis=(1, 2, 3))
    return edges[: int(np.flatnonzero(sizes > negligible).max(initial=-2)) + 3]


def _all_terms(counts: tuple[int, int], harmonics: int) -> Terms:
    """Return all terms up to a harmonic: even ones of the first entries, odd ones of the others, so many of each."""
    even, odd = counts
    rows = [
        (entry, n, sine)
        for n in range(harmonics + 1)
        for sine in ((0, 1) if n else (0,))
        for entry in (range(even) if n % 2 == 0 else range(even, even + odd))
    ]
    entries, multiples, sines = np.array(rows).T
    return Terms(entries, multiples, sines)


def _coefficients(sampling: Sampling, waves: Complex, terms: Terms) -> Array:
    """Return the coefficients (n, t) of the terms from samples (n, directions, ...) over half a circle."""
    circle = np.concatenate([waves, waves.conj()], axis=1)
    count = circle.shape[1]
    both = np.concatenate([np.fft.rfft(entry, axis=1) for entry in sampling.entries(circle)], axis=2)
    chosen = both[:, terms.harmonics, terms.entries]
    weights = np.where(terms.harmonics == 0, 1.0, 2.0) / count
    return np.asarray(np.where(terms.sines == 1, -chosen.imag, chosen.real) * weights)
