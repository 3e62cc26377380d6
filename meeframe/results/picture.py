"""Contact zone mapped to the plane and cut into triangles, for drawing."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from meeframe.common.memoize import memoize_by_identity
from meeframe.fields import Array, Indices
from meeframe.mesh import local_frames
from meeframe.mesh.regular import Cells, extreme_points, grid_shape
from meeframe.results.canvas import MAP_COLOURS, prefixed
from meeframe.results.records import Zone

# meshio's cell types cut into triangles, by position of the node in the cell
TRIANGLES: Final = {
    "triangle": ((0, 1, 2),),
    "triangle6": ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
    "quad": ((0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),  # 4: its centre, or else one diagonal would be preferred
    "quad8": ((0, 4, 7), (4, 1, 5), (5, 2, 6), (6, 3, 7), (4, 5, 7), (5, 6, 7)),
    "quad9": ((0, 4, 8), (0, 8, 7), (4, 1, 5), (4, 5, 8), (8, 5, 2), (8, 2, 6), (7, 8, 6), (7, 6, 3)),
}


MAX_SHADED_NODES: Final = 200_000
"""Number of nodes up to which colours are interpolated between them; figures do not have many more pixels."""


def lengths(zones: Iterable[Zone]) -> tuple[float, str]:
    """Return the factor and unit of lengths along the axes of pictures of zones, measured from their middles."""
    return prefixed(np.array([np.ptp(extreme_points(zone.points), axis=0) / 2 for zone in zones]), "m")


@dataclass(frozen=True, eq=False)
class Picture:
    """Plane picture of a contact zone.

    points: its nodes, (n, 2), in a unit of so many metres; axes: those of the picture in space, (2, 3); cells: of the
    zone; pixels: coordinates (nx,) and (ny,) of a grid along the axes with more nodes than a figure has room for, which
    is drawn node by node in place of triangles.
    """

    points: Array
    factor: float
    unit: str
    axes: Array
    cells: Cells
    pixels: tuple[Array, Array] | None = None

    @classmethod
    def of(cls, zone: Zone, scale: tuple[float, str] | None = None) -> "Picture":
        """Return the zone seen along its mean normal, coordinates from the middle of its extent.

        They run along the axes that the zone's frames have where no direction field rotates them. scale: factor and
        unit, if not those that suit the zone. A zone without known cells is cut by Delaunay triangulation.
        """
        return _picture(zone, scale or lengths([zone]))

    @cached_property
    def quads(self) -> Indices:
        """Nodes (q, 4) of the quads, each of which has a point of the triangulation at its centre."""
        blocks = [nodes for name, nodes in self.cells if name == "quad"]
        return np.concatenate(blocks) if blocks else np.empty((0, 4), np.int64)

    @cached_property
    def triangulation(self) -> Any:
        """Triangulation of matplotlib, by the nodes and then the centres of the quads."""
        from matplotlib.tri import Triangulation

        flat = _with_centres(self.points, self.quads)
        triangles = _triangles(self.cells, len(self.points)) if self.cells else None
        return Triangulation(flat[:, 0], flat[:, 1], triangles)

    def around(self, chosen: NDArray[np.bool_]) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the limits along x and y of a square around these nodes (n,), half as large again.

        It holds the elements at these nodes, into which the contact edge extends, and is cut at the border of the zone.
        """
        low, high = self.points[chosen].min(axis=0), self.points[chosen].max(axis=0)
        half_width = 0.75 * (high - low).max() or np.ptp(self.points, axis=0).max()
        if self.pixels is None:
            beside = np.unique(self.triangles_at(chosen).triangles)
            flat = np.column_stack([self.triangulation.x, self.triangulation.y])[beside]
            half_width = max(half_width, np.abs(flat - (low + high) / 2).max())
        begin = np.maximum((low + high) / 2 - half_width, self.points.min(axis=0))
        end = np.minimum((low + high) / 2 + half_width, self.points.max(axis=0))
        return (float(begin[0]), float(end[0])), (float(begin[1]), float(end[1]))

    def extended(self, nodal: Array, inside: NDArray[np.bool_]) -> Array:
        """Return values (n,) with those outside replaced by the mean of the inner nodes of the same cells.

        inside: (n,) nodes that keep their values. Nodes without such a neighbour become zero. Pixels need no such
        values, because no colour fades between them.
        """
        if self.pixels is not None:
            return np.where(inside, nodal, 0.0)
        total, count = np.zeros(len(nodal)), np.zeros(len(nodal))
        flat = self.triangulation.triangles
        for cells in (flat[(flat < len(nodal)).all(axis=1)], self.quads):
            inner = inside[cells]
            for column in range(cells.shape[1]):
                np.add.at(total, cells[:, column], (nodal[cells] * inner).sum(axis=1))
                np.add.at(count, cells[:, column], inner.sum(axis=1))
        return np.where(inside, nodal, total / np.maximum(count, 1.0))

    def shade(self, axes: Any, nodal: Array, inside: NDArray[np.bool_] | None = None, **limits: float) -> Any:
        """Draw values (n,) at the nodes as colours over the zone, or over the triangles at nodes `inside` (n,).

        limits: vmin, vmax.
        """
        if self.pixels is not None:
            return self._image(axes, nodal if inside is None else np.where(inside, nodal, np.nan), **limits)
        flat = self.triangulation if inside is None else self.triangles_at(inside)
        drawn = axes.tripcolor(flat, self._values(nodal), shading="gouraud", cmap=MAP_COLOURS, **limits)
        drawn.set_in_layout(False)  # it ends with its axes; matplotlib would find its extent triangle by triangle
        return drawn

    def outline(self, axes: Any, level: Array, colour: str) -> None:
        """Draw the line between nodes of a positive and of a negative level (n,)."""
        style: dict[str, Any] = {"levels": [0.0], "colors": colour, "linewidths": 1.2 if self.pixels is None else 0.4}
        if self.pixels is not None:
            axes.contour(*self.pixels, self._grid(level).T, **style)
        else:
            axes.tricontour(self.triangles_at(level > 0.0, level < 0.0), self._values(level), **style)

    def fill(self, axes: Any, level: Array, colour: str) -> Any:
        """Fill the region of a positive level (n,) with a colour."""
        if self.pixels is not None:
            from matplotlib.colors import ListedColormap

            drawn = self._image(axes, np.where(level > 0.0, 1.0, np.nan))
            drawn.set_cmap(ListedColormap([colour]))
            return drawn
        chosen = self.triangles_at(level > 0.0)
        return axes.tricontourf(chosen, self._values(level), [0.0, max(2.0 * level.max(), 1.0)], colors=[colour])

    def clip(self, axes: Any, drawn: Any, level: Array) -> None:
        """Clip what is drawn to the region of a positive level (n,); pixels end there anyway."""
        if self.pixels is not None:
            return
        region = self.fill(axes, level, "none")
        (outline,) = region.get_paths()
        region.remove()
        drawn.set_clip_path(outline, axes.transData)

    def _grid(self, nodal: Array) -> Array:
        """Return values (n,) at the nodes as those of the pixels, (nx, ny)."""
        assert self.pixels is not None
        x, y = self.pixels
        return nodal.reshape(len(x), len(y))

    def _values(self, nodal: Array) -> Array:
        """Return the values at the points of the triangulation of values (n,) at the nodes."""
        return _with_centres(nodal, self.quads)

    def _image(self, axes: Any, nodal: Array, **limits: float) -> Any:
        """Draw values (n,) at the nodes, nan where nothing is drawn, as pixels of an image."""
        assert self.pixels is not None
        (left, right), (below, above) = (
            (values[0] - half, values[-1] + half)
            for values, half in ((each, (each[1] - each[0]) / 2) for each in self.pixels)
        )
        image = np.ma.masked_invalid(self._grid(nodal).T)
        extent = left, right, below, above
        return axes.imshow(image, origin="lower", extent=extent, cmap=MAP_COLOURS, aspect="equal", **limits)

    def section(self, x: Array, *nodal: Array) -> list[Array]:
        """Return the values along y = 0 at x (k,) for each of the values (n,) at the nodes.

        They are masked where there is no zone.
        """
        from matplotlib.tri import LinearTriInterpolator

        if self.pixels is not None:
            along, across = self.pixels
            last = min(max(int(np.searchsorted(across, 0.0)), 1), len(across) - 1)
            share = float(np.clip((0.0 - across[last - 1]) / (across[last] - across[last - 1]), 0.0, 1.0))
            grids = map(self._grid, nodal)
            rows = ((1.0 - share) * grid[:, last - 1] + share * grid[:, last] for grid in grids)
            return [np.ma.masked_invalid(np.interp(x, along, row, left=np.nan, right=np.nan)) for row in rows]
        y = self.triangulation.y[self.triangulation.triangles]
        across = self._subset((y.min(axis=1) <= 0.0) & (y.max(axis=1) >= 0.0))
        return [LinearTriInterpolator(across, self._values(values))(x, np.zeros_like(x)) for values in nodal]

    def triangles_at(self, *kinds: NDArray[np.bool_]) -> Any:
        """Return the triangles at nodes (n,) of every kind: contours are found faster in few triangles."""
        triangles = self.triangulation.triangles
        at = [(self._values(kind.astype(float)) > 0.0)[triangles].any(axis=1) for kind in kinds]
        return self._subset(np.logical_and.reduce(at))

    def _subset(self, chosen: NDArray[np.bool_]) -> Any:
        """Return the triangulation by these triangles (t,) alone, or all if there are none.

        matplotlib's triangulations have at least one triangle.
        """
        from matplotlib.tri import Triangulation

        flat = self.triangulation
        return Triangulation(flat.x, flat.y, flat.triangles[chosen]) if chosen.any() else flat


