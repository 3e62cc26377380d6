"""Flux nodes, which allow jumps of tractions and fluxes at edges of the body.

Values (extended displacements) are continuous and have one node at each mesh point. Fluxes (extended tractions) are
continuous on a face only and have one node for each *patch*: the elements that meet at a point, belong to one face
group and have no sharp edge between them.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from meeframe.common.memoize import memoize_by_identity
from meeframe.elements.base import shape_derivatives
from meeframe.fields import Array, Indices
from meeframe.mesh.surface import ElementBlock, SurfaceMesh


@dataclass(frozen=True, eq=False)
class Corners:
    """Local nodes of all elements of a mesh, here called corners.

    Attributes
    ----------
    block, element, local, point, group : Indices
        Block, element in the block, local node, mesh point and face group of each corner, (c,).
    normal : Array
        Outward unit normal of the element at each corner, (c, 3).
    """

    block: Indices
    element: Indices
    local: Indices
    point: Indices
    group: Indices
    normal: Array


@dataclass(frozen=True, eq=False)
class Patches:
    """Flux nodes of a mesh.

    Attributes
    ----------
    point, group : Indices
        Mesh point and face group of each flux node, (m,).
    connectivity : tuple of Indices
        Flux nodes of the elements of each block, (e, n).
    corners : Corners
        Corners of the mesh.
    corner_patch : Indices
        Flux node of each corner, (c,).
    """

    point: Indices
    group: Indices
    connectivity: tuple[Indices, ...]
    corners: Corners
    corner_patch: Indices


@memoize_by_identity
def find_patches(mesh: SurfaceMesh, edge_angle: float) -> Patches:
    """Return the flux nodes of a mesh.

    Parameters
    ----------
    mesh : SurfaceMesh
        The mesh.
    edge_angle : float
        Elements whose normals at a point differ by more than this [rad] belong to different patches.

    Returns
    -------
    Patches
        Flux nodes, grouped into patches with continuous normals.
    """
    corners = mesh_corners(mesh)
    corner_patch = _number_patches(corners, np.cos(edge_angle))
    _, first = np.unique(corner_patch, return_index=True)
    sizes = [block.connectivity.size for block in mesh.blocks]
    numbers = np.split(corner_patch, np.cumsum(sizes)[:-1])
    connectivity = tuple(n.reshape(block.connectivity.shape) for n, block in zip(numbers, mesh.blocks, strict=True))
    return Patches(corners.point[first], corners.group[first], connectivity, corners, corner_patch)


def mesh_corners(mesh: SurfaceMesh) -> Corners:
    """Return the corners of a mesh, block by block, element by element."""
    arrays = [_block_corners(number, block, mesh.points) for number, block in enumerate(mesh.blocks)]
    return Corners(*(np.concatenate(columns) for columns in zip(*arrays, strict=True)))


def _block_corners(number: int, block: ElementBlock, points: Array) -> tuple[Indices, ...]:
    n_elements, n_nodes = block.connectivity.shape
    derivatives = shape_derivatives(block.element, block.element.nodes)
    tangents = np.einsum("ank,enx->eakx", derivatives, points[block.connectivity])
    normals = np.cross(tangents[:, :, 0], tangents[:, :, 1]).reshape(-1, 3)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    element, local = np.indices((n_elements, n_nodes)).reshape(2, -1)
    block_number = np.full(n_elements * n_nodes, number)
    return block_number, element, local, block.connectivity.ravel(), np.repeat(block.groups, n_nodes), normals


def _number_patches(corners: Corners, cosine: float) -> Indices:
    """Return the patch of each corner: corners of one point and group are linked if their normals nearly agree."""
    order = np.lexsort((corners.group, corners.point))
    link_from, link_to = [], []
    for shift in range(1, _max_corners_at_a_point(corners)):
        a, b = order[:-shift], order[shift:]
        same = (corners.point[a] == corners.point[b]) & (corners.group[a] == corners.group[b])
        smooth = np.einsum("nx,nx->n", corners.normal[a], corners.normal[b]) > cosine
        link_from.append(a[same & smooth])
        link_to.append(b[same & smooth])
    rows, columns = np.concatenate(link_from), np.concatenate(link_to)
    n = len(order)
    graph = coo_array((np.ones(len(rows)), (rows, columns)), shape=(n, n))
    labels = connected_components(graph, directed=False)[1]
    return np.asarray(labels, dtype=np.int64)


def _max_corners_at_a_point(corners: Corners) -> int:
    return int(np.bincount(corners.point).max())
