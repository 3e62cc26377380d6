"""The boundary value problem of one body: what a formulation is given."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.fields import MEE, Array, FieldSet
from meeframe.mesh.surface import SurfaceMesh


@dataclass(frozen=True, eq=False)
class BoundaryCondition:
    """One field prescribed on one face group: its value (displacement, potential) or its flux (traction, D.nu, B.nu).

    group: face group; field: column of the field in global axes; kind: what is prescribed; data: SI units, one number
    or one per point of mesh.group_points(group). Groups and fields without a condition have zero flux. Sign: outward
    normal.
    """

    group: str
    field: int
    kind: Literal["value", "flux"]
    data: float | Array = 0.0


@dataclass(frozen=True, eq=False)
class Body:
    """A body, its boundary conditions and its potential contact zone.

    stiffness: extended stiffness C_iJKm, (3, fields, fields, 3) [SI]; contact_group: the face group that may come into
    contact (None: no contact zone, a plain boundary value problem); fields: names of the columns. No condition may name
    the contact group.
    """

    stiffness: Array
    mesh: SurfaceMesh
    conditions: tuple[BoundaryCondition, ...]
    contact_group: str | None
    fields: FieldSet = MEE


def check_conditions(body: Body) -> None:
    """Check that conditions are complete, outside the contact zone, and do not repeat each other.

    Raises MeshError for an unknown face group, else CaseError.
    """
    seen: set[tuple[str, int]] = set()
    for condition in body.conditions:
        _check_condition(condition, len(body.mesh.group_points(condition.group)), body.fields.size)
        if condition.group == body.contact_group:
            others = ", ".join(name for name in body.mesh.group_names if name != body.contact_group)
            raise CaseError(
                f"boundary condition on {condition.group!r}: it is the contact zone, whose tractions and fluxes follow "
                f"from contact; name one of {others}"
            )
        key = (condition.group, condition.field)
        if key in seen:
            name = f"{body.fields.value_names[condition.field]} or {body.fields.flux_names[condition.field]}"
            raise CaseError(f"boundary conditions on {condition.group!r} prescribe {name} twice")
        seen.add(key)


def _check_condition(condition: BoundaryCondition, n_points: int, n_fields: int) -> None:
    name = f"boundary condition on {condition.group!r}"
    if condition.kind not in ("value", "flux"):
        raise CaseError(f"{name}: kind = {condition.kind!r}; allowed: 'value', 'flux'")
    if condition.field not in range(n_fields):
        raise CaseError(f"{name}: field = {condition.field!r}; allowed: 0 to {n_fields - 1}")
    if np.shape(condition.data) not in ((), (n_points,)):
        raise CaseError(f"{name}: data of shape {np.shape(condition.data)}; allowed: one number or ({n_points},)")
    if not np.isfinite(condition.data).all():
        raise CaseError(f"{name}: its data must be finite numbers")
