"""The contact zone: its points, local frames, integration weights."""

from dataclasses import dataclass

import numpy as np

from meeframe.common.errors import MeshError
from meeframe.common.memoize import memoize_by_identity
from meeframe.elements.base import shape_functions
from meeframe.fields import Array, Indices
from meeframe.mesh.measures import ORDER, affine, gauss_rule, normal_vectors
from meeframe.mesh.surface import ElementBlock, SurfaceMesh

STEEPEST = np.cos(np.pi / 4)  # an element's normal stays within 45 degrees of the zone's normal at its nodes
SHORTEST_E1 = 0.1  # e1 follows the second axis where the normal is within 6 degrees of the first


@dataclass(frozen=True, eq=False)
class ContactZone:
    """Geometry of the contact zone as a ReducedSystem hands it on.

    points: (n, 3) [m]; frames: (n, 3, 3), rows e1, e2, nu, right-handed, nu outward; weights: (n,) [m^2], the integral
    of each shape function over the zone; cells: (meshio cell type, connectivity into points) pairs; numbers: (n,)
    numbers of the points in the mesh, rising. The arrays are read-only: a zone is found once for its mesh.
    """

    points: Array
    frames: Array
    weights: Array
    cells: tuple[tuple[str, Indices], ...]
    numbers: Indices


def zone_frames(mesh: SurfaceMesh, group: str) -> ContactZone:
    """Return the contact zone of a face group.

    Normals at points are means over the zone's elements alone, weighted by their areas. Raises MeshError if there is no
    such group, it has no elements, or it turns a sharp edge.
    """
    return _zone(mesh, group)


@memoize_by_identity
def _zone(mesh: SurfaceMesh, group: str) -> ContactZone:
    blocks = _zone_blocks(mesh, group)
    used = np.zeros(len(mesh.points), bool)
    for block in blocks:
        used[block.connectivity] = True
    numbers, places = np.flatnonzero(used), np.cumsum(used) - 1
    weights, normals = np.zeros(len(numbers)), np.zeros((len(numbers), 3))
    cells, corners = [], []
    for block in blocks:
        local = places[block.connectivity]
        cells.append((block.element.meshio_type, local))
        corners.append(_unit_normals(mesh, block))
        integrals = _shape_integrals(mesh, block)
        np.add.at(weights, local, integrals)
        np.add.at(normals, local, corners[-1] * integrals.sum(axis=1)[:, None, None])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    if not (lengths > 0).all():
        raise MeshError(f"contact zone {group!r}: no normal at {mesh.points[numbers[np.argmin(lengths)]]} [m]")
    zone = ContactZone(mesh.points[numbers], frames_of(normals / lengths), weights, tuple(cells), numbers)
    _check_smooth(corners, zone, group)
    for array in (zone.points, zone.frames, zone.weights, zone.numbers, *(local for _, local in cells)):
        array.setflags(write=False)
    return zone


def check_contact_zone(mesh: SurfaceMesh, group: str) -> None:
    """Raise MeshError unless the group exists, has elements, leaves some of the surface free and is smooth."""
    zone_frames(mesh, group)
    if sum(len(block.connectivity) for block in _zone_blocks(mesh, group)) == mesh.n_elements:
        raise MeshError(f"contact zone {group!r}: it is the whole surface, so that nothing holds the body")


def frames_of(normals: Array, first_axis: tuple[float, float, float] = (1.0, 0.0, 0.0)) -> Array:
    """Return the right-handed orthonormal frames (n, 3, 3), rows e1, e2, nu, for unit normals (n, 3).

    e1 is as close to first_axis as the tangent plane allows; where the normal is nearly parallel to that axis it
    follows the next axis in cyclic order instead.
    """
    axis = np.asarray(first_axis, float)
    e1 = axis - (normals @ axis)[:, None] * normals
    parallel = np.linalg.norm(e1, axis=1) < SHORTEST_E1
    second = np.roll(axis, 1)
    e1[parallel] = second - (normals[parallel] @ second)[:, None] * normals[parallel]
    e1 /= np.linalg.norm(e1, axis=1, keepdims=True)
    return np.stack([e1, np.cross(normals, e1), normals], axis=1)


def _zone_blocks(mesh: SurfaceMesh, group: str) -> list[ElementBlock]:
    index = mesh.group(group)
    chosen = [(block, block.groups == index) for block in mesh.blocks]
    blocks = [ElementBlock(b.element, b.connectivity[own], b.groups[own]) for b, own in chosen if own.any()]
    if not blocks:
        raise MeshError(f"contact zone {group!r}: the face group has no elements")
    return blocks


def _shape_integrals(mesh: SurfaceMesh, block: ElementBlock) -> Array:
    """Return int N_a dS over each element, (e, n): the Jacobian of an element without curvature and warp is
    constant."""
    xi, weights = gauss_rule(block.element.reference, ORDER)
    shapes = shape_functions(block.element, xi)
    jacobians = np.linalg.norm(normal_vectors(mesh.points, block.element, block.connectivity, xi[:1]), axis=-1)
    integrals: Array = jacobians * (weights @ shapes)
    curved = np.flatnonzero(~affine(mesh.points, block.element, block.connectivity))
    normals = normal_vectors(mesh.points, block.element, block.connectivity[curved], xi)
    integrals[curved] = (np.linalg.norm(normals, axis=-1) * weights) @ shapes
    return integrals


def _unit_normals(mesh: SurfaceMesh, block: ElementBlock) -> Array:
    normals = normal_vectors(mesh.points, block.element, block.connectivity, block.element.nodes)
    lengths = np.linalg.norm(normals, axis=-1, keepdims=True)
    unit: Array = normals / np.where(lengths > 0, lengths, 1.0)
    return unit


def _check_smooth(normals: list[Array], zone: ContactZone, group: str) -> None:
    """Refuse a zone with sharp mesh edges; normals: (e, n, 3) at the nodes of the elements of each block."""
    for own, (_, local) in zip(normals, zone.cells, strict=True):
        cosines = np.einsum("eni,eni->en", own, zone.frames[local, 2])
        sharp = np.unique(local[cosines < STEEPEST])
        if sharp.size:
            raise MeshError(
                f"contact zone {group!r}: it turns by more than 45 degrees at {sharp.size} points, the first at "
                f"{zone.points[sharp[0]]} [m]; a contact zone is a smooth surface"
            )
