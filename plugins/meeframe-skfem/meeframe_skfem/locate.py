"""Location of points on a surface mesh, by element and reference coordinates of the nearest point."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.sparse import csr_array

from meeframe.plugin import Array, Indices, SurfaceElement
from meeframe.plugin.surfaces import ElementBlock, Reference, shape_derivatives, shape_functions

MAX_ITERATIONS: Final = 30
MAX_CHANGE: Final = 1e-14  # change of reference coordinates
MAX_COORDINATE: Final = 3.0  # bound of reference coordinates during the iteration
MIN_SHAPE: Final = 1e-12  # smaller shape functions are round-off, which would make equal data of two faces differ
_BATCH_SIZE: Final = 10_000_000  # points times elements of one batch


@dataclass(frozen=True, eq=False)
class NearestPoints:
    """Nearest points on the elements of one block.

    Attributes
    ----------
    element : Indices
        Elements, (m,).
    xi : Array
        Reference coordinates, (m, 2).
    distance : Array
        Distances, (m,), inf if no element is near.
    """

    element: Indices
    xi: Array
    distance: Array


def nearest_points(points: Array, block: ElementBlock, targets: Array, max_distance: float) -> NearestPoints:
    """Return the nearest point on a block of elements for each target.

    Parameters
    ----------
    points : Array
        Points of the mesh, (p, 3).
    block : ElementBlock
        The elements.
    targets : Array
        Targets, (m, 3).
    max_distance : float
        Search distance. Farther points may be missed; their distance is then inf.
    """
    element, target = _candidates(points[block.connectivity], targets, max_distance)
    xi, distance = _project(block.element, points[block.connectivity[element]], targets[target])
    order = np.lexsort((distance, target))
    first = order[np.unique(target[order], return_index=True)[1]]
    nearest = NearestPoints(
        np.zeros(len(targets), np.int64), np.zeros((len(targets), 2)), np.full(len(targets), np.inf)
    )
    nearest.element[target[first]] = element[first]
    nearest.xi[target[first]] = xi[first]
    nearest.distance[target[first]] = distance[first]
    return nearest


def interpolation(
    points: Array, blocks: list[ElementBlock], targets: Array, max_distance: float
) -> tuple[csr_array, Array]:
    """Return the interpolation from the points of a mesh to the points nearest to targets.

    Parameters
    ----------
    points : Array
        Points of the mesh, (p, 3).
    blocks : list of ElementBlock
        The elements.
    targets : Array
        Targets, (m, 3).
    max_distance : float
        Search distance, see `nearest_points`.

    Returns
    -------
    csr_array
        Interpolation matrix, (m, p).
    Array
        Distances of the targets, (m,).
    """
    candidates = [nearest_points(points, block, targets, max_distance) for block in blocks]
    distance = np.min([nearest.distance for nearest in candidates], axis=0)
    best = np.argmin([nearest.distance for nearest in candidates], axis=0)
    rows, columns, shares = [], [], []
    for number, (block, nearest) in enumerate(zip(blocks, candidates, strict=True)):
        members = np.flatnonzero((best == number) & np.isfinite(distance))
        shape = shape_functions(block.element, nearest.xi[members])
        rows.append(np.repeat(members, shape.shape[1]))
        columns.append(block.connectivity[nearest.element[members]].ravel())
        shares.append(np.where(np.abs(shape) < MIN_SHAPE, 0.0, shape).ravel())
    entries = (np.concatenate(shares), (np.concatenate(rows), np.concatenate(columns)))
    return csr_array(entries, shape=(len(targets), len(points))), distance


def _candidates(corners: Array, targets: Array, max_distance: float) -> tuple[Indices, Indices]:
    """Return elements and targets with the target near the bounding box of the element; corners (e, n, 3)."""
    low, high = corners.min(axis=1) - max_distance, corners.max(axis=1) + max_distance
    step = max(1, _BATCH_SIZE // max(1, len(targets)))
    matches = []
    for start in range(0, len(low), step):
        batch = slice(start, start + step)
        inside = ((targets >= low[batch, None]) & (targets <= high[batch, None])).all(axis=-1)
        element, target = np.nonzero(inside)
        matches.append((element + start, target))
    return np.concatenate([e for e, _ in matches]), np.concatenate([w for _, w in matches])


def _project(element: SurfaceElement, nodes: Array, targets: Array) -> tuple[Array, Array]:
    """Return reference coordinates (m, 2) of the nearest point on each element (m, n, 3), and its distance (m,)."""
    xi = np.tile(element.nodes.mean(axis=0), (len(targets), 1))
    for _ in range(MAX_ITERATIONS):
        offset = targets - np.einsum("mn,mnx->mx", shape_functions(element, xi), nodes)
        tangents = np.einsum("mnk,mnx->mkx", shape_derivatives(element, xi), nodes)
        metric = tangents @ tangents.transpose(0, 2, 1)
        step = np.linalg.solve(metric, np.einsum("mkx,mx->mk", tangents, offset)[..., None])[..., 0]
        next_xi = np.clip(xi + step, -MAX_COORDINATE, MAX_COORDINATE)
        change, xi = np.abs(next_xi - xi).max(initial=0.0), next_xi
        if change < MAX_CHANGE:
            break
    xi = _clip(element.reference, xi)
    offset = targets - np.einsum("mn,mnx->mx", shape_functions(element, xi), nodes)
    return xi, np.linalg.norm(offset, axis=1)


def _clip(reference: Reference, xi: Array) -> Array:
    """Return reference coordinates clipped to the reference domain."""
    if reference == "quadrilateral":
        return np.clip(xi, -1.0, 1.0)
    positive = np.maximum(xi, 0.0)
    inside: Array = positive / np.maximum(positive.sum(axis=1, keepdims=True), 1.0)
    return inside
