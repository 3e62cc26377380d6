"""Approximate convolution on a free grid: the near response on the grid, the smooth rest on a coarser one.

The response K(theta)/r is split by a factor that falls smoothly from one to zero within a cutoff radius. The near part
needs only this radius as padding around the grid, instead of the width of the grid; the rest is smooth enough for every
RATIO-th node (meeframe_halfspace.cutoff): loads are restricted to the coarse grid by the transpose of the interpolation
of its response. Computed in single precision.

References
----------
Ewald, Ann. Phys. 369 (1921) 253, on sums of 1/r by a near and a smooth part.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import ceil, prod
from typing import Any, Final, final

import numpy as np
import scipy  # submodules are loaded on first use

from meeframe.plugin import Array
from meeframe_halfspace.cells import far_tables
from meeframe_halfspace.convolution import Convolution, Symbol
from meeframe_halfspace.cutoff import MIN_CUTOFF, cutoff_radius, near_factor
from meeframe_halfspace.grid_response import FreeGrid, GridResponse, free_symbol
from meeframe_halfspace.transfer import RATIO, WEIGHTS, add_interpolated, add_restricted, coarse_count

SINGLE: Final = np.dtype(np.float32)
MAX_NODE_RATIO: Final = 0.6
"""Largest number of nodes relative to the padded grid for which two grids take clearly less time."""


@final
@dataclass(frozen=True, eq=False)
class TwoGrids:
    """Convolution on two grids.

    Attributes
    ----------
    near
        Convolution on the grid.
    far
        Convolution on the coarse grid.
    """

    near: Convolution
    far: Convolution

    def response(self, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        """Return the approximate response in single precision; see Convolution.response."""
        load = load.astype(SINGLE, copy=False)
        displacement = self.near.response(load, loaded, fields)
        _add_interpolated(self.far.response(_restrict(load), loaded, fields), displacement)
        return displacement


def two_grids(response: GridResponse, scale: Array) -> TwoGrids | None:
    """Return the convolution on two grids, or None if it would not take less time.

    Parameters
    ----------
    response
        Response of the grid.
    scale
        Scaling (5, 5), see Convolution.
    """
    if not isinstance(response, FreeGrid):
        return None
    most = MAX_NODE_RATIO * prod(response.padded)
    if prod(_padded(response, MIN_CUTOFF * max(response.spacing))) > most:
        return None
    width = max(n * h for n, h in zip(response.size, response.spacing, strict=True))
    padded = _padded(response, cutoff_radius(response.response, response.spacing, width))
    if prod(padded) > most:
        return None
    nx, ny = response.size
    size = coarse_count(nx), coarse_count(ny)
    numbers, parities = response.response.numbers, response.response.parities
    split = _Split(response, padded, size, (_fast_size(2 * size[0]), _fast_size(2 * size[1])))
    near = Convolution(Symbol(split.near, numbers, parities), response.size, padded, scale)
    return TwoGrids(near, Convolution(Symbol(split.far, numbers, parities), size, split.coarse_padded, scale))


@dataclass(frozen=True, eq=False)
class _Split:
    """Response of a free grid, split into near and far on grids of `padded` and `coarse_padded` nodes."""

    response: FreeGrid
    padded: tuple[int, int]
    coarse: tuple[int, int]
    coarse_padded: tuple[int, int]

    @cached_property
    def _gaps(self) -> tuple[int, int]:
        """Numbers of unloaded nodes between the two ends of the grid, along both axes."""
        (nx, ny), (px, py) = self.response.size, self.padded
        return px - nx, py - ny

    @cached_property
    def _cutoff(self) -> float:
        return min(gap * h for gap, h in zip(self._gaps, self.response.spacing, strict=True))

    @cached_property
    def _inner(self) -> FreeGrid:
        nx, ny = (min(n, gap) for n, gap in zip(self.response.size, self._gaps, strict=True))
        return self.response.within((nx, ny))

    @cached_property
    def _near_factor(self) -> Array:
        return near_factor(self._inner.size, self.response.spacing, self._cutoff)

    @cached_property
    def _far_factor(self) -> Array:
        hx, hy = self.response.spacing
        return 1.0 - near_factor(self.coarse, (RATIO * hx, RATIO * hy), self._cutoff)

    def near(self, numbers: Sequence[int], precision: np.dtype[Any]) -> Iterator[tuple[int, Array]]:
        """Yield entries of the symbol, see GridResponse.symbol."""
        for number, table in self._inner.tables(numbers):
            yield number, self._symbol(number, table, self._near_factor, self.padded, precision)

    def far(self, numbers: Sequence[int], precision: np.dtype[Any]) -> Iterator[tuple[int, Array]]:
        """Yield entries of the symbol of the coarse grid, see GridResponse.symbol."""
        fine, tables = self.response, dict(self._inner.tables(numbers))
        for number, table in far_tables(fine.response, fine.spacing, fine.shape, self.coarse, numbers, RATIO):
            near = tables[number]
            middle, begin = (0, 0) if near.shape[1] == self._inner.size[1] else (near.shape[1] // 2, self.coarse[1] - 1)
            near = near[::RATIO, middle % RATIO :: RATIO]
            begin -= middle // RATIO
            table[: len(near), begin : begin + near.shape[1]] = near
            yield number, self._symbol(number, table, self._far_factor, self.coarse_padded, precision)

    def _symbol(
        self, number: int, table: Array, factor: Array, padded: tuple[int, int], precision: np.dtype[Any]
    ) -> Array:
        values = (table * factor[:, -table.shape[1] :]).astype(precision)
        return free_symbol(values, self.response.response, number, padded)


def _restrict(fine: Array) -> Array:
    """Apply the transpose of `_add_interpolated` to loads: (k, cx, cy) from fine (k, nx, ny)."""
    return np.array([_restrict_first_axis(_restrict_first_axis(values).T).T for values in fine])


def _restrict_first_axis(fine: Array) -> Array:
    """Restrict to the coarse grid along the first axis."""
    coarse = np.zeros((coarse_count(len(fine)), fine.shape[1]), fine.dtype)
    add_restricted(np.ascontiguousarray(fine), WEIGHTS, coarse)
    return coarse


def _add_interpolated(coarse: Array, fine: Array) -> None:
    """Add the interpolation of coarse (k, cx, cy) to fine (k, nx, ny)."""
    for coarse_values, fine_values in zip(coarse, fine, strict=True):
        columns = np.zeros((fine_values.shape[1], len(coarse_values)), fine_values.dtype)
        add_interpolated(np.ascontiguousarray(coarse_values.T), WEIGHTS, columns)
        add_interpolated(np.ascontiguousarray(columns.T), WEIGHTS, fine_values)


def _padded(response: FreeGrid, radius: float) -> tuple[int, int]:
    """Return the size of the grid with padding as wide as the radius [m]."""
    px, py = (_fast_size(n + ceil(radius / h)) for n, h in zip(response.size, response.spacing, strict=True))
    return px, py


def _fast_size(count: int) -> int:
    """Return an even number of nodes, at least `count`, with fast transforms."""
    return 2 * int(scipy.fft.next_fast_len((count + 1) // 2, real=True))
