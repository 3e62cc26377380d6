"""Tables of a case file that describe a body: its mesh, its boundary conditions, and a second body as a whole."""

import math
from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal

from pydantic import BeforeValidator, Field, ValidationError, ValidationInfo, model_validator

from meeframe.elements.base import SurfaceElement
from meeframe.fields import FieldSet
from meeframe.fields.units import Quantity
from meeframe.formulations.base import Formulation
from meeframe.mesh.body import BoundaryCondition
from meeframe.mesh.surface import SurfaceMesh
from meeframe.model.layer_tables import BaseTable, LayerTable
from meeframe.model.values import (
    DEFAULT_FORMULATION,
    Count,
    CountPair,
    Flag,
    FreeLength,
    FreePressure,
    GridCountPair,
    Size,
    SizePair,
    Table,
    Text,
    by_name,
    finite,
    with_keys,
)
from meeframe.plugin.validation import Problem, TableError, problems_of

_RELATIVE_HALF_WIDTH: Final = 16.0
"""Extent of the mesh of a half space around its contact zone, in widths of the zone."""


class GradedTable(Table):
    """Common keys of a graded block and a half space, as in meeframe.mesh.half_space_mesh and Grading."""

    contact_width: SizePair
    divisions: CountPair
    element: Annotated[SurfaceElement, by_name(SurfaceElement)] = Field(default="quad4", validate_default=True)
    first_ring: Annotated[float, Quantity("", gt=0, lt=math.inf)] = 1.0


class BlockTable(GradedTable):
    """Table [mesh] of a graded block; the keys are those of meeframe.mesh.block_mesh and its Grading."""

    type: Literal["block"] = "block"
    half_width: SizePair
    height: Size
    rings: Count
    layers: Count
    layer_growth: Annotated[float, Quantity("", gt=0, lt=math.inf)] = 1.5


class HalfSpaceTable(GradedTable):
    """Table [mesh] on the plane that bounds a half space, a semi-infinite body that needs no supports.

    half_width, rings: of the mesh around the contact zone, which not every formulation uses.
    """

    type: Literal["half-space"]
    divisions: GridCountPair
    half_width: SizePair | None = None
    rings: Count = 6

    @property
    def half_widths(self) -> tuple[float, float]:
        """Value of half_width, by default that many widths of the contact zone."""
        return self.half_width or (
            _RELATIVE_HALF_WIDTH * self.contact_width[0],
            _RELATIVE_HALF_WIDTH * self.contact_width[1],
        )


class FileTable(Table):
    """Table [mesh] of a mesh read from a file.

    unit: that of its coordinates; the other keys are those of meeframe.mesh.read_mesh.
    """

    type: Literal["file"] = "file"
    file: Text
    unit: Text = "m"
    merge_tolerance: Size | None = None
    group_data: Text | None = None
    reorient: Flag = False

    @property
    def scale(self) -> float:
        """Length of the file's unit in metres."""
        return float(Quantity("m").convert(f"1 {self.unit}"))

    @model_validator(mode="after")
    def _unit_of_length(self) -> "FileTable":
        try:
            _ = self.scale
        except ValueError:
            raise TableError(Problem(("unit",), "should be a unit of length such as mm", self.unit)) from None
        return self


MeshTable = BlockTable | HalfSpaceTable | FileTable | SurfaceMesh


def _mesh(value: Any, info: ValidationInfo) -> Any:
    """Validate a mesh table with the model that its keys select.

    A union of models would report errors of all of them; this reports those of the intended one.
    """
    if isinstance(value, SurfaceMesh):  # in a case that is built in Python
        return value
    if not isinstance(value, Mapping):
        raise TableError(Problem((), "should be a table", value))
    models: dict[str, type[Table]] = {"block": BlockTable, "half-space": HalfSpaceTable, "file": FileTable}
    kind = value.get("type", "file" if "file" in value else "block")
    model = models.get(kind) if isinstance(kind, str) else None
    if model is None:
        raise TableError(Problem(("type",), f"should be one of {', '.join(models)}", kind))
    try:
        return model.model_validate(value, context=info.context)
    except ValidationError as error:
        raise TableError(*problems_of(error, model)) from None


MESH_BY_TYPE: Final = BeforeValidator(_mesh)
BY_NAME: Final = by_name(Formulation, default=DEFAULT_FORMULATION)
_ONE_OR_MORE: Final = BeforeValidator(lambda value: (value,) if isinstance(value, str) else value)


class BoundaryTable(Table):
    """Table [[boundary]]: conditions on face groups, in three independent parts; the rest has zero flux.

    displacement and traction: three components each, global axes, 'free' where nothing is prescribed.
    """

    group: Annotated[tuple[Text, ...], Field(min_length=1), _ONE_OR_MORE]
    displacement: tuple[FreeLength, FreeLength, FreeLength] | None = None
    traction: tuple[FreePressure, FreePressure, FreePressure] | None = None

    @classmethod
    def of(cls, fields: FieldSet) -> "type[BoundaryTable]":
        """Return the table with the keys of scalar fields: a potential or a flux each."""
        keys = [
            key
            for scalar in fields.scalars
            for key in ((scalar.value_name, scalar.value_unit), (scalar.flux_name, scalar.flux_unit))
        ]
        return with_keys(cls, fields, {name: (finite(unit) | None, None) for name, unit in keys})

    def conditions(self) -> tuple[BoundaryCondition, ...]:
        """Return all prescribed conditions, on each group."""
        return tuple(BoundaryCondition(group, *prescribed) for group in self.group for prescribed in self._prescribed())

    def _prescribed(self) -> list[tuple[int, Literal["value", "flux"], float]]:
        """Return (field, kind, number in SI) of each prescribed component."""
        scalars = self.field_set.scalars
        values = (*(self.displacement or (None,) * 3), *(getattr(self, scalar.value_name) for scalar in scalars))
        fluxes = (*(self.traction or (None,) * 3), *(getattr(self, scalar.flux_name) for scalar in scalars))
        return [
            *((field, "value", number) for field, number in enumerate(values) if number is not None),
            *((field, "flux", number) for field, number in enumerate(fluxes) if number is not None),
        ]


class SecondBodyTable(Table):
    """Table [second_body]: the second of two deformable bodies in its own coordinates.

    Keys as for the first body. zone: the face group that may come into contact.
    """

    material: dict[str, Any]
    mesh: Annotated[MeshTable, MESH_BY_TYPE]
    boundary: tuple[BoundaryTable, ...] = ()
    layers: tuple[LayerTable, ...] = ()
    base: BaseTable | None = None
    zone: Text = "contact"
    formulation: Annotated[Formulation, BY_NAME] = Field(default=DEFAULT_FORMULATION, validate_default=True)

    @classmethod
    def of(cls, fields: FieldSet) -> "type[SecondBodyTable]":
        """Return the table for the fields of a case."""
        return with_keys(cls, fields, body_keys(fields))


def body_keys(fields: FieldSet) -> dict[str, Any]:
    """Return the keys of a body that depend on the fields of a case: types and defaults."""
    return {
        "boundary": (tuple[BoundaryTable.of(fields), ...], ()),  # type: ignore[misc]
        "layers": (tuple[LayerTable.of(fields), ...], ()),  # type: ignore[misc]
        "base": (BaseTable.of(fields) | None, None),
    }
