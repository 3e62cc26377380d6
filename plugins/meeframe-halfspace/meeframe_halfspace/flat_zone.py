"""A contact zone that is part of a plane: one frame, however many elements it has."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.core.errors import MeshError
from meeframe.core.fields import Array
from meeframe.core.mesh import Indices, SurfaceMesh
from meeframe.geometry import frames_of

FLAT: Final = 1e-6
"""By so much may normals differ, and nodes be off the plane as a part of the zone."""


@dataclass(frozen=True, eq=False)
class FlatZone:
    """points: (n, 3) [m], in the order of the mesh; frame: (3, 3), rows e1, e2, outward normal; cells: (meshio cell
    type, connectivity into points) pairs."""

    points: Array
    frame: Array
    cells: tuple[tuple[str, Indices], ...]


def flat_zone(mesh: SurfaceMesh, group: str) -> FlatZone:
    """Contact zone of a face group, its points and frame those of meeframe.geometry.zone_frames.

    Raises MeshError if there is no such group, it has no elements, or it is not flat.
    """
    index = mesh.group(group)
    chosen = [(block.element, block.connectivity[block.groups == index]) for block in mesh.blocks]
    chosen = [(element, connectivity) for element, connectivity in chosen if len(connectivity)]
    if not chosen:
        raise MeshError(f"contact zone {group!r}: the face group has no elements")
    used = np.zeros(len(mesh.points), bool)
    for _, connectivity in chosen:
        used[connectivity] = True
    places = np.cumsum(used) - 1
    points = mesh.points[used]
    normals = np.concatenate([_normals(mesh.points, connectivity[:, :3]) for _, connectivity in chosen])
    frame = frames_of(normals[:1])[0]
    turn, depth = float(np.abs(normals - frame[2]).max()), float(np.ptp(points @ frame[2]))
    if not turn <= FLAT or depth > FLAT * float(np.ptp(points, axis=0).max()):
        raise MeshError(f"contact zone {group!r}: a half space has a flat one; this is {depth:.3g} m deep")
    return FlatZone(points, frame, tuple((element.meshio_type, places[nodes]) for element, nodes in chosen))


def _normals(points: Array, corners: Indices) -> Array:
    """Unit normals (e, 3) of elements whose first three corners (e, 3) are given."""
    first, second, third = (points[corners[:, k]] for k in range(3))
    normals = np.cross(second - first, third - first)
    unit: Array = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return unit
