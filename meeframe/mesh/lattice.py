"""Meshes of any element type from surfaces of straight quadrilateral cells."""

from dataclasses import dataclass
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from meeframe.common.errors import MeshError
from meeframe.elements.base import SurfaceElement
from meeframe.fields import Array, Indices
from meeframe.mesh.regular import grid_cells
from meeframe.mesh.surface import ElementBlock, SurfaceMesh

MIN_SIZE: Final = 1e-60
"""Least size of a body [m]; ratios of sizes stay finite."""

Entry = TypeVar("Entry", np.float64, np.int64)


@dataclass(frozen=True, eq=False)
class QuadSurface:
    """A surface of quadrilateral cells, before an element type is chosen.

    Attributes
    ----------
    points : Array
        Positions of the corners, (p, 3).
    quads : Indices
        Corner numbers of the cells, (e, 4), counter-clockwise seen from outside.
    groups : Indices
        Index of each cell into group_names, (e,).
    parity : Indices
        0 or 1 for each cell, (e,), different for neighbours: the diagonal along which a cell is split into triangles.
    group_names : tuple of str
        Names of the face groups.
    """

    points: Array
    quads: Indices
    groups: Indices
    parity: Indices
    group_names: tuple[str, ...]


def place_nodes(surface: QuadSurface, element: SurfaceElement) -> SurfaceMesh:
    """Return the mesh of one element type on the cells of a surface.

    Corner points keep their numbers. Further nodes follow, at bilinear (quadrilateral) or linear (triangle)
    interpolations of the corners, and are shared between neighbours. Triangles split the cells along alternating
    diagonals, so that an even number of divisions gives a mesh with the symmetry of the cells.
    """
    corners, groups = surface.quads, surface.groups
    if element.reference == "triangle":
        corners, groups = _split(corners, surface.parity), np.repeat(groups, 2)
    weights = corner_weights(element)
    points, connectivity = _number_nodes(surface.points, corners, weights)
    return SurfaceMesh(points, (ElementBlock(element, connectivity, groups),), surface.group_names)


def corner_weights(element: SurfaceElement) -> Array:
    """Return the weights (n, corners) of the corners in the position of each node of a straight-sided element."""
    x, y = np.asarray(element.nodes, float).T
    if element.reference == "triangle":
        return np.stack([1 - x - y, x, y], axis=1)
    signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    weights: Array = 0.25 * (1 + x[:, None] * signs[:, 0]) * (1 + y[:, None] * signs[:, 1])
    return weights


def _split(quads: Indices, parity: Indices) -> Indices:
    """Return two triangles per cell, (2e, 3), along the diagonal 0-2 where parity is 0, 1-3 where it is 1."""
    straight = quads[:, [[0, 1, 2], [0, 2, 3]]]
    crossed = quads[:, [[0, 1, 3], [1, 2, 3]]]
    return np.where((parity == 0)[:, None, None], straight, crossed).reshape(-1, 3)


def _number_nodes(points: Array, corners: Indices, weights: Array) -> tuple[Array, Indices]:
    """Return points, corners first, and connectivity; nodes with equal weights on the same corners share a point."""
    if np.array_equal(weights, np.eye(corners.shape[1])):
        return points, corners
    connectivity = np.empty((len(corners), len(weights)), np.int64)
    at_corner = weights.max(axis=1) > 1 - 1e-12
    connectivity[:, at_corner] = corners[:, weights[at_corner].argmax(axis=1)]
    between = weights[~at_corner]
    if len(between) == 0:
        return points, connectivity
    # the key of a node: its corners with non-zero weight, in rising order, and these weights in units of 1e-9
    involved = np.where(np.abs(between) > 1e-12, corners[:, None, :], -1)
    shares = np.broadcast_to(np.rint(between * 1e9).astype(np.int64), involved.shape)
    rising = np.argsort(involved, axis=-1)
    key = np.concatenate([np.take_along_axis(a, rising, axis=-1) for a in (involved, shares)], axis=-1)
    _, first, number = np.unique(key.reshape(-1, key.shape[-1]), axis=0, return_index=True, return_inverse=True)
    connectivity[:, ~at_corner] = len(points) + number.reshape(len(corners), len(between))
    positions = np.einsum("nc,ecd->end", between, points[corners]).reshape(-1, 3)
    return np.concatenate([points, positions[first]]), connectivity


def symmetric_spacing(half_width: float, divisions: int) -> Array:
    """Return equally spaced points of [-half_width, half_width], (divisions + 1,), antisymmetric to the last bit."""
    steps: Array = half_width * (np.arange(-divisions, divisions + 1, 2) / divisions)
    return steps


def grid_points(half_widths: tuple[float, float], divisions: tuple[int, int], height: float) -> Array:
    """Return the points of a horizontal rectangle centred on the x3 axis, (nx + 1, ny + 1, 3)."""
    x, y = (symmetric_spacing(a, n) for a, n in zip(half_widths, divisions, strict=True))
    points = np.empty((len(x), len(y), 3))
    points[:, :, 0], points[:, :, 1], points[:, :, 2] = x[:, None], y, height
    return points


def border_entries(grid: NDArray[Entry]) -> NDArray[Entry]:
    """Return the border (2 nx + 2 ny, ...) of a grid (nx + 1, ny + 1, ...), counter-clockwise from entry [0, 0]."""
    return np.concatenate([grid[:-1, 0], grid[-1, :-1], grid[:0:-1, -1], grid[0, :0:-1]])


