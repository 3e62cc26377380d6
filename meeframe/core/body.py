"""The boundary value problem of one body: what a formulation is given."""

from dataclasses import dataclass
from typing import Literal

from meeframe.core.fields import Array
from meeframe.core.mesh import SurfaceMesh


@dataclass(frozen=True, eq=False)
class BoundaryCondition:
    """One field prescribed on one face group: its value (displacement, potential) or its flux (traction, D.nu, B.nu).

    group: face group; field: 0..4 in global axes; kind: what is prescribed; data: SI units, one number or one per point
    of mesh.group_points(group). Groups and fields without a condition have zero flux. Sign: outward normal.
    """

    group: str
    field: int
    kind: Literal["value", "flux"]
    data: float | Array = 0.0


@dataclass(frozen=True, eq=False)
class Body:
    """A body, its boundary conditions and its potential contact zone.

    stiffness: extended stiffness C_iJKm, (3, 5, 5, 3) [SI]; contact_group: the face group that may come into contact
    (None: no contact zone, a plain boundary value problem). No condition may name the contact group.
    """

    stiffness: Array
    mesh: SurfaceMesh
    conditions: tuple[BoundaryCondition, ...]
    contact_group: str | None
