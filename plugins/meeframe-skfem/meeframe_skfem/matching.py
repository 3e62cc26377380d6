"""Transfer of face groups, boundary data and contact zone from a surface mesh to the boundary of a volume mesh."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import scipy  # submodules are loaded on first use

from meeframe.plugin import (
    Array,
    Body,
    BoundaryCondition,
    ContactZone,
    Indices,
    MeshError,
    SurfaceMesh,
    find_contact_zone,
)
from meeframe.plugin.surfaces import ElementBlock, area, shape_functions
from meeframe_skfem.layers import LayeredMesh, layered_mesh
from meeframe_skfem.locate import interpolation, nearest_points
from meeframe_skfem.volume import Faces, VolumeMesh, boundary_faces

MAX_DISTANCE: Final = 1e-3  # largest distance of the volume's boundary from the surface, relative to the body
MAX_AREA_DIFFERENCE: Final = 1e-3  # largest relative difference of the areas of a face group
NODE_TOLERANCE: Final = 1e-6  # largest distance of matching nodes of the zone, relative to the node spacing


@dataclass(frozen=True, eq=False)
class MatchedBody:
    """A body whose surface mesh is the boundary of its volume mesh.

    Attributes
    ----------
    volume : VolumeMesh
        The volume mesh.
    faces : Faces
        Its boundary faces.
    body : Body
        The body with the boundary of the volume as its surface mesh, whose single block has the elements of `faces`.
    nodes : Indices
        Point numbers in the volume of the points of the surface, (b,).
    zone : ContactZone
        The contact zone of the reduced system.
    zone_points : Indices
        Points of the surface that are those of the zone, (n,).
    layered : LayeredMesh
        The volume mesh with the materials of its cells.
    """

    volume: VolumeMesh
    faces: Faces
    body: Body
    nodes: Indices
    zone: ContactZone
    zone_points: Indices
    layered: LayeredMesh


def match(body: Body, volume: VolumeMesh) -> MatchedBody:
    """Transfer face groups, boundary data and contact zone to the boundary of a volume mesh.

    A face belongs to the group in which its centre lies. Data at points are interpolated by the surface elements.

    Raises
    ------
    MeshError
        If the boundary of the volume is not the surface of the body, if face groups cut faces of the volume, if the
        elements of the contact zone are not faces of the volume, or if its cells do not fit the layers.
    CaseError
        As `layered_mesh`.
    """
    if body.contact_group is None:
        raise MeshError("the body has no contact zone to condense to")
    faces = boundary_faces(volume)
    nodes, connectivity = np.unique(faces.nodes, return_inverse=True)
    connectivity = connectivity.reshape(faces.nodes.shape).astype(np.int64)
    points = volume.points[nodes]
    size = float(np.ptp(body.mesh.points, axis=0).max())
    centres = points[connectivity].transpose(0, 2, 1) @ _centre_shape(volume)
    block = ElementBlock(volume.element.surface, connectivity, _groups(body.mesh, centres, MAX_DISTANCE * size))
    surface = SurfaceMesh(points, (block,), body.mesh.group_names)
    _check_areas(body.mesh, surface)
    conditions = _transfer_conditions(body, surface, MAX_DISTANCE * size)
    zone = find_contact_zone(body.mesh, body.contact_group)
    zone_points = _zone_points(zone, surface, body.contact_group)
    layered = layered_mesh(body, volume, zone)
    matched = replace(body, mesh=surface, conditions=conditions)
    return MatchedBody(volume, faces, matched, nodes, zone, zone_points, layered)


def _centre_shape(volume: VolumeMesh) -> Array:
    element = volume.element.surface
    centre: Array = shape_functions(element, element.nodes.mean(axis=0)[None])[0]
    return centre


def _groups(mesh: SurfaceMesh, centres: Array, max_distance: float) -> Indices:
    """Return the face group of each face, from the element on which its centre lies."""
    locations = [nearest_points(mesh.points, block, centres, max_distance) for block in mesh.blocks]
    distance = np.array([location.distance for location in locations])
    far = ~(distance.min(axis=0) <= max_distance)
    if far.any():
        raise MeshError(
            f"volume mesh: {np.count_nonzero(far)} of its {len(far)} boundary faces are not on the body's surface, "
            f"the first at {centres[far][0]} [m]; both meshes must have the same boundary"
        )
    groups = np.array([block.groups[location.element] for block, location in zip(mesh.blocks, locations, strict=True)])
    return np.asarray(np.take_along_axis(groups, distance.argmin(axis=0)[None], axis=0)[0], np.int64)


def _check_areas(mesh: SurfaceMesh, surface: SurfaceMesh) -> None:
    for name in mesh.group_names:
        expected, actual = area(mesh, name), area(surface, name)
        if not abs(actual - expected) <= MAX_AREA_DIFFERENCE * expected:
            raise MeshError(
                f"volume mesh: its faces in group {name!r} have an area of {actual:g} m^2, the group has {expected:g} "
                "m^2; face groups must consist of whole faces of the volume mesh"
            )


def _transfer_conditions(body: Body, surface: SurfaceMesh, max_distance: float) -> tuple[BoundaryCondition, ...]:
    """Return the conditions with their data at the points of the boundary of the volume."""
    conditions = []
    for condition in body.conditions:
        data = condition.data
        if np.ndim(data) > 0:
            targets = surface.points[surface.group_points(condition.group)]
            index = body.mesh.group(condition.group)
            blocks = [replace(b, connectivity=b.connectivity[b.groups == index]) for b in body.mesh.blocks]
            blocks = [block for block in blocks if len(block.connectivity)]
            matrix, distance = interpolation(body.mesh.points, blocks, targets, max_distance)
            if not (distance <= max_distance).all():
                raise MeshError(f"volume mesh: its boundary does not lie on the face group {condition.group!r}")
            values = np.zeros(len(body.mesh.points))
            values[body.mesh.group_points(condition.group)] = data
            data = matrix @ values
        conditions.append(replace(condition, data=data))
    return tuple(conditions)


def _zone_points(zone: ContactZone, surface: SurfaceMesh, group: str) -> Indices:
    """Return the points of the surface that are those of the zone, in the order of the zone."""
    spacing = float(scipy.spatial.cKDTree(zone.points).query(zone.points, k=2)[0][:, 1].min())
    distance, points = scipy.spatial.cKDTree(surface.points).query(zone.points)
    block = surface.blocks[0]
    faces = np.sort(block.connectivity[block.groups == surface.group(group)], axis=1)
    zone_faces = [np.sort(points[cells], axis=1) for _, cells in zone.cells]
    is_equal = (
        len(zone_faces) == 1 and zone_faces[0].shape == faces.shape and (_rows(zone_faces[0]) == _rows(faces)).all()
    )
    if not (is_equal and (distance <= NODE_TOLERANCE * spacing).all()):
        raise MeshError(
            f"contact zone {group!r}: its elements are not the faces of the volume mesh there ({len(faces)} "
            f"{block.element.name}); both meshes must have the same nodes in the zone"
        )
    return np.asarray(points, np.int64)


def _rows(table: Indices) -> Indices:
    """Return the rows of a table in lexicographic order."""
    return table[np.lexsort(table.T[::-1])]
