"""Half spaces on every second node: loads go on bilinearly between them, displacements are looked at there alone."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, final, overload

import numpy as np

from meeframe.core.fields import Array
from meeframe.core.mesh import Indices
from meeframe_halfspace.convolution import Convolution
from meeframe_halfspace.grid import Grid
from meeframe_halfspace.kernels import N_SYMMETRIC, N_VALUES

FEWEST: Final = 24
"""Nodes along an axis of the coarsest grid."""


def coarse_grid(grid: Grid, convolution: Convolution) -> Grid | None:
    """The grid of every second node, numbered anew row by row; None if it is too coarse or does not fit."""
    size = tuple((n + 1) // 2 for n in grid.size)
    if min(size) < FEWEST or any(n % 2 for n in convolution.padded):
        return None
    spacing = 2.0 * grid.spacing[0], 2.0 * grid.spacing[1]
    return Grid(np.arange(size[0] * size[1]).reshape(size), spacing, grid.frame)


def coarse_convolution(convolution: Convolution) -> Convolution:
    """Response at every second node to densities that are bilinear between every second node."""
    (nx, ny), (px, py) = convolution.size, convolution.padded
    symbol = FoldedSymbol(convolution.symbol, py)
    return Convolution(symbol, ((nx + 1) // 2, (ny + 1) // 2), (px // 2, py // 2))


def coarse_cells(grid: Grid) -> tuple[tuple[str, Indices], ...]:
    """Quadrilaterals between the nodes of a grid."""
    nodes = grid.nodes
    corners = nodes[:-1, :-1], nodes[1:, :-1], nodes[1:, 1:], nodes[:-1, 1:]
    return (("quad", np.stack([corner.ravel() for corner in corners], axis=1)),)


def bilinear(values: Array, size: tuple[int, int], periodic: bool) -> Array:
    """Values (k, cx, cy) at every second node of a grid of that size, at all of its nodes, (k, nx, ny).

    Beyond the border they fall to zero in one of their spacings, unless the grid repeats itself.
    """
    fine = np.empty((len(values), *size))
    fine[:, ::2, ::2] = values
    fine[:, 1::2, ::2] = _between(values, periodic)[:, : size[0] // 2]
    fine[:, :, 1::2] = _between(fine[:, :, ::2].swapaxes(1, 2), periodic).swapaxes(1, 2)[:, :, : size[1] // 2]
    return fine


def _between(values: Array, periodic: bool) -> Array:
    """Means of values (k, m, l) and the next ones along the second axis; zero is beyond the last unless periodic."""
    means = 0.5 * values
    means[:, :-1] += 0.5 * values[:, 1:]
    if periodic:
        means[:, -1] += 0.5 * values[:, 0]
    return means


@final
@dataclass(frozen=True, eq=False)
class FoldedSymbol(Sequence[Array]):
    """Entries of the symbol of a coarse convolution, (px / 2, py / 4 + 1) each, made when they are asked for.

    fine: entries (px, py // 2 + 1) of the finer one, whose py is `columns`. Seen at every second node, waves that
    differ by its wave number are the same; the four of them add up, each with the transform of the bilinear density.
    """

    fine: Sequence[Array]
    columns: int
    made: dict[int, Array] = field(default_factory=dict)

    def __len__(self) -> int:
        return N_VALUES

    @overload
    def __getitem__(self, entry: int) -> Array: ...
    @overload
    def __getitem__(self, entry: slice) -> Sequence[Array]: ...
    def __getitem__(self, entry: int | slice) -> Array | Sequence[Array]:
        if isinstance(entry, slice):
            return [self[place] for place in range(*entry.indices(N_VALUES))]
        if entry not in self.made:
            self.made[entry] = _folded(self.fine[entry], self.columns, 1.0 if entry < N_SYMMETRIC else -1.0)
        return self.made[entry]


def _folded(symbol: Array, columns: int, parity: float) -> Array:
    """One entry on the coarser grid; parity: of the entry, which is that of its conjugate wave."""
    rows, half = len(symbol), columns // 2
    kept = half // 2 + 1
    across = 0.5 + 0.5 * np.cos(2.0 * np.pi / columns * np.arange(half + 1))
    along = 0.5 + 0.5 * np.cos(2.0 * np.pi / rows * np.arange(rows))
    # the wave beyond the highest one along the rows is the conjugate of one that is kept
    mirrored = (symbol * across)[:, half : half - kept : -1]
    sums = symbol[:, :kept] * across[:kept]
    sums[0] += parity * mirrored[0]
    sums[1:] += parity * mirrored[:0:-1]
    sums *= along[:, None]
    folded: Array = sums[: rows // 2] + sums[rows // 2 :]
    return folded
