"""Responses of free and periodic grids on layers: those of the top material, and the difference from them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, final

import numpy as np

from meeframe.plugin import Array
from meeframe_halfspace.cells import TABLES, Shape, share_out
from meeframe_halfspace.difference import point_difference
from meeframe_halfspace.difference_table import DifferenceTable, Series, compiled
from meeframe_halfspace.grid_response import (
    EntrySeries,
    FreeGrid,
    GridResponse,
    PeriodicGrid,
    Window,
    free_symbol,
    mean_length,
    periodic_diagonal,
)
from meeframe_halfspace.layered_kernels import fill_waves
from meeframe_halfspace.layered_symbol import LayeredResponse
from meeframe_halfspace.radial import RadialSeries
from meeframe_halfspace.response import mirror_parity


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
    table
        Integrals of the difference over the density around a node.
    """

    layers: LayeredResponse
    homogeneous: FreeGrid
    table: DifferenceTable

    @classmethod
    def of(
        cls, layers: LayeredResponse, spacing: tuple[float, float], size: tuple[int, int], shape: Shape
    ) -> "LayeredFreeGrid":
        """Return the response of a grid. Raises MaterialError as `point_difference`."""
        homogeneous = FreeGrid(layers.top, spacing, size, shape)
        difference = point_difference(layers.difference, layers.thickness, widest_offset(spacing, size))
        table = DifferenceTable(
            difference, layers.layout.n_values, 2.0 * layers.decay * layers.thickness, spacing, size, shape
        )
        return cls(layers.top, spacing, size, layers, homogeneous, table)

    @property
    def series(self) -> EntrySeries:
        """The entries of the symbol."""
        return self.layers

    @property
    def padded(self) -> tuple[int, int]:
        """Size of the periodic grid to which the symbol belongs."""
        return self.homogeneous.padded

    def symbol(self, numbers: Sequence[int]) -> Iterator[tuple[int, Array]]:
        """Yield entries by integration over the density around the node."""
        wanted = [number for number in numbers if number in self.layers.numbers]
        of_each_half = max(1, TABLES // (16 * self.size[0] * self.size[1]))
        for is_half in (True, False):
            alike = [number for number in wanted if bool(self._mirror(number)) is is_half]
            for batch in (alike[first : first + of_each_half] for first in range(0, len(alike), of_each_half)):
                for number, table in zip(batch, self._tables(batch, is_half), strict=True):
                    yield number, free_symbol(table, self.layers, number, self.padded)

    def _mirror(self, number: int) -> int:
        return mirror_parity(self.layers.entry(number)[0])

    def _tables(self, numbers: list[int], is_half: bool) -> Array:
        """Return tables (n, nx, ny) of mirrored entries, (n, nx, 2 ny - 1) of others, as FreeGrid.tables."""
        tables = self.table.integrals(numbers, is_half)
        for number, table in self.homogeneous.complete_tables(numbers, is_half).items():
            tables[numbers.index(number)] += table
        return tables

    @property
    def diagonal(self) -> Array:
        """Response (entries,) of a node to the density around it."""
        values = self.table.diagonal
        values[self.response.layout.n_symmetric :] = 0.0  # odd functions vanish at zero
        return np.asarray(values + self.homogeneous.diagonal)

    def wave_response(self) -> "LayeredPeriodicGrid":
        """Return the response of the free grid on the top material, with waves of the difference on the padded grid."""
        waves = LayeredPeriodicGrid.of(self.layers, self.spacing, self.padded, self.homogeneous.shape)
        return replace(waves, free=self.homogeneous)

    def coarsen(self) -> "LayeredFreeGrid":
        """Return the coarser grid, on which the difference is the same function."""
        return self._on(self.homogeneous.coarsen())

    def restrict(self, size: tuple[int, int]) -> "LayeredFreeGrid":
        """Return the response without the nodes around the subgrid."""
        return self._on(self.homogeneous.restrict(size))

    def _on(self, homogeneous: FreeGrid) -> "LayeredFreeGrid":
        spacing, size = homogeneous.spacing, homogeneous.size
        return replace(self, spacing=spacing, size=size, homogeneous=homogeneous, table=self.table.on(spacing, size))


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
    free
        A free grid on the top material, whose response takes the place of that of the periodic one and of the mean load
        for the approximate inverse; None for the response of the periodic grid.
    """

    layers: LayeredResponse
    homogeneous: PeriodicGrid
    free: FreeGrid | None = None

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

    def symbol(self, numbers: Sequence[int]) -> Iterator[tuple[int, Array]]:
        """Yield entries from the series of the surface compliance."""
        count = self.size[1] if self.layers.parities is None else self.size[1] // 2 + 1
        n_waves = self.size[0] // 2 + 1
        for number in numbers:
            if number not in self.layers.numbers:
                continue
            symbol = self.homogeneous.wave_entry(number, count) if self.free is None else self._free_entry(number)
            if symbol is None:
                symbol = np.zeros((n_waves, count))
            add_waves(self, self.layers.difference, number, symbol)
            if self.free is None and number < self.response.layout.n_symmetric:
                symbol[0, 0] = self._uniform[number]
            yield number, symbol

    def _free_entry(self, number: int) -> Array | None:
        """Return an entry of the symbol of the free grid, laid out as those of the layers; None if it is zero."""
        assert self.free is not None
        is_half = bool(mirror_parity(self.layers.entry(number)[0]))
        for table in self.free.complete_tables([number], is_half).values():
            return free_symbol(table, self.layers, number, self.padded)
        return None

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


def add_waves(
    grid: LayeredPeriodicGrid, series: RadialSeries, number: int, symbol: Array, inverse_square: bool = False
) -> None:
    """Add an entry of a series in the wave number q, over q or its square, to a symbol; not at q = 0.

    symbol: (nx // 2 + 1, ny), or (nx // 2 + 1, ny // 2 + 1) for the first half of the waves along the second axis.
    """
    waves, windows = grid.homogeneous.waves(symbol.shape[1])
    compiled_series, values = compiled(series, [number]), np.zeros_like(symbol) if inverse_square else symbol
    share_out(partial(_fill_waves, (*waves, *windows, *grid.size), compiled_series, values), len(values))
    if inverse_square:
        q = np.hypot(waves[0][:, None], waves[1])
        symbol += np.divide(values, q, out=np.zeros_like(values), where=q > 0.0)


def widest_offset(spacing: tuple[float, float], size: tuple[int, int]) -> float:
    """Return the largest distance [m] at which a difference is sampled, beyond the border, also of coarser grids."""
    return float(np.hypot(*((1.5 * n + 8.0) * h for n, h in zip(size, spacing, strict=True))))


def _fill_waves(grid: tuple[Any, ...], series: Series, out: Array, first: int, last: int) -> None:
    fill_waves(first, last, *grid, series, 0, out)
