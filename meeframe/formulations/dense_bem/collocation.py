"""Collocation points: as many equations of each field at each mesh point as there are unknowns.

Where one unknown of a field belongs to a point, eq. (19) is collocated there. Where a value is prescribed on several
patches that meet at a point, each of them has an unknown flux there and the equations at the point itself would be
alike; each is then collocated a little inside its own patch.
"""

from dataclasses import dataclass

import numpy as np

from meeframe.elements.base import shape_functions
from meeframe.fields import Array, Indices
from meeframe.formulations.dense_bem.layout import NONE, Layout
from meeframe.mesh.surface import SurfaceMesh

INWARD_SHIFT = 0.35
"""How far, from node to centre of the element, a collocation point moves inside its patch."""


@dataclass(frozen=True, eq=False)
class Sources:
    """Collocation points.

    position: (s, 3); row: (s, fields) row of each field's equation, NONE where it is not collocated;
    own_start: (s + 1,) into own_block, own_element and source_xi (o, 2), the elements that hold each point;
    mesh_points, shape: (s, k) mesh points and shape values that interpolate at it, zero-padded.
    """

    position: Array
    row: Indices
    own_start: Indices
    own_block: Indices
    own_element: Indices
    source_xi: Array
    mesh_points: Indices
    shape: Array


def collocate(mesh: SurfaceMesh, layout: Layout) -> Sources:
    """Return the collocation points for a layout; every row 0..n_unknowns-1 appears once."""
    patches = layout.patches
    n_flux_unknowns = np.zeros((len(mesh.points), layout.flux_column.shape[1]), int)
    np.add.at(n_flux_unknowns, patches.point, layout.flux_column != NONE)
    shared = n_flux_unknowns[patches.point] > 1
    at_node = layout.value_column.copy()
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
    own = np.concatenate([order[a:b] for a, b in zip(start, stop, strict=True)])
    width = max(block.connectivity.shape[1] for block in mesh.blocks)
    mesh_points = np.zeros((len(points), width), np.int64)
    shape = np.zeros((len(points), width))
    mesh_points[:, 0], shape[:, 0] = points, 1.0
    nodes = [block.element.nodes for block in mesh.blocks]
    xi = np.array([nodes[b][a] for b, a in zip(corners.block[own], corners.local[own], strict=True)])
    own_start = np.concatenate([[0], np.cumsum(stop - start)])
    return Sources(
        mesh.points[points],
        rows[points],
        own_start,
        corners.block[own],
        corners.element[own],
        xi.reshape(-1, 2),
        mesh_points,
        shape,
    )


def _inside_patches(mesh: SurfaceMesh, layout: Layout, rows: Indices) -> Sources:
    corners = layout.patches.corners
    patch = np.flatnonzero((rows != NONE).any(axis=1))
    _, first_of_patch = np.unique(layout.patches.of_corner, return_index=True)
    own = first_of_patch[patch]
    width = max(block.connectivity.shape[1] for block in mesh.blocks)
    xi = np.zeros((len(own), 2))
    mesh_points = np.zeros((len(own), width), np.int64)
    shape = np.zeros((len(own), width))
    for k, corner in enumerate(own):
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
        np.arange(len(own) + 1),
        corners.block[own],
        corners.element[own],
        xi,
        mesh_points,
        shape,
    )


def _join(a: Sources, b: Sources) -> Sources:
    own_start = np.concatenate([a.own_start, a.own_start[-1] + b.own_start[1:]])

    def stack(name: str) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        joined: Array = np.concatenate([getattr(a, name), getattr(b, name)])
        return joined

    return Sources(
        stack("position"),
        stack("row").astype(np.int64),
        own_start,
        stack("own_block").astype(np.int64),
        stack("own_element").astype(np.int64),
        stack("source_xi"),
        stack("mesh_points").astype(np.int64),
        stack("shape"),
    )
