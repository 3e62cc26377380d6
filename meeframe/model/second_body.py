"""Second of two deformable bodies, as described by a case."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from meeframe.common.errors import CaseError, MeshError
from meeframe.fields import FieldSet
from meeframe.formulations.base import Formulation, check_body
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.material import Material
from meeframe.material.layers import LayerStack
from meeframe.mesh import ContactZone, check_contact_zone, find_contact_zone
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.mesh.mortar import check_facing
from meeframe.mesh.surface import SurfaceMesh
from meeframe.plugin.sources import faults_of_plugins
from meeframe.system.two_body import TURN_OVER, match_nodes

MAX_SPACING_RATIO: Final = 1.05
"""Largest ratio of the spacings of nodes, of the second body and the first, without a warning."""
_BODIES: Final = ("first body", "second body")


@dataclass(frozen=True, eq=False)
class SecondBody:
    """Second body of a case, in its own coordinates, in which its contact zone faces up; see meeframe.system.two_body.

    Attributes
    ----------
    material : Material
        Material.
    mesh : SurfaceMesh
        Surface mesh [m].
    conditions : tuple of BoundaryCondition
        Boundary conditions.
    zone : str
        Name of the face group that may come into contact.
    formulation : Formulation
        Formulation.
    layers : LayerStack
        Layers on the contact zone, and a rigid base.

    Raises
    ------
    MeshError, CaseError
        As for a case: if the mesh does not fit the formulation, or a condition or layer is not valid.
    """

    material: Material
    mesh: SurfaceMesh
    conditions: tuple[BoundaryCondition, ...] = ()
    zone: str = "contact"
    formulation: Formulation = field(default_factory=DenseBEM)
    layers: LayerStack = field(default_factory=LayerStack)

    def __post_init__(self) -> None:
        check_contact_zone(self.mesh, self.zone)
        with faults_of_plugins():
            check_body(self.formulation, self.body)
            self.formulation.check(self.body)

    @property
    def body(self) -> Body:
        """Boundary value problem for the formulation."""
        return Body.of(self.material, self.mesh, self.conditions, self.zone, self.layers)


def check_fields(second_body: SecondBody | None, fields: FieldSet) -> None:
    """Check that the material of the second body has the fields of the first.

    Parameters
    ----------
    second_body : SecondBody or None
        Second body, if there is one.
    fields : FieldSet
        Field set of the first body.

    Raises
    ------
    CaseError
        If it has other fields.
    """
    if second_body is not None and second_body.material.fields != fields:
        theirs, ours = ", ".join(second_body.material.fields.names), ", ".join(fields.names)
        raise CaseError(f"the second body has the scalar fields {theirs}, the first {ours}; allowed: the same fields")


def _zones_without_match(
    second_body: SecondBody | None, mesh: SurfaceMesh, zone: str
) -> tuple[ContactZone, ContactZone] | None:
    """Return the contact zones of both bodies if their nodes do not coincide; None if they do or there is one body."""
    if second_body is None:
        return None
    zones = find_contact_zone(mesh, zone), find_contact_zone(second_body.mesh, second_body.zone)
    return zones if match_nodes(*zones) is None else None


def check_match(second_body: SecondBody | None, mesh: SurfaceMesh, zone: str) -> None:
    """Check that the contact zone of the second body fits that of the first.

    The nodes of both coincide, or `meeframe.system.transfer` can transfer between them: not on a periodic surface, and
    not with edges between nodes, which are those of one of the divisions.

    Parameters
    ----------
    second_body : SecondBody or None
        Second body, if there is one.
    mesh : SurfaceMesh
        Mesh of the first body.
    zone : str
        Name of the contact zone of the first body.

    Raises
    ------
    MeshError
        If the zones do not fit.
    """
    zones = _zones_without_match(second_body, mesh, zone)
    if second_body is None or zones is None:
        return
    first, second = zones
    for name, applies in (
        ("a periodic surface", second_body.formulation.is_periodic()),
        ("edges resolved between the nodes", second_body.formulation.resolves_edges()),
    ):
        if applies:
            raise MeshError(
                f"the contact zones of the two bodies have {len(first.points)} and {len(second.points)} nodes that do "
                f"not coincide; allowed with {name}: the same division of both, with the second turned over about the "
                "x1 axis"
            )
    check_facing(first.points, first.cells, second.points * TURN_OVER, second.cells)


def coarse_zone(second_body: SecondBody | None, mesh: SurfaceMesh, zone: str) -> Iterator[str]:
    """Yield a warning if the nodes of the second body's zone, other than those of the first, are farther apart.

    Parameters
    ----------
    second_body : SecondBody or None
        Second body, if there is one.
    mesh : SurfaceMesh
        Mesh of the first body.
    zone : str
        Name of the contact zone of the first body.

    Yields
    ------
    str
        The warning.
    """
    zones = _zones_without_match(second_body, mesh, zone)
    if zones is None:
        return
    first, second = zones
    spacing, other = (float(np.sqrt(one.weights.sum() / len(one.points))) for one in (first, second))
    if other > MAX_SPACING_RATIO * spacing:
        yield (
            f"the nodes of the second body's contact zone are {other:.3g} m apart, those of the first {spacing:.3g} m: "
            "pressures at nodes oscillate, while forces are accurate; better: exchange the bodies, or refine the second"
        )


def check_alike(second_body: SecondBody | None, formulation: Formulation) -> None:
    """Check that both bodies have a periodic surface or neither, and that both resolve contact edges or neither.

    The formulations provide this information.

    Parameters
    ----------
    second_body : SecondBody or None
        Second body, if there is one.
    formulation : Formulation
        Formulation of the first body.

    Raises
    ------
    CaseError
        If the bodies differ.
    """
    if second_body is None:
        return
    theirs = second_body.formulation
    if theirs.is_periodic() != formulation.is_periodic():
        one, other = _BODIES if formulation.is_periodic() else _BODIES[::-1]
        raise CaseError(
            f"the surface of the {one} is periodic, that of the {other} is not; allowed: both or neither "
            "(half-space: periodic)"
        )
    if theirs.resolves_edges() != formulation.resolves_edges():
        one, other = _BODIES if formulation.resolves_edges() else _BODIES[::-1]
        raise CaseError(
            f"the formulation of the {one} resolves the edges of the contact between the nodes, that of the {other} "
            "does not; allowed: both or neither (half-space: edges)"
        )
