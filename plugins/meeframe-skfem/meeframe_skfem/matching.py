"""The body seen from its volume mesh: face groups, boundary data and contact zone on the volume's own boundary."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import scipy  # its parts load where they are used

from meeframe.plugin import Array, Body, BoundaryCondition, ContactZone, Indices, MeshError, SurfaceMesh, zone_frames
from meeframe.plugin.surfaces import ElementBlock, area, shape_functions
from meeframe_skfem.locate import interpolation, nearest
from meeframe_skfem.volume import Faces, VolumeMesh, boundary_faces

REACH: Final = 1e-3  # the volume's boundary is nowhere farther from the surface, in sizes of the body
AREA: Final = 1e-3  # nor do areas of face groups differ by more, relatively
SAME: Final = 1e-6  # nodes of the contact zone coincide to this part of its shortest distance between nodes


@dataclass(frozen=True, eq=False)
class Matched:
    """A body on the boundary of its volume mesh.

    volume: the mesh; faces: its boundary faces; body: the body with the volume's boundary as its surface mesh, whose
    one block has the elements of `faces`; nodes: (b,) point numbers in the volume of the surface's points;
    zone: the contact zone, as a reduced system has it; zone_points: (n,) the surface's points that are the zone's.
    """

    volume: VolumeMesh
    faces: Faces
    body: Body
    nodes: Indices
    zone: ContactZone
    zone_points: Indices


def match(body: Body, volume: VolumeMesh) -> Matched:
    """Carry face groups, boundary data and contact zone over to the boundary of a volume mesh.

    A face belongs to the group that its centre lies in; data given point by point are interpolated by the surface
    elements. Raises MeshError if the boundary is not that surface, if face groups are not made of whole faces, or if
    the elements of the contact zone are not faces of the volume.
    """
    if body.contact_group is None:
        raise MeshError("the body has no contact zone to condense to")
    faces = boundary_faces(volume)
    nodes, connectivity = np.unique(faces.nodes, return_inverse=True)
    connectivity = connectivity.reshape(faces.nodes.shape).astype(np.int64)
    points = volume.points[nodes]
    size = float(np.ptp(body.mesh.points, axis=0).max())
    centres = points[connectivity].transpose(0, 2, 1) @ _centre_shape(volume)
    block = ElementBlock(volume.element.surface, connectivity, _groups(body.mesh, centres, REACH * size))
    surface = SurfaceMesh(points, (block,), body.mesh.group_names)
    _check_areas(body.mesh, surface)
    conditions = _carried(body, surface, REACH * size)
    zone = zone_frames(body.mesh, body.contact_group)
    zone_points = _zone_points(zone, surface, body.contact_group)
    return Matched(volume, faces, replace(body, mesh=surface, conditions=conditions), nodes, zone, zone_points)


def _centre_shape(volume: VolumeMesh) -> Array:
    element = volume.element.surface
    centre: Array = shape_functions(element, element.nodes.mean(axis=0)[None])[0]
    return centre


def _groups(mesh: SurfaceMesh, centres: Array, reach: float) -> Indices:
    """Face group of each face, by the element that its centre lies on."""
    found = [nearest(mesh.points, block, centres, reach) for block in mesh.blocks]
    distance = np.array([places.distance for places in found])
    far = ~(distance.min(axis=0) <= reach)
    if far.any():
        raise MeshError(
            f"volume mesh: {np.count_nonzero(far)} of its {len(far)} boundary faces are not on the body's surface, "
            f"the first at {centres[far][0]} [m]; volume and surface mesh are to bound the same body"
        )
    groups = np.array([block.groups[places.element] for block, places in zip(mesh.blocks, found, strict=True)])
    return np.asarray(np.take_along_axis(groups, distance.argmin(axis=0)[None], axis=0)[0], np.int64)


def _check_areas(mesh: SurfaceMesh, surface: SurfaceMesh) -> None:
    for name in mesh.group_names:
        given, found = area(mesh, name), area(surface, name)
        if not abs(found - given) <= AREA * given:
            raise MeshError(
                f"volume mesh: its faces in group {name!r} have an area of {found:g} m^2, the group has {given:g} m^2; "
                "face groups are to consist of whole faces of the volume mesh"
            )


def _carried(body: Body, surface: SurfaceMesh, reach: float) -> tuple[BoundaryCondition, ...]:
    """The conditions with their data at the points of the volume's boundary."""
    conditions = []
    for condition in body.conditions:
        data = condition.data
        if np.ndim(data) > 0:
            at = surface.points[surface.group_points(condition.group)]
            index = body.mesh.group(condition.group)
            blocks = [replace(b, connectivity=b.connectivity[b.groups == index]) for b in body.mesh.blocks]
            blocks = [block for block in blocks if len(block.connectivity)]
            matrix, distance = interpolation(body.mesh.points, blocks, at, reach)
            if not (distance <= reach).all():
                raise MeshError(f"volume mesh: its boundary is not on the surface's group {condition.group!r}")
            values = np.zeros(len(body.mesh.points))
            values[body.mesh.group_points(condition.group)] = data
            data = matrix @ values
        conditions.append(replace(condition, data=data))
    return tuple(conditions)


def _zone_points(zone: ContactZone, surface: SurfaceMesh, group: str) -> Indices:
    """Points of the surface that are those of the zone, in the zone's order."""
    spacing = float(scipy.spatial.cKDTree(zone.points).query(zone.points, k=2)[0][:, 1].min())
    distance, found = scipy.spatial.cKDTree(surface.points).query(zone.points)
    block = surface.blocks[0]
    own = np.sort(block.connectivity[block.groups == surface.group(group)], axis=1)
    wanted = [np.sort(found[cells], axis=1) for _, cells in zone.cells]
    alike = len(wanted) == 1 and wanted[0].shape == own.shape and (_rows(wanted[0]) == _rows(own)).all()
    if not (alike and (distance <= SAME * spacing).all()):
        raise MeshError(
            f"contact zone {group!r}: its elements are not the faces of the volume mesh there ({len(own)} "
            f"{block.element.name}); both meshes are to have the same nodes in the zone"
        )
    return np.asarray(found, np.int64)


def _rows(table: Indices) -> Indices:
    """The rows of a table in lexicographic order."""
    return table[np.lexsort(table.T[::-1])]
