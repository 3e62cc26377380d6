"""An approximate inverse of the half space on its grid: wave by wave, as if the grid repeated itself."""

from collections.abc import Sequence
from itertools import product
from typing import Final

import numpy as np

from meeframe.plugin import Array
from meeframe_halfspace.convolution import Convolution, Spectrum, Symbol
from meeframe_halfspace.entries import entry_layout
from meeframe_halfspace.grid_response import full_entry

NEGLIGIBLE: Final = 1e-5
"""Entries this small relative to those of both fields alone are treated as zero."""


def wave_inverse(
    convolution: Convolution, fields: Sequence[int], waves: Symbol | None = None, resistances: Array | None = None
) -> Convolution:
    """Return the convolution that gives the loads of k fields for their displacements.

    On a periodic grid it is exact. On a free grid of p padded nodes along an axis, the p / 2 nodes respond to waves as
    their neighbours do on average: as if the response were multiplied by cos(2 pi x / p), which falls to zero like its
    part that wraps around, and preserves the shorter waves. Single precision is sufficient for preconditioning.

    waves: symbol on the padded grid from which the inverse is made in place of that of the convolution. The latter has
    errors of the order of the response at the end of the grid, which is large for a hard film on a soft substrate.
    resistances: (k,) in series with the response of each field to its own load; none by default.
    """
    source = convolution.symbol if waves is None else waves
    k, padded = len(fields), convolution.padded
    if not convolution.periodic:
        padded = padded[0] // 2, padded[1] // 2

    parities, layout = source.parities, entry_layout(len(convolution.scale))
    numbers = {number for row, column in product(fields, repeat=2) for number, *_ in layout.entries(row, column)}
    symbol, indices = source.entries(numbers)

    def entry(number: int, parity: float) -> Array | float:
        if number not in indices:
            return 0.0
        known = symbol[indices[number]].astype(np.float32)
        if convolution.periodic:
            return known
        if parities is not None:
            known = full_entry(known, parities[number], convolution.padded[1])
        return _between(known, parity)[:, :count]

    count = padded[1] if parities is None else padded[1] // 2 + 1
    matrix: Spectrum = np.zeros((k, k, padded[0] // 2 + 1, count), np.complex64)
    for row, field in enumerate(fields):
        for column, other in enumerate(fields[: row + 1]):
            matrix[row, column].real = entry(int(layout.real[field, other]), 1.0)
            if column != row:
                matrix[row, column].imag = layout.sign[field, other] * entry(int(layout.imaginary[field, other]), -1.0)
                matrix[column, row] = matrix[row, column].conj()
    if resistances is not None:
        for row, field in enumerate(fields):
            matrix[row, row].real += resistances[row] / convolution.scale[field, field]
    _invert(matrix)
    nonzero: dict[int, Array] = {}
    alone = [np.sqrt(np.abs(matrix[row, row]).max()) for row in range(k)]
    for (row, field), (column, other) in product(enumerate(fields), repeat=2):
        halves = (layout.real, matrix[row, column].real, 0.0), (layout.imaginary, matrix[row, column].imag, 1.0)
        for number, values, sign in halves:
            if layout.sign[field, other] >= sign and np.abs(values).max() > NEGLIGIBLE * alone[row] * alone[column]:
                nonzero[int(number[field, other])] = values
    result = Symbol.of(np.array(list(nonzero.values())), list(nonzero), parities)
    return Convolution(result, convolution.size, padded, 1.0 / convolution.scale.T, library=convolution.library)


def _between(entry: Array, parity: float) -> Array:
    """Return means (px // 4 + 1, py // 2) of a symbol's entry (px // 2 + 1, py) at the four waves by each even one.

    px, py: even; parity: 1 of entries that are even functions of the wave, -1 of odd ones.
    """
    odd = entry[1::2, 1::2]
    along = odd + np.roll(odd, 1, axis=1)  # of the waves 2 l - 1 and 2 l + 1
    around = np.empty((len(along) + 2, along.shape[1]), entry.dtype)
    around[1:-1] = along
    for row in (0, -1):  # beyond the first and the last row the spectrum continues with reversed wave numbers
        around[row] = parity * np.roll(along[row, ::-1], 1)
    return 0.25 * (around[:-1] + around[1:])[: (len(entry) - 1) // 2 + 1]


def _invert(matrix: Spectrum) -> None:
    """Invert matrices (k, k, px, py) in place, by elimination of one field after another.

    Pivoting is unnecessary: in scaled fields they are nearly definite in loads and fluxes each, with opposite signs.
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
