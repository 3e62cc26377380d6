"""Values of some nodes of a grid, gone on with beside them, and the transposed map.

Of all displacements that agree on the loaded nodes, that with the least energy belongs to a load on those alone: with
the inverse W of the compliance on the whole grid, the one of the compliance restricted to those nodes is the least of
E' W E over all extensions E from them. That with zeros is far from it where the loaded nodes end, and where they are
many small spots in a larger one. Here values fade away over a few scales, on each of which cells of 2 x 2 have the mean
of those in them, and those without any a part of the interpolation between cells twice as large.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit

from meeframe.fields import Array, Indices

LEVELS: Final = 4
"""Scales, each twice as large as the one before, ..."""
FIRST, OTHERS = 0.8, 0.7
"""... and the parts of the interpolation that cells without values have, nodes and larger ones: with these conjugate
gradients took the fewest steps on the rough surfaces of validation/benchmarks/half_space.py."""


@dataclass(frozen=True, eq=False)
class Pyramid:
    """Of cells around the nodes of a grid that repeats itself, single precision.

    places: (f,) of the nodes with values in the flattened grid, and cells: (f,) of those that hold them among the
    smallest; shares: (a, b) inverse of their number in each cell, zero where there are none, of the grid and of each
    larger scale.
    """

    places: Indices
    cells: Indices
    shares: tuple[Array, ...]

    @classmethod
    def of(cls, size: tuple[int, int], places: Indices) -> "Pyramid":
        """Of a grid of that size."""
        numbers: list[Array] = [np.zeros(size, np.float32)]
        numbers[0].ravel()[places] = 1.0
        for _ in range(LEVELS):
            numbers.append(_sums(numbers[-1]))
        inverses = (np.divide(1.0, number, out=np.zeros_like(number), where=number > 0.0) for number in numbers)
        rows, columns = np.divmod(places, size[1])
        return cls(places, rows // 2 * numbers[1].shape[1] + columns // 2, tuple(inverses))

    def extended(self, values: Array) -> Array:
        """Values (f,) of the nodes at all places, (a, b)."""
        sums: list[Array] = [np.zeros(self.shares[0].shape, np.float32)]
        sums[0].ravel()[self.places] = values
        for _ in range(LEVELS):
            sums.append(_sums(sums[-1]))
        whole = sums[-1] * self.shares[-1]
        for level in reversed(range(LEVELS)):
            interpolate(whole, _part(level), self.shares[level], sums[level])
            whole = sums[level]
        return whole

    def gathered(self, whole: Array) -> Array:
        """The transposed map, (f,) from (a, b)."""
        parts = [whole]
        for level, share in enumerate(self.shares[:-1]):
            larger = np.zeros(self.shares[level + 1].shape, np.float32)
            restrict(parts[-1], _part(level), share, larger)
            parts.append(larger)
        sums = parts[-1] * self.shares[-1]
        for level in reversed(range(1, LEVELS)):
            sums = add_to_cells(sums, parts[level], self.shares[level])
        gathered: Array = whole.take(self.places) + sums.take(self.cells)
        return gathered


def _part(level: int) -> float:
    return FIRST if level == 0 else OTHERS


def _sums(fine: Array) -> Array:
    """Over cells of 2 x 2, (a, b) -> (ceil(a / 2), ceil(b / 2))."""
    coarse = np.zeros((-(-fine.shape[0] // 2), -(-fine.shape[1] // 2)), np.float32)
    add_up(fine, coarse)
    return coarse


@njit(cache=True, nogil=True)
def add_up(fine, coarse):
    """coarse += sums of fine over cells of 2 x 2."""
    for i in range(fine.shape[0]):
        row, sums = fine[i], coarse[i // 2]
        for j in range(fine.shape[1] // 2):
            sums[j] += row[2 * j] + row[2 * j + 1]
        if fine.shape[1] % 2:
            sums[-1] += row[-1]


@njit(cache=True, nogil=True)
def add_to_cells(coarse, fine, shares):
    """fine shares + coarse at the cell that each belongs to."""
    sums = np.empty_like(fine)
    for i in range(fine.shape[0]):
        for j in range(fine.shape[1]):
            sums[i, j] = fine[i, j] * shares[i, j] + coarse[i // 2, j // 2]
    return sums


@njit(cache=True, nogil=True)
def interpolate(coarse, part, shares, fine):
    """fine = sums in fine times their shares, or the part of the values between coarse ones where there are none."""
    between = np.empty(coarse.shape[1] + 2, coarse.dtype)  # of the row, with the neighbours across its ends
    a, b = np.float32(0.75 * part), np.float32(0.25 * part)
    c, d = np.float32(0.75), np.float32(0.25)
    for i in range(fine.shape[0]):
        p = i // 2
        here, there = coarse[p], coarse[(p + 2 * (i % 2) - 1) % coarse.shape[0]]
        for j in range(len(here)):
            between[j + 1] = a * here[j] + b * there[j]
        between[0], between[-1] = between[-2], between[1]
        row, share = fine[i], shares[i]
        for j in range(fine.shape[1] // 2):
            left, right = c * between[j + 1] + d * between[j], c * between[j + 1] + d * between[j + 2]
            row[2 * j] = row[2 * j] * share[2 * j] if share[2 * j] > 0.0 else left
            row[2 * j + 1] = row[2 * j + 1] * share[2 * j + 1] if share[2 * j + 1] > 0.0 else right
        if fine.shape[1] % 2:
            row[-1] = row[-1] * share[-1] if share[-1] > 0.0 else c * between[-2] + d * between[-3]


@njit(cache=True, nogil=True)
def restrict(fine, part, shares, coarse):
    """coarse += what `interpolate` takes from it, transposed."""
    columns, width = fine.shape[1], coarse.shape[1]
    free = np.zeros(2 * width + 2, coarse.dtype)  # of the row, where there are no shares, with those across its ends
    between = np.empty(width, coarse.dtype)
    a, b = np.float32(0.75 * part), np.float32(0.25 * part)
    c, d, zero = np.float32(0.75), np.float32(0.25), np.float32(0.0)
    for i in range(fine.shape[0]):
        row, share = fine[i], shares[i]
        for j in range(columns):
            free[j + 1] = zero if share[j] > zero else row[j]
        free[0], free[-1] = free[-2], free[1]
        for j in range(width):
            between[j] = c * (free[2 * j + 1] + free[2 * j + 2]) + d * (free[2 * j] + free[2 * j + 3])
        p = i // 2
        q = (p + 2 * (i % 2) - 1) % coarse.shape[0]
        here, there = coarse[p], coarse[q]
        for j in range(width):
            here[j] += a * between[j]
        for j in range(width):
            there[j] += b * between[j]
