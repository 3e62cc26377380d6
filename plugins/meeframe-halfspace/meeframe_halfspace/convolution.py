"""Linear maps from loads on a regular grid to displacements on it, by real fast Fourier transforms."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal, final

import numba
import numpy as np
import scipy.fft
from numpy.typing import NDArray

from meeframe.core.fields import N_FIELDS, Array
from meeframe_halfspace.cells import share_out
from meeframe_halfspace.kernels import N_SYMMETRIC, N_VALUES, add_product, fill_symbol
from meeframe_halfspace.response import STRICT, UPPER, PointResponse

Window = Literal["bilinear", "constant", "trigonometric"]

Spectrum = NDArray[np.complex128]

_REAL, _IMAGINARY = np.zeros((2, N_FIELDS, N_FIELDS), np.int64)
"""Entries (5, 5) of the symbol that are real and imaginary part of its matrix, ..."""
_REAL[UPPER] = _REAL[UPPER[::-1]] = np.arange(N_SYMMETRIC)
_IMAGINARY[STRICT] = _IMAGINARY[STRICT[::-1]] = np.arange(N_SYMMETRIC, N_VALUES)
_SIGN: Final = np.triu(np.ones((N_FIELDS, N_FIELDS)), 1) - np.tril(np.ones((N_FIELDS, N_FIELDS)), -1)
"""... and the sign of the latter."""
HALVINGS: Final = 8
"""Sizes of padded grids are multiples of it, so that there are coarser grids."""
_POWERS: Final = {"trigonometric": 0, "constant": 1, "bilinear": 2}


@final
@dataclass(frozen=True, eq=False)
class Convolution:
    """response = symbol * load on a grid of `size` nodes inside a periodic one of `padded` nodes.

    symbol: 25 entries (px, py // 2 + 1), real: the symmetric ones are the real part, the antisymmetric ones the
    imaginary part of a Hermitian matrix (meeframe_halfspace.response). Padded with zeros to twice its size, the grid
    stands free.
    """

    symbol: Sequence[Array]
    size: tuple[int, int]
    padded: tuple[int, int]

    @property
    def periodic(self) -> bool:
        """Whether the grid repeats itself."""
        return self.size == self.padded

    def apply(self, load: Array) -> Array:
        """Response (5, nx, ny) to a load (5, nx, ny), scaled fields."""
        return self.response({field: part for field, part in enumerate(load) if part.any()}, range(N_FIELDS))

    def response(self, load: Mapping[int, Array], fields: Sequence[int]) -> Array:
        """In k fields alone, (k, nx, ny), to the loads (nx, ny) of some fields; one transform for each of both."""
        (nx, ny), (px, py) = self.size, self.padded
        workers = numba.get_num_threads()
        if not load:
            return np.zeros((len(fields), nx, ny))
        spectra = {}
        for field, part in load.items():
            rows = scipy.fft.rfft(part, py, axis=1, workers=workers)
            spectra[field] = scipy.fft.fft(rows, px, axis=0, overwrite_x=True, workers=workers)
        response = np.empty((len(fields), nx, ny))
        for place, field in enumerate(fields):
            product = self._product(field, spectra, last=place == len(fields) - 1)
            rows = scipy.fft.ifft(product, axis=0, overwrite_x=True, workers=workers)[:nx]
            response[place] = scipy.fft.irfft(rows, py, axis=1, workers=workers)[:, :ny]
        return response

    def _product(self, field: int, spectra: dict[int, Spectrum], last: bool) -> Spectrum:
        """Spectrum of the response in a field; the last one of a single load may take its place."""
        if last and list(spectra) == [field]:
            spectra[field] *= self.symbol[_REAL[field, field]]
            return spectra[field]
        product = np.zeros(next(iter(spectra.values())).shape, complex)

        def add(first: int, end: int) -> None:
            rows = slice(first, end)
            for other, spectrum in spectra.items():
                real, imaginary = self.symbol[_REAL[field, other]], self.symbol[_IMAGINARY[field, other]]
                add_product(real[rows], imaginary[rows], _SIGN[field, other], spectrum[rows], product[rows])

        share_out(add, len(product))
        return product

    def own(self) -> Array:
        """Response (25,) of a node to the density around it, entries of the symmetric and the antisymmetric part."""
        px, py = self.padded
        twice = np.full(py // 2 + 1, 2.0)  # waves with their conjugates, but those that are their own
        twice[0] = 1.0
        if py % 2 == 0:
            twice[-1] = 1.0
        values = np.array([entry.sum(axis=0) @ twice for entry in self.symbol]) / (px * py)
        values[N_SYMMETRIC:] = 0.0  # an odd function at zero
        return values


def free_convolution(table: Array) -> Convolution:
    """Of the response to one cell, (25, nx, 2 ny - 1) as meeframe_halfspace.cells.cell_table gives it."""
    _, nx, wide = table.shape
    ny = (wide + 1) // 2
    px, py = (HALVINGS * scipy.fft.next_fast_len(-(-(2 * n - 1) // HALVINGS), real=True) for n in (nx, ny))
    workers = numba.get_num_threads()
    symbol = np.empty((N_VALUES, px, py // 2 + 1))
    for entry, response in enumerate(table):
        symmetric = entry < N_SYMMETRIC
        kernel = np.zeros((px, py))
        _wrap(kernel, response, 1.0 if symmetric else -1.0)
        spectrum = scipy.fft.rfft2(kernel, overwrite_x=True, workers=workers)
        symbol[entry] = spectrum.real if symmetric else spectrum.imag
    return Convolution(tuple(symbol), (nx, ny), (px, py))


def _wrap(kernel: Array, response: Array, parity: float) -> None:
    """Enter the response, (nx, 2 ny - 1), of offsets (i, j) and by parity (-i, -j), negative ones from the end."""
    nx, wide = response.shape
    ny = (wide + 1) // 2
    kernel[:nx, :ny] = response[:, ny - 1 :]
    kernel[:nx, kernel.shape[1] - ny + 1 :] = response[:, : ny - 1]
    turned = parity * response[:0:-1, ::-1]  # offsets from (1 - nx, 1 - ny) to (-1, ny - 1)
    kernel[kernel.shape[0] - nx + 1 :, :ny] = turned[:, ny - 1 :]
    kernel[kernel.shape[0] - nx + 1 :, kernel.shape[1] - ny + 1 :] = turned[:, : ny - 1]


def periodic_convolution(
    response: PointResponse, spacing: tuple[float, float], shape: Window, size: tuple[int, int]
) -> Convolution:
    """Of a surface that repeats itself after `size` nodes `spacing` [m] apart.

    A wave q answers with Y(q)/|q| times the transform of the density around a node, which is 1 for trigonometric. Waves
    shorter than the grid resolves are left out. The mean load has no finite response: here it answers as a wave as long
    as the period, averaged over all directions. That says from which plane displacements and potentials count, and
    keeps the compliance positive definite.
    """
    nx, ny = size
    waves = [2.0 * np.pi * scipy.fft.fftfreq(nx, spacing[0]), 2.0 * np.pi * scipy.fft.rfftfreq(ny, spacing[1])]
    power = _POWERS[shape]
    windows = [np.sinc(q * h / (2.0 * np.pi)) ** power for q, h in zip(waves, spacing, strict=True)]
    even, odd = response.wave_series()
    symbol = np.empty((N_VALUES, nx, len(waves[1])))

    def fill(first: int, last: int) -> None:
        fill_symbol(first, last, waves[0], waves[1], windows[0], windows[1], nx, ny, even, odd, symbol)

    share_out(fill, nx)
    symbol[:N_SYMMETRIC, 0, 0] = even[0, 0] * mean_length(size, spacing)
    return Convolution(tuple(symbol), size, size)


def mean_length(size: tuple[int, int], spacing: tuple[float, float]) -> float:
    """Length [m] by which a uniform load on a periodic surface is multiplied: 1/k of a wave as long as the period."""
    return float(np.sqrt(size[0] * spacing[0] * size[1] * spacing[1]) / (2.0 * np.pi))
