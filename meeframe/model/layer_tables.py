"""Tables of a case file that describe layers, their interfaces and a rigid base."""

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator

from meeframe.fields import FieldSet
from meeframe.fields.units import Quantity
from meeframe.material import Material
from meeframe.material.grading import Grading
from meeframe.material.layers import Interface, RigidBase
from meeframe.model.values import Size, Table, with_keys
from meeframe.plugin.validation import Problem, TableError

BONDED = "bonded"
_Stiffness = Annotated[float, Quantity("N/m^3", gt=0)]


def _interface(value: Any) -> Any:
    if value == BONDED:
        return {}
    if isinstance(value, str):
        raise TableError(Problem((), f"should be {BONDED!r} or a table such as {{electrode = 'grounded'}}", value))
    return value


def _material(value: Any) -> Any:
    """Return the table of a material that is given by its name."""
    return {"name": value} if isinstance(value, str) else value


class InterfaceTable(Table):
    """Table `interface` of a layer; without a key the interface is bonded in the field that the key belongs to."""

    normal_stiffness: _Stiffness = math.inf
    tangential_stiffness: _Stiffness = math.inf
    electrode: Literal["grounded", "floating"] | None = None

    @classmethod
    def of(cls, fields: FieldSet) -> "type[InterfaceTable]":
        """Return the table with the keys of scalar fields: a conductance each."""
        keys = {
            f"{scalar.name}_conductance": (Annotated[float, Quantity(scalar.conductance_unit, gt=0)], math.inf)
            for scalar in fields.scalars
        }
        return with_keys(cls, fields, keys)

    def interface(self) -> Interface:
        """Return the interface."""
        conductances = {name: getattr(self, f"{name}_conductance") for name in self.field_set.names}
        finite = {name: value for name, value in conductances.items() if math.isfinite(value)}
        return Interface(self.normal_stiffness, self.tangential_stiffness, finite, self.electrode)


class GradingTable(Table):
    """Table `grading` of a layer, key by key as in meeframe.material.grading.Grading."""

    law: Literal["exponential", "power", "table"]
    ratio: Annotated[float, Quantity("", gt=0, lt=math.inf)] | None = None
    exponent: Annotated[float, Quantity("", gt=0, lt=math.inf)] | None = None
    depths: tuple[Annotated[float, Quantity("", ge=0, le=1)], ...] | None = None
    factors: tuple[Annotated[float, Quantity("", ge=0, lt=math.inf)], ...] | None = None
    material: Annotated[dict[str, Any] | None, BeforeValidator(_material)] = None
    tolerance: Annotated[float, Quantity("", gt=0, lt=math.inf)] = 1e-3

    def grading(self, material: Material | None) -> Grading:
        """Return the grading, with its material."""
        values = {name: getattr(self, name) for name in GradingTable.model_fields if name != "material"}
        return Grading(**values, material=material)


class LayerTable(Table):
    """Table [[layers]]: one layer, the first of which is at the surface."""

    material: Annotated[dict[str, Any], BeforeValidator(_material)]
    thickness: Size
    rotation: dict[str, Any] | None = None
    grading: GradingTable | None = None
    interface: Annotated[InterfaceTable, BeforeValidator(_interface)]

    @classmethod
    def of(cls, fields: FieldSet) -> "type[LayerTable]":
        """Return the table for the fields of a case."""
        interface = InterfaceTable.of(fields)
        return with_keys(cls, fields, {"interface": (Annotated[interface, BeforeValidator(_interface)], interface())})


class BaseTable(Table):
    """Table [base]: a rigid base below the material of a half space."""

    thickness: Size

    @classmethod
    def of(cls, fields: FieldSet) -> "type[BaseTable]":
        """Return the table with the keys of scalar fields: grounded or insulating."""
        keys: Mapping[str, Any] = {
            scalar.name: (Literal["grounded", "insulating"], "grounded") for scalar in fields.scalars
        }
        return with_keys(cls, fields, keys)

    def base(self) -> RigidBase:
        """Return the base."""
        insulating = (name for name in self.field_set.names if getattr(self, name) == "insulating")
        return RigidBase(self.thickness, tuple(insulating))
