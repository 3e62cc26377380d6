"""Collocation points, with as many equations of each field at each mesh point as there are unknowns.

If a point has one unknown of a field, eq. (19) is collocated at the point. If a value is prescribed on several patches
that meet at a point, each of them has an unknown flux there, and their equations at the point would be the same. Each
equation is then collocated at a point inside its patch.
"""

from dataclasses import dataclass

import numpy as np

from meeframe.elements.base import shape_functions
from meeframe.fields import Array, Indices
from meeframe.formulations.dense_bem.layout import NONE, Layout
from meeframe.mesh.surface import SurfaceMesh

INWARD_SHIFT = 0.35
"""Shift of a collocation point into its patch, as a fraction of the distance from node to centre of the element."""


@dataclass(frozen=True, eq=False)
class Sources:
    """Collocation points.

    Attributes
    ----------
    position : Array
        Positions, (s, 3).
    row : Indices
        Row of the equation of each field, (s, fields), NONE if it is not collocated here.
    singular_start : Indices
        First singular element of each point, and their number, (s + 1,). Singular elements contain the point.
    singular_block, singular_element : Indices
        Block and element in the block of each singular element, (o,).
    singular_xi : Array
        Reference coordinates of the point on each singular element, (o, 2).
    mesh_points, shape : Indices, Array
        Mesh points and shape functions that interpolate at each collocation point, (s, k), zero-padded.
    """

    position: Array
    row: Indices
    singular_start: Indices
    singular_block: Indices
    singular_element: Indices
    singular_xi: Array
    mesh_points: Indices
    shape: Array


def collocate(mesh: SurfaceMesh, layout: Layout) -> Sources:
    """Return the collocation points of a layout.

    Parameters
    ----------
    mesh : SurfaceMesh
        The mesh.
    layout : Layout
        Numbers of the unknowns.

    Returns
    -------
    Sources
        Collocation points, in which each row from 0 to n_unknowns - 1 occurs once.
    """
    patches = layout.patches
    n_flux_unknowns = np.zeros((len(mesh.points), layout.flux_column.shape[1]), int)
    np.add.at(n_flux_unknowns, patches.point, layout.flux_column != NONE)
    shared = n_flux_unknowns[patches.point] > 1
    at_node = np.where(layout.value_column < layout.n_unknowns, layout.value_column, NONE)
    single = (layout.flux_column != NONE) & ~shared
    patch, field = np.nonzero(single)
    at_node[patches.point[patch], field] = layout.flux_column[patch, field]
    inside = np.where(shared, layout.flux_column, NONE)
    return _join(_at_nodes(mesh, layout, at_node), _inside_patches(mesh, layout, inside))


def _at_nodes(mesh: SurfaceMesh, layout: Layout, rows: Indices) -> Sources:
    corners = layout.patches.corners
    points = np.flatnonzero((rows != NONE).any(axis=1))
    order = np.argsort(corners.point, kind="stable")
    start = np.searchsorted(corners.point[order], points)
    stop = np.searchsorted(corners.point[order], points, side="right")
    singular = np.concatenate([order[a:b] for a, b in zip(start, stop, strict=True)])
    width = max(block.connectivity.shape[1] for block in mesh.blocks)
    mesh_points = np.zeros((len(points), width), np.int64)
    shape = np.zeros((len(points), width))
    mesh_points[:, 0], shape[:, 0] = points, 1.0
    nodes = [block.element.nodes for block in mesh.blocks]
    xi = np.array([nodes[b][a] for b, a in zip(corners.block[singular], corners.local[singular], strict=True)])
    singular_start = np.concatenate([[0], np.cumsum(stop - start)])
    return Sources(
        mesh.points[points],
        rows[points],
        singular_start,
        corners.block[singular],
        corners.element[singular],
        xi.reshape(-1, 2),
        mesh_points,
        shape,
    )


def _inside_patches(mesh: SurfaceMesh, layout: Layout, rows: Indices) -> Sources:
    corners = layout.patches.corners
    patch = np.flatnonzero((rows != NONE).any(axis=1))
    _, first_of_patch = np.unique(layout.patches.corner_patch, return_index=True)
    singular = first_of_patch[patch]
    width = max(block.connectivity.shape[1] for block in mesh.blocks)
    xi = np.zeros((len(singular), 2))
    mesh_points = np.zeros((len(singular), width), np.int64)
    shape = np.zeros((len(singular), width))
    for k, corner in enumerate(singular):
        block = mesh.blocks[corners.block[corner]]
        nodes = block.element.nodes
        node = nodes[corners.local[corner]]
        xi[k] = node + INWARD_SHIFT * (nodes.mean(axis=0) - node)
        mesh_points[k, : len(nodes)] = block.connectivity[corners.element[corner]]
        shape[k, : len(nodes)] = shape_functions(block.element, xi[k : k + 1])[0]
    position = np.einsum("sk,skx->sx", shape, mesh.points[mesh_points])
    return Sources(
        position,
        rows[patch],
        np.arange(len(singular) + 1),
        corners.block[singular],
        corners.element[singular],
        xi,
        mesh_points,
        shape,
    )


def _join(a: Sources, b: Sources) -> Sources:
    singular_start = np.concatenate([a.singular_start, a.singular_start[-1] + b.singular_start[1:]])

    def stack(name: str) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        joined: Array = np.concatenate([getattr(a, name), getattr(b, name)])
        return joined

    return Sources(
        stack("position"),
        stack("row").astype(np.int64),
        singular_start,
        stack("singular_block").astype(np.int64),
        stack("singular_element").astype(np.int64),
        stack("singular_xi"),
        stack("mesh_points").astype(np.int64),
        stack("shape"),
    )