def prism_surface(
    top: Array, loops: Array, base: Array, groups: tuple[int, Indices, int], names: tuple[str, ...]
) -> QuadSurface:
    """Return the closed surface of a top grid, strips of cells between successive loops around it, and a base grid.

    Parameters
    ----------
    top, base : Array
        Points of the grids, (nx + 1, ny + 1, 3), seen from above.
    loops : Array
        Points of the loops, (k, 2 nx + 2 ny, 3), counter-clockwise from above; the last one is the border of the base.
    groups : tuple
        Group of the top, groups of the cells of the strips (k, 2 nx + 2 ny), and group of the base.
    names : tuple of str
        Names of the groups.
    """
    shape = top.shape[:2]
    top_numbers = np.arange(shape[0] * shape[1]).reshape(shape)
    count = loops.shape[1]
    loop_numbers = _loop_numbers(top_numbers, len(loops))
    base_numbers = np.empty(shape, np.int64)
    base_numbers.flat[border_entries(top_numbers)] = loop_numbers[-1]
    inner = base_numbers[1:-1, 1:-1]
    inner[...] = top_numbers.size + loop_numbers.size + np.arange(inner.size).reshape(inner.shape)

    strips = _strip_cells(np.concatenate([border_entries(top_numbers)[None], loop_numbers]))
    cells = grid_cells(top_numbers)
    chequer = _checkerboard(shape[0] - 1, shape[1] - 1)
    return QuadSurface(
        points=np.concatenate([block.reshape(-1, 3) for block in (top, loops, base[1:-1, 1:-1])]),
        quads=np.concatenate([cells, strips, grid_cells(base_numbers)[:, ::-1]]),
        groups=np.concatenate([np.full(len(cells), groups[0]), groups[1].ravel(), np.full(len(cells), groups[2])]),
        parity=np.concatenate([chequer, _checkerboard(len(loops), count), chequer]),
        group_names=names,
    )


def frame_surface(grid: Array, loops: Array, names: tuple[str, str]) -> QuadSurface:
    """Return the open surface of a grid and of strips of cells between successive loops around it.

    Parameters
    ----------
    grid : Array
        Points of the grid, (nx + 1, ny + 1, 3), seen from above.
    loops : Array
        Points of the loops, (k, 2 nx + 2 ny, 3), counter-clockwise from above.
    names : tuple of str
        Names of the group of the grid and of the group of the strips.
    """
    shape, count = grid.shape[:2], loops.shape[1]
    quads, groups = frame_quads((shape[0], shape[1]), len(loops))
    return QuadSurface(
        points=np.concatenate([grid.reshape(-1, 3), loops.reshape(-1, 3)]),
        quads=quads,
        groups=groups,
        parity=np.concatenate([_checkerboard(shape[0] - 1, shape[1] - 1), _checkerboard(len(loops), count)]),
        group_names=names,
    )


def frame_quads(shape: tuple[int, int], loops: int) -> tuple[Indices, Indices]:
    """Return the cells (e, 4) of a grid of nodes of a shape and of strips around it, and the group 0 or 1 of each.

    loops: number of loops around the grid, see `frame_surface`.
    """
    numbers = np.arange(shape[0] * shape[1]).reshape(shape)
    border = border_entries(numbers)[None]
    cells, strips = grid_cells(numbers), _strip_cells(np.concatenate([border, _loop_numbers(numbers, loops)]))
    return np.concatenate([cells, strips]), np.repeat([0, 1], [len(cells), len(strips)])


def _loop_numbers(numbers: Indices, loops: int) -> Indices:
    """Return the numbers (loops, m) of the points of loops, which follow those of the grid that they surround."""
    return numbers.size + np.arange(loops * border_entries(numbers).size).reshape(loops, -1)


def _strip_cells(loops: Indices) -> Indices:
    """Return the cells between successive loops (k + 1, m) of point numbers, (k m, 4)."""
    inner_loops, outer_loops = loops[:-1], loops[1:]
    return np.stack(
        [inner_loops, outer_loops, np.roll(outer_loops, -1, 1), np.roll(inner_loops, -1, 1)], axis=-1
    ).reshape(-1, 4)


def _checkerboard(rows: int, columns: int) -> Indices:
    """Return the parities of rows x columns cells, row by row."""
    parity: Indices = np.add.outer(np.arange(rows), np.arange(columns)).ravel() % 2
    return parity


def border_sides(divisions: tuple[int, int], sides: tuple[int, int, int, int]) -> Indices:
    """Return one value for each cell of a strip, from values for y-, x+, y+ and x-, in the order of the border."""
    nx, ny = divisions
    return np.repeat(np.asarray(sides), [nx, ny, nx, ny])


def check_values(name: str, values: tuple[float, ...], *, at_least: float | None = None) -> None:
    """Check that all values are finite and at least MIN_SIZE, or integers of at least `at_least`.

    Raises
    ------
    MeshError
        If a value is not; the message names it.
    """
    for value in values:
        if at_least is None and not (np.isfinite(value) and value >= MIN_SIZE):
            raise MeshError(f"{name} = {value!r}: must be a finite positive number, at least {MIN_SIZE:g}")
        if at_least is not None and (int(value) != value or value < at_least):
            raise MeshError(f"{name} = {value!r}: must be an integer of at least {at_least:g}")
