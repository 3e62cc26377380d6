"""The contact zone: its points, local frames and integration weights."""

from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from meeframe.common.errors import MeshError
from meeframe.common.memoize import memoize_by_identity
from meeframe.elements.base import shape_functions
from meeframe.fields import Array, Indices
from meeframe.mesh.measures import VOLUME_ORDER, affine, gauss_rule, normal_vectors
from meeframe.mesh.regular import Cells, GridCells, GridPoints, grid_weights, shared_frames
from meeframe.mesh.surface import ElementBlock, SurfaceMesh

MIN_NORMAL_COSINE = np.cos(np.pi / 4)  # of an element's normal with the zone's normal at its nodes: 45 degrees
MIN_E1_LENGTH = 0.1  # e1 follows the second axis where the normal is within 6 degrees of the first


@dataclass(frozen=True, eq=False)
class ContactZone:
    """Geometry of a contact zone. The arrays are read-only, since a zone is shared by all users of its mesh.

    Attributes
    ----------
    points : Array
        Positions, (n, 3) [m].
    frames : Array
        Local frames, (n, 3, 3), right-handed, with rows e1, e2 and the outward normal nu.
    weights : Array
        Integral of each shape function over the zone, (n,) [m^2].
    cells : sequence of tuple
        meshio cell type and connectivity into `points` of each block.
    numbers : Indices
        Numbers of the points in the mesh, (n,), rising.
    """

    points: Array
    frames: Array
    weights: Array
    cells: Cells
    numbers: Indices


def find_contact_zone(mesh: SurfaceMesh, group: str) -> ContactZone:
    """Return the contact zone of a face group.

    Normals at points are means over the elements of the zone alone, weighted by their areas. Points of a half space
    share one frame.

    Parameters
    ----------
    mesh : SurfaceMesh
        The mesh.
    group : str
        Name of the face group.

    Returns
    -------
    ContactZone
        Nodes, frames, weights and elements of the zone.

    Raises
    ------
    MeshError
        If there is no such group, it has no elements, or it has a sharp mesh edge.
    """
    if mesh.grid is not None and mesh.group(group) == 0:
        return _grid_zone(mesh, mesh.grid)  # made in less time than its memory is worth
    return _stored_zone(mesh, group)


@memoize_by_identity
def _stored_zone(mesh: SurfaceMesh, group: str) -> ContactZone:
    return _read_only(_zone(mesh, group))


def _read_only(zone: ContactZone) -> ContactZone:
    for array in (zone.points, zone.frames, zone.weights, zone.numbers, *(local for _, local in zone.cells)):
        array.setflags(write=False)
    return zone


def _grid_zone(mesh: SurfaceMesh, shape: tuple[int, int]) -> ContactZone:
    """Return the zone of the first face group of a half space, a grid of this shape."""
    count = shape[0] * shape[1]
    points = cast(GridPoints, mesh.points).on(slice(None), slice(None))
    frame = local_frames(np.array([[0.0, 0.0, 1.0]]))[0]
    spacing = ((points[-1] - points[0])[:2] / (np.array(shape) - 1.0)).tolist()
    weights = grid_weights(shape, (spacing[0], spacing[1]))
    return ContactZone(points, shared_frames(frame, count), weights, GridCells(shape), np.arange(count))


def _zone(mesh: SurfaceMesh, group: str) -> ContactZone:
    blocks = _zone_blocks(mesh, group)
    in_zone = np.zeros(len(mesh.points), bool)
    for block in blocks:
        in_zone[block.connectivity] = True
    numbers = np.flatnonzero(in_zone)
    # the points of a generated zone come first in its mesh, which then shares its arrays
    are_first = numbers[-1] == len(numbers) - 1
    points = mesh.points[: len(numbers)] if are_first else mesh.points[numbers]
    local_number = None if are_first else np.cumsum(in_zone) - 1
    weights, cells, integrals = np.zeros(len(numbers)), [], []
    for block in blocks:
        local = block.connectivity if local_number is None else local_number[block.connectivity]
        cells.append((block.element.meshio_type, local))
        integrals.append(_shape_integrals(mesh, block))
        weights += np.bincount(local.ravel(), integrals[-1].ravel(), len(numbers))
    if mesh.semi_infinite:
        normal = _unit_normals(mesh, ElementBlock(blocks[0].element, blocks[0].connectivity[:1], blocks[0].groups[:1]))
        frames = shared_frames(local_frames(normal[0, :1])[0], len(numbers))
        zone = ContactZone(points, frames, weights, tuple(cells), numbers)
    else:
        corners = [_unit_normals(mesh, block) for block in blocks]
        normals = np.zeros((len(numbers), 3))
        for (_, local), each, integral in zip(cells, corners, integrals, strict=True):
            np.add.at(normals, local, each * integral.sum(axis=1)[:, None, None])
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        if not (lengths > 0).all():
            raise MeshError(f"contact zone {group!r}: no normal at {points[np.argmin(lengths)]} [m]")
        zone = ContactZone(points, local_frames(normals / lengths), weights, tuple(cells), numbers)
        _check_smooth(corners, zone, group)
    return zone


