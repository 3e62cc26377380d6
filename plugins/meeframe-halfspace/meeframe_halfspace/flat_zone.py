"""A contact zone in a plane, with one frame for all elements."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.plugin import Array, Cells, GridCells, Indices, MeshError, SurfaceMesh, find_contact_zone

FLATNESS: Final = 1e-6
"""Largest relative distance of nodes from the plane."""


@dataclass(frozen=True, eq=False)
class FlatZone:
    """A flat contact zone.

    Attributes
    ----------
    points
        Points (n, 3) in the order of the mesh [m].
    frame
        Rows e1, e2, outward normal, (3, 3).
    cells
        Pairs of meshio cell type and connectivity into points.
    """

    points: Array
    frame: Array
    cells: Cells


def flat_zone(mesh: SurfaceMesh, group: str) -> FlatZone:
    """Return the contact zone of a face group of a half space, with the points of meeframe.mesh.find_contact_zone.

    Raises
    ------
    MeshError
        If there is no such group, it has no elements, or it is not flat.
    """
    zone = find_contact_zone(mesh, group)
    points, cells, frame = zone.points, zone.cells, zone.frames[0]
    if isinstance(cells, GridCells):
        return FlatZone(points, frame, cells)
    x1, x2, level = frame @ points.T
    depth = float(np.ptp(level))
    if depth > FLATNESS * max(float(np.ptp(x1)), float(np.ptp(x2))):
        raise MeshError(f"contact zone {group!r}: a half space needs a flat zone; this one is {depth:.3g} m deep")
    if not all((_orientation(x1, x2, nodes) > 0.0).all() for _, nodes in cells):
        raise MeshError(f"contact zone {group!r}: some elements are degenerate or face the inside of the half space")
    return FlatZone(points, frame, cells)


def _orientation(x1: Array, x2: Array, nodes: Indices) -> Array:
    """Return twice the signed areas (e,) of the triangles of the first three corners of elements (e, k)."""
    x, y = ([coordinate[nodes[:, k]] for k in range(3)] for coordinate in (x1, x2))
    areas: Array = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
    return areas
