"""A contact zone that is part of a plane: one frame, however many elements it has."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.plugin import Array, Indices, MeshError, SurfaceMesh, local_frames

FLAT: Final = 1e-6
"""By so much, as a part of the zone, may nodes be off the plane."""


@dataclass(frozen=True, eq=False)
class FlatZone:
    """points: (n, 3) [m], in the order of the mesh; frame: (3, 3), rows e1, e2, outward normal; cells: (meshio cell
    type, connectivity into points) pairs."""

    points: Array
    frame: Array
    cells: tuple[tuple[str, Indices], ...]


def flat_zone(mesh: SurfaceMesh, group: str) -> FlatZone:
    """Contact zone of a face group, its points and frame those of meeframe.mesh.find_contact_zone.

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
    cells = tuple((element.meshio_type, places[nodes]) for element, nodes in chosen)
    first, second, third = points[cells[0][1][0, :3]]
    normal = np.cross(second - first, third - first)
    frame = local_frames(normal[None] / np.linalg.norm(normal))[0]
    along, across, level = frame @ points.T
    depth = float(np.ptp(level))
    if depth > FLAT * max(float(np.ptp(along)), float(np.ptp(across))):
        raise MeshError(f"contact zone {group!r}: a half space has a flat one; this is {depth:.3g} m deep")
    if not all((_turns(along, across, nodes) > 0.0).all() for _, nodes in cells):
        raise MeshError(f"contact zone {group!r}: a half space has one side, of which elements show the other or none")
    return FlatZone(points, frame, cells)


def _turns(along: Array, across: Array, nodes: Indices) -> Array:
    """Twice the areas (e,) of the triangles of the first three corners of elements (e, k), seen from outside."""
    x, y = ([coordinate[nodes[:, k]] for k in range(3)] for coordinate in (along, across))
    turns: Array = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
    return turns
