"""Square cells with constant densities, the grid of the half spaces in closed form."""

import numpy as np

from meeframe.common.errors import MeeframeError
from meeframe.fields import Array
from meeframe.system.dense import DenseSystem
from meeframe.system.reduced import NodalFields


def cell_centres(side: float, cells: int) -> tuple[Array, Array]:
    """Return the coordinates (n,) [m] of the centres of cells x cells cells on |x|, |y| < side/2, x running fastest."""
    centres = (np.arange(cells) + 0.5) * (side / cells) - side / 2
    x, y = (grid.ravel() for grid in np.meshgrid(centres, centres))
    return x, y


def cell_system(matrix: Array, side: float, offset: Array | None = None) -> DenseSystem:
    """Return the reduced system of a compliance between densities on the cells and displacements at their centres.

    Parameters
    ----------
    matrix
        Compliance (n, f, n, f).
    side
        Side of the square [m].
    offset
        Offset (n, f) as in ReducedSystem; zero by default.
    """
    n = len(matrix)
    cells = round(n**0.5)
    x, y = cell_centres(side, cells)
    return DenseSystem(
        points=np.column_stack([x, y, np.zeros(n)]),
        frames=np.tile(np.eye(3), (n, 1, 1)),
        weights=np.full(n, (side / cells) ** 2),
        cells=(),
        offset=np.zeros((n, matrix.shape[1])) if offset is None else offset,
        matrix=matrix,
        recovery=_refuse,
    )


def _refuse(_load: Array) -> NodalFields:
    raise MeeframeError("this half space is its contact zone only")
