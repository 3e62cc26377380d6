"""Checks that a mesh is the closed, outward oriented boundary of a body, with messages that say what is wrong where."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from meeframe.common.errors import MeshError
from meeframe.fields import Array, Indices
from meeframe.mesh.measures import gauss_rule, normal_vectors, volume_shares
from meeframe.mesh.nearby import close_pairs
from meeframe.mesh.parts import connected_surfaces
from meeframe.mesh.surface import ElementBlock, SurfaceMesh
from meeframe.mesh.topology import Edges, find_edges, reflection

Flags = NDArray[np.bool_]

SHOWN = 3  # offenders whose place a message gives
COINCIDENT = 1e-3  # points closer than this part of the shortest edge are duplicates
PLANE = 1e-9  # normals on the boundary of a half space differ by less
COLLAPSED = 1e-6  # an element's Jacobian may nowhere fall below this part of its mean
LARGEST = 1e60  # coordinates [m] of which areas and volumes are numbers


def check_mesh(mesh: SurfaceMesh) -> None:
    """Raise MeshError, saying what, how many and where, unless the mesh is a valid boundary.

    In this order: numbers in range, finite points, no unused point, no repeated node, no duplicate points, no
    degenerate or folded element, closed and manifold, consistently oriented, conforming at mid-sides, outward. The
    boundary of a semi-infinite body has to be plane instead of closed.
    """
    _check_numbers(mesh)
    _check_points(mesh)
    _check_elements(mesh)
    _check_edges(mesh, find_edges(mesh))
    if mesh.semi_infinite:
        _check_plane(mesh)
        return
    parts, inverted = _inverted_parts(mesh)
    if inverted.any():
        middles = _middles(mesh)[inverted[parts]]
        how = "is" if inverted.all() else f"has {inverted.sum()} of {len(inverted)} closed parts"
        must = "elements must be counter-clockwise seen from outside; reorient = true turns those of a file"
        what = f"the surface {how} inside out ({must})"
        _refuse(what, middles, "element")


def orient_outward(mesh: SurfaceMesh) -> SurfaceMesh:
    """Return the mesh with every closed surface that is inside out flipped. Raises MeshError if not closed or
    inconsistent."""
    _check_numbers(mesh)
    _check_edges(mesh, find_edges(mesh))
    parts, inverted = _inverted_parts(mesh)
    blocks, first = [], 0
    for block in mesh.blocks:
        flip = inverted[parts[first : first + len(block.groups)]]
        first += len(flip)
        flipped = block.connectivity[:, reflection(block.element)]
        blocks.append(ElementBlock(block.element, np.where(flip[:, None], flipped, block.connectivity), block.groups))
    return replace(mesh, blocks=tuple(blocks))


def merge_points(mesh: SurfaceMesh, tolerance: float) -> SurfaceMesh:
    """Return the mesh with points closer than tolerance [m] (or linked by such) merged into the first, unused ones
    dropped.

    Raises MeshError if that would collapse an element.
    """
    if not (np.isfinite(tolerance) and tolerance >= 0):
        raise MeshError(f"merge_tolerance = {tolerance!r}: must be a length of at least zero")
    _check_numbers(mesh)
    _check_finite(mesh)
    pairs = close_pairs(mesh.points, tolerance)
    n = len(mesh.points)
    _, label = connected_components(coo_array((np.ones(len(pairs)), tuple(pairs.T)), shape=(n, n)), directed=False)
    first = np.unique(label, return_index=True)[1]
    target = first[label].astype(np.int64)
    blocks = tuple(ElementBlock(b.element, target[b.connectivity], b.groups) for b in mesh.blocks)
    merged = drop_unused(replace(mesh, blocks=blocks))
    _check_repeats(merged)
    return merged


def drop_unused(mesh: SurfaceMesh) -> SurfaceMesh:
    """Return the mesh without points that no element uses. Raises MeshError if numbers are out of range."""
    _check_numbers(mesh)
    used = _used(mesh)
    number = np.cumsum(used) - 1
    blocks = tuple(ElementBlock(b.element, number[b.connectivity], b.groups) for b in mesh.blocks)
    return replace(mesh, points=mesh.points[used], blocks=blocks)


def _used(mesh: SurfaceMesh) -> Flags:
    """Return whether an element uses each point, (p,)."""
    used = np.zeros(len(mesh.points), bool)
    for block in mesh.blocks:
        used[block.connectivity] = True
    return used


def _refuse(what: str, places: Array, thing: str) -> None:
    shown = ", ".join("({:.6g}, {:.6g}, {:.6g})".format(*place) for place in places[:SHOWN])
    more = ", ..." if len(places) > SHOWN else ""
    raise MeshError(f"{what}: {len(places)} {thing}{'s' * (len(places) > 1)}, at {shown}{more} [m]")


def _middles(mesh: SurfaceMesh) -> Array:
    """Return the mean of the nodes of each element, (n_elements, 3)."""
    return np.concatenate([mesh.points[b.connectivity].mean(axis=1) for b in mesh.blocks])


def _check_numbers(mesh: SurfaceMesh) -> None:
    if mesh.n_elements == 0:
        raise MeshError("the surface has no elements")
    if mesh.points.ndim != 2 or mesh.points.shape[1] != 3:
        raise MeshError(f"points of the surface have the shape {mesh.points.shape}; (p, 3) is wanted")
    for block in mesh.blocks:
        shape, nodes = block.connectivity.shape, len(block.element.nodes)
        if block.connectivity.ndim != 2 or shape[1] != nodes:
            raise MeshError(f"connectivity of {block.element.name} has the shape {shape}; (e, {nodes}) is wanted")
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
                    f"there is no {name} {wrong[0]}, which {block.element.name} uses; numbers end at {limit - 1}"
                )


def _check_finite(mesh: SurfaceMesh) -> None:
    bad = ~(np.abs(mesh.points) <= LARGEST).all(axis=1)
    if bad.any():
        _refuse(f"the surface has coordinates that are not finite or beyond {LARGEST:g} m", mesh.points[bad], "point")


def _check_points(mesh: SurfaceMesh) -> None:
    _check_finite(mesh)
    used = _used(mesh)
    if not used.all():
        _refuse("the surface has points that no element uses", mesh.points[~used], "point")
    _check_repeats(mesh)
    ends = mesh.points[find_edges(mesh).ends]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    extent = np.ptp(mesh.points, axis=0).max()
    shortest = lengths[lengths > 1e-12 * extent].min(initial=extent)
    pairs = close_pairs(mesh.points, COINCIDENT * shortest)
    if len(pairs):
        places = mesh.points[np.sort(pairs.max(axis=1))]
        _refuse("the surface has points that coincide with others (merge_tolerance merges them)", places, "pair")


def _check_repeats(mesh: SurfaceMesh) -> None:
    for block in mesh.blocks:
        ordered = np.sort(block.connectivity, axis=1)
        bad = (ordered[:, 1:] == ordered[:, :-1]).any(axis=1)
        if bad.any():
            places = mesh.points[block.connectivity[bad]].mean(axis=1)
            _refuse("the surface has elements with the same node twice", places, f"{block.element.name} element")


def _check_elements(mesh: SurfaceMesh) -> None:
    """Check the Jacobian's sign: at nodes and Gauss points the normal is within a right angle of the mean normal."""
    for block in mesh.blocks:
        xi, weights = gauss_rule(block.element.reference, 3)
        inside = normal_vectors(mesh.points, block.element, block.connectivity, xi)
        at_nodes = normal_vectors(mesh.points, block.element, block.connectivity, block.element.nodes)
        mean = np.einsum("emd,m->ed", inside, weights / weights.sum())
        size = np.linalg.norm(inside, axis=-1).max(axis=1)
        along = np.einsum("emd,ed->em", np.concatenate([inside, at_nodes], axis=1), mean).min(axis=1)
        extent = np.ptp(mesh.points[block.connectivity], axis=1).max(axis=1)
        bad = (along <= COLLAPSED * size**2) | (size <= 1e-12 * extent**2)
        if bad.any():
            places = mesh.points[block.connectivity[bad]].mean(axis=1)
            what = "the surface has degenerate or folded elements (zero or negative Jacobian)"
            _refuse(what, places, f"{block.element.name} element")


