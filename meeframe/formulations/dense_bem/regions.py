"""Division of a layered body into homogeneous regions, each with a closed surface mesh.

The body is a prism below the plane face of its contact zone. The elements of that face are repeated on both sides of
each interface and on the base, so that the meshes of neighbouring regions have the same nodes on their interface.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np

from meeframe.common.errors import CaseError, MeshError
from meeframe.elements import Quad4, Quad8, Quad9
from meeframe.elements.base import SurfaceElement
from meeframe.fields import ELECTRIC, Array, Indices
from meeframe.formulations.dense_bem.layout import BODY, Joint, Joints
from meeframe.formulations.dense_bem.patches import mesh_corners
from meeframe.material.layers import Interface, LayerStack
from meeframe.mesh import area, find_contact_zone
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.mesh.surface import ElementBlock, SurfaceMesh
from meeframe.mesh.topology import boundary_polygon, find_edges, reflection

GROWTH: Final = 1.5
"""Largest ratio of the heights of successive elements on the sides of a region, downwards."""
TOLERANCE: Final = 1e-6
"""Distance of points from a plane, relative to the size of the body; difference of normals; of potentials."""
MAX_AREA_DIFFERENCE: Final = 1e-3
"""Largest relative difference of areas of a face group, whose curved border may be divided anew."""
FAR_GROUPS: Final = ("side", "base")
"""Face groups of the box for layers on a rigid base."""
_ALLOWED: Final = "allowed: prisms with sides at right angles to the zone, such as blocks, or the formulation skfem"


@dataclass(frozen=True, eq=False)
class Region:
    """A layer, or the material below all of them.

    Attributes
    ----------
    body : Body
        The region as a homogeneous body; its contact zone is the interface above it or the zone of the whole body.
    joints : Joints
        Interfaces with the other regions.
    interface : Interface or None
        Properties of the interface below; None for the lowest region.
    """

    body: Body
    joints: Joints = BODY
    interface: Interface | None = None

    @property
    def normal(self) -> Array:
        """Normal of the interfaces, (3,), upwards."""
        normal: Array = find_contact_zone(self.body.mesh, self.body.contact_group or "").frames[0, 2]
        return normal

    def shares(self, joint: Joint | None) -> Array:
        """Return the shares of the nodes of an interface in means over it, (m,)."""
        weights = find_contact_zone(self.body.mesh, "" if joint is None else joint.group).weights
        shares: Array = weights / weights.sum()
        return shares


@dataclass(frozen=True, eq=False)
class _Prism:
    """A prism of some height.

    Attributes
    ----------
    face : SurfaceMesh
        Its upper face with the groups of the body.
    downward : Array
        Unit vector, (3,).
    height : float
        Height [m].
    sides, side_groups : Indices
        Points (k, 2 or 3) of the face along its outer edges in the sense of its elements, and groups below them, (k,).
    base_group : int
        Group of the base.
    """

    face: SurfaceMesh
    downward: Array
    height: float
    sides: Indices
    side_groups: Indices
    base_group: int


def divide(body: Body) -> tuple[Region, ...]:
    """Return the regions of a body from the contact zone down; a homogeneous body is one region.

    Raises
    ------
    MeshError
        If the body is not a prism below the plane face of its contact zone, the layers are as thick as the body, or
        face groups do not reach from one face to the other.
    CaseError
        If the body has no contact zone, or is semi-infinite without a rigid base that grounds all potentials, if
        boundary data vary on sides or base, or if an electrode has two potentials.
    """
    if not body.layers:
        return (Region(body),)
    if body.contact_group is None:
        raise CaseError("layers are parallel to a contact zone; allowed: bodies with one")
    if body.mesh.semi_infinite:
        body, prism = _prism_on_base(body)
    else:
        prism = _find_prism(body)
    layers = body.layers.layers
    depths = np.cumsum([0.0, *(layer.thickness for layer in layers)])
    if depths[-1] >= prism.height * (1.0 - TOLERANCE):
        raise MeshError(
            f"the layers are {depths[-1]:.6g} m thick, the body is {prism.height:.6g} m deep below the contact zone; "
            "allowed: thinner layers, below which there is some of [material]"
        )
    prefix = "interface below layer"
    while any(name.startswith(prefix) for name in body.mesh.group_names):
        prefix += "'"
    joints = [
        Joint(f"{prefix} {number}", _potential(body, prism, layer.interface)) for number, layer in enumerate(layers, 1)
    ]
    regions = []
    for number, (top, bottom) in enumerate(pairwise([*depths, prism.height])):
        above, below = [None, *joints][number], [*joints, None][number]
        mesh = _mesh(prism, top, bottom, above, below)
        material = body if below is None else layers[number].material
        region = replace(
            body,
            stiffness=material.stiffness,
            thermal_moduli=material.thermal_moduli,
            mesh=mesh,
            conditions=tuple(c for c in body.conditions if len(mesh.group_points(c.group))),
            contact_group=body.contact_group if above is None else above.group,
            layers=LayerStack(),
        )
        regions.append(Region(region, Joints(above, below), None if below is None else layers[number].interface))
    return tuple(regions)


@contextmanager
def located_below(number: int) -> Iterator[None]:
    """Add to errors of supports and boundary data that they are those of the region below a layer, if not 0."""
    try:
        yield
    except CaseError as error:
        if number == 0:
            raise
        raise CaseError(
            f"below layer {number}: {error}; dense-bem needs supports and potentials below each interface; allowed: "
            "those of sides or base, or the formulation skfem"
        ) from error


def _potential(body: Body, prism: _Prism, interface: Interface) -> float | None:
    """Return the potential of an electrode, which the sides of the body may prescribe; NaN if it floats."""
    if interface.electrode is None:
        return None
    sides = {body.mesh.group_names[group] for group in prism.side_groups}
    prescribed = [
        float(condition.data)
        for condition in body.conditions
        if condition.group in sides and condition.field == ELECTRIC and condition.kind == "value"
    ]
    if interface.electrode == "floating" and not prescribed:
        return np.nan
    potential = 0.0 if interface.electrode == "grounded" else prescribed[0]
    if np.abs(np.array(prescribed) - potential).max(initial=0.0) > TOLERANCE * np.abs(prescribed).max(initial=0.0):
        raise CaseError(
            "electrode of a layer: boundary conditions prescribe another electric potential on faces that it touches; "
            "allowed: zero beside a grounded electrode, one potential beside a floating one"
        )
    return potential


def _find_prism(body: Body) -> _Prism:
    """Return the prism that a body is."""
    mesh = body.mesh
    zone = find_contact_zone(mesh, body.contact_group or "")
    downward = -zone.frames[0, 2]
    depths = (mesh.points - zone.points[0]) @ downward
    height, tolerance = float(depths.max()), TOLERANCE * float(np.ptp(mesh.points, axis=0).max())
    corners = mesh_corners(mesh)
    along = corners.normal @ downward
    on_face, on_base = (np.abs(depths[corners.point] - depth) <= tolerance for depth in (0.0, height))
    of_face, of_base, of_side = (np.abs(along - cosine) <= TOLERANCE for cosine in (-1.0, 1.0, 0.0))
    if not ((on_face & of_face) | (on_base & of_base) | of_side).all():
        raise MeshError(
            "layers: the body is not a prism below the plane face of the contact zone "
            f"{body.contact_group!r}; {_ALLOWED}"
        )
    base_groups = np.unique(corners.group[of_base])
    if len(base_groups) > 1:
        names = ", ".join(mesh.group_names[group] for group in base_groups)
        raise MeshError(f"layers: the face opposite to the contact zone has the groups {names}; allowed: one group")
    face = _face(mesh, np.split(of_face, np.cumsum([block.connectivity.size for block in mesh.blocks])[:-1]))
    points = np.unique(np.concatenate([b.connectivity.ravel() for b in face.blocks]))
    sides, groups = _sides(mesh, face)
    number = np.zeros(len(mesh.points), np.int64)
    number[points] = np.arange(len(points))
    blocks = tuple(replace(block, connectivity=number[block.connectivity]) for block in face.blocks)
    face = replace(face, points=mesh.points[points], blocks=blocks)
    prism = _Prism(face, downward, height, number[sides], groups, int(base_groups[0]))
    _check_groups(body, prism)
    return prism


def _prism_on_base(body: Body) -> tuple[Body, _Prism]:
    """Return the box for layers on a rigid base below the mesh of a half space, whose values vanish at sides and base.

    The first result has the conditions of the box, for a mesh of its upper face alone.
    """
    base = body.layers.base
    if base is None or base.insulating:
        below = "no [base]" if base is None else f"the base insulates {', '.join(base.insulating)}"
        raise CaseError(
            f"dense-bem: layers of a half space, {below}; allowed: a rigid base with all potentials zero, blocks, or "
            "the formulation half-space"
        )
    mesh = replace(body.mesh, group_names=(*body.mesh.group_names, *FAR_GROUPS), semi_infinite=False)
    conditions = [BoundaryCondition(group, field, "value") for group in FAR_GROUPS for field in range(body.fields.size)]
    zone = find_contact_zone(body.mesh, body.contact_group or "")
    side, last = len(body.mesh.group_names), len(mesh.group_names) - 1
    sides = _outline(mesh)
    height = body.layers.thickness + base.thickness
    prism = _Prism(mesh, -zone.frames[0, 2], height, sides, np.full(len(sides), side), last)
    return replace(body, mesh=mesh, conditions=(*body.conditions, *conditions)), prism


def _face(mesh: SurfaceMesh, corners: list[np.ndarray[tuple[int, ...], np.dtype[np.bool_]]]) -> SurfaceMesh:
    """Return the elements with the chosen corners, with all points of the mesh."""
    blocks = []
    for block, chosen in zip(mesh.blocks, corners, strict=True):
        members = chosen.reshape(block.connectivity.shape).all(axis=1)
        if members.any():
            blocks.append(ElementBlock(block.element, block.connectivity[members], block.groups[members]))
    return replace(mesh, blocks=tuple(blocks))


def _sides(mesh: SurfaceMesh, face: SurfaceMesh) -> tuple[Indices, Indices]:
    """Return the points along the outer edges of a face, (k, 2 or 3), and the groups of the elements beyond them."""
    sides = _outline(face)
    groups = np.concatenate([block.groups for block in mesh.blocks])
    every = find_edges(mesh)
    beyond = {(a, b): groups[element] for (a, b), element in zip(every.ends.tolist(), every.elements, strict=True)}
    return sides, np.array([beyond[b, a] for a, b in sides[:, [0, -1]].tolist()])


def _outline(face: SurfaceMesh) -> Indices:
    """Return the points along the outer edges of a face, (k, 2 or 3), in the sense of its elements."""
    steps = boundary_polygon(face)  # segments from node to node, along one edge of an element after the other
    edges = find_edges(face)
    per_edge = 1 + int((edges.between >= 0).any(axis=0).sum())
    steps = steps.reshape(-1, per_edge, 2)
    return np.column_stack([steps[:, 0, 0], steps[:, :, 1]])


def _check_groups(body: Body, prism: _Prism) -> None:
    """Raise an error unless groups reach from face to base, and boundary data on sides and base are uniform.

    The areas of the groups tell whether the group below an edge of the face is the same at all depths.
    """
    mesh = _mesh(prism, 0.0, prism.height, None, None)
    for name in body.mesh.group_names:
        expected, actual = area(body.mesh, name), area(mesh, name)
        if abs(actual - expected) > MAX_AREA_DIFFERENCE * expected:
            raise MeshError(
                f"layers: the face group {name!r} has an area of {expected:g} m^2, the sides below its upper edge "
                f"{actual:g} m^2; allowed: groups that reach from the face of the contact zone to the opposite face"
            )
    upper = {body.mesh.group_names[group] for block in prism.face.blocks for group in block.groups}
    for condition in body.conditions:
        if np.ndim(condition.data) > 0 and condition.group not in upper:
            raise CaseError(
                f"layers: boundary condition on {condition.group!r} has data at points; allowed: one number on each "
                "face but that of the contact zone"
            )


def _mesh(prism: _Prism, top: float, bottom: float, above: Joint | None, below: Joint | None) -> SurfaceMesh:
    """Return the closed mesh of the part of a prism between two depths; the points of its upper face come first."""
    face, count = prism.face, len(prism.face.points)
    quadratic = prism.sides.shape[1] == 3
    levels = _levels(prism, top, bottom)
    if quadratic:  # with nodes halfway
        levels = np.sort(np.concatenate([levels, (levels[1:] + levels[:-1]) / 2]))
    names = [*face.group_names, *(joint.group for joint in (above, below) if joint is not None)]
    upper_group = None if above is None else names.index(above.group)
    lower_group = prism.base_group if below is None else names.index(below.group)
    blocks = []
    for block in face.blocks:
        groups = block.groups if upper_group is None else np.full_like(block.groups, upper_group)
        blocks.append(replace(block, groups=groups))
        lower = block.connectivity[:, reflection(block.element)] + (len(levels) - 1) * count
        blocks.append(ElementBlock(block.element, lower, np.full_like(block.groups, lower_group)))
    element = _side_element(face, quadratic)
    steps = count * np.arange(0, len(levels) - 1, 2 if quadratic else 1)
    strip = _strip(prism.sides, element, count)
    blocks.append(
        ElementBlock(
            element,
            (strip + steps[:, None, None]).reshape(-1, strip.shape[1]),
            np.tile(prism.side_groups, len(steps)),
        )
    )
    points = (face.points + levels[:, None, None] * prism.downward).reshape(-1, 3)
    used = np.unique(np.concatenate([block.connectivity.ravel() for block in blocks]))
    number = np.zeros(len(points), np.int64)
    number[used] = np.arange(len(used))
    renumbered = tuple(replace(block, connectivity=number[block.connectivity]) for block in blocks)
    return SurfaceMesh(points[used], renumbered, tuple(names))


def _levels(prism: _Prism, top: float, bottom: float) -> Array:
    """Return the depths of the edges of elements on the sides, as far apart as those of the face at first."""
    ends = prism.face.points[prism.sides[:, [0, -1]]]
    first, height = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean()), bottom - top
    count = int(np.ceil(np.log1p(height * (GROWTH - 1.0) / first) / np.log(GROWTH) - TOLERANCE))
    ends_of = np.cumsum(np.concatenate([[0.0], GROWTH ** np.arange(max(count, 1))]))
    levels: Array = top + height * ends_of / ends_of[-1]
    return levels


def _side_element(face: SurfaceMesh, quadratic: bool) -> SurfaceElement:
    if not quadratic:
        return Quad4()
    return Quad9() if any(isinstance(block.element, Quad9) for block in face.blocks) else Quad8()


def _strip(sides: Indices, element: SurfaceElement, count: int) -> Indices:
    """Return the elements below edges a to b of a face, with b, a, and the nodes below a and b as corners.

    A level has `count` points; quadratic elements extend over two.
    """
    a, b = sides[:, 0], sides[:, -1]
    if isinstance(element, Quad4):
        return np.column_stack([b, a, a + count, b + count])
    middle, low = sides[:, 1], 2 * count
    nodes = [b, a, a + low, b + low, middle, a + count, middle + low, b + count]
    if isinstance(element, Quad9):
        nodes.append(middle + count)
    return np.column_stack(nodes)
