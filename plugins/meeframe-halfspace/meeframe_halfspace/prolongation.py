"""Prolongation of values at some nodes of a grid to all nodes, and the transposed map.

Among all displacements that agree on the loaded nodes, the one with the least energy belongs to a load on these nodes
only. With the inverse W of the compliance on the whole grid, the inverse of the compliance restricted to the loaded
nodes is the minimum of P' W P over all prolongations P from them. Prolongation by zeros is far from the minimum at the
border of the loaded nodes and where these are many small spots. Here values decay over a few levels: on each of them
cells of 2 x 2 have the mean of the values in them, and empty cells a fraction of the interpolation between cells twice
as large.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from meeframe.plugin import Array, Indices

LEVELS: Final = 4
"""Number of levels, each with cells twice as wide as the one before."""
FINEST_FRACTION, COARSE_FRACTION = 0.8, 0.7
"""Fractions of the interpolated value in empty cells, on the finest level and on the others: with these values
conjugate gradients took the fewest iterations on the rough surfaces of validation/benchmarks/half_space.py."""


@dataclass(frozen=True, eq=False)
class MultilevelProlongation:
    """Prolongation on the levels of a periodic grid, in single precision.

    Attributes
    ----------
    places
        Positions (f,) of the nodes with values in the flattened grid.
    cells
        Numbers (f,) of the cells of 2 x 2 that contain them.
    inverse_counts
        For the grid, as bytes, and each coarser level the inverse number of nodes in each cell, (a, b), zero if there
        are none.
    """

    places: Indices
    cells: Indices
    inverse_counts: tuple[NDArray[Any], ...]

    @classmethod
    def of(cls, size: tuple[int, int], places: Indices) -> "MultilevelProlongation":
        """Create the prolongation from nodes at these positions (f,) of a grid of this size."""
        numbers: list[NDArray[Any]] = [np.zeros(size, np.uint8)]
        numbers[0].ravel()[places] = 1
        for _ in range(LEVELS):
            numbers.append(_sums(numbers[-1]))
        inverses = [np.divide(1.0, number, out=np.zeros_like(number), where=number > 0.0) for number in numbers[1:]]
        rows, columns = np.divmod(places, size[1])
        return cls(places, rows // 2 * numbers[1].shape[1] + columns // 2, (numbers[0], *inverses))

    def prolong(self, values: Array) -> Array:
        """Return values at all nodes, (a, b), from values (f,) of the nodes with values."""
        sums: list[Array] = [np.zeros(self.inverse_counts[0].shape, np.float32)]
        sums[0].ravel()[self.places] = values
        for _ in range(LEVELS):
            sums.append(_sums(sums[-1]))
        field = sums[-1] * self.inverse_counts[-1]
        for level in reversed(range(LEVELS)):
            interpolate(field, _fraction(level), self.inverse_counts[level], sums[level])
            field = sums[level]
        return field

    def restrict(self, field: Array) -> Array:
        """Return the transposed map, (f,) from (a, b)."""
        levels = [field]
        for level, inverse_count in enumerate(self.inverse_counts[:-1]):
            coarse = np.zeros(self.inverse_counts[level + 1].shape, np.float32)
            restrict_level(levels[-1], _fraction(level), inverse_count, coarse)
            levels.append(coarse)
        sums = levels[-1] * self.inverse_counts[-1]
        for level in reversed(range(1, LEVELS)):
            sums = add_to_cells(sums, levels[level], self.inverse_counts[level])
        restricted: Array = field.take(self.places) + sums.take(self.cells)
        return restricted


def _fraction(level: int) -> float:
    return FINEST_FRACTION if level == 0 else COARSE_FRACTION


def _sums(fine: NDArray[Any]) -> Array:
    """Return sums over cells of 2 x 2, (a, b) -> (ceil(a / 2), ceil(b / 2))."""
    coarse = np.zeros((-(-fine.shape[0] // 2), -(-fine.shape[1] // 2)), np.float32)
    add_up(fine, coarse)
    return coarse


@njit(cache=True, nogil=True)
def add_up(fine, coarse):
    """Add sums of fine values over cells of 2 x 2 to coarse."""
    for i in range(fine.shape[0]):
        row, sums = fine[i], coarse[i // 2]
        for j in range(fine.shape[1] // 2):
            sums[j] += row[2 * j] + row[2 * j + 1]
        if fine.shape[1] % 2:
            sums[-1] += row[-1]


@njit(cache=True, nogil=True)
def add_to_cells(coarse, fine, inverse_counts):
    """Return fine values times inverse counts plus the coarse value of the cell of each."""
    sums = np.empty_like(fine)
    for i in range(fine.shape[0]):
        for j in range(fine.shape[1]):
            sums[i, j] = fine[i, j] * inverse_counts[i, j] + coarse[i // 2, j // 2]
    return sums


@njit(cache=True, nogil=True)
def interpolate(coarse, fraction, inverse_counts, fine):
    """Replace sums in fine by means, and by a fraction of interpolated coarse values in empty cells."""
    between = np.empty(coarse.shape[1] + 2, coarse.dtype)  # values of the row, periodically continued
    a, b = np.float32(0.75 * fraction), np.float32(0.25 * fraction)
    c, d = np.float32(0.75), np.float32(0.25)
    for i in range(fine.shape[0]):
        p = i // 2
        center_row, neighbour_row = coarse[p], coarse[(p + 2 * (i % 2) - 1) % coarse.shape[0]]
        for j in range(len(center_row)):
            between[j + 1] = a * center_row[j] + b * neighbour_row[j]
        between[0], between[-1] = between[-2], between[1]
        row, inverse_count = fine[i], inverse_counts[i]
        for j in range(fine.shape[1] // 2):
            left, right = c * between[j + 1] + d * between[j], c * between[j + 1] + d * between[j + 2]
            row[2 * j] = row[2 * j] * inverse_count[2 * j] if inverse_count[2 * j] > 0.0 else left
            row[2 * j + 1] = row[2 * j + 1] * inverse_count[2 * j + 1] if inverse_count[2 * j + 1] > 0.0 else right
        if fine.shape[1] % 2:
            row[-1] = row[-1] * inverse_count[-1] if inverse_count[-1] > 0.0 else c * between[-2] + d * between[-3]


@njit(cache=True, nogil=True)
def restrict_level(fine, fraction, inverse_counts, coarse):
    """Add the transpose of `interpolate` to coarse."""
    columns, width = fine.shape[1], coarse.shape[1]
    free = np.zeros(2 * width + 2, coarse.dtype)  # values of the row in empty cells, periodically continued
    between = np.empty(width, coarse.dtype)
    a, b = np.float32(0.75 * fraction), np.float32(0.25 * fraction)
    c, d, zero = np.float32(0.75), np.float32(0.25), np.float32(0.0)
    for i in range(fine.shape[0]):
        row, inverse_count = fine[i], inverse_counts[i]
        for j in range(columns):
            free[j + 1] = zero if inverse_count[j] > zero else row[j]
        free[0], free[-1] = free[-2], free[1]
        for j in range(width):
            between[j] = c * (free[2 * j + 1] + free[2 * j + 2]) + d * (free[2 * j] + free[2 * j + 3])
        p = i // 2
        q = (p + 2 * (i % 2) - 1) % coarse.shape[0]
        center_row, neighbour_row = coarse[p], coarse[q]
        for j in range(width):
            center_row[j] += a * between[j]
        for j in range(width):
            neighbour_row[j] += b * between[j]
