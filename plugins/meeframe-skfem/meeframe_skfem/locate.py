"""Where points lie on a surface mesh: element and reference coordinates of the nearest place."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.sparse import csr_array

from meeframe.plugin import Array, Indices, SurfaceElement
from meeframe.plugin.surfaces import ElementBlock, Reference, shape_derivatives, shape_functions

ITERATIONS: Final = 30
CONVERGED: Final = 1e-14  # of reference coordinates
FARTHEST: Final = 3.0  # reference coordinates are kept below while they are sought
NOTHING: Final = 1e-12  # shape values below are round-off, which would tell equal data of two faces apart
_PAIRS: Final = 10_000_000  # points times elements looked at in one go


@dataclass(frozen=True, eq=False)
class Places:
    """Nearest places on elements of one block: (m,) element, (m, 2) reference coordinates, (m,) distance, or inf."""

    element: Indices
    xi: Array
    distance: Array


def nearest(points: Array, block: ElementBlock, at: Array, reach: float) -> Places:
    """The nearest place on a block for each point `at` (m, 3).

    points: of the mesh. Places farther away than `reach` may be missed; their distance is then inf.
    """
    element, which = _candidates(points[block.connectivity], at, reach)
    xi, distance = _project(block.element, points[block.connectivity[element]], at[which])
    order = np.lexsort((distance, which))
    first = order[np.unique(which[order], return_index=True)[1]]
    places = Places(np.zeros(len(at), np.int64), np.zeros((len(at), 2)), np.full(len(at), np.inf))
    places.element[which[first]] = element[first]
    places.xi[which[first]] = xi[first]
    places.distance[which[first]] = distance[first]
    return places


def interpolation(points: Array, blocks: list[ElementBlock], at: Array, reach: float) -> tuple[csr_array, Array]:
    """Matrix (m, p) from values at the mesh's points to those at places nearest to `at` (m, 3), and distances (m,)."""
    found = [nearest(points, block, at, reach) for block in blocks]
    distance = np.min([places.distance for places in found], axis=0)
    best = np.argmin([places.distance for places in found], axis=0)
    rows, columns, shares = [], [], []
    for number, (block, places) in enumerate(zip(blocks, found, strict=True)):
        own = np.flatnonzero((best == number) & np.isfinite(distance))
        shape = shape_functions(block.element, places.xi[own])
        rows.append(np.repeat(own, shape.shape[1]))
        columns.append(block.connectivity[places.element[own]].ravel())
        shares.append(np.where(np.abs(shape) < NOTHING, 0.0, shape).ravel())
    entries = (np.concatenate(shares), (np.concatenate(rows), np.concatenate(columns)))
    return csr_array(entries, shape=(len(at), len(points))), distance


def _candidates(corners: Array, at: Array, reach: float) -> tuple[Indices, Indices]:
    """Pairs (element, point) with the point within reach of the element's box; corners (e, n, 3)."""
    low, high = corners.min(axis=1) - reach, corners.max(axis=1) + reach
    step = max(1, _PAIRS // max(1, len(at)))
    pairs = []
    for start in range(0, len(low), step):
        part = slice(start, start + step)
        inside = ((at >= low[part, None]) & (at <= high[part, None])).all(axis=-1)
        element, which = np.nonzero(inside)
        pairs.append((element + start, which))
    return np.concatenate([e for e, _ in pairs]), np.concatenate([w for _, w in pairs])


def _project(element: SurfaceElement, nodes: Array, at: Array) -> tuple[Array, Array]:
    """Reference coordinates (m, 2) of the nearest place on each element, nodes (m, n, 3), and its distance (m,)."""
    xi = np.tile(element.nodes.mean(axis=0), (len(at), 1))
    for _ in range(ITERATIONS):
        offset = at - np.einsum("mn,mnx->mx", shape_functions(element, xi), nodes)
        tangents = np.einsum("mnk,mnx->mkx", shape_derivatives(element, xi), nodes)
        metric = tangents @ tangents.transpose(0, 2, 1)
        step = np.linalg.solve(metric, np.einsum("mkx,mx->mk", tangents, offset)[..., None])[..., 0]
        moved = np.clip(xi + step, -FARTHEST, FARTHEST)
        change, xi = np.abs(moved - xi).max(initial=0.0), moved
        if change < CONVERGED:
            break
    xi = _inside(element.reference, xi)
    offset = at - np.einsum("mn,mnx->mx", shape_functions(element, xi), nodes)
    return xi, np.linalg.norm(offset, axis=1)


def _inside(reference: Reference, xi: Array) -> Array:
    """Reference coordinates moved into the reference domain."""
    if reference == "quadrilateral":
        return np.clip(xi, -1.0, 1.0)
    positive = np.maximum(xi, 0.0)
    inside: Array = positive / np.maximum(positive.sum(axis=1, keepdims=True), 1.0)
    return inside
