"""Responses of free and periodic grids to the density around one node; transforms are made on demand."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, Literal, Protocol, final

import numba
import numpy as np
import scipy  # submodules are loaded on first use

from meeframe.plugin import Array, Indices
from meeframe_halfspace.cells import Shape, cell_table, far_tables, near_size, share_out, unfold
from meeframe_halfspace.kernels import fill_symbol
from meeframe_halfspace.response import PointResponse, mirror_parity, series_entry

Window = Literal["bilinear", "constant", "trigonometric"]
POWERS: Final = {"trigonometric": 0, "constant": 1, "bilinear": 2}


class EntrySeries(Protocol):
    """The entries of a response and their symmetries; see PointResponse."""

    @property
    def numbers(self) -> list[int]:
        """Numbers of the nonzero entries."""

    @property
    def parities(self) -> Indices | None:
        """Parities of the entries if each is an even or odd function of the angle."""

    def entry(self, number: int) -> tuple[Array, bool]:
        """Return the series (n, 2) of an entry, and True if its harmonics are odd."""


@dataclass(frozen=True, eq=False)
class GridResponse(ABC):
    """The response of a half space on a grid of `size` nodes, `spacing` [m] apart, in scaled fields.

    response: that of a half space of the material at the surface.
    """

    response: PointResponse
    spacing: tuple[float, float]
    size: tuple[int, int]

    @property
    @abstractmethod
    def series(self) -> EntrySeries:
        """The entries of the symbol."""

    @property
    @abstractmethod
    def padded(self) -> tuple[int, int]:
        """Size of the periodic grid to which the symbol belongs."""

    @abstractmethod
    def symbol(self, numbers: Sequence[int]) -> Iterator[tuple[int, Array]]:
        """Yield the nonzero ones among some entries, see Symbol, with the parities of the response."""

    @property
    @abstractmethod
    def diagonal(self) -> Array:
        """Response (entries,) of a node to the density around it."""

    @abstractmethod
    def wave_response(self) -> "GridResponse | None":
        """Return the response to waves on the padded grid if its inverse approximates that of a free grid better."""

    @abstractmethod
    def coarsen(self) -> "GridResponse | None":
        """Return the response on a grid of every second node; None if that does not fit."""

    @abstractmethod
    def restrict(self, size: tuple[int, int]) -> "GridResponse | None":
        """Return the response on a subgrid of that size; None on periodic grids, whose subgrids are not periodic."""


@final
@dataclass(frozen=True, eq=False)
class FreeGrid(GridResponse):
    """The response of a free grid.

    Attributes
    ----------
    shape
        Shape of the density around a node.
    near
        All entries near the node, None if not known.
    """

    shape: Shape
    near: Array | None = None

    @property
    def series(self) -> EntrySeries:
        """The entries of the symbol."""
        return self.response

    @property
    def padded(self) -> tuple[int, int]:
        """An even size, at least twice that of the grid, for `wave_inverse`."""
        px, py = (2 * int(scipy.fft.next_fast_len(n, real=True)) for n in self.size)
        return px, py

    @cached_property
    def _near(self) -> Array:
        """All entries near the node, see cell_table."""
        if self.near is not None:
            return self.near
        return cell_table(self.response, self.spacing, self.shape, near_size(self.spacing, self.size))

    def tables(self, numbers: Sequence[int]) -> Iterator[tuple[int, Array]]:
        """Yield the nonzero ones among some entries, (nx, 2 ny - 1) or (nx, ny), exact also near the node."""
        for number, table in far_tables(self.response, self.spacing, self.shape, self.size, numbers):
            near = self._near[number]
            half_width = near.shape[1] // 2
            if table.shape[1] == self.size[1]:
                table[: len(near), : half_width + 1] = near[:, half_width:]
            else:
                table[: len(near), self.size[1] - 1 - half_width : self.size[1] + half_width] = near
            yield number, table

    def complete_tables(self, numbers: Sequence[int], is_half: bool) -> dict[int, Array]:
        """Return the nonzero ones among some entries: (nx, ny) if `is_half`, else (nx, 2 ny - 1)."""
        result = {}
        for number, table in self.tables(numbers):
            unfolds = not is_half and table.shape[1] == self.size[1]
            result[number] = unfold(table, mirror_parity(self.response.entry(number)[0])) if unfolds else table
        return result

    def symbol(self, numbers: Sequence[int]) -> Iterator[tuple[int, Array]]:
        """Yield entries by integration over the density around the node, exact to round-off."""
        for number, table in self.tables(numbers):
            yield number, free_symbol(table, self.response, number, self.padded)

    @property
    def diagonal(self) -> Array:
        """Response (entries,) of a node to the density around it."""
        values = self._near[:, 0, self._near.shape[2] // 2].copy()
        values[self.response.layout.n_symmetric :] = 0.0  # odd functions vanish at zero
        return values

    def wave_response(self) -> None:
        """Return None: the symbol of the free grid serves as well."""
        return

    def coarsen(self) -> "FreeGrid":
        """Return the coarser grid; as of 1/r, the response at as many spacings is twice that of the finer one."""
        spacing, size = _double(self.spacing), _halve(self.size)
        return replace(self, spacing=spacing, size=size, near=2.0 * self._near_box(near_size(spacing, size)))

    def restrict(self, size: tuple[int, int]) -> "FreeGrid":
        """Return the response without the nodes around the subgrid."""
        return replace(self, size=size, near=self._near_box(near_size(self.spacing, size)))

    def _near_box(self, size: tuple[int, int]) -> Array:
        """Return the entries near the node on a grid of that size."""
        (nx, ny), middle = size, self._near.shape[2] // 2
        return self._near[:, :nx, middle - ny + 1 : middle + ny]


@final
@dataclass(frozen=True, eq=False)
class PeriodicGrid(GridResponse):
    """The response of a surface that repeats itself after `size` nodes.

    The response to a wave q is Y(q)/|q| times the transform of the density around a node, which is 1 for trigonometric.
    Waves shorter than the grid resolves are left out. The mean load has no finite response; here it is that to a wave
    as long as the period, averaged over all directions. This defines the plane from which displacements count, and
    keeps the compliance positive definite.
    """

    shape: Window

    @property
    def series(self) -> EntrySeries:
        """The entries of the symbol."""
        return self.response

    @property
    def padded(self) -> tuple[int, int]:
        """The size of the grid."""
        return self.size

    def symbol(self, numbers: Sequence[int]) -> Iterator[tuple[int, Array]]:
        """Yield entries from the series of the surface compliance."""
        count = self.size[1] if self.response.parities is None else self.size[1] // 2 + 1
        for number in numbers:
            entry = self.wave_entry(number, count)
            if entry is not None:
                yield number, entry

    def waves(self, count: int) -> tuple[list[Array], list[Array]]:
        """Return wave numbers (nx // 2 + 1,), (count,), and the transforms of the density along both axes."""
        waves = [
            2.0 * np.pi * scipy.fft.rfftfreq(self.size[0], self.spacing[0]),
            2.0 * np.pi * scipy.fft.fftfreq(self.size[1], self.spacing[1])[:count],
        ]
        power = POWERS[self.shape]
        return waves, [np.sinc(q * h / (2.0 * np.pi)) ** power for q, h in zip(waves, self.spacing, strict=True)]

    def wave_entry(self, number: int, count: int) -> Array | None:
        """Return an entry (nx // 2 + 1, count) of the symbol, for the first wave numbers along the second axis."""
        nx, ny = self.size
        even, odd = self.response.wave_series()
        coefficients, antisymmetric = series_entry(even, odd, number)
        if not len(coefficients):
            return None
        waves, windows = self.waves(count)
        symbol = np.empty((len(waves[0]), count))

        def fill(first: int, last: int) -> None:
            fill_symbol(first, last, *waves, *windows, nx, ny, coefficients, antisymmetric, symbol)

        share_out(fill, len(symbol))
        if not antisymmetric:
            symbol[0, 0] = coefficients[0, 0] * mean_length(self.size, self.spacing)
        return symbol

    @property
    def diagonal(self) -> Array:
        """Response (entries,) of a node to the density around it."""
        return periodic_diagonal(self)

    def wave_response(self) -> None:
        """Return None: the symbol of the grid is that of the waves."""
        return

    def coarsen(self) -> "PeriodicGrid | None":
        """Return the coarser grid; None unless numbers of nodes are even."""
        if any(n % 2 for n in self.size):
            return None
        return replace(self, spacing=_double(self.spacing), size=_halve(self.size))

    def restrict(self, size: tuple[int, int]) -> None:
        """Return None: subgrids of a period are not periodic."""
        return


def periodic_diagonal(grid: GridResponse) -> Array:
    """Return the response (entries,) of a node of a periodic grid to the density around it, the mean of the symbol."""
    layout = grid.response.layout
    values = np.zeros(layout.n_values)  # odd functions vanish at zero
    for number, symbol in grid.symbol(range(layout.n_symmetric)):
        values[number] = symbol_mean(symbol, grid.series.parities, number, grid.size)
    return values


def symbol_mean(symbol: Array, parities: Indices | None, number: int, size: tuple[int, int]) -> float:
    """Return the mean of an entry of the symbol of a periodic grid of this size over all waves."""
    nx, ny = size
    multiplicity = np.full(nx // 2 + 1, 2.0)  # waves with their conjugates, except real ones
    multiplicity[0] = 1.0
    if nx % 2 == 0:
        multiplicity[-1] = 1.0
    full = symbol if parities is None else full_entry(symbol, parities[number], ny)
    return float(multiplicity @ full.sum(axis=1) / (nx * ny))


def mean_length(size: tuple[int, int], spacing: tuple[float, float]) -> float:
    """Return the factor [m] of a uniform load on a periodic surface: 1/k of a wave as long as the period."""
    return float(np.sqrt(size[0] * spacing[0] * size[1] * spacing[1]) / (2.0 * np.pi))


def free_symbol(table: Array, response: EntrySeries, number: int, padded: tuple[int, int]) -> Array:
    """Return an entry of a symbol, see Symbol, from its table.

    Parameters
    ----------
    table
        Table (nx, 2 ny - 1) or (nx, ny), see far_tables.
    response
        Response of the half space.
    number
        Number of the entry.
    padded
        Size (px, py) of the padded grid, even.
    """
    coefficients, odd = response.entry(number)
    parity, mirror = (-1 if odd else 1), mirror_parity(coefficients)
    if mirror:
        half = _half_symbol(table, (parity * mirror, mirror), padded)
        return half if response.parities is not None else full_entry(half, mirror, padded[1])
    kernel = np.zeros(padded, table.dtype)
    _wrap(kernel, table, float(parity))
    spectrum = scipy.fft.rfftn(kernel, axes=(1, 0), overwrite_x=True, workers=numba.get_num_threads())
    return np.ascontiguousarray(spectrum.imag if odd else spectrum.real)


def _wrap(kernel: Array, response: Array, parity: float) -> None:
    """Enter the response, (nx, 2 ny - 1), at offsets (i, j) and by parity at (-i, -j), negative ones from the end."""
    nx, wide = response.shape
    ny = (wide + 1) // 2
    kernel[:nx, :ny] = response[:, ny - 1 :]
    kernel[:nx, kernel.shape[1] - ny + 1 :] = response[:, : ny - 1]
    reflected = parity * response[:0:-1, ::-1]  # offsets from (1 - nx, 1 - ny) to (-1, ny - 1)
    kernel[kernel.shape[0] - nx + 1 :, :ny] = reflected[:, ny - 1 :]
    kernel[kernel.shape[0] - nx + 1 :, kernel.shape[1] - ny + 1 :] = reflected[:, : ny - 1]


def full_entry(half: Array, parity: int, width: int) -> Array:
    """Return the entry (n, width) of a symbol that is even or odd along its rows from its half (n, width // 2 + 1)."""
    return np.concatenate([half, parity * half[:, (width - 1) // 2 : 0 : -1]], axis=1)


def _half_symbol(quarter: Array, parities: tuple[int, int], padded: tuple[int, int]) -> Array:
    """Return an entry (px // 2 + 1, py // 2 + 1) of a symbol from its kernel at nonnegative offsets, (nx, ny).

    parities: 1 or -1 along each axis, for an even or odd kernel; padded: (px, py), even.
    """
    (along, across), (px, py) = parities, padded
    half = _half_spectrum(_half_spectrum(quarter, along, px, 0), across, py, 1)
    return np.negative(half, out=half) if along == across == -1 else half  # i squared


def _half_spectrum(half: Array, parity: int, padded: int, axis: int) -> Array:
    """Return the transform, padded // 2 + 1 along an axis, of even or odd functions from zero on.

    The factor i of odd functions is omitted.
    """
    middle, workers = padded // 2, numba.get_num_threads()
    if parity == 1:
        return np.asarray(scipy.fft.dct(half, 1, middle + 1, axis, workers=workers))
    spectrum = np.zeros((middle + 1, half.shape[1]) if axis == 0 else (half.shape[0], middle + 1))
    positive, inside = (values[1:] if axis == 0 else values[:, 1:] for values in (half, spectrum))
    if positive.size:  # else one row of nodes, at zero
        inside = inside[:-1] if axis == 0 else inside[:, :-1]
        np.negative(scipy.fft.dst(positive, 1, middle - 1, axis, workers=workers), out=inside)
    return spectrum


def _double(spacing: tuple[float, float]) -> tuple[float, float]:
    return 2.0 * spacing[0], 2.0 * spacing[1]


def _halve(size: tuple[int, int]) -> tuple[int, int]:
    return (size[0] + 1) // 2, (size[1] + 1) // 2
