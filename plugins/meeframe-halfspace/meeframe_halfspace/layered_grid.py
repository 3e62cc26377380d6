"""Responses of free and periodic grids on layers: those of the top material, and the difference from them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, Final, final

import numpy as np
import scipy  # submodules are loaded on first use

from meeframe.plugin import Array, Indices
from meeframe_halfspace.cells import TABLES, Shape, density_pieces, node_weights, share_out, unfold
from meeframe_halfspace.difference import point_difference
from meeframe_halfspace.grid_response import (
    DOUBLE,
    EntrySeries,
    FreeGrid,
    GridResponse,
    PeriodicGrid,
    Window,
    free_symbol,
    mean_length,
    periodic_diagonal,
)
from meeframe_halfspace.layered_kernels import MAX_RULE, fill_cells, fill_samples, fill_waves
from meeframe_halfspace.layered_symbol import LayeredResponse
from meeframe_halfspace.radial import RadialSeries
from meeframe_halfspace.response import mirror_parity

_MIN_DISTANCE: Final = 16.0
"""Distance in spacings from the singularities of the difference beyond which samples at nodes suffice, to 5e-11."""
_HALF_WIDTH: Final = 4
_SMOOTH_DISTANCE: Final = 96.0
"""Distance in spacings from the source beyond which samples at every _HOP-th node are interpolated, to 2e-11."""
_HOP, _NEIGHBOURS = 4, 10
_ACCURACY: Final = 1e-11
"""Accuracy of integrals over the density, relative to the difference."""
_RULES: Final = np.zeros((MAX_RULE, 2, MAX_RULE))
for _count in range(1, MAX_RULE + 1):
    _RULES[_count - 1, :, :_count] = np.polynomial.legendre.leggauss(_count)
Series = tuple[Array, ...]


@final
@dataclass(frozen=True, eq=False)
class LayeredFreeGrid(GridResponse):
    """The response of a free grid on layers.

    Attributes
    ----------
    layers
        The response of the layers.
    homogeneous
        Response of the grid on a half space of the top material.
    difference
        Difference of the point response, which holds up to the diagonal of the grid.
    """

    layers: LayeredResponse
    homogeneous: FreeGrid
    difference: RadialSeries

    @classmethod
    def of(
        cls, layers: LayeredResponse, spacing: tuple[float, float], size: tuple[int, int], shape: Shape
    ) -> "LayeredFreeGrid":
        """Return the response of a grid. Raises MaterialError as `point_difference`."""
        homogeneous = FreeGrid(layers.top, spacing, size, shape)
        # with room for the samples beyond the border, also of coarser grids
        distance = float(np.hypot(*((1.5 * n + 8.0) * h for n, h in zip(size, spacing, strict=True))))
        difference = point_difference(layers.difference, layers.thickness, distance)
        return cls(layers.top, spacing, size, layers, homogeneous, difference)

    @property
    def series(self) -> EntrySeries:
        """The entries of the symbol."""
        return self.layers

    @property
    def padded(self) -> tuple[int, int]:
        """Size of the periodic grid to which the symbol belongs."""
        return self.homogeneous.padded

    def symbol(self, numbers: Sequence[int], precision: np.dtype[Any] = DOUBLE) -> Iterator[tuple[int, Array]]:
        """Yield entries by integration over the density around the node."""
        wanted = [number for number in numbers if number in self.layers.numbers]
        of_each_half = max(1, TABLES // (16 * self.size[0] * self.size[1]))
        for is_half in (True, False):
            alike = [number for number in wanted if bool(self._mirror(number)) is is_half]
            for batch in (alike[first : first + of_each_half] for first in range(0, len(alike), of_each_half)):
                for number, table in zip(batch, self._tables(batch, is_half), strict=True):
                    table = table.astype(precision, copy=False)
                    yield number, free_symbol(table, self.layers, number, self.padded)

    def _mirror(self, number: int) -> int:
        return mirror_parity(self.layers.entry(number)[0])

    def _tables(self, numbers: list[int], is_half: bool) -> Array:
        """Return tables (n, nx, ny) of mirrored entries, (n, nx, 2 ny - 1) of others, as FreeGrid.tables."""
        tables = self._difference_tables(numbers, is_half)
        for number, table in self.homogeneous.tables(numbers):
            complete = table
            if not is_half and table.shape[1] == self.size[1]:
                complete = unfold(table, mirror_parity(self.response.entry(number)[0]))
            tables[numbers.index(number)] += complete
        return tables

    def _difference_tables(self, numbers: list[int], is_half: bool) -> Array:
        """Return the integrals of the difference over the density, as `_tables`, from samples at the nodes.

        Far from the source, samples at every fourth node are interpolated.
        """
        series, ny = compiled(self.difference, numbers), self.size[1]
        i, j = np.arange(self.size[0]), np.arange(0 if is_half else 1 - ny, ny)
        smooth = int(_SMOOTH_DISTANCE)
        if len(i) <= 2 * smooth and len(j) <= 2 * smooth:
            tables = self._integrals(i, j, series, len(numbers))
        else:
            tables = self._interpolated_integrals(i, j, series, len(numbers))
            distance = smooth * max(self.spacing)
            inside = (np.flatnonzero(np.abs(n) * h <= distance) for n, h in zip((i, j), self.spacing, strict=True))
            inner = tuple(slice(one[0], one[-1] + 1) for one in inside)
            tables[:, *inner] = self._integrals(i[inner[0]], j[inner[1]], series, len(numbers))
        near = self._near[numbers]
        middle, width = near.shape[2] // 2, near.shape[1]
        if is_half:
            tables[:, :width, : middle + 1] = near[:, :, middle:]
        else:
            tables[:, :width, ny - 1 - middle : ny + middle] = near
        return tables

    @property
    def _weights(self) -> Array:
        """Weights of samples at consecutive nodes for the integral over the density around the middle one."""
        return node_weights(self.homogeneous.shape, _HALF_WIDTH, 1)

    def _integrals(self, i: Indices, j: Indices, series: Series, count: int) -> Array:
        """Return the integrals over the density around nodes i and j (count, nx, ny) from samples at all nodes."""
        x, y = (h * _with_margin(n) for n, h in zip((i, j), self.spacing, strict=True))
        samples = _sampled(x, y, series, count)
        for axis in (1, 2):
            samples = scipy.ndimage.correlate1d(samples, self._weights, axis, mode="nearest")
        inside = slice(_HALF_WIDTH, -_HALF_WIDTH)
        return np.prod(self.spacing) * samples[:, inside, inside]

    def _interpolated_integrals(self, i: Indices, j: Indices, series: Series, count: int) -> Array:
        """Return integrals as `_integrals` from samples at some nodes."""
        (coarse_i, along), (coarse_j, across) = (_interpolation(_with_margin(n)) for n in (i, j))
        along, across = _averages(self._weights, len(i)) @ along, _averages(self._weights, len(j)) @ across
        hx, hy = self.spacing
        coarse = hx * hy * _sampled(hx * coarse_i, hy * coarse_j, series, count)
        tables = np.empty((count, len(i), len(j)))
        for table, one in zip(tables, coarse, strict=True):
            table[:] = along @ (across @ one.T).T
        return tables

    @cached_property
    def _near(self) -> Array:
        """Integrals of the difference over the density near the node, as `cell_table`."""
        height, widest = 2.0 * self.layers.decay * self.layers.thickness, max(self.spacing)
        radius = np.sqrt(max(0.0, (_MIN_DISTANCE * widest) ** 2 - height**2))
        nx, ny = (min(n, int(np.ceil(radius / h)) + 1) for n, h in zip(self.size, self.spacing, strict=True))
        table = np.empty((self.response.layout.n_values, nx, 2 * ny - 1))
        sides = [density_pieces(self.homogeneous.shape, h) for h in self.spacing]
        series = compiled(self.difference, range(len(table)))
        width = -0.5 * np.log(_ACCURACY)
        share_out(partial(_fill_cells, np.array(self.spacing), *sides, width, height, series, table), nx)
        return table

    @property
    def diagonal(self) -> Array:
        """Response (entries,) of a node to the density around it."""
        values = self._near[:, 0, self._near.shape[2] // 2].copy()
        values[self.response.layout.n_symmetric :] = 0.0  # odd functions vanish at zero
        return np.asarray(values + self.homogeneous.diagonal)

    def wave_response(self) -> "LayeredPeriodicGrid":
        """Return the response to waves on the padded grid."""
        return LayeredPeriodicGrid.of(self.layers, self.spacing, self.padded, self.homogeneous.shape)

    def coarsen(self) -> "LayeredFreeGrid":
        """Return the coarser grid, on which the difference is the same function."""
        return self._on(self.homogeneous.coarsen())

    def restrict(self, size: tuple[int, int]) -> "LayeredFreeGrid":
        """Return the response without the nodes around the subgrid."""
        return self._on(self.homogeneous.restrict(size))

    def _on(self, homogeneous: FreeGrid) -> "LayeredFreeGrid":
        return replace(self, spacing=homogeneous.spacing, size=homogeneous.size, homogeneous=homogeneous)


@final
@dataclass(frozen=True, eq=False)
class LayeredPeriodicGrid(GridResponse):
    """The response of layers whose surface repeats itself: each wave has its own compliance.

    A uniform load has a finite response on a rigid base that insulates no field; else it is that of `PeriodicGrid`.

    Attributes
    ----------
    layers
        The response of the layers.
    homogeneous
        Response of the grid on a half space of the top material.
    """

    layers: LayeredResponse
    homogeneous: PeriodicGrid

    @classmethod
    def of(
        cls, layers: LayeredResponse, spacing: tuple[float, float], size: tuple[int, int], shape: Window
    ) -> "LayeredPeriodicGrid":
        """Return the response of a grid."""
        return cls(layers.top, spacing, size, layers, PeriodicGrid(layers.top, spacing, size, shape))

    @property
    def series(self) -> EntrySeries:
        """The entries of the symbol."""
        return self.layers

    @property
    def padded(self) -> tuple[int, int]:
        """The size of the grid."""
        return self.size

    def symbol(self, numbers: Sequence[int], precision: np.dtype[Any] = DOUBLE) -> Iterator[tuple[int, Array]]:
        """Yield entries from the series of the surface compliance."""
        count = self.size[1] if self.layers.parities is None else self.size[1] // 2 + 1
        waves, windows = self.homogeneous.waves(count)
        for number in numbers:
            if number not in self.layers.numbers:
                continue
            symbol = self.homogeneous.wave_entry(number, count)
            if symbol is None:
                symbol = np.zeros((len(waves[0]), count))
            series = compiled(self.layers.difference, [number])
            share_out(partial(_fill_waves, (*waves, *windows, *self.size), series, symbol), len(symbol))
            if number < self.response.layout.n_symmetric:
                symbol[0, 0] = self._uniform[number]
            yield number, symbol.astype(precision, copy=False)

    @cached_property
    def _uniform(self) -> Array:
        return self.layers.uniform(mean_length(self.size, self.spacing))

    @property
    def diagonal(self) -> Array:
        """Response (entries,) of a node to the density around it."""
        return periodic_diagonal(self)

    def wave_response(self) -> None:
        """Return None: the symbol of the grid is that of the waves."""
        return

    def coarsen(self) -> "LayeredPeriodicGrid | None":
        """Return the coarser grid; None unless numbers of nodes are even."""
        coarse = self.homogeneous.coarsen()
        return None if coarse is None else replace(self, spacing=coarse.spacing, size=coarse.size, homogeneous=coarse)

    def restrict(self, size: tuple[int, int]) -> None:
        """Return None: subgrids of a period are not periodic."""
        return


def compiled(series: RadialSeries, numbers: Sequence[int]) -> Series:
    """Return a series of some entries, numbered from zero, as `add_series` takes it."""
    terms, position = series.terms, {number: index for index, number in enumerate(numbers)}
    chosen = np.array([index for index, entry in enumerate(terms.entries) if int(entry) in position], np.int64)
    chosen = chosen[np.argsort(terms.harmonics[chosen], kind="stable")]
    coefficients = np.ascontiguousarray(series.coefficients[:, chosen])
    negligible = 1e-3 * max(series.error, np.finfo(float).eps * float(np.abs(series.coefficients).max(initial=0.0)))
    reversed_nonzero = np.abs(coefficients[:, :, ::-1]) > negligible
    counts = np.where(reversed_nonzero.any(axis=2), coefficients.shape[2] - reversed_nonzero.argmax(axis=2), 0)
    entries = np.array([position[int(entry)] for entry in terms.entries[chosen]], np.int64)
    return series.edges, coefficients, counts, entries, terms.harmonics[chosen], terms.sines[chosen]


def _sampled(x: Array, y: Array, series: Series, count: int) -> Array:
    """Return a series at offsets x (nx,), y (ny,), (count, nx, ny)."""
    samples = np.empty((count, len(x), len(y)))
    share_out(partial(_fill_samples, x, y, series, samples), len(x))
    return samples


def _with_margin(positions: Indices) -> Indices:
    """Return consecutive positions with _HALF_WIDTH more on both sides."""
    return np.arange(positions[0] - _HALF_WIDTH, positions[-1] + _HALF_WIDTH + 1)


def _averages(weights: Array, count: int) -> scipy.sparse.csr_array:
    """Return the matrix (count, count + 8) of sums of consecutive values with some weights."""
    diagonals, shape = [np.full(count, weight) for weight in weights], (count, count + len(weights) - 1)
    return scipy.sparse.diags_array(diagonals, offsets=range(len(weights)), shape=shape).tocsr()


def _interpolation(positions: Indices) -> tuple[Indices, scipy.sparse.csr_array]:
    """Return every _HOP-th position around some consecutive ones, and the weights of values there, (n, m).

    The weights are those of the polynomial through the _NEIGHBOURS nearest ones.
    """
    margin = _NEIGHBOURS // 2
    low = positions[0] // _HOP - margin + 1
    coarse = _HOP * np.arange(low, positions[-1] // _HOP + margin + 1)
    first = positions // _HOP - margin + 1 - low
    steps = np.arange(_NEIGHBOURS)
    t = (positions % _HOP) / _HOP + margin - 1
    weights = np.ones((len(positions), _NEIGHBOURS))
    for node in steps:
        for other in steps[steps != node]:
            weights[:, node] *= (t - other) / (node - other)
    columns = first[:, None] + steps
    rows = np.repeat(np.arange(len(positions)), _NEIGHBOURS)
    shape = len(positions), len(coarse)
    return coarse, scipy.sparse.csr_array((weights.ravel(), (rows, columns.ravel())), shape=shape)


def _fill_samples(x: Array, y: Array, series: Series, out: Array, first: int, last: int) -> None:
    fill_samples(first, last, x, y, series, out)


def _fill_cells(
    spacing: Array,
    along: Array,
    across: Array,
    width: float,
    height: float,
    series: Series,
    out: Array,
    first: int,
    last: int,
) -> None:
    fill_cells(first, last, spacing, along, across, width, height, series, _RULES, out)


def _fill_waves(grid: tuple[Any, ...], series: Series, out: Array, first: int, last: int) -> None:
    fill_waves(first, last, *grid, series, 0, out)