def _check_edges(mesh: SurfaceMesh, edges: Edges) -> None:
    count = np.bincount(edges.number)
    sense = np.bincount(edges.number, weights=np.where(edges.ends[:, 0] < edges.ends[:, 1], 1.0, -1.0))
    first = np.unique(edges.number, return_index=True)[1]
    middle = mesh.points[edges.ends[first]].mean(axis=1)
    faults = (
        (count > 2, "the surface is not a manifold, more than two elements share an edge"),
        ((count == 1) & (not mesh.semi_infinite), "the surface is not closed, only one element has an edge"),
        (
            (count == 2) & (sense != 0),
            "the surface is not consistently oriented, two elements run along an edge in the same direction",
        ),
    )
    for bad, what in faults:
        if bad.any():
            _refuse(what, middle[bad], "edge")
    order = np.argsort(edges.number, kind="stable")
    order = order[count[edges.number[order]] == 2].reshape(-1, 2)
    differ = (edges.between[order[:, 0]] != edges.between[order[:, 1]]).any(axis=1)
    if differ.any():
        places = middle[edges.number[order[differ, 0]]]
        _refuse(
            "the surface is not conforming, the mid-side nodes of two elements differ along an edge", places, "edge"
        )


def _check_plane(mesh: SurfaceMesh) -> None:
    normals = []
    for block in mesh.blocks:
        vectors = normal_vectors(mesh.points, block.element, block.connectivity, block.element.nodes)
        normals.append((vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)).mean(axis=1))
    deviation = np.linalg.norm(np.concatenate(normals) - normals[0][0], axis=1)
    tilted = deviation > PLANE
    if tilted.any():
        _refuse("the boundary of a half space is not plane", _middles(mesh)[tilted], "element")


def _inverted_parts(mesh: SurfaceMesh) -> tuple[Indices, Flags]:
    """Return the closed surface that each element belongs to, (n_elements,), and whether each surface is inside out,
    (parts,).

    A surface inside an odd number of others bounds a cavity: its elements must look inwards.
    """
    parts, inside = connected_surfaces(mesh)
    signed = np.bincount(parts, weights=volume_shares(mesh, mesh.points.mean(axis=0)))
    return parts, np.where(inside.sum(axis=1) % 2 == 0, signed, -signed) <= 0