@memoize_by_identity
def _picture(zone: Zone, scale: tuple[float, str]) -> Picture:
    extremes = extreme_points(zone.points)
    middle = (extremes.min(axis=0) + extremes.max(axis=0)) / 2
    normal = zone.frames[:, 2].mean(axis=0)
    axes = local_frames(normal[None] / np.linalg.norm(normal))[0, :2]
    points = (axes @ (zone.points - middle).T / scale[0]).T  # stored one coordinate after another
    return Picture(points, *scale, axes, zone.cells, _pixels(zone, points))


def _pixels(zone: Zone, points: Array) -> tuple[Array, Array] | None:
    """Return the coordinates of a fine grid of points (n, 2) along both axes; None for other points."""
    shape = grid_shape(zone.cells, len(points)) if len(points) > MAX_SHADED_NODES else None
    if shape is None:
        return None
    grid = points.reshape(*shape, 2)
    x, y = grid[:, 0, 0], grid[0, :, 1]
    uniform = [np.arange(len(values)) * (values[-1] - values[0]) / (len(values) - 1) + values[0] for values in (x, y)]
    expected = np.stack(np.broadcast_arrays(uniform[0][:, None], uniform[1][None, :]), axis=-1)
    rising = x[-1] > x[0] and y[-1] > y[0]
    return (x, y) if rising and np.abs(grid - expected).max() < 1e-6 * (x[1] - x[0]) else None


def _with_centres(nodal: Array, quads: Indices) -> Array:
    return np.concatenate([nodal, nodal[quads].mean(axis=1)])


def _triangles(cells: Cells, n_nodes: int) -> Indices:
    triangles: list[Indices] = []
    for name, nodes in cells:
        if name == "quad":
            nodes = np.column_stack([nodes, n_nodes + np.arange(len(nodes))])
            n_nodes += len(nodes)
        # elements of plugins are drawn by their corners only
        cut = TRIANGLES.get(name, ((0, 1, 2),) if name.startswith("triangle") else ((0, 1, 2), (2, 3, 0)))
        triangles += [nodes[:, triangle] for triangle in cut]
    return np.concatenate(triangles)
