"""Approximate convolutions on a free grid: near responses on the grid itself, far ones on a coarser grid.

A factor that falls smoothly from one to zero within a cut-off radius splits the response K(theta)/r into two parts. The
near part needs padding by this radius only, instead of the width of the grid. The far part is smooth, so that every
HOP-th node represents it (meeframe_halfspace.reach); the transpose of the interpolation of its response restricts the
loads. All in single precision.
Source: Ewald, Ann. Phys. 369 (1921) 253, on sums of 1/r by a near and a smooth part.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import ceil, prod
from typing import Any, Final, final

import numpy as np
import scipy  # its parts load where they are used

from meeframe.plugin import Array
from meeframe_halfspace.cells import far_tables
from meeframe_halfspace.convolution import Convolution, Symbol
from meeframe_halfspace.grid_response import FreeGrid, GridResponse, free_symbol
from meeframe_halfspace.reach import LEAST, nearness, reach
from meeframe_halfspace.transfer import HOP, WEIGHTS, add_interpolated, add_restricted, coarse_count

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
        answer = self.near.response(load, loaded, fields)
        _add_interpolated(self.far.response(_restricted(load), loaded, fields), answer)
        return answer


def two_grids(response: GridResponse, scale: Array) -> TwoGrids | None:
    """Return the two convolutions of a grid's response, None if they would not take less time.

    scale: (5, 5), see Convolution.
    """
    if not isinstance(response, FreeGrid):
        return None
    most = MAX_PADDED * prod(response.padded)
    if prod(_padded(response, LEAST * max(response.spacing))) > most:
        return None
    widest = max(n * h for n, h in zip(response.size, response.spacing, strict=True))
    padded = _padded(response, reach(response.response, response.spacing, widest))
    if prod(padded) > most:
        return None
    nx, ny = response.size
    size = coarse_count(nx), coarse_count(ny)
    numbers, parities = response.response.numbers, response.response.parities
    cut = _Cut(response, padded, size, (_fast(2 * size[0]), _fast(2 * size[1])))
    near = Convolution(Symbol(cut.near, numbers, parities), response.size, padded, scale)
    return TwoGrids(near, Convolution(Symbol(cut.far, numbers, parities), size, cut.coarse_padded, scale))


@dataclass(frozen=True, eq=False)
class _Cut:
    """A free grid's response in two parts, near on a grid of `padded` nodes, far on one of `coarse_padded`."""

    response: FreeGrid
    padded: tuple[int, int]
    coarse: tuple[int, int]
    coarse_padded: tuple[int, int]

    @cached_property
    def _rows(self) -> tuple[int, int]:
        """Number of padding nodes along each axis."""
        (nx, ny), (px, py) = self.response.size, self.padded
        return px - nx, py - ny

    @cached_property
    def _reach(self) -> float:
        return min(rows * h for rows, h in zip(self._rows, self.response.spacing, strict=True))

    @cached_property
    def _inner(self) -> FreeGrid:
        nx, ny = (min(n, rows) for n, rows in zip(self.response.size, self._rows, strict=True))
        return self.response.restrict((nx, ny))

    @cached_property
    def _nearness(self) -> Array:
        return nearness(self._inner.size, self.response.spacing, self._reach)

    @cached_property
    def _farness(self) -> Array:
        hx, hy = self.response.spacing
        return 1.0 - nearness(self.coarse, (HOP * hx, HOP * hy), self._reach)

    def near(self, numbers: Sequence[int], precision: np.dtype[Any]) -> Iterator[tuple[int, Array]]:
        """Yield entries of the symbol, see GridResponse.symbol."""
        for number, table in self._inner.tables(numbers):
            yield number, self._symbol(number, table, self._nearness, self.padded, precision)

    def far(self, numbers: Sequence[int], precision: np.dtype[Any]) -> Iterator[tuple[int, Array]]:
        """Yield entries of the symbol of the coarse grid, see GridResponse.symbol."""
        whole, known = self.response, dict(self._inner.tables(numbers))
        for number, table in far_tables(whole.response, whole.spacing, whole.shape, self.coarse, numbers, HOP):
            near = known[number]
            middle, begin = (0, 0) if near.shape[1] == self._inner.size[1] else (near.shape[1] // 2, self.coarse[1] - 1)
            near = near[::HOP, middle % HOP :: HOP]
            begin -= middle // HOP
            table[: len(near), begin : begin + near.shape[1]] = near
            yield number, self._symbol(number, table, self._farness, self.coarse_padded, precision)

    def _symbol(
        self, number: int, table: Array, factor: Array, padded: tuple[int, int], precision: np.dtype[Any]
    ) -> Array:
        part = (table * factor[:, -table.shape[1] :]).astype(precision)
        return free_symbol(part, self.response.response, number, padded)


def _restricted(fine: Array) -> Array:
    """Return the transposed interpolation of loads, (k, cx, cy) from (k, nx, ny)."""
    return np.array([_along_first(_along_first(part).T).T for part in fine])


def _along_first(fine: Array) -> Array:
    coarse = np.zeros((coarse_count(len(fine)), fine.shape[1]), fine.dtype)
    add_restricted(np.ascontiguousarray(fine), WEIGHTS, coarse)
    return coarse


def _add_interpolated(coarse: Array, fine: Array) -> None:
    """Add the interpolation of values (k, cx, cy) of the coarse grid to fine (k, nx, ny)."""
    for few, many in zip(coarse, fine, strict=True):
        across = np.zeros((many.shape[1], len(few)), many.dtype)
        add_interpolated(np.ascontiguousarray(few.T), WEIGHTS, across)
        add_interpolated(np.ascontiguousarray(across.T), WEIGHTS, many)


def _padded(response: FreeGrid, reach: float) -> tuple[int, int]:
    """Return the size of the grid padded by a cut-off radius [m]."""
    px, py = (_fast(n + ceil(reach / h)) for n, h in zip(response.size, response.spacing, strict=True))
    return px, py


def _fast(count: int) -> int:
    """Return the next larger even number with fast transforms."""
    return 2 * int(scipy.fft.next_fast_len((count + 1) // 2, real=True))
