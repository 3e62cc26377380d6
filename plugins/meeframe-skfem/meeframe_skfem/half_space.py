"""The box that stands for a half space, or for layers on a rigid base."""

from dataclasses import replace
from typing import Final

import numpy as np

from meeframe.plugin import Body, BoundaryCondition, SurfaceMesh, find_contact_zone
from meeframe.plugin.surfaces import ElementBlock, Quad4
from meeframe_skfem.elements import HEX8
from meeframe_skfem.grid import tensor_grid
from meeframe_skfem.volume import boundary_faces

FAR_GROUPS: Final = ("side", "base")


def box_below(body: Body, depth: float) -> Body:
    """Return the box below the mesh of a half space, at whose sides and base displacements and potentials are zero.

    Parameters
    ----------
    body : Body
        A half space with a contact zone, whose plane is normal to a coordinate axis.
    depth : float
        Depth of the box [m].
    """
    mesh = body.mesh
    assert body.contact_group is not None
    outward = find_contact_zone(mesh, body.contact_group).frames[0, 2]
    corners = np.concatenate([mesh.points, mesh.points - depth * outward])
    x, y, z = np.stack([corners.min(axis=0), corners.max(axis=0)], axis=1)
    box = tensor_grid((x, y, z), HEX8)
    faces = boundary_faces(box).nodes
    heights = (box.points[faces].mean(axis=1) - mesh.points[0]) @ outward
    below = heights < -0.25 * depth  # all faces but the top one
    groups = len(mesh.group_names) + (heights[below] < -0.75 * depth).astype(np.int64)
    block = ElementBlock(Quad4(), len(mesh.points) + faces[below], groups)
    surface = SurfaceMesh(
        np.concatenate([mesh.points, box.points]), (*mesh.blocks, block), (*mesh.group_names, *FAR_GROUPS)
    )
    held = [BoundaryCondition(group, field, "value") for group in FAR_GROUPS for field in range(body.fields.size)]
    layers = replace(body.layers, base=None)
    return replace(body, mesh=surface, conditions=(*body.conditions, *held), layers=layers)
