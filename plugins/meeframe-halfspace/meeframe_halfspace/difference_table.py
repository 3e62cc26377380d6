"""Tables of a smooth difference of responses, integrated over the density around a node of a free grid."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Final

import numpy as np
import scipy  # submodules are loaded on first use

from meeframe.plugin import Array, Indices
from meeframe_halfspace.cells import Shape, density_pieces, node_weights, share_out
from meeframe_halfspace.layered_kernels import MAX_RULE, fill_cells, fill_products, fill_samples
from meeframe_halfspace.radial import RadialSeries

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


@dataclass(frozen=True, eq=False)
class DifferenceTable:
    """Integrals of a difference over the density around a node.

    Attributes
    ----------
    difference
        Difference of the point response, which holds up to the diagonal of the grid.
    n_entries
        Number of its entries.
    height
        Smallest imaginary distance [m] above the source at which it is singular.
    spacing
        Spacing along both axes [m].
    size
        Numbers of nodes (nx, ny).
    shape
        Shape of the density around a node.
    """

    difference: RadialSeries
    n_entries: int
    height: float
    spacing: tuple[float, float]
    size: tuple[int, int]
    shape: Shape

    def on(self, spacing: tuple[float, float], size: tuple[int, int]) -> "DifferenceTable":
        """Return the integrals on another grid, on which the difference is the same function."""
        return replace(self, spacing=spacing, size=size)

    def integrals(self, numbers: list[int], is_half: bool) -> Array:
        """Return tables (n, nx, 2 ny - 1) of entries at offsets j from 1 - ny on, (n, nx, ny) from 0 on if `is_half`.

        They come from samples at the nodes; far from the source, those at every fourth node are interpolated.
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
    def diagonal(self) -> Array:
        """Integrals (entries,) around the node itself."""
        return np.array(self._near[:, 0, self._near.shape[2] // 2])

    @property
    def _weights(self) -> Array:
        """Weights of samples at consecutive nodes for the integral over the density around the middle one."""
        return node_weights(self.shape, _HALF_WIDTH, 1)

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
        return _multiplied(along, _multiplied(across, coarse.swapaxes(1, 2)).swapaxes(1, 2))

    @cached_property
    def _near(self) -> Array:
        """Integrals of all entries over the density near the node, as `cell_table`."""
        radius = np.sqrt(max(0.0, (_MIN_DISTANCE * max(self.spacing)) ** 2 - self.height**2))
        nx, ny = (min(n, int(np.ceil(radius / h)) + 1) for n, h in zip(self.size, self.spacing, strict=True))
        table = np.empty((self.n_entries, nx, 2 * ny - 1))
        sides = [density_pieces(self.shape, h) for h in self.spacing]
        series = compiled(self.difference, range(len(table)))
        width = -0.5 * np.log(_ACCURACY)
        share_out(partial(_fill_cells, np.array(self.spacing), *sides, width, self.height, series, table), nx)
        return table


def compiled(series: RadialSeries, numbers: Sequence[int]) -> Series:
    """Return a series of some entries, numbered from zero, as `sum_degrees` takes it."""
    terms, position = series.terms, {number: index for index, number in enumerate(numbers)}
    chosen = np.array([index for index, entry in enumerate(terms.entries) if int(entry) in position], np.int64)
    chosen = chosen[np.argsort(terms.harmonics[chosen], kind="stable")]
    negligible = 1e-3 * max(series.error, np.finfo(float).eps * float(np.abs(series.coefficients).max(initial=0.0)))
    coefficients = np.ascontiguousarray(series.coefficients[:, chosen].swapaxes(1, 2))
    largest_from_here_on = np.maximum.accumulate(np.abs(coefficients[:, ::-1]), axis=1)[:, ::-1]
    coefficients[largest_from_here_on <= negligible] = 0.0
    counts = np.where(coefficients, np.arange(1, len(chosen) + 1), 0).max(axis=2, initial=0)
    entries = np.array([position[int(entry)] for entry in terms.entries[chosen]], np.int64)
    return series.edges, coefficients, counts, entries, terms.harmonics[chosen], terms.sines[chosen]


def _sampled(x: Array, y: Array, series: Series, count: int) -> Array:
    """Return a series at offsets x (nx,), y (ny,), (count, nx, ny)."""
    samples = np.empty((count, len(x), len(y)))
    share_out(partial(_fill_samples, x, y, series, samples), len(x))
    return samples


def _multiplied(matrix: scipy.sparse.csr_array, values: Array) -> Array:
    """Return the products (count, n, width) of a matrix (n, m) with values (count, m, width)."""
    count, _, width = values.shape
    products = np.empty((count, matrix.shape[0], width))
    share_out(partial(_fill_products, matrix, np.ascontiguousarray(values), products), matrix.shape[0])
    return products


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
    fill_samples(first, last, x, y, int(np.flatnonzero(y == 0.0)[0]), series, out)


def _fill_products(matrix: scipy.sparse.csr_array, values: Array, out: Array, first: int, last: int) -> None:
    fill_products(first, last, matrix.indptr, matrix.indices, matrix.data, values, out)


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
