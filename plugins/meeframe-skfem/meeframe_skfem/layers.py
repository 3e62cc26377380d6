"""The materials of the cells of a volume mesh, and the nodes of the interfaces between layers."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from meeframe.plugin import MECHANICAL, Array, Body, CaseError, ContactZone, Indices, MeshError
from meeframe_skfem.elements import face_nodes
from meeframe_skfem.volume import VolumeMesh

INTERFACE_TOLERANCE: Final = 1e-6  # distance of a cell beyond an interface, relative to its extent along the depth
PLANE_TOLERANCE: Final = (
    1e-6  # distance of points of the zone from a plane, relative to its width; difference of normals
)


@dataclass(frozen=True, eq=False)
class InterfaceNodes:
    """Nodes and faces of the interface below a layer.

    Attributes
    ----------
    upper, lower : Indices
        Nodes above and below, (s,), at the same positions, the upper ones rising; the same nodes if no field jumps.
    faces : Indices
        Numbers in `upper` of the nodes of the faces above, (t, k); none if no field jumps.
    springs : Array
        Fluxes by jumps of the values in global axes, (fields, fields) [SI]; zero for fields that do not jump.
    jumps : Array
        True for fields that jump, (fields,), in global axes.
    electrode : str or None
        Electrode at the interface, 'grounded' or 'floating'.
    """

    upper: Indices
    lower: Indices
    faces: Indices
    springs: Array
    jumps: Array
    electrode: str | None


@dataclass(frozen=True, eq=False)
class LayeredMesh:
    """A volume mesh with a material for each cell, and two nodes at each point of interfaces where fields jump.

    Attributes
    ----------
    mesh : VolumeMesh
        The mesh with p nodes.
    originals : Indices
        Points of the original mesh, (p,); its nodes come first and in the same order.
    stiffnesses : tuple of Array
        Extended stiffnesses, (3, fields, fields, 3), of the layers from the surface down and of the body [SI].
    regions : Indices
        Number of the stiffness of each cell, (e,).
    interfaces : tuple of InterfaceNodes
        Interfaces that are not bonded.
    """

    mesh: VolumeMesh
    originals: Indices
    stiffnesses: tuple[Array, ...]
    regions: Indices
    interfaces: tuple[InterfaceNodes, ...] = ()


def layered_mesh(body: Body, volume: VolumeMesh, zone: ContactZone) -> LayeredMesh:
    """Assign the cells of a volume mesh to the layers of a body by the depth of their centroids below the zone.

    Raises
    ------
    MeshError
        If the zone is not plane, the layers are thicker than the body, or a cell lies on both sides of an interface.
    CaseError
        If only the normal or the tangential displacement jumps at an interface that is oblique to the axes.
    """
    layers = body.layers.layers
    stiffnesses = (*(layer.material.stiffness for layer in layers), body.stiffness)
    plain = LayeredMesh(volume, np.arange(len(volume.points)), stiffnesses, np.zeros(len(volume.cells), np.int64))
    if not layers:
        return plain
    normal = plane_normal(zone)
    regions = _regions(body, volume, (zone.points[0] - volume.points) @ normal)
    layered = replace(plain, regions=regions)
    for number, layer in enumerate(layers):
        if not layer.interface.is_bonded:
            layered = _with_interface(layered, body, number, normal)
    return layered


def interface_depths(body: Body) -> Array:
    """Return the depths of the interfaces below the surface, (layers,) [m]."""
    return np.cumsum([layer.thickness for layer in body.layers.layers])


def check_thickness(body: Body, depth: float) -> None:
    """Raise MeshError unless the material below the layers of a body of some depth has a positive thickness."""
    total = body.layers.thickness
    if total >= depth * (1.0 - INTERFACE_TOLERANCE):
        raise MeshError(
            f"the layers are {total:.6g} m thick, the body is {depth:.6g} m deep below the contact zone; allowed: "
            "thinner layers, below which there is some of [material]"
        )


def plane_normal(zone: ContactZone) -> Array:
    """Return the normal (3,) of a plane zone, which layers are parallel to; raise MeshError for other zones."""
    normals = zone.frames[:, 2]
    normal: Array = normals[0]
    heights = (zone.points - zone.points[0]) @ normal
    width = float(np.ptp(zone.points, axis=0).max())
    if np.ptp(heights) > PLANE_TOLERANCE * width or np.abs(normals - normal).max() > PLANE_TOLERANCE:
        raise MeshError("layers are parallel to the contact zone, which is not plane; allowed: a plane zone")
    return normal


def _regions(body: Body, volume: VolumeMesh, depths: Array) -> Indices:
    """Return the layer of each cell, from the depths of the nodes."""
    check_thickness(body, float(depths.max()))
    interfaces = interface_depths(body)
    of_cells = depths[volume.cells[:, : volume.element.n_corners]]
    upper, lower = of_cells.min(axis=1), of_cells.max(axis=1)
    margin = INTERFACE_TOLERANCE * (lower - upper)
    for number, depth in enumerate(interfaces, 1):
        crossing = np.count_nonzero((upper < depth - margin) & (lower > depth + margin))
        if crossing:
            raise MeshError(
                f"volume mesh: {crossing} of {len(of_cells)} cells lie on both sides of the interface below layer "
                f"{number}, {depth:.6g} m below the contact zone; allowed: cells with faces at this depth, or a box "
                "without `volume`, whose grid is fitted to the layers"
            )
    regions = np.searchsorted(interfaces, of_cells.mean(axis=1))
    empty = set(range(len(interfaces) + 1)) - set(regions.tolist())
    if empty:
        raise MeshError(f"volume mesh: layer {min(empty) + 1} has no cells; allowed: cells between its two interfaces")
    return np.asarray(regions, np.int64)


def _with_interface(layered: LayeredMesh, body: Body, number: int, normal: Array) -> LayeredMesh:
    """Return the mesh with the nodes of the interface below a layer, doubled if a field jumps."""
    interface, mesh = body.layers.layers[number].interface, layered.mesh
    above = mesh.cells[layered.regions <= number]
    below = layered.regions > number
    upper = np.intersect1d(above, mesh.cells[below])
    springs, jumps = _springs(interface.compliance(body.fields), normal, number + 1)
    none = np.empty((0, 0), np.int64)
    if not jumps.any():
        nodes = InterfaceNodes(upper, upper, none, springs, jumps, interface.electrode)
        return replace(layered, interfaces=(*layered.interfaces, nodes))
    lower = len(mesh.points) + np.arange(len(upper))
    renumbered = np.arange(len(mesh.points))
    renumbered[upper] = lower
    cells = np.where(below[:, None], renumbered[mesh.cells], mesh.cells)
    faces = above[:, face_nodes(mesh.element)].reshape(-1, face_nodes(mesh.element).shape[1])
    faces = faces[np.isin(faces, upper).all(axis=1)]
    nodes = InterfaceNodes(upper, lower, np.searchsorted(upper, faces), springs, jumps, interface.electrode)
    return replace(
        layered,
        mesh=replace(mesh, points=np.concatenate([mesh.points, mesh.points[upper]]), cells=cells),
        originals=np.concatenate([layered.originals, layered.originals[upper]]),
        interfaces=(*layered.interfaces, nodes),
    )


def _springs(compliance: Array, normal: Array, number: int) -> tuple[Array, Array]:
    """Return fluxes by jumps (fields, fields) and which fields jump, from (tangential, tangential, normal, scalars)."""
    jumps = compliance != 0.0
    stiffness = np.divide(1.0, compliance, where=jumps, out=np.zeros(len(compliance)))
    springs = np.diag(stiffness)
    tangential, along = stiffness[0], stiffness[2]
    springs[MECHANICAL, MECHANICAL] = tangential * np.eye(3) + (along - tangential) * np.outer(normal, normal)
    if jumps[0] != jumps[2]:
        axis = int(np.abs(normal).argmax())
        if np.abs(normal[axis]) < 1.0 - PLANE_TOLERANCE**2:
            raise CaseError(
                f"interface below layer {number}: only one of normal_stiffness and tangential_stiffness is finite and "
                "the interface is oblique to the axes; allowed: both of them, or neither"
            )
        jumps[MECHANICAL] = np.where(np.arange(3) == axis, jumps[2], jumps[0])
    return springs, jumps
