"""Response of a regular grid to the load on one of its cells, integrated to round-off."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache, partial
from typing import Final, Literal

import numba
import numpy as np

from meeframe.plugin import Array
from meeframe_halfspace.kernels import NEAR, fill_far, fill_rows, tabulate
from meeframe_halfspace.response import PointResponse, mirror_parity

Shape = Literal["bilinear", "constant"]

_EDGE_POINTS: Final = 48
MAX_GAUSS_POINTS: Final = 9
_ANGLES: Final = 8192
_ANGLES_PER_HARMONIC: Final = 200
_ACCURACY: Final = 1e-13
FAR_DISTANCE: Final = 30.0
"""Distance from a cell, in spacings, beyond which the response at nodes suffices to integrate over the density."""
TABLES: Final = 2**25
"""Bytes of tables that are made at once."""
STENCIL_HALF_WIDTH: Final = 4
"""Nodes on either side in that sum, which is exact up to the ninth degree; its error is about 48 / distance^10."""


def cell_table(response: PointResponse, spacing: tuple[float, float], shape: Shape, size: tuple[int, int]) -> Array:
    """Return the response (entries, nx, 2 ny - 1) i spacings along e1 and j along e2 from a node with unit density.

    Scaled fields; i from 0 to nx - 1, j from -(ny - 1) to ny - 1; entries as of PointResponse. The response at (-i, -j)
    has the same symmetric entries and the opposite antisymmetric ones. shape: density around a node, constant on its
    cell or bilinear to zero at its neighbours; spacing [m].
    """
    nx, ny = size
    table = np.empty((response.layout.n_values, nx, 2 * ny - 1))
    along, across, steps = density_pieces(shape, spacing[0]), density_pieces(shape, spacing[1]), np.array(spacing)
    tables, thresholds = _product_rules(shape)
    rule = np.array(np.polynomial.legendre.leggauss(_EDGE_POINTS))

    even, odd = response.even, response.odd
    around = tabulate(even, odd, max(_ANGLES, _ANGLES_PER_HARMONIC * 2 * len(even)))

    def fill(first: int, last: int) -> None:
        fill_rows(first, last, steps, along, across, even, odd, around, rule, tables, thresholds, table)

    share_out(fill, nx)
    return table


def near_size(spacing: tuple[float, float], size: tuple[int, int]) -> tuple[int, int]:
    """Return the numbers of nodes along both axes of a grid that are near the cell, where `far_table` does not hold."""
    widest = max(spacing)
    nx, ny = (min(n, int(np.ceil(FAR_DISTANCE * widest / h)) + 1) for n, h in zip(size, spacing, strict=True))
    return nx, ny


def far_table(
    response: PointResponse, spacing: tuple[float, float], shape: Shape, size: tuple[int, int], entry: int, hop: int = 1
) -> Array:
    """Return one entry of `cell_table`, (nx, 2 ny - 1), which is accurate except near the cell (`near_size`).

    hop: step of the offsets in spacings; the entry has half as many digits if it is larger than one.
    """
    for _, table in far_tables(response, spacing, shape, size, [entry], hop):
        return unfold(table, mirror_parity(response.entry(entry)[0]))
    return np.zeros((size[0], 2 * size[1] - 1))


def far_tables(
    response: PointResponse,
    spacing: tuple[float, float],
    shape: Shape,
    size: tuple[int, int],
    entries: Iterable[int],
    hop: int = 1,
) -> Iterator[tuple[int, Array]]:
    """Yield each nonzero entry with its `far_table`, or its half (nx, ny) at offsets j >= 0 if the entry is mirrored.

    Samples at the nodes add up to the integral over a density with weights that are exact for polynomials. Entries
    whose series have the same harmonics are computed together.
    """
    nx, ny = size
    steps, weights = hop * np.array(spacing), node_weights(shape, STENCIL_HALF_WIDTH if hop == 1 else 1, hop)
    alike = defaultdict[tuple[bool, int], list[tuple[int, Array]]](list)
    for entry in entries:
        coefficients, odd = response.entry(entry)
        if len(coefficients):
            alike[odd, 0 if mirror_parity(coefficients) else ny - 1].append((entry, coefficients))
    for (odd, middle), of_kind in alike.items():
        most = max(1, TABLES // (8 * nx * (middle + ny)))
        for batch in (of_kind[first : first + most] for first in range(0, len(of_kind), most)):
            series = np.zeros((len(batch), max(len(coefficients) for _, coefficients in batch), 2))
            for full, (_, coefficients) in zip(series, batch, strict=True):
                full[: len(coefficients)] = coefficients
            tables = np.empty((len(batch), nx, middle + ny))
            share_out(partial(_fill_far, steps, series, odd, weights, middle, tables), nx)
            yield from zip((entry for entry, _ in batch), tables, strict=True)


def _fill_far(
    steps: Array, series: Array, odd: bool, weights: Array, middle: int, tables: Array, first: int, last: int
) -> None:
    fill_far(first, last, steps, series, odd, weights, middle, tables)


def unfold(half: Array, mirror: int) -> Array:
    """Return a table (nx, 2 ny - 1) from its half at offsets j >= 0, see far_tables."""
    return np.concatenate([mirror * half[:, :0:-1], half], axis=1) if mirror else half


def share_out(work: Callable[[int, int], None], count: int) -> None:
    """Call work(first, last) on ranges that cover range(count), in as many threads as numba has."""
    threads = numba.get_num_threads()
    if threads == 1:
        work(0, count)
        return
    bounds = np.linspace(0, count, min(4 * threads, count) + 1).astype(int)
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, bounds[:-1].tolist(), bounds[1:].tolist()))


def density_pieces(shape: Shape, h: float) -> Array:
    """Return rows (start, end, w0, w1) of the density along one axis about its node: w0 + w1 * coordinate."""
    if shape == "constant":
        return np.array([[-h / 2, h / 2, 1.0, 0.0]])
    return np.array([[-h, 0.0, 1.0, 1.0 / h], [0.0, h, 1.0, -1.0 / h]])


@lru_cache(maxsize=2)
def _product_rules(shape: Shape) -> tuple[Array, Array]:
    """Return Gauss rules of the density, (k, 2, k) nodes in spacings and weights, and the distances they require.

    The error of n points falls like (width / (4 distance))^2n, width of the density and distance in spacings.
    """
    tables = np.zeros((MAX_GAUSS_POINTS, 2, MAX_GAUSS_POINTS))
    for n in range(1, MAX_GAUSS_POINTS + 1):
        tables[n - 1, :, :n] = gauss_rule(shape, n)
    width = 1.0 if shape == "constant" else 2.0
    thresholds = width / 4.0 * _ACCURACY ** (-0.5 / np.arange(1, MAX_GAUSS_POINTS + 1))
    thresholds[-1] = min(thresholds[-1], NEAR)
    return tables, thresholds


@lru_cache(maxsize=4)
def node_weights(shape: Shape, half_width: int, hop: int) -> Array:
    """Return weights (2 half_width + 1,) of values at every hop-th node for the integral over the middle density.

    They are in units of hop spacings.
    """
    powers = 2 * np.arange(half_width + 1)
    moments = 0.5**powers / (powers + 1.0) if shape == "constant" else 2.0 / ((powers + 1.0) * (powers + 2.0))
    moments = moments / float(hop) ** (powers + 1)
    values = np.arange(half_width + 1.0)[None, :] ** powers[:, None]
    half = np.linalg.solve(values, moments)  # of the middle one, and of both nodes at each distance
    half[1:] /= 2.0
    return np.concatenate([half[:0:-1], half])


def gauss_rule(shape: Shape, n: int) -> tuple[Array, Array]:
    """Return the Gauss rule (n,), (n,) of the density on an axis, from the recurrence of its orthogonal polynomials."""
    x, w = np.polynomial.legendre.leggauss(2 * MAX_GAUSS_POINTS)
    if shape == "constant":
        points, weights = x / 2, w / 2
    else:
        points = np.concatenate([(x - 1) / 2, (x + 1) / 2])
        weights = np.concatenate([w, w]) / 2 * (1 - np.abs(points))
    # the density is even, so that the recurrence has no middle terms
    previous, current, norm = np.zeros_like(points), np.ones_like(points), 1.0
    ratios: list[float] = []
    for _ in range(n - 1):
        following = points * current - (ratios[-1] if ratios else 0.0) * previous
        length = float(weights @ following**2)
        ratios.append(length / norm)
        previous, current, norm = current, following, length
    off = np.sqrt(ratios)
    nodes, vectors = np.linalg.eigh(np.diag(off, 1) + np.diag(off, -1))
    return nodes, vectors[0] ** 2
