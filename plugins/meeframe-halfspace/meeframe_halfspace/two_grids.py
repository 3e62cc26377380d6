"""A convolution on a free grid to a few digits: what is near on the grid itself, the rest on a coarser one.

The response K(theta)/r is cut in two by a factor that falls smoothly from one to zero within a reach. What is near a
node needs no more room beside the grid than that, instead of as much again as the grid is wide; the rest is smooth, so
that every HOP-th node tells it (meeframe_halfspace.reach): loads are gathered there by the transpose of the
interpolation that takes its response back. In single precision.
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
from meeframe_halfspace.transfer import HOP, WEIGHTS, add_gathered, add_scattered, coarse_count

SINGLE: Final = np.dtype(np.float32)
WORTH: Final = 0.6
"""Of the nodes of the padded grid at most: with more, two grids hardly take less time."""


@final
@dataclass(frozen=True, eq=False)
class TwoGrids:
    """near: on the grid; far: on the coarse one."""

    near: Convolution
    far: Convolution

    def response(self, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        """See Convolution.response, but roughly and in single precision."""
        load = load.astype(SINGLE, copy=False)
        answer = self.near.response(load, loaded, fields)
        _add_between(self.far.response(_gathered(load), loaded, fields), answer)
        return answer


def two_grids(response: GridResponse, scale: Array) -> TwoGrids | None:
    """Of a grid's response; scale: (5, 5), see Convolution. None if it would not take less time."""
    if not isinstance(response, FreeGrid):
        return None
    most = WORTH * prod(response.padded)
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
    """The response of a free grid in two parts, near on a grid of `padded` nodes, far on one of `coarse_padded`."""

    response: FreeGrid
    padded: tuple[int, int]
    coarse: tuple[int, int]
    coarse_padded: tuple[int, int]

    @cached_property
    def _rows(self) -> tuple[int, int]:
        """Nodes without a load that are between one end of the grid and the other."""
        (nx, ny), (px, py) = self.response.size, self.padded
        return px - nx, py - ny

    @cached_property
    def _reach(self) -> float:
        return min(rows * h for rows, h in zip(self._rows, self.response.spacing, strict=True))

    @cached_property
    def _inner(self) -> FreeGrid:
        nx, ny = (min(n, rows) for n, rows in zip(self.response.size, self._rows, strict=True))
        return self.response.within((nx, ny))

    @cached_property
    def _nearness(self) -> Array:
        return nearness(self._inner.size, self.response.spacing, self._reach)

    @cached_property
    def _farness(self) -> Array:
        hx, hy = self.response.spacing
        return 1.0 - nearness(self.coarse, (HOP * hx, HOP * hy), self._reach)

    def near(self, numbers: Sequence[int], precision: np.dtype[Any]) -> Iterator[tuple[int, Array]]:
        """Entries of the symbol, see GridResponse.symbol."""
        for number, table in self._inner.tables(numbers):
            yield number, self._symbol(number, table, self._nearness, self.padded, precision)

    def far(self, numbers: Sequence[int], precision: np.dtype[Any]) -> Iterator[tuple[int, Array]]:
        """Entries of the symbol of the coarse grid, see GridResponse.symbol."""
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


def _gathered(fine: Array) -> Array:
    """What `_add_between` takes from loads, transposed: (k, cx, cy) of fine (k, nx, ny)."""
    return np.array([_along_first(_along_first(part).T).T for part in fine])


def _along_first(fine: Array) -> Array:
    coarse = np.zeros((coarse_count(len(fine)), fine.shape[1]), fine.dtype)
    add_gathered(np.ascontiguousarray(fine), WEIGHTS, coarse)
    return coarse


def _add_between(coarse: Array, fine: Array) -> None:
    """fine (k, nx, ny) += what is between nodes of coarse (k, cx, cy)."""
    for few, many in zip(coarse, fine, strict=True):
        across = np.zeros((many.shape[1], len(few)), many.dtype)
        add_scattered(np.ascontiguousarray(few.T), WEIGHTS, across)
        add_scattered(np.ascontiguousarray(across.T), WEIGHTS, many)


def _padded(response: FreeGrid, reach: float) -> tuple[int, int]:
    """Nodes of the grid with as many beside it as are within reach [m]."""
    px, py = (_fast(n + ceil(reach / h)) for n, h in zip(response.size, response.spacing, strict=True))
    return px, py


def _fast(count: int) -> int:
    """An even number of nodes, at least so many, with fast transforms."""
    return 2 * int(scipy.fft.next_fast_len((count + 1) // 2, real=True))
