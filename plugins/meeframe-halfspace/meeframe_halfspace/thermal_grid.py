"""Responses of grids on a body that heat expands or polarizes: those of the other fields, and that to heat."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, final

import numpy as np
import scipy  # submodules are loaded on first use

from meeframe.plugin import Array
from meeframe_halfspace.grid_response import (
    DOUBLE,
    POWERS,
    EntrySeries,
    FreeGrid,
    GridResponse,
    PeriodicGrid,
    free_symbol,
    symbol_mean,
)
from meeframe_halfspace.thermal import ENTRIES, ThermalResponse
from meeframe_halfspace.thermal_cells import heat_table

ZERO_FREQUENCY: Final = (0, 0)
"""Index of the mean load in a symbol, whose response to heat is left out: it is not finite."""


@final
@dataclass(frozen=True, eq=False)
class HeatedGrid(GridResponse):
    """The response of a grid with the temperature among its fields, which acts on others.

    Attributes
    ----------
    base
        The response without that action.
    reference_radius
        Radius [m] at which the mean response to heat at a point vanishes; without effect on a periodic grid, whose
        response to heat has zero mean.
    """

    base: FreeGrid | PeriodicGrid
    reference_radius: float

    @classmethod
    def of(cls, base: FreeGrid | PeriodicGrid, reference_radius: float) -> "HeatedGrid":
        """Return the response on the grid of `base`, whose point response includes heat."""
        return cls(base.response, base.spacing, base.size, base, reference_radius)

    @property
    def series(self) -> EntrySeries:
        """The entries of the symbol."""
        return self.response

    @property
    def padded(self) -> tuple[int, int]:
        """The size of the periodic grid to which the symbol belongs."""
        return self.base.padded

    @property
    def _first(self) -> int:
        """Number of the first entry that belongs to heat."""
        return self.response.layout.n_hermitian

    @property
    def _thermal(self) -> ThermalResponse:
        thermal = self.response.thermal
        assert thermal is not None
        return thermal

    def symbol(self, numbers: Sequence[int], precision: np.dtype[Any] = DOUBLE) -> Iterator[tuple[int, Array]]:
        """Yield entries of the other fields as `base` does, then those of heat."""
        yield from self.base.symbol([number for number in numbers if number < self._first], precision)
        for number in numbers:
            if number >= self._first and len(self.response.entry(number)[0]):
                yield number, self._heat_symbol(number).astype(precision, copy=False)

    def _heat_symbol(self, number: int) -> Array:
        if isinstance(self.base, PeriodicGrid):
            return periodic_symbol(self.base, self._thermal, number - self._first)
        return free_symbol(self._table(number - self._first, self.size), self.response, number, self.padded)

    def _table(self, number: int, size: tuple[int, int]) -> Array:
        assert isinstance(self.base, FreeGrid)
        return heat_table(self._thermal, number, self.spacing, self.base.shape, size, self.reference_radius)

    @cached_property
    def diagonal(self) -> Array:
        """Response (entries,) of a node to the density around it; odd functions vanish there."""
        values = self.base.diagonal.copy()
        for number in range(self._first, self._first + ENTRIES // 2):
            if not len(self.response.entry(number)[0]):
                continue
            if isinstance(self.base, FreeGrid):
                table = self._table(number - self._first, (1, 1))
                values[number] = table[0, table.shape[1] // 2]
                continue
            values[number] = symbol_mean(self._heat_symbol(number), self.response.parities, number, self.size)
        return values

    def wave_response(self) -> None:
        """Return None: the symbol of the grid serves as well."""
        return

    def coarsen(self) -> "HeatedGrid | None":
        """Return the response on the grid of every second node, with the same reference radius."""
        base = self.base.coarsen()
        return None if base is None else HeatedGrid.of(base, self.reference_radius)

    def restrict(self, size: tuple[int, int]) -> "HeatedGrid | None":
        """Return the response on a subgrid of that size, with the same reference radius; None on periodic grids."""
        if not isinstance(self.base, FreeGrid):
            return None
        return HeatedGrid.of(self.base.restrict(size), self.reference_radius)


def periodic_symbol(grid: PeriodicGrid, thermal: ThermalResponse, number: int) -> Array:
    """Return an entry of y_h / q^2 times the transform of the density, zero for the mean load.

    Parameters
    ----------
    grid
        The grid.
    thermal
        Response to heat.
    number
        Number of the entry, see ThermalResponse.entry.
    """
    (nx, ny), (coefficients, is_odd) = grid.size, thermal.entry(number)
    count = ny if grid.response.parities is None else ny // 2 + 1
    along = 2.0 * np.pi * scipy.fft.rfftfreq(nx, grid.spacing[0])
    across = 2.0 * np.pi * scipy.fft.fftfreq(ny, grid.spacing[1])[:count]
    symbol = np.zeros((len(along), count))
    # the highest wave number of an even count stands for both signs: the mean of the two is real where it must be
    for sign_x, sign_y in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        x, y = along.copy(), across.copy()
        if nx % 2 == 0:
            x[-1] *= sign_x
        if ny % 2 == 0:
            y[ny // 2] *= sign_y
        symbol += 0.25 * _waves(coefficients, is_odd, x[:, None], y[None, :])
    for axis, (q, spacing) in enumerate(zip((along, across), grid.spacing, strict=True)):
        window = np.sinc(q * spacing / (2.0 * np.pi)) ** POWERS[grid.shape]
        symbol *= window[:, None] if axis == 0 else window
    symbol[ZERO_FREQUENCY] = 0.0
    return symbol


def _waves(coefficients: Array, is_odd: bool, x: Array, y: Array) -> Array:
    """Return the series at the angle of the waves (x, y) over their square; zero for the mean load."""
    square = x**2 + y**2
    angle = np.arctan2(y, x)
    values = np.zeros(square.shape)
    for n, (cosine, sine) in enumerate(coefficients):
        harmonic = 2 * n + is_odd
        values += cosine * np.cos(harmonic * angle) + sine * np.sin(harmonic * angle)
    return np.divide(values, square, out=np.zeros_like(values), where=square > 0.0)
