"""Approximate convolutions on a free grid: near responses on the grid itself, far ones on a coarser grid.

A factor that falls smoothly from one to zero within a cutoff radius splits the response K(theta)/r into two parts. The
near part needs padding by this radius only, instead of the width of the grid. The far part is smooth, so that every
RATIO-th node represents it (meeframe_halfspace.cutoff); the transpose of the interpolation of its response restricts
the loads. All in single precision.

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
MAX_PADDED: Final = 0.6
"""Largest padded near grid, as a fraction of the padded full grid, for which two grids take less time."""


@final
@dataclass(frozen=True, eq=False)
class TwoGrids:
    """Two convolutions: `near` on the grid, `far` on the coarse one."""

    near: Convolution
    far: Convolution

    def response(self, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        """Return Convolution.response to about four digits, in single precision."""
        load = load.astype(SINGLE, copy=False)
        displacement = self.near.response(load, loaded, fields)
        _add_interpolated(self.far.response(_restrict(load), loaded, fields), displacement)
        return displacement


def two_grids(response: GridResponse, scale: Array) -> TwoGrids | None:
    """Return the two convolutions of a grid's response, None if they would not take less time.

    scale: (5, 5), see Convolution.
    """
    if not isinstance(response, FreeGrid):
        return None
    limit = MAX_PADDED * prod(response.padded)
    if prod(_padded(response, MIN_CUTOFF * max(response.spacing))) > limit:
        return None
    width = max(n * h for n, h in zip(response.size, response.spacing, strict=True))
    padded = _padded(response, cutoff_radius(response.response, response.spacing, width))
    if prod(padded) > limit:
        return None
    nx, ny = response.size
    size = coarse_count(nx), coarse_count(ny)
    numbers, parities = response.response.numbers, response.response.parities
    split = _Split(response, padded, size, (_fast_size(2 * size[0]), _fast_size(2 * size[1])))
    near = Convolution(Symbol(split.near, numbers, parities), response.size, padded, scale)
    return TwoGrids(near, Convolution(Symbol(split.far, numbers, parities), size, split.coarse_padded, scale))


@dataclass(frozen=True, eq=False)
class _Split:
    """A free grid's response in two parts, near on a grid of `padded` nodes, far on one of `coarse_padded`."""

    response: FreeGrid
    padded: tuple[int, int]
    coarse: tuple[int, int]
    coarse_padded: tuple[int, int]

    @cached_property
    def _padding(self) -> tuple[int, int]:
        """Number of padding nodes along each axis."""
        (nx, ny), (px, py) = self.response.size, self.padded
        return px - nx, py - ny

    @cached_property
    def _cutoff(self) -> float:
        return min(gap * h for gap, h in zip(self._padding, self.response.spacing, strict=True))

    @cached_property
    def _inner(self) -> FreeGrid:
        nx, ny = (min(n, gap) for n, gap in zip(self.response.size, self._padding, strict=True))
        return self.response.restrict((nx, ny))

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
    """Return the transposed interpolation of loads, (k, cx, cy) from (k, nx, ny)."""
    return np.array([_restrict_first_axis(_restrict_first_axis(values).T).T for values in fine])


def _restrict_first_axis(fine: Array) -> Array:
    coarse = np.zeros((coarse_count(len(fine)), fine.shape[1]), fine.dtype)
    add_restricted(np.ascontiguousarray(fine), WEIGHTS, coarse)
    return coarse


def _add_interpolated(coarse: Array, fine: Array) -> None:
    """Add the interpolation of values (k, cx, cy) of the coarse grid to fine (k, nx, ny)."""
    for coarse_values, fine_values in zip(coarse, fine, strict=True):
        columns = np.zeros((fine_values.shape[1], len(coarse_values)), fine_values.dtype)
        add_interpolated(np.ascontiguousarray(coarse_values.T), WEIGHTS, columns)
        add_interpolated(np.ascontiguousarray(columns.T), WEIGHTS, fine_values)


def _padded(response: FreeGrid, radius: float) -> tuple[int, int]:
    """Return the size of the grid padded by a cut-off radius [m]."""
    px, py = (_fast_size(n + ceil(radius / h)) for n, h in zip(response.size, response.spacing, strict=True))
    return px, py


def _fast_size(count: int) -> int:
    """Return the next larger even number with fast transforms."""
    return 2 * int(scipy.fft.next_fast_len((count + 1) // 2, real=True))
