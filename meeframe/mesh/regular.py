"""Contact zones that are simpler than a general mesh: one frame for all nodes, and nodes on a rectangular grid."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar, cast, final

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin
from numpy.typing import NDArray

from meeframe.fields import Array, Indices

Entry = TypeVar("Entry", np.float64, np.int64)
Cells = Sequence[tuple[str, Indices]]
"""Pairs of a meshio cell type and its connectivity."""


@final
@dataclass(frozen=True)
class GridCells(Sequence[tuple[str, Indices]]):
    """Cells of a grid of nodes that are numbered row by row: one block of quadrilaterals, made whenever it is read.

    Attributes
    ----------
    shape : tuple of int
        Numbers (nx, ny) of nodes.
    """

    shape: tuple[int, int]

    def __len__(self) -> int:
        """Return the number of blocks."""
        return 1

    def __iter__(self) -> Iterator[tuple[str, Indices]]:
        """Yield the block."""
        yield "quad", self.nodes(np.arange(self.n_cells))

    def __getitem__(self, index: Any) -> Any:
        """Return the block, or a tuple with it for a slice."""
        return tuple(self)[index]

    @property
    def n_cells(self) -> int:
        """Number of cells."""
        return (self.shape[0] - 1) * (self.shape[1] - 1)

    def nodes(self, cells: Indices) -> Indices:
        """Return the nodes of cells.

        Parameters
        ----------
        cells : Indices
            Numbers of the cells, (e,), row by row.

        Returns
        -------
        Indices
            Numbers of their nodes, (e, 4), counter-clockwise from above.
        """
        row, column = np.divmod(cells, self.shape[1] - 1)
        first = row * self.shape[1] + column
        return np.stack([first, first + self.shape[1], first + self.shape[1] + 1, first + 1], axis=-1)


@final
@dataclass(frozen=True, eq=False)
class GridPoints(NDArrayOperatorsMixin):
    """Points of a grid in the plane x3 = 0, an array (n, 3) whose entries are made whenever they are read.

    They are numbered row by row. NumPy's functions, operators and methods take it as an array.

    Attributes
    ----------
    x, y : Array
        Coordinates (nx,) and (ny,) of the rows and columns [m].
    others : Array
        Further points (m, 3), which are numbered after those of the grid [m].
    """

    x: Array
    y: Array
    others: Array = field(default_factory=lambda: np.zeros((0, 3)))

    @classmethod
    def make(cls, x: Array, y: Array, *others: Array) -> Array:
        """Return the points as what they are to their users, an array.

        Parameters
        ----------
        x, y : Array
            Coordinates (nx,) and (ny,) of the rows and columns [m].
        *others : Array
            Further points, (m, 3) [m]; one array at most.

        Returns
        -------
        Array
            Points, (nx * ny + m, 3) [m].
        """
        return cast(Array, cls(x, y, *others))

    def on(self, rows: slice, columns: slice) -> Array:
        """Return the points on some rows and columns of the grid.

        Parameters
        ----------
        rows, columns : slice
            Indices of the coordinates x and y.

        Returns
        -------
        Array
            Points, (n, 3) [m], numbered row by row.
        """
        return GridPoints.make(self.x[rows], self.y[columns])

    @property
    def shape(self) -> tuple[int, int]:
        """Shape (n, 3) of the array."""
        return len(self), 3

    @property
    def ndim(self) -> int:
        """Number of dimensions of the array."""
        return 2

    @property
    def nbytes(self) -> int:
        """Number of bytes of the array."""
        return len(self) * 3 * self.dtype.itemsize

    @property
    def dtype(self) -> np.dtype[np.float64]:
        """Type of the coordinates."""
        return np.dtype(np.float64)

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.x) * len(self.y) + len(self.others)

    def __getitem__(self, index: Any) -> Array:
        """Return the points or coordinates of an index, as NumPy does; for numbers of points only these are made."""
        if isinstance(index, slice):
            index = np.arange(*index.indices(len(self)))
        elif isinstance(index, int):
            index = np.int64(range(len(self))[index])
        elif isinstance(index, np.ndarray) and index.dtype == bool and index.shape == (len(self),):
            index = np.flatnonzero(index)
        is_numbers = isinstance(index, np.ndarray | np.integer) and index.dtype.kind in "iu"
        if not is_numbers or len(self.others):
            array: Array = self.__array__()[index]
            return array
        number = np.where(index < 0, index + len(self), index)
        row, column = np.unravel_index(number, (len(self.x), len(self.y)))
        points = np.zeros((*number.shape, 3))
        points[..., 0], points[..., 1] = self.x[row], self.y[column]
        return points

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        """Return the array (n, 3), stored coordinate by coordinate: pages of zeros take no memory."""
        coordinates = np.zeros((3, len(self)))
        on_grid = coordinates[:, : len(self.x) * len(self.y)].reshape(3, len(self.x), len(self.y))
        on_grid[0], on_grid[1] = self.x[:, None], self.y
        coordinates[:, len(self) - len(self.others) :] = self.others.T
        return coordinates.T.astype(dtype or float, copy=False)

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        return getattr(ufunc, method)(*(np.asarray(i) if isinstance(i, GridPoints) else i for i in inputs), **options)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):  # protocols, and pickling before there are attributes
            raise AttributeError(f"GridPoints has no attribute {name!r}")
        return getattr(self.__array__(), name)


def extreme_points(points: Array) -> Array:
    """Return points (m, 3) among which linear functions have their extremes: the corners of a grid, or all points."""
    if not isinstance(points, GridPoints) or len(points.others):
        return points
    n, ny = len(points), len(points.y)
    return points[np.array([0, ny - 1, n - ny, n - 1])]


def shared_frames(frame: Array, count: int) -> Array:
    """Return one frame (3, 3) for all nodes, (count, 3, 3), as a view that takes no memory."""
    return np.broadcast_to(frame, (count, 3, 3))


def shares_frame(frames: Array) -> bool:
    """Return whether frames (n, 3, 3) are a view of a single one."""
    return len(frames) > 0 and frames.strides[0] == 0


def local_components(frames: Array, vectors: Array) -> Array:
    """Return the components of vectors (n, 3) along the rows of frames (n, k, 3), (n, k)."""
    if shares_frame(frames):
        return np.asarray(vectors @ frames[0].T)
    components: Array = np.einsum("nai,ni->na", frames, vectors)
    return components


def global_components(frames: Array, components: Array) -> Array:
    """Return the vectors (n, 3) whose components along the rows of frames (n, k, 3) are given, (n, k)."""
    if shares_frame(frames):
        return np.asarray(components @ frames[0])
    vectors: Array = np.einsum("na,nai->ni", components, frames)
    return vectors


def grid_cells(numbers: Indices) -> Indices:
    """Return the cells of a grid of point numbers (nx, ny), counter-clockwise from above, ((nx - 1) (ny - 1), 4)."""
    cells = np.empty((numbers.shape[0] - 1, numbers.shape[1] - 1, 4), np.int64)
    for k, corner in enumerate((numbers[:-1, :-1], numbers[1:, :-1], numbers[1:, 1:], numbers[:-1, 1:])):
        cells[:, :, k] = corner
    return cells.reshape(-1, 4)


def border_entries(grid: NDArray[Entry]) -> NDArray[Entry]:
    """Return the border (2 nx + 2 ny, ...) of a grid (nx + 1, ny + 1, ...), counter-clockwise from entry [0, 0]."""
    return np.concatenate([grid[:-1, 0], grid[-1, :-1], grid[:0:-1, -1], grid[0, :0:-1]])


def frame_quads(shape: tuple[int, int], loops: int) -> tuple[Indices, Indices]:
    """Return the cells (e, 4) of a grid of nodes of a shape and of strips around it, and the group 0 or 1 of each.

    loops: number of loops around the grid, see `frame_surface`.
    """
    numbers = np.arange(shape[0] * shape[1]).reshape(shape)
    border = border_entries(numbers)[None]
    cells, strips = grid_cells(numbers), strip_cells(np.concatenate([border, loop_numbers(numbers, loops)]))
    return np.concatenate([cells, strips]), np.repeat([0, 1], [len(cells), len(strips)])


def loop_numbers(numbers: Indices, loops: int) -> Indices:
    """Return the numbers (loops, m) of the points of loops, which follow those of the grid that they surround."""
    return numbers.size + np.arange(loops * border_entries(numbers).size).reshape(loops, -1)


def strip_cells(loops: Indices) -> Indices:
    """Return the cells between successive loops (k + 1, m) of point numbers, (k m, 4)."""
    inner_loops, outer_loops = loops[:-1], loops[1:]
    return np.stack(
        [inner_loops, outer_loops, np.roll(outer_loops, -1, 1), np.roll(inner_loops, -1, 1)], axis=-1
    ).reshape(-1, 4)


def outermost_cells(shape: tuple[int, int]) -> Indices:
    """Return those cells (e, 4) of a grid of nodes of a shape that are at its border."""
    nx, ny = shape
    rows, columns = ny * np.arange(nx)[:, None], np.arange(ny)
    at_ends = [rows[:2] + columns, rows[max(nx - 2, 1) :] + columns]
    strips = [*at_ends, rows[1:-1] + columns[:2], rows[1:-1] + columns[max(ny - 2, 1) :]]
    return np.concatenate([grid_cells(strip) for strip in strips if min(strip.shape) > 1])


def grid_weights(shape: tuple[int, int], spacing: tuple[float, float]) -> Array:
    """Return the areas (nx ny,) of the nodes of a grid: a cell, or half or a quarter of one on its border."""
    along, across = (np.full(n, h) for n, h in zip(shape, spacing, strict=True))
    for lengths in (along, across):
        lengths[[0, -1]] *= 0.5
    return np.outer(along, across).ravel()


def grid_shape(cells: Cells, count: int) -> tuple[int, int] | None:
    """Return the numbers (nx, ny) of nodes of a grid whose cells are quadrilaterals numbered row by row.

    Parameters
    ----------
    cells : sequence of tuple
        meshio cell type and connectivity of each block.
    count : int
        Number of nodes.

    Returns
    -------
    tuple of int or None
        The shape, None if the cells are not those of `grid_cells` for numbers that count along the second axis first.
    """
    if isinstance(cells, GridCells):
        return cells.shape
    if len(cells) != 1 or cells[0][0] != "quad" or not len(cells[0][1]):
        return None
    quads = cells[0][1]
    ny = int(quads[0, 1] - quads[0, 0])
    if ny < 2 or count % ny or len(quads) != (count // ny - 1) * (ny - 1):
        return None
    first = np.arange(count).reshape(-1, ny)[:-1, :-1].ravel()
    if any(not np.array_equal(quads[:, k], first + offset) for k, offset in enumerate((0, ny, ny + 1, 1))):
        return None
    return count // ny, ny


def nodes_of_mixed_cells(cells: Cells, chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the nodes (n,) of those cells that have both chosen nodes (n,) and others."""
    mixed = np.zeros(len(chosen), bool)
    if isinstance(cells, GridCells):
        chosen_on_grid, mixed_on_grid = chosen.reshape(cells.shape), mixed.reshape(cells.shape)
        sides = slice(None, -1), slice(1, None)
        corners = [(rows, columns) for rows in sides for columns in sides]
        of_corners = [chosen_on_grid[corner] for corner in corners]
        is_mixed = np.logical_or.reduce(of_corners) & ~np.logical_and.reduce(of_corners)
        for corner in corners:
            mixed_on_grid[corner] |= is_mixed
        return mixed
    for _, nodes in cells:
        of_cells = chosen[nodes]
        mixed[nodes[of_cells.any(axis=1) & ~of_cells.all(axis=1)]] = True
    return mixed
