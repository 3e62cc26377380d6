"""Linear maps from loads on a regular grid to displacements on it, by real fast Fourier transforms."""

from dataclasses import dataclass
from typing import Final, Literal, final

import numba
import numpy as np
import scipy.fft

from meeframe.core.fields import N_FIELDS, Array
from meeframe_halfspace.cells import share_out
from meeframe_halfspace.kernels import N_SYMMETRIC, N_VALUES, fill_symbol, multiply
from meeframe_halfspace.response import PointResponse

Window = Literal["bilinear", "constant", "trigonometric"]

_POWERS: Final = {"trigonometric": 0, "constant": 1, "bilinear": 2}


@final
@dataclass(frozen=True, eq=False)
class Convolution:
    """response = symbol * load on a grid of `size` nodes inside a periodic one of `padded` nodes.

    symbol: (px, py // 2 + 1, 25) real: the symmetric entries are the real part, the antisymmetric ones the imaginary
    part of a Hermitian matrix (meeframe_halfspace.response). Padded with zeros to twice its size, the grid stands free.
    """

    symbol: Array
    size: tuple[int, int]
    padded: tuple[int, int]

    def apply(self, load: Array) -> Array:
        """Response (5, nx, ny) to a load (5, nx, ny), scaled fields."""
        (nx, ny), (px, py) = self.size, self.padded
        workers = numba.get_num_threads()
        spectra = np.zeros((N_FIELDS, px, py // 2 + 1), complex)
        for field in np.flatnonzero(load.any(axis=(1, 2))).tolist():
            rows = scipy.fft.rfft(load[field], py, axis=1, workers=workers)
            spectra[field] = scipy.fft.fft(rows, px, axis=0, overwrite_x=True, workers=workers)
        share_out(lambda first, last: multiply(spectra[:, first:last], self.symbol[first:last]), px)
        response = np.empty((N_FIELDS, nx, ny))
        for field in range(N_FIELDS):
            rows = scipy.fft.ifft(spectra[field], axis=0, overwrite_x=True, workers=workers)[:nx]
            response[field] = scipy.fft.irfft(rows, py, axis=1, workers=workers)[:, :ny]
        return response

    def own(self) -> Array:
        """Response (25,) of a node to the density around it, entries of the symmetric and the antisymmetric part."""
        px, py = self.padded
        twice = np.full(self.symbol.shape[1], 2.0)  # waves with their conjugates, but those that are their own
        twice[0] = 1.0
        if py % 2 == 0:
            twice[-1] = 1.0
        values: Array = np.einsum("ijk,j->k", self.symbol, twice) / (px * py)
        values[N_SYMMETRIC:] = 0.0  # an odd function at zero
        return values


def free_convolution(table: Array) -> Convolution:
    """Of the response to one cell, (25, nx, 2 ny - 1) as meeframe_halfspace.cells.cell_table gives it."""
    _, nx, wide = table.shape
    ny = (wide + 1) // 2
    px, py = (scipy.fft.next_fast_len(2 * n - 1, real=True) for n in (nx, ny))
    workers = numba.get_num_threads()
    symbol = np.empty((px, py // 2 + 1, N_VALUES))
    for entry, response in enumerate(table):
        symmetric = entry < N_SYMMETRIC
        kernel = np.zeros((px, py))
        _wrap(kernel, response, 1.0 if symmetric else -1.0)
        spectrum = scipy.fft.rfft2(kernel, overwrite_x=True, workers=workers)
        symbol[..., entry] = spectrum.real if symmetric else spectrum.imag
    return Convolution(symbol, (nx, ny), (px, py))


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
    symbol = np.empty((nx, len(waves[1]), N_VALUES))

    def fill(first: int, last: int) -> None:
        fill_symbol(first, last, waves[0], waves[1], windows[0], windows[1], nx, ny, even, odd, symbol)

    share_out(fill, nx)
    symbol[0, 0, :N_SYMMETRIC] = even[0, 0] * mean_length(size, spacing)
    return Convolution(symbol, size, size)


def mean_length(size: tuple[int, int], spacing: tuple[float, float]) -> float:
    """Length [m] by which a uniform load on a periodic surface is multiplied: 1/k of a wave as long as the period."""
    return float(np.sqrt(size[0] * spacing[0] * size[1] * spacing[1]) / (2.0 * np.pi))
