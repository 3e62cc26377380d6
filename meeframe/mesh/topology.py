"""Edges of the elements of a mesh, and which of them are shared."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from meeframe.common.memoize import memoize_by_identity
from meeframe.elements.base import SurfaceElement
from meeframe.fields import Indices
from meeframe.mesh.surface import SurfaceMesh


@dataclass(frozen=True, eq=False)
class MeshEdges:
    """Edges of all elements, one entry for each element and edge, block after block.

    Attributes
    ----------
    ends : Indices
        Corner numbers, (k, 2), in the sense of the element.
    between : Indices
        Point numbers inside the edge, (k, m), in the sense from the smaller to the larger end, padded with -1.
    elements : Indices
        Element numbers over all blocks, (k,).
    number : Indices
        Number of the mesh edge, (k,), counted from 0; the same for entries with the same two ends.
    """

    ends: Indices
    between: Indices
    elements: Indices
    number: Indices


def corner_count(element: SurfaceElement) -> int:
    """Return the number of corners of an element, which are its first nodes."""
    return 3 if element.reference == "triangle" else 4


def edge_nodes(element: SurfaceElement) -> list[Indices]:
    """Return the local node numbers along each edge, from one corner to the next, counter-clockwise."""
    n = corner_count(element)
    nodes = np.asarray(element.nodes, float)
    edges = []
    for k in range(n):
        start, along = nodes[k], nodes[(k + 1) % n] - nodes[k]
        offset = nodes - start
        on_edge = np.abs(along[0] * offset[:, 1] - along[1] * offset[:, 0]) < 1e-9
        edges.append(np.flatnonzero(on_edge)[np.argsort(offset[on_edge] @ along)])
    return edges


@memoize_by_identity
def find_edges(mesh: SurfaceMesh) -> MeshEdges:
    """Return the edges of a mesh whose connectivity is in range."""
    ends, between, elements, first = [np.empty((0, 2), np.int64)], [], [np.empty(0, np.int64)], 0
    for block in mesh.blocks:
        numbers = first + np.arange(len(block.connectivity))
        first += len(numbers)
        for local in edge_nodes(block.element):
            nodes = block.connectivity[:, local]
            ends.append(nodes[:, [0, -1]])
            between.append(np.where((nodes[:, 0] < nodes[:, -1])[:, None], nodes, nodes[:, ::-1])[:, 1:-1])
            elements.append(numbers)
    width = max((inner.shape[1] for inner in between), default=0)
    padded = [np.pad(inner, ((0, 0), (0, width - inner.shape[1])), constant_values=-1) for inner in between]
    all_ends = np.concatenate(ends)
    inside = np.concatenate(padded) if padded else np.empty((0, 0), np.int64)
    _, number = np.unique(np.sort(all_ends, axis=1), axis=0, return_inverse=True)
    edges = MeshEdges(all_ends, inside, np.concatenate(elements), number.ravel())
    for array in (edges.ends, edges.between, edges.elements, edges.number):
        array.setflags(write=False)
    return edges


def reflection(element: SurfaceElement) -> Indices:
    """Return the node order (n,) of an element seen from its other side: connectivity[:, order] is flipped."""
    swapped = np.asarray(element.nodes, float)[:, ::-1]
    distance = np.abs(swapped[:, None, :] - element.nodes[None, :, :]).sum(axis=-1)
    order: Indices = distance.argmin(axis=1).astype(np.int64)
    return order


def boundary_polygon(mesh: SurfaceMesh) -> Indices:
    """Return the segments (k, 2) of the boundary of an open mesh, as point numbers in the sense of the elements."""
    edges = find_edges(mesh)
    open_edges = np.flatnonzero(np.bincount(edges.number)[edges.number] == 1)
    sides = []
    for edge in open_edges:
        start, end = edges.ends[edge]
        inner = edges.between[edge][edges.between[edge] >= 0]
        path = [start, *(inner if start < end else inner[::-1]), end]
        sides += list(pairwise(path))
    return np.array(sides, np.int64).reshape(-1, 2)