def check_contact_zone(mesh: SurfaceMesh, group: str) -> None:
    """Check that a face group can be a contact zone.

    Parameters
    ----------
    mesh : SurfaceMesh
        The mesh.
    group : str
        Name of the face group.

    Raises
    ------
    MeshError
        If there is no such group, it has no elements or a sharp mesh edge, or it is the whole surface.
    """
    find_contact_zone(mesh, group)
    if mesh.grid is not None:  # with rings of elements around it
        return
    if sum(len(block.connectivity) for block in _zone_blocks(mesh, group)) == mesh.n_elements:
        raise MeshError(f"contact zone {group!r}: it is the whole surface, so that the body has no supports")


def local_frames(normals: Array, first_axis: tuple[float, float, float] = (1.0, 0.0, 0.0)) -> Array:
    """Return right-handed orthonormal frames for unit normals.

    Parameters
    ----------
    normals : Array
        Unit normals nu, (n, 3).
    first_axis : tuple of float
        Unit vector whose projection on the tangent plane gives e1. Where the normal is nearly parallel to it, the next
        axis in cyclic order is used.

    Returns
    -------
    Array
        Frames, (n, 3, 3), with rows e1, e2, nu.
    """
    axis = np.asarray(first_axis, float)
    e1 = axis - (normals @ axis)[:, None] * normals
    parallel = np.linalg.norm(e1, axis=1) < MIN_E1_LENGTH
    second = np.roll(axis, 1)
    e1[parallel] = second - (normals[parallel] @ second)[:, None] * normals[parallel]
    e1 /= np.linalg.norm(e1, axis=1, keepdims=True)
    return np.stack([e1, np.cross(normals, e1), normals], axis=1)


def _zone_blocks(mesh: SurfaceMesh, group: str) -> list[ElementBlock]:
    index = mesh.group(group)
    chosen = [(block, _selection(block.groups == index)) for block in mesh.blocks]
    blocks = [ElementBlock(b.element, b.connectivity[selected], b.groups[selected]) for b, selected in chosen]
    blocks = [block for block in blocks if len(block.groups)]
    if not blocks:
        raise MeshError(f"contact zone {group!r}: the face group has no elements")
    return blocks


def _selection(selected: NDArray[np.bool_]) -> NDArray[np.bool_] | slice:
    """Return a mask, as a slice if it marks the first entries, for views in place of copies."""
    count = int(selected.sum())
    return slice(count) if selected[:count].all() else selected


def _shape_integrals(mesh: SurfaceMesh, block: ElementBlock) -> Array:
    """Return int N_a dS over each element, (e, n); the Jacobian of affine elements is constant."""
    xi, weights = gauss_rule(block.element.reference, VOLUME_ORDER)
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
    """Raise MeshError for sharp mesh edges in a zone; normals: (e, n, 3) at the nodes of each block of elements."""
    for element_normals, (_, local) in zip(normals, zone.cells, strict=True):
        cosines = np.einsum("eni,eni->en", element_normals, zone.frames[local, 2])
        sharp = np.unique(local[cosines < MIN_NORMAL_COSINE])
        if sharp.size:
            raise MeshError(
                f"contact zone {group!r}: it bends by more than 45 degrees at {sharp.size} points, the first at "
                f"{zone.points[sharp[0]]} [m]; a contact zone must be smooth"
            )
