"""Checks that a mesh is the closed, outward oriented boundary of a body."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from meeframe.common.errors import MeshError
from meeframe.common.memoize import memoize_by_identity
from meeframe.fields import Array, Indices
from meeframe.mesh.measures import gauss_rule, normal_vectors, volume_shares
from meeframe.mesh.nearby import close_point_pairs
from meeframe.mesh.parts import connected_surfaces
from meeframe.mesh.surface import ElementBlock, SurfaceMesh
from meeframe.mesh.topology import MeshEdges, find_edges, reflection

Flags = NDArray[np.bool_]

MAX_POSITIONS_SHOWN = 3  # largest number of positions in a message
MERGE_FRACTION = 1e-3  # points closer than this fraction of the shortest edge are duplicates
PLANE_TOLERANCE = 1e-9  # largest difference of unit normals on the boundary of a half space
MIN_JACOBIAN_RATIO = 1e-6  # least Jacobian of an element relative to its mean
MAX_COORDINATE = 1e60  # largest coordinate [m] for which areas and volumes do not overflow


@memoize_by_identity
def check_mesh(mesh: SurfaceMesh) -> None:
    """Check that a mesh is the boundary of a body.

    The checks are, in this order: indices in range, finite points, no unused points, no repeated nodes, no duplicate
    points, no degenerate or folded elements, closed and manifold, consistently oriented, conforming at mid-sides,
    oriented outwards. The boundary of a semi-infinite body must be plane instead of closed.

    Parameters
    ----------
    mesh : SurfaceMesh
        The mesh.

    Raises
    ------
    MeshError
        If a check fails; the message says what is wrong, how often and where.
    """
    _check_numbers(mesh)
    _check_points(mesh)
    _check_elements(mesh)
    _check_edges(mesh, find_edges(mesh))
    if mesh.semi_infinite:
        _check_plane(mesh)
        return
    surfaces, inverted = _inverted_surfaces(mesh)
    if inverted.any():
        middles = _middles(mesh)[inverted[surfaces]]
        state = "is" if inverted.all() else f"has {inverted.sum()} of {len(inverted)} closed surfaces"
        rule = "elements must be counter-clockwise seen from outside; reorient = true flips those of a file"
        _reject(f"the surface {state} inside out ({rule})", middles, "element")


def orient_outward(mesh: SurfaceMesh) -> SurfaceMesh:
    """Return the mesh with all closed surfaces oriented outwards.

    Parameters
    ----------
    mesh : SurfaceMesh
        The mesh.

    Returns
    -------
    SurfaceMesh
        The oriented mesh.

    Raises
    ------
    MeshError
        If the mesh is not closed or not consistently oriented.
    """
    _check_numbers(mesh)
    _check_edges(mesh, find_edges(mesh))
    surfaces, inverted = _inverted_surfaces(mesh)
    blocks, first = [], 0
    for block in mesh.blocks:
        flip = inverted[surfaces[first : first + len(block.groups)]]
        first += len(flip)
        flipped = block.connectivity[:, reflection(block.element)]
        blocks.append(ElementBlock(block.element, np.where(flip[:, None], flipped, block.connectivity), block.groups))
    return replace(mesh, blocks=tuple(blocks))


def merge_points(mesh: SurfaceMesh, tolerance: float) -> SurfaceMesh:
    """Merge points that lie close together and remove unused points.

    Parameters
    ----------
    mesh : SurfaceMesh
        The mesh.
    tolerance : float
        Points closer than this [m], or linked by a chain of such points, become the first one of them.

    Returns
    -------
    SurfaceMesh
        The mesh of the remaining points.

    Raises
    ------
    MeshError
        If the tolerance is negative or an element would collapse.
    """
    if not (np.isfinite(tolerance) and tolerance >= 0):
        raise MeshError(f"merge_tolerance = {tolerance!r}: must be a length of at least zero")
    _check_numbers(mesh)
    _check_finite(mesh)
    pairs = close_point_pairs(mesh.points, tolerance)
    n = len(mesh.points)
    _, label = connected_components(coo_array((np.ones(len(pairs)), tuple(pairs.T)), shape=(n, n)), directed=False)
    first = np.unique(label, return_index=True)[1]
    target = first[label].astype(np.int64)
    blocks = tuple(ElementBlock(b.element, target[b.connectivity], b.groups) for b in mesh.blocks)
    merged = remove_unused_points(replace(mesh, blocks=blocks))
    _check_repeats(merged)
    return merged


def remove_unused_points(mesh: SurfaceMesh) -> SurfaceMesh:
    """Return the mesh without points that no element uses.

    Raises
    ------
    MeshError
        If point or group numbers are out of range.
    """
    _check_numbers(mesh)
    is_used = _used_points(mesh)
    number = np.cumsum(is_used) - 1
    blocks = tuple(ElementBlock(b.element, number[b.connectivity], b.groups) for b in mesh.blocks)
    return replace(mesh, points=mesh.points[is_used], blocks=blocks)


def _used_points(mesh: SurfaceMesh) -> Flags:
    """Return the points that an element uses, (p,)."""
    is_used = np.zeros(len(mesh.points), bool)
    for block in mesh.blocks:
        is_used[block.connectivity] = True
    return is_used


def _reject(message: str, positions: Array, noun: str) -> None:
    shown = ", ".join("({:.6g}, {:.6g}, {:.6g})".format(*position) for position in positions[:MAX_POSITIONS_SHOWN])
    more = ", ..." if len(positions) > MAX_POSITIONS_SHOWN else ""
    raise MeshError(f"{message}: {len(positions)} {noun}{'s' * (len(positions) > 1)}, at {shown}{more} [m]")


def _middles(mesh: SurfaceMesh) -> Array:
    """Return the mean of the nodes of each element, (n_elements, 3)."""
    return np.concatenate([mesh.points[b.connectivity].mean(axis=1) for b in mesh.blocks])


def _check_numbers(mesh: SurfaceMesh) -> None:
    if mesh.n_elements == 0:
        raise MeshError("the surface has no elements")
    if mesh.points.ndim != 2 or mesh.points.shape[1] != 3:
        raise MeshError(f"points of the surface have shape {mesh.points.shape}; allowed: (p, 3)")
    for block in mesh.blocks:
        shape, nodes = block.connectivity.shape, len(block.element.nodes)
        if block.connectivity.ndim != 2 or shape[1] != nodes:
            raise MeshError(f"connectivity of {block.element.name} has shape {shape}; allowed: (e, {nodes})")
        if block.groups.shape != shape[:1]:
            raise MeshError(
                f"there are {shape[0]} elements {block.element.name}, but {len(block.groups)} group numbers"
            )
        for name, numbers, limit in (
            ("point", block.connectivity, len(mesh.points)),
            ("face group", block.groups, len(mesh.group_names)),
        ):
            wrong = numbers[(numbers < 0) | (numbers >= limit)]
            if wrong.size:
                raise MeshError(
                    f"{block.element.name} elements use {name} {wrong[0]}, but the largest number is {limit - 1}"
                )


def _check_finite(mesh: SurfaceMesh) -> None:
    bad = ~(np.abs(mesh.points) <= MAX_COORDINATE).all(axis=1)
    if bad.any():
        _reject(
            f"the surface has coordinates that are not finite or beyond {MAX_COORDINATE:g} m", mesh.points[bad], "point"
        )


def _check_points(mesh: SurfaceMesh) -> None:
    _check_finite(mesh)
    is_used = _used_points(mesh)
    if not is_used.all():
        _reject("the surface has points that no element uses", mesh.points[~is_used], "point")
    _check_repeats(mesh)
    ends = mesh.points[find_edges(mesh).ends]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    extent = np.ptp(mesh.points, axis=0).max()
    shortest = lengths[lengths > 1e-12 * extent].min(initial=extent)
    pairs = close_point_pairs(mesh.points, MERGE_FRACTION * shortest)
    if len(pairs):
        positions = mesh.points[np.sort(pairs.max(axis=1))]
        _reject("the surface has points that coincide with others (merge_tolerance merges them)", positions, "pair")


def _check_repeats(mesh: SurfaceMesh) -> None:
    for block in mesh.blocks:
        ordered = np.sort(block.connectivity, axis=1)
        bad = (ordered[:, 1:] == ordered[:, :-1]).any(axis=1)
        if bad.any():
            positions = mesh.points[block.connectivity[bad]].mean(axis=1)
            _reject("the surface has elements with the same node twice", positions, f"{block.element.name} element")


def _check_elements(mesh: SurfaceMesh) -> None:
    """Check that the normal at nodes and Gauss points is within a right angle of the mean normal."""
    for block in mesh.blocks:
        xi, weights = gauss_rule(block.element.reference, 3)
        inside = normal_vectors(mesh.points, block.element, block.connectivity, xi)
        at_nodes = normal_vectors(mesh.points, block.element, block.connectivity, block.element.nodes)
        mean = np.einsum("emd,m->ed", inside, weights / weights.sum())
        size = np.linalg.norm(inside, axis=-1).max(axis=1)
        along = np.einsum("emd,ed->em", np.concatenate([inside, at_nodes], axis=1), mean).min(axis=1)
        extent = np.ptp(mesh.points[block.connectivity], axis=1).max(axis=1)
        bad = (along <= MIN_JACOBIAN_RATIO * size**2) | (size <= 1e-12 * extent**2)
        if bad.any():
            positions = mesh.points[block.connectivity[bad]].mean(axis=1)
            message = "the surface has degenerate or folded elements (zero or negative Jacobian)"
            _reject(message, positions, f"{block.element.name} element")


def _check_edges(mesh: SurfaceMesh, edges: MeshEdges) -> None:
    count = np.bincount(edges.number)
    sense = np.bincount(edges.number, weights=np.where(edges.ends[:, 0] < edges.ends[:, 1], 1.0, -1.0))
    first = np.unique(edges.number, return_index=True)[1]
    middle = mesh.points[edges.ends[first]].mean(axis=1)
    faults = (
        (count > 2, "the surface is not a manifold: more than two elements share an edge"),
        ((count == 1) & (not mesh.semi_infinite), "the surface is not closed: an edge belongs to only one element"),
        (
            (count == 2) & (sense != 0),
            "the surface is not consistently oriented: two elements run along an edge in the same direction",
        ),
    )
    for bad, message in faults:
        if bad.any():
            _reject(message, middle[bad], "edge")
    order = np.argsort(edges.number, kind="stable")
    order = order[count[edges.number[order]] == 2].reshape(-1, 2)
    differ = (edges.between[order[:, 0]] != edges.between[order[:, 1]]).any(axis=1)
    if differ.any():
        positions = middle[edges.number[order[differ, 0]]]
        _reject(
            "the surface is not conforming: the mid-side nodes of two elements differ along an edge", positions, "edge"
        )


def _check_plane(mesh: SurfaceMesh) -> None:
    normals = []
    for block in mesh.blocks:
        vectors = normal_vectors(mesh.points, block.element, block.connectivity, block.element.nodes)
        normals.append((vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)).mean(axis=1))
    deviation = np.linalg.norm(np.concatenate(normals) - normals[0][0], axis=1)
    tilted = deviation > PLANE_TOLERANCE
    if tilted.any():
        _reject("the boundary of a half space is not plane", _middles(mesh)[tilted], "element")


def _inverted_surfaces(mesh: SurfaceMesh) -> tuple[Indices, Flags]:
    """Return the closed surface of each element, (n_elements,), and which surfaces are inside out, (s,).

    A surface inside an odd number of others bounds a cavity and must be oriented inwards.
    """
    surfaces, inside = connected_surfaces(mesh)
    signed = np.bincount(surfaces, weights=volume_shares(mesh, mesh.points.mean(axis=0)))
    return surfaces, np.where(inside.sum(axis=1) % 2 == 0, signed, -signed) <= 0
