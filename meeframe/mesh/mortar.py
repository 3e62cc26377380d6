"""Integrals over two contact zones with different divisions, for mortar transfer between them.

Both surfaces are projected along the mean normal of the first one. Their elements are split into triangles, triangles
of both surfaces are intersected, and products of shape functions are integrated over the intersections, so that no
integrand has a kink within a rule (Puso and Laursen, Comput. Methods Appl. Mech. Engrg. 193 (2004) 601-629).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
import scipy  # its parts load where they are used
from numpy.typing import NDArray

from meeframe.common.errors import MeshError
from meeframe.elements import ELEMENTS
from meeframe.elements.base import SurfaceElement, shape_derivatives, shape_functions
from meeframe.fields import Array, Indices
from meeframe.mesh.measures import VOLUME_ORDER, corners, gauss_rule, normal_vectors, vector_areas
from meeframe.mesh.regular import Cells
from meeframe.mesh.zone import local_frames

MIN_COSINE: Final = 0.5
"""Smallest cosine between the normal of an element and the direction of projection: 60 degrees."""
MAX_DISTANCE: Final = 0.1
"""Largest distance of the surfaces along the direction of projection, relative to the extent of the first zone."""
MAX_UNCOVERED: Final = 0.1
"""Largest fraction of an element of the first zone that may lie outside the second, as between polygonal outlines."""
_GAUSS_POINTS: Final = {1: 4, 2: 5}
"""Gauss points per direction on intersections, by the highest order of the elements: exact for parallelograms."""
_TRIANGLES: Final = {
    "triangle": [[0, 1, 2]],
    "triangle6": [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]],
    "quad": [[0, 1, 2], [0, 2, 3]],
    "quad8": [[0, 4, 7], [4, 1, 5], [5, 2, 6], [6, 3, 7], [4, 5, 6], [4, 6, 7]],
    "quad9": [[0, 4, 8], [4, 1, 8], [1, 5, 8], [5, 2, 8], [2, 6, 8], [6, 3, 8], [3, 7, 8], [7, 0, 8]],
}
"""Nodes of the triangles into which an element is split, by the type of its cells in meshio."""
_BY_TYPE: Final = {element.meshio_type: element for element in ELEMENTS.values()}
_NEGLIGIBLE: Final = 1e-14
"""Area of an intersection, relative to the smaller triangle, below which it is dropped."""
_MAX_CORNERS: Final = 9
"""Corners of an intersection of two triangles: 6, and more that coincide to round-off."""
_MAX_NEWTON: Final = 30
_POSITION: Final = 1e-14
"""Largest error of a position in the plane, relative to the largest coordinate."""
_CANDIDATES: Final = 12
"""Number of triangles, the nearest ones, among which the one that contains a node is searched."""
_CANDIDATE_PAIRS: Final = 300_000
"""Number of pairs of points and candidate triangles that are compared at once."""
_CHUNK: Final = 20_000
"""Number of pairs of triangles that are intersected at once."""


@dataclass(frozen=True, eq=False)
class Mortar:
    """Integrals of products of shape functions N of two surfaces with n and m nodes.

    Attributes
    ----------
    axes
        (3, 3) rows: two directions in the plane of projection and the direction of projection.
    mixed
        (n, m) sparse matrix, integrals of N_a N_b over the first surface. Its rows add up to the integrals of N_a, and
        it has the first moments of N_a in the plane of projection.
    first, second
        (n, n) and (m, m) sparse matrices, integrals of N_a N_b over each of the surfaces.
    """

    axes: Array
    mixed: "scipy.sparse.csr_array"
    first: "scipy.sparse.csr_array"
    second: "scipy.sparse.csr_array"


@dataclass(frozen=True, eq=False)
class _Block:
    """Elements of one type: connectivity (e, k)."""

    element: SurfaceElement
    nodes: Indices


@dataclass(frozen=True, eq=False)
class _Surface:
    """A surface in axes of the projection, points (n, 3), with its triangles.

    corners: (t, 3, 2) in the plane, counter-clockwise; block, element: (t,) block of each and its element.
    """

    points: Array
    blocks: tuple[_Block, ...]
    corners: Array
    block: Indices
    element: Indices


def find_mortar(points: Array, cells: Cells, other_points: Array, other_cells: Cells) -> Mortar:
    """Return the integrals over two surfaces that face each other.

    Parameters
    ----------
    points, other_points
        (n, 3) and (m, 3) nodes of the first and the second surface [m], in common axes.
    cells, other_cells
        Pairs of a meshio cell type and its connectivity, counter-clockwise seen from outside each body.

    Returns
    -------
    Mortar
        The integrals.

    Raises
    ------
    MeshError
        If an element of the first surface lies outside the second (MAX_UNCOVERED), the surfaces are too far from each
        other (MAX_DISTANCE), an element is too steep or faces the other way (MIN_COSINE), or has an unknown type.
    """
    axes, first, second, located = _facing(points, cells, other_points, other_cells)
    mass, mixed = _mass(first), _mixed(first, second)
    return Mortar(axes, _corrected(mixed, mass, first, second, located), mass, _mass(second))


def locate_on_plane(points: Array, nodes: Array, cells: Cells, normal: Array) -> "Located":
    """Return the shape functions of a plane surface at points.

    Parameters
    ----------
    points
        (m, 3) positions on it [m].
    nodes
        (n, 3) nodes of its elements [m].
    cells
        Pairs of a meshio cell type and its connectivity, counter-clockwise seen against the normal.
    normal
        (3,) its unit normal.

    Returns
    -------
    Located
        Shape functions, and their derivatives in global axes.

    Raises
    ------
    MeshError
        If an element has an unknown type.
    """
    axes = local_frames(normal[None])[0]
    surface = _surface(nodes @ axes.T, cells, 1.0, "body")
    count = len(surface.corners)  # any triangle is a candidate, as elements may differ in size by any factor
    batches = np.array_split(points @ axes.T, 1 + len(points) * count // _CANDIDATE_PAIRS)
    located = [_locate(batch, surface, count) for batch in batches]
    numbers = np.concatenate([batch.nodes for batch in located])
    names = ("shapes", "slopes", "inside")
    shapes, slopes, inside = (np.concatenate([getattr(batch, name) for batch in located]) for name in names)
    return Located(numbers, shapes, slopes @ axes[:2], inside)


def check_facing(points: Array, cells: Cells, other_points: Array, other_cells: Cells) -> None:
    """Raise MeshError as `find_mortar`, without integration."""
    _facing(points, cells, other_points, other_cells)


def _facing(
    points: Array, cells: Cells, other_points: Array, other_cells: Cells
) -> tuple[Array, _Surface, _Surface, "Located"]:
    """Return the axes of the projection, both surfaces in them, and the nodes of the first on the second."""
    area = np.concatenate([vector_areas(points[outline]) for outline in corners(cells)]).sum(axis=0)
    axes = local_frames((area / np.linalg.norm(area))[None])[0]
    first = _surface(points @ axes.T, cells, 1.0, "first body")
    second = _surface(other_points @ axes.T, other_cells, -1.0, "second body")
    _check_covered(first, second)
    located = _locate(first.points, second)
    _check_distance(first, second, located)
    return axes, first, second, located


def _surface(points: Array, cells: Cells, sense: float, body: str) -> _Surface:
    """Return a surface whose normals are along the direction of projection (sense 1) or opposite to it (-1)."""
    blocks: list[_Block] = []
    triangles, block, element = [], [], []
    for name, nodes in cells:
        if name not in _BY_TYPE:
            raise MeshError(
                f"the contact zone of the {body} has cells of type {name}; allowed where the contact zones of two "
                f"bodies are divided differently: {', '.join(_TRIANGLES)}"
            )
        kind = _BY_TYPE[name]
        normals = normal_vectors(points, kind, nodes, kind.nodes)
        cosines = sense * normals[..., 2] / np.linalg.norm(normals, axis=-1)
        steep = np.flatnonzero(~(cosines.min(axis=1) >= MIN_COSINE))
        if steep.size:
            raise MeshError(
                f"the contact zones of the two bodies do not face each other: {steep.size} elements of the {body} are "
                f"inclined by {np.degrees(np.arccos(cosines[steep].min())):.0f} degrees or less; allowed: zones that "
                f"are inclined to the mean plane of the first by {np.degrees(np.arccos(MIN_COSINE)):.0f} degrees"
            )
        split = np.array(_TRIANGLES[name])[:, :: int(sense)]
        triangles.append(points[nodes[:, split], :2].reshape(-1, 3, 2))
        block.append(np.full(len(nodes) * len(split), len(blocks)))
        element.append(np.repeat(np.arange(len(nodes)), len(split)))
        blocks.append(_Block(kind, nodes))
    if not blocks:
        raise MeshError(f"the contact zone of the {body} has no cells, which are needed to divide it differently")
    return _Surface(points, tuple(blocks), np.concatenate(triangles), np.concatenate(block), np.concatenate(element))


def _mass(surface: _Surface) -> "scipy.sparse.csr_array":
    """Return the integrals of products of shape functions, (n, n)."""
    n = len(surface.points)
    total = scipy.sparse.csr_array((n, n))
    for block in surface.blocks:
        xi, weights = gauss_rule(block.element.reference, VOLUME_ORDER)
        shapes = shape_functions(block.element, xi)
        shares = np.linalg.norm(normal_vectors(surface.points, block.element, block.nodes, xi), axis=-1) * weights
        entries = np.einsum("eg,ga,gb->eab", shares, shapes, shapes, optimize=True)
        total = total + _scatter(entries, block.nodes, block.nodes, (n, n))
    return total


def _scatter(entries: Array, rows: Indices, columns: Indices, shape: tuple[int, int]) -> "scipy.sparse.csr_array":
    """Return the sum of small matrices (e, a, b) with rows (e, a) and columns (e, b)."""
    places = np.broadcast_to(rows[:, :, None], entries.shape), np.broadcast_to(columns[:, None, :], entries.shape)
    return scipy.sparse.coo_array((entries.ravel(), (places[0].ravel(), places[1].ravel())), shape).tocsr()


def _mixed(first: _Surface, second: _Surface) -> "scipy.sparse.csr_array":
    """Return the integrals of products of shape functions over the intersections, (n, m)."""
    shape = (len(first.points), len(second.points))
    total = scipy.sparse.csr_array(shape)
    for triangles, one, two in _pieces(first, second):
        for i, j in np.ndindex(len(first.blocks), len(second.blocks)):
            chosen = np.flatnonzero((first.block[one] == i) & (second.block[two] == j))
            elements, others = first.element[one[chosen]], second.element[two[chosen]]
            entries = _products(triangles[chosen], first, i, elements, second, j, others)
            rows, columns = first.blocks[i].nodes[elements], second.blocks[j].nodes[others]
            total = total + _scatter(entries, rows, columns, shape)
    return total


def _products(
    triangles: Array, first: _Surface, i: int, elements: Indices, second: _Surface, j: int, others: Indices
) -> Array:
    """Return the integrals of the products of shape functions over triangles (t, 3, 2) of two elements each."""
    block, other = first.blocks[i], second.blocks[j]
    xi, weights = gauss_rule("triangle", _GAUSS_POINTS[max(block.element.order, other.element.order)])
    barycentric = np.column_stack([1.0 - xi.sum(axis=1), xi])
    places = np.einsum("gc,tcd->tgd", barycentric, triangles)
    size = places.shape[:2]
    nodes, other_nodes = (
        np.repeat(surface.points[side.nodes[numbers]], size[1], axis=0)
        for surface, side, numbers in ((first, block, elements), (second, other, others))
    )
    xi_of, other_xi = (
        _reference_points(side.element, corner[..., :2], places.reshape(-1, 2))
        for side, corner in ((block, nodes), (other, other_nodes))
    )
    shares = 2.0 * _areas(triangles)[:, None] * weights * _stretch(block.element, nodes, xi_of).reshape(size)
    shapes = shape_functions(block.element, xi_of).reshape(*size, -1)
    other_shapes = shape_functions(other.element, other_xi).reshape(*size, -1)
    products: Array = np.einsum("tg,tga,tgb->tab", shares, shapes, other_shapes, optimize=True)
    return products


def _reference_points(element: SurfaceElement, nodes: Array, places: Array) -> Array:
    """Return the reference points (m, 2) of places (m, 2) in elements with nodes (m, k, 2), by Newton's method."""
    xi = np.tile(element.nodes.mean(axis=0), (len(places), 1))
    allowed = _POSITION * np.abs(nodes).max(initial=0.0)
    for _ in range(_MAX_NEWTON):
        misfit = places - np.einsum("ma,mad->md", shape_functions(element, xi), nodes)
        if np.abs(misfit).max(initial=0.0) <= allowed:
            break
        xi = xi + np.einsum("mkd,md->mk", _inverse(nodes, shape_derivatives(element, xi)), misfit)
    return xi


