"""An approximate inverse of the half space on its grid: wave by wave, as if the grid repeated itself."""

from collections.abc import Sequence
from itertools import product
from typing import Final

import numpy as np
import scipy  # its parts load where they are used

from meeframe.core.fields import N_FIELDS, Array
from meeframe_halfspace.convolution import IMAGINARY, REAL, SIGN, Convolution, Spectrum, Symbol
from meeframe_halfspace.kernels import N_VALUES

NONE: Final = 1e-5
"""Entries so far below those of both fields alone are round-off, or as little."""


def wave_inverse(convolution: Convolution, fields: Sequence[int]) -> Convolution:
    """Loads of the given k fields from the displacements that they cause.

    A node in the middle tells the kernel. On a free grid that is tapered to zero half a grid away, which leaves the
    waves that are shorter as they are, and wrapped around; of a periodic one the inverse is exact. Single precision:
    what preconditions need not be better.
    """
    size, k = convolution.size, len(fields)
    middle = size[0] // 2, size[1] // 2
    load: Array = np.zeros((1, *size), np.float32)
    load[0, *middle] = 1.0
    unscaled = Convolution(convolution.symbol, size, convolution.padded, np.ones((N_FIELDS, N_FIELDS)))
    matrix = np.empty((k, k, size[0] // 2 + 1, size[1]), np.complex64)
    for column, loaded in enumerate(fields):
        kernel = np.roll(unscaled.response(load, [loaded], fields[column:]), (-middle[0], -middle[1]), axis=(1, 2))
        if not convolution.periodic:
            along, across = (np.cos(np.pi * scipy.fft.fftfreq(n)).astype(np.float32) for n in size)
            kernel *= np.outer(along, across)
        matrix[column:, column] = scipy.fft.rfftn(kernel, axes=(2, 1), overwrite_x=True)
        matrix[column, column:] = matrix[column:, column].conj()
    _invert(matrix)
    entries: Array = np.empty((N_VALUES, *matrix.shape[2:]), np.float32)
    numbers: list[int] = []
    alone = [np.sqrt(np.abs(matrix[row, row]).max()) for row in range(k)]
    for (row, field), (column, other) in product(enumerate(fields), repeat=2):
        parts = (REAL, matrix[row, column].real, 0.0), (IMAGINARY, matrix[row, column].imag, 1.0)
        for number, part, sign in parts:
            if SIGN[field, other] >= sign and np.abs(part).max() > NONE * alone[row] * alone[column]:
                numbers.append(int(number[field, other]))
                entries[numbers[-1]] = part
    return Convolution(Symbol.of(entries, numbers), size, size, 1.0 / convolution.scale.T)


def _invert(matrix: Spectrum) -> None:
    """Matrices (k, k, px, py) in place, by elimination of one field after another.

    Without pivots: in scaled fields they are nearly definite in loads and fluxes each, with opposite signs.
    """
    for i, pivot in enumerate(matrix):
        inverse = 1.0 / pivot[i]
        pivot[i] = 1.0
        pivot *= inverse
        for j, row in enumerate(matrix):
            if j != i:
                share = row[i].copy()
                row[i] = 0.0
                row -= share * pivot
