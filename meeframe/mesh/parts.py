"""Closed surfaces of a mesh and the separate parts of the body that they bound."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from meeframe.common.memoize import memoize_by_identity
from meeframe.fields import Array, Indices
from meeframe.mesh.surface import SurfaceMesh
from meeframe.mesh.topology import corner_count, find_edges


@memoize_by_identity
def connected_surfaces(mesh: SurfaceMesh) -> tuple[Indices, NDArray[np.bool_]]:
    """Find the connected surfaces of a mesh.

    Returns
    -------
    Indices
        Surface of each element, (n_elements,). Elements that share an edge belong to the same surface.
    ndarray of bool
        True where surface i lies inside surface j, (s, s); meaningless for open surfaces.
    """
    edges = find_edges(mesh)
    n, sides = mesh.n_elements, len(edges.number)
    graph = coo_array((np.ones(sides), (edges.elements, n + edges.number)), shape=(n + sides, n + sides))
    surface = np.unique(connected_components(graph, directed=False)[1][:n], return_inverse=True)[1]
    count = int(surface.max(initial=-1)) + 1
    inside = np.zeros((count, count), bool)
    if count > 1:
        triangles, element = _corner_triangles(mesh)
        for number in range(count):
            probe = triangles[np.argmax(surface[element] == number), 0]
            angles = np.bincount(surface[element], weights=_solid_angles(triangles - probe), minlength=count)
            inside[number] = np.abs(angles) > 2 * np.pi
            inside[number, number] = False
    surface = surface.astype(np.int64)
    surface.setflags(write=False)
    inside.setflags(write=False)
    return surface, inside


def body_parts(mesh: SurfaceMesh) -> Indices:
    """Return the separate part of the body that each point bounds, (p,), counted from 0.

    The surface of a cavity belongs to the part around it.
    """
    surface, inside = connected_surfaces(mesh)
    depth = inside.sum(axis=1)
    around = np.argmax(inside & (depth == depth[:, None] - 1), axis=1)
    part = np.unique(np.where(depth % 2 == 0, np.arange(len(depth)), around), return_inverse=True)[1][surface]
    point_part, first = np.zeros(len(mesh.points), np.int64), 0
    for block in mesh.blocks:
        point_part[block.connectivity] = part[first : first + len(block.groups), None]
        first += len(block.groups)
    return point_part


def _corner_triangles(mesh: SurfaceMesh) -> tuple[Array, Indices]:
    """Return the elements as flat triangles between corners, (t, 3, 3), and the element of each triangle, (t,)."""
    triangles, element, first = [], [], 0
    for block in mesh.blocks:
        numbers = first + np.arange(len(block.connectivity))
        first += len(numbers)
        for k in range(1, corner_count(block.element) - 1):
            triangles.append(mesh.points[block.connectivity[:, [0, k, k + 1]]])
            element.append(numbers)
    return np.concatenate(triangles), np.concatenate(element)


def _solid_angles(triangles: Array) -> Array:
    """Return the solid angle of each triangle (t, 3, 3) seen from the origin (van Oosterom, Strackee, 1983)."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    triple = np.einsum("ti,ti->t", a, np.cross(b, c))
    dots = la * lb * lc + np.einsum("ti,ti->t", a, b) * lc + np.einsum("ti,ti->t", b, c) * la
    angles: Array = 2 * np.arctan2(triple, dots + np.einsum("ti,ti->t", c, a) * lb)
    return angles