def _stretch(element: SurfaceElement, nodes: Array, xi: Array) -> Array:
    """Return the area of elements with nodes (m, k, 3) over that of their projection at reference points (m, 2)."""
    tangents = np.einsum("mad,mak->mdk", nodes, shape_derivatives(element, xi))
    normals = np.cross(tangents[..., 0], tangents[..., 1])
    stretch: Array = np.linalg.norm(normals, axis=1) / np.abs(normals[:, 2])
    return stretch


def _inverse(nodes: Array, derivatives: Array) -> Array:
    """Return the derivatives of reference coordinates in the plane, (m, k, d), at nodes (m, a, d)."""
    (xx, xy), (yx, yy) = np.moveaxis(np.einsum("mad,mak->mdk", nodes, derivatives), 0, -1)
    inverse: Array = np.array([[yy, -xy], [-yx, xx]]) / (xx * yy - xy * yx)
    return np.moveaxis(inverse, -1, 0)


def _pieces(first: _Surface, second: _Surface) -> Iterator[tuple[Array, Indices, Indices]]:
    """Yield triangles (t, 3, 2) of the intersection and, (t,) each, the triangles of both surfaces they belong to."""
    low, high = first.corners.min(axis=1), first.corners.max(axis=1)
    other_low, other_high = second.corners.min(axis=1), second.corners.max(axis=1)
    rows = max(1, _CHUNK * 50 // len(other_low))
    for start in range(0, len(low), rows):
        some = slice(start, start + rows)
        overlap = (low[some, None] < other_high).all(axis=2) & (other_low < high[some, None]).all(axis=2)
        pairs = np.argwhere(overlap)
        pairs[:, 0] += start
        for begin in range(0, len(pairs), _CHUNK):
            one, two = pairs[begin : begin + _CHUNK].T
            triangles, pair = _intersections(first.corners[one], second.corners[two])
            yield triangles, one[pair], two[pair]


def _intersections(first: Array, second: Array) -> tuple[Array, Indices]:
    """Return triangles (s, 3, 2) that make up the intersections of pairs of triangles (p, 3, 2), and their pairs (s,).

    Polygons are cut along one side of the second triangle after the other (Sutherland and Hodgman).
    """
    polygons = np.zeros((len(first), _MAX_CORNERS, 2))
    polygons[:, :3] = first
    counts = np.full(len(first), 3)
    for side in range(3):
        start, along = second[:, side], second[:, (side + 1) % 3] - second[:, side]
        polygons, counts = _cut(polygons, counts, start, along)
    n = _MAX_CORNERS - 2
    fans = np.stack([np.repeat(polygons[:, :1], n, axis=1), polygons[:, 1:-1], polygons[:, 2:]], axis=2)
    smallest = np.minimum(_areas(first), _areas(second))
    used = (np.arange(n) + 2 < counts[:, None]) & (_areas(fans) > _NEGLIGIBLE * smallest[:, None])
    pair, fan = np.nonzero(used)
    return fans[pair, fan], pair


def _cut(polygons: Array, counts: Indices, start: Array, along: Array) -> tuple[Array, Indices]:
    """Return the parts of polygons (p, c, 2) with some corners each to the left of lines."""
    p, size = np.arange(len(polygons)), polygons.shape[1]
    relative = polygons - start[:, None]
    left = along[:, None, 0] * relative[..., 1] - along[:, None, 1] * relative[..., 0]
    result, filled = np.zeros_like(polygons), np.zeros(len(polygons), np.int64)
    for corner in range(size):
        valid = corner < counts
        following = np.where(corner + 1 < counts, corner + 1, 0)
        here, there = left[:, corner], left[p, following]
        inside = valid & (here >= 0.0)
        result[p[inside], filled[inside]] = polygons[inside, corner]
        filled += inside
        crosses = valid & ((here >= 0.0) != (there >= 0.0)) & (here != 0.0) & (there != 0.0)
        fraction = np.divide(here, here - there, out=np.zeros_like(here), where=crosses)[:, None]
        point = polygons[:, corner] + fraction * (polygons[p, following] - polygons[:, corner])
        result[p[crosses], filled[crosses]] = point[crosses]
        filled += crosses
    return result, filled


def _areas(triangles: Array) -> Array:
    """Return the areas (...,) of counter-clockwise triangles (..., 3, 2)."""
    along, across = triangles[..., 1, :] - triangles[..., 0, :], triangles[..., 2, :] - triangles[..., 0, :]
    areas: Array = 0.5 * (along[..., 0] * across[..., 1] - along[..., 1] * across[..., 0])
    return areas


def _check_covered(first: _Surface, second: _Surface) -> None:
    """Raise MeshError for elements of the first surface that lie outside the second."""
    covered, total = ([np.zeros(len(block.nodes)) for block in first.blocks] for _ in range(2))
    areas, triangles = np.zeros(len(first.corners)), _areas(first.corners)
    for pieces, one, _ in _pieces(first, second):
        np.add.at(areas, one, _areas(pieces))
    for i in range(len(first.blocks)):
        chosen = first.block == i
        np.add.at(covered[i], first.element[chosen], areas[chosen])
        np.add.at(total[i], first.element[chosen], triangles[chosen])
    uncovered = 1.0 - np.concatenate(covered) / np.concatenate(total)
    outside = np.flatnonzero(uncovered > MAX_UNCOVERED)
    if outside.size:
        raise MeshError(
            f"the contact zones of the two bodies do not match: {outside.size} of the {len(uncovered)} elements of the "
            "first do not lie opposite that of the second, turned over about the x1 axis, with up to "
            f"{uncovered.max():.0%} of their area; allowed: the same nodes in both zones, or a zone of the first body "
            f"inside that of the second, to {MAX_UNCOVERED:.0%} of each element"
        )


@dataclass(frozen=True, eq=False)
class Located:
    """Shape functions of a surface near points (n,).

    nodes: (n, k); shapes: (n, k); slopes: (n, k, d), derivatives in the plane. Surplus columns are zero. inside: (n,),
    distance from the nearest side of the triangle around the point, in its heights; negative outside the surface.
    """

    nodes: Indices
    shapes: Array
    slopes: Array
    inside: Array


def _locate(points: Array, second: _Surface, candidates: int = _CANDIDATES) -> Located:
    """Return the shape functions of the element of a surface in which, or nearest to which, each point (n, 3) lies."""
    n, width = len(points), max(block.nodes.shape[1] for block in second.blocks)
    tree = scipy.spatial.cKDTree(second.corners.mean(axis=1))
    _, near = tree.query(points[:, :2], min(candidates, len(second.corners)))
    near = near.reshape(n, -1)
    sides = second.corners[near]  # (n, c, 3, 2)
    areas = [
        _areas(np.stack([np.broadcast_to(points[:, None, :2], sides[:, :, 0].shape), *pair], axis=2))
        for pair in (
            (sides[:, :, 1], sides[:, :, 2]),
            (sides[:, :, 2], sides[:, :, 0]),
            (sides[:, :, 0], sides[:, :, 1]),
        )
    ]
    inside = np.min(areas, axis=0) / _areas(sides)
    triangle = near[np.arange(n), inside.argmax(axis=1)]
    arrays = np.zeros((n, width), np.int64), np.zeros((n, width)), np.zeros((n, width, 2))
    located = Located(*arrays, inside.max(axis=1))
    for j, block in enumerate(second.blocks):
        chosen = np.flatnonzero(second.block[triangle] == j)
        nodes = block.nodes[second.element[triangle[chosen]]]
        k, plane = nodes.shape[1], second.points[nodes][..., :2]
        xi = _reference_points(block.element, plane, points[chosen, :2])
        derivatives = shape_derivatives(block.element, xi)
        located.nodes[chosen, :k] = nodes
        located.shapes[chosen, :k] = shape_functions(block.element, xi)
        located.slopes[chosen, :k] = np.einsum("mak,mkd->mad", derivatives, _inverse(plane, derivatives))
    return located


def _check_distance(first: _Surface, second: _Surface, located: Located) -> None:
    extent = float(np.linalg.norm(np.ptp(first.points, axis=0)))
    heights = np.einsum("nk,nk->n", located.shapes, second.points[located.nodes, 2])
    distances: Array = np.abs(heights - first.points[:, 2])
    if not distances.max() <= MAX_DISTANCE * extent:
        raise MeshError(
            f"the contact zones of the two bodies are up to {distances.max():.3g} m apart along the normal of the "
            f"first; allowed: {MAX_DISTANCE * extent:.3g} m, {MAX_DISTANCE:.0%} of its extent"
        )


def _corrected(
    mixed: "scipy.sparse.csr_array",
    mass: "scipy.sparse.csr_array",
    first: _Surface,
    second: _Surface,
    located: Located,
) -> "scipy.sparse.csr_array":
    """Return mixed integrals with the integrals and first moments of the shape functions of the first surface.

    They miss slivers outside the second surface, and round-off. The element of the second surface near each node is
    continued linearly to supply them.
    """
    one, other = first.points[:, :2], second.points[:, :2]
    integrals: Array = mass.sum(axis=1) - mixed.sum(axis=1)
    moments: Array = mass @ one - mixed @ other - integrals[:, None] * one
    entries = integrals[:, None] * located.shapes + np.einsum("nkd,nd->nk", located.slopes, moments)
    rows: NDArray[np.int64] = np.arange(len(one))[:, None]
    return mixed + _scatter(entries[:, None, :], rows, located.nodes, mixed.shape)
