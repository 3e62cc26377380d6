"""Responses of grids on a body that heat expands or polarizes: those of the other fields, and that to heat."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, final

import numpy as np
import scipy  # submodules are loaded on first use

from meeframe.plugin import N_FIELDS, Array
from meeframe_halfspace.cells import unfold
from meeframe_halfspace.difference import heat_difference, level_radius
from meeframe_halfspace.difference_table import DifferenceTable
from meeframe_halfspace.grid_response import (
    POWERS,
    EntrySeries,
    FreeGrid,
    GridResponse,
    PeriodicGrid,
    free_symbol,
    mean_length,
    symbol_mean,
)
from meeframe_halfspace.layered_grid import LayeredFreeGrid, LayeredPeriodicGrid, add_waves, widest_offset
from meeframe_halfspace.layered_symbol import undetermined_levels, uniform_heat
from meeframe_halfspace.response import mirror_parity
from meeframe_halfspace.thermal import ENTRIES, ThermalResponse
from meeframe_halfspace.thermal_cells import heat_table

ZERO_FREQUENCY: Final = (0, 0)
"""Index of the mean load in a symbol, whose response to heat is left out on half spaces: it is not finite."""


@final
@dataclass(frozen=True, eq=False)
class HeatedGrid(GridResponse):
    """The response of a grid with the temperature among its fields, which acts on others.

    Attributes
    ----------
    base
        The response without that action.
    reference_radii
        Radii (N_FIELDS,) [m] at which the mean response of the material at the surface to heat at a point vanishes;
        without effect on a periodic grid, whose response to heat has zero mean.
    table
        Difference of the response of layers to heat from that of their top material, on a free grid with layers.
    """

    base: FreeGrid | PeriodicGrid | LayeredFreeGrid | LayeredPeriodicGrid
    reference_radii: Array
    table: DifferenceTable | None = None

    @classmethod
    def of(cls, base: FreeGrid | PeriodicGrid, reference_radius: float) -> "HeatedGrid":
        """Return the response on the grid of `base`, whose point response includes heat."""
        return cls(base.response, base.spacing, base.size, base, np.full(N_FIELDS, reference_radius))

    @classmethod
    def of_layers(cls, base: LayeredFreeGrid | LayeredPeriodicGrid, reference_radius: float) -> "HeatedGrid":
        """Return the response on the grid of `base`, on layers.

        The radius has no effect on fields whose level is not undetermined, as on a rigid base or above an electrode.
        Raises MaterialError as `heat_difference`.
        """
        layers = base.layers
        radii = np.full(N_FIELDS, reference_radius)
        if isinstance(base, LayeredPeriodicGrid):
            return cls(base.response, base.spacing, base.size, base, radii)
        assert layers.heat_difference is not None
        determined = np.setdiff1d(np.arange(N_FIELDS), undetermined_levels(layers.body, layers.frame))
        radii[determined] = np.nan
        offset = widest_offset(base.spacing, base.size)
        difference = heat_difference(layers.heat_difference, layers.thickness, layers.depth, offset, radii)
        radii[determined] = level_radius(layers.depth)
        height = 2.0 * min(layers.heat_decay * layers.thickness, layers.depth)
        table = DifferenceTable(difference, ENTRIES, height, base.spacing, base.size, base.homogeneous.shape)
        return cls(base.response, base.spacing, base.size, base, radii, table)

    @property
    def series(self) -> EntrySeries:
        """The entries of the symbol."""
        return self.base.series

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

    def symbol(self, numbers: Sequence[int]) -> Iterator[tuple[int, Array]]:
        """Yield entries of the other fields as `base` does, then those of heat."""
        yield from self.base.symbol([number for number in numbers if number < self._first])
        for number in numbers:
            if number >= self._first and len(self.series.entry(number)[0]):
                yield number, self._heat_symbol(number)

    def _heat_symbol(self, number: int) -> Array:
        entry = number - self._first
        if isinstance(self.base, LayeredPeriodicGrid):
            return self._symbol_of_layers(self.base, entry)
        if isinstance(self.base, PeriodicGrid):
            return periodic_symbol(self.base, self._thermal, entry, self.series.parities is not None)
        return free_symbol(self._table(entry, self.size), self.series, number, self.padded)

    def _symbol_of_layers(self, base: LayeredPeriodicGrid, entry: int) -> Array:
        """Return an entry of the symbol of layers, with its finite response to a mean load."""
        layers = base.layers
        symbol = periodic_symbol(base.homogeneous, self._thermal, entry, layers.parities is not None)
        assert layers.heat_difference is not None
        add_waves(base, layers.heat_difference, entry, symbol, inverse_square=True)
        if entry < N_FIELDS:
            symbol[ZERO_FREQUENCY] = self._uniform[entry]
        return symbol

    @cached_property
    def _uniform(self) -> Array:
        assert isinstance(self.base, LayeredPeriodicGrid)
        layers = self.base.layers
        return uniform_heat(layers.body, layers.frame, mean_length(self.size, self.spacing))

    def _table(self, entry: int, size: tuple[int, int]) -> Array:
        """Return an entry of the response at offsets of a free grid, half of them if it is mirrored, see heat_table."""
        base = self.base.homogeneous if isinstance(self.base, LayeredFreeGrid) else self.base
        assert isinstance(base, FreeGrid)
        radius = float(self.reference_radii[entry % N_FIELDS])
        values = heat_table(self._thermal, entry, self.spacing, base.shape, size, radius)
        if self.table is None:
            return values
        is_half, ny = bool(mirror_parity(self.series.entry(self._first + entry)[0])), size[1]
        if is_half:
            values = values[:, values.shape[1] - ny :]  # all offsets of entries that are zero for the top material
        elif values.shape[1] == ny:
            values = unfold(values, mirror_parity(self._thermal.entry(entry)[0]))
        values += self.table.on(self.spacing, size).integrals([entry], is_half)[0]
        return values

    @cached_property
    def diagonal(self) -> Array:
        """Response (entries,) of a node to the density around it; odd functions vanish there."""
        values = self.base.diagonal.copy()
        for number in range(self._first, self._first + ENTRIES // 2):
            if not len(self.series.entry(number)[0]):
                continue
            if isinstance(self.base, FreeGrid | LayeredFreeGrid):
                table = self._table(number - self._first, (1, 1))
                values[number] = table[0, table.shape[1] // 2]
                continue
            values[number] = symbol_mean(self._heat_symbol(number), self.series.parities, number, self.size)
        return values

    def wave_response(self) -> GridResponse | None:
        """Return that of `base`: its inverse is that of each field and its neighbours without heat."""
        return self.base.wave_response()

    def coarsen(self) -> "HeatedGrid | None":
        """Return the response on the grid of every second node, with the same reference radius."""
        return self._on(self.base.coarsen())

    def restrict(self, size: tuple[int, int]) -> "HeatedGrid | None":
        """Return the response on a subgrid of that size, with the same reference radius; None on periodic grids."""
        return self._on(self.base.restrict(size))

    def _on(self, base: FreeGrid | PeriodicGrid | LayeredFreeGrid | LayeredPeriodicGrid | None) -> "HeatedGrid | None":
        if base is None:
            return None
        table = None if self.table is None else self.table.on(base.spacing, base.size)
        return replace(self, spacing=base.spacing, size=base.size, base=base, table=table)


def periodic_symbol(grid: PeriodicGrid, thermal: ThermalResponse, number: int, is_half: bool) -> Array:
    """Return an entry of y_h / q^2 times the transform of the density, zero for the mean load.

    Parameters
    ----------
    grid
        The grid.
    thermal
        Response to heat.
    number
        Number of the entry, see ThermalResponse.entry.
    is_half
        Whether all entries are even or odd along the second axis, so that its first half stands for all of it.
    """
    (nx, ny), (coefficients, is_odd) = grid.size, thermal.entry(number)
    count = ny // 2 + 1 if is_half else ny
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
