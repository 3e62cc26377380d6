"""The boundary value problem of one body, the input of a formulation."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from meeframe.common.errors import CaseError
from meeframe.fields import MEE, Array, FieldScaling, FieldSet
from meeframe.material.layers import LayerStack
from meeframe.material.material import Material
from meeframe.mesh.surface import SurfaceMesh


@dataclass(frozen=True, eq=False)
class BoundaryCondition:
    """One field prescribed on one face group, by its value or by its flux.

    Groups and fields without a condition have zero flux.

    Attributes
    ----------
    group : str
        Name of the face group.
    field : int
        Column of the field, in global axes.
    kind : {'value', 'flux'}
        Whether the value (displacement, potential) or the flux (traction, D.nu, B.nu, outward normal) is prescribed.
    data : float or Array
        One number, or one for each point of mesh.group_points(group), in SI units.
    """

    group: str
    field: int
    kind: Literal["value", "flux"]
    data: float | Array = 0.0


@dataclass(frozen=True, eq=False)
class Body:
    """A body, its boundary conditions and its potential contact zone.

    Attributes
    ----------
    stiffness : Array
        Extended stiffness C_iJKm, (3, fields, fields, 3), in SI units.
    mesh : SurfaceMesh
        Boundary of the body.
    conditions : tuple of BoundaryCondition
        Boundary conditions, none of them on the contact group.
    contact_group : str or None
        Face group that may come into contact, None for a boundary value problem without contact.
    fields : FieldSet
        Names of the columns.
    thermal_moduli : Array or None
        beta_iJ, (3, 5), by which the temperature, one of the fields, acts on the others; None if it does not.
    layers : LayerStack
        Layers on the body, and its rigid base; none for a homogeneous body.
    """

    stiffness: Array
    mesh: SurfaceMesh
    conditions: tuple[BoundaryCondition, ...]
    contact_group: str | None
    fields: FieldSet = MEE
    layers: LayerStack = field(default_factory=LayerStack)
    thermal_moduli: Array | None = None

    @property
    def scaled_stiffness(self) -> Array:
        """Stiffness with fields in units in which their entries have similar magnitudes."""
        return FieldScaling.of(self.stiffness).scale_stiffness(self.stiffness)

    @classmethod
    def of(
        cls,
        material: Material,
        mesh: SurfaceMesh,
        conditions: tuple[BoundaryCondition, ...],
        contact_group: str | None,
        layers: LayerStack | None = None,
    ) -> "Body":
        """Return the body of a material, with its fields.

        Parameters
        ----------
        material : Material
            Its material.
        mesh, conditions, contact_group, layers
            As for `Body`.

        Returns
        -------
        Body
            The body.
        """
        geometry = mesh, conditions, contact_group
        return cls(material.stiffness, *geometry, material.fields, layers or LayerStack(), material.thermal_moduli)

    @property
    def all_moduli(self) -> tuple[Array | None, ...]:
        """Thermal moduli of the layers from the surface down, and of the material below them."""
        return (*(layer.material.thermal_moduli for layer in self.layers.layers), self.thermal_moduli)

    @property
    def expands(self) -> bool:
        """True if the temperature acts on the other fields of the body or of one of its layers."""
        return any(moduli is not None for moduli in self.all_moduli)


def check_layers(body: Body) -> None:
    """Raise CaseError unless the layers of a body have its fields, and only a half space has a rigid base."""
    for number, layer in enumerate(body.layers.layers, 1):
        if layer.material.fields != body.fields:
            theirs, ours = ", ".join(layer.material.fields.names), ", ".join(body.fields.names)
            raise CaseError(
                f"layer {number} has the scalar fields {theirs}, the body {ours}; allowed: materials with the same "
                "fields"
            )
    if body.layers.base is not None and not body.mesh.semi_infinite:
        raise CaseError("a rigid base is below a half space; allowed for this mesh: boundary conditions on its groups")


def check_conditions(body: Body) -> None:
    """Check that conditions are complete, outside the contact zone, and do not repeat each other.

    Parameters
    ----------
    body : Body
        The body.

    Raises
    ------
    MeshError
        For an unknown face group.
    CaseError
        If a condition is not valid, names the contact zone or repeats another one.
    """
    seen: set[tuple[str, int]] = set()
    for condition in body.conditions:
        _check_condition(condition, len(body.mesh.group_points(condition.group)), body.fields.size)
        if condition.group == body.contact_group:
            others = ", ".join(name for name in body.mesh.group_names if name != body.contact_group)
            raise CaseError(
                f"boundary condition on {condition.group!r}: it is the contact zone, where contact determines "
                f"tractions and fluxes; allowed: {others}"
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
        raise CaseError(
            f"{name}: data has shape {np.shape(condition.data)}; allowed: one number or shape ({n_points},)"
        )
    if not np.isfinite(condition.data).all():
        raise CaseError(f"{name}: data must be finite numbers")
