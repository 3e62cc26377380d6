"""What a case file may say: one frozen model for each table. Documented in docs/case-files.md."""

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Annotated, Any, Final, Literal

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    Strict,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
    model_validator,
)

from meeframe.case.step import Step
from meeframe.core.body import BoundaryCondition
from meeframe.core.contact import ConductivityLaw, ContactLaw, Solver
from meeframe.core.element import SurfaceElement
from meeframe.core.errors import CaseError
from meeframe.core.formulation import Formulation
from meeframe.core.indenter import Indenter
from meeframe.core.quantities import Quantity
from meeframe.geometry import FrictionAxes, Placement
from meeframe.plugin.registry import CONTRACTS, Registry
from meeframe.plugin.validation import Problem, TableError, build, problems_of
from meeframe.solvers import Limits

_FINITE: Final = {"gt": -math.inf, "lt": math.inf}

Text = Annotated[str, Strict(), Field(min_length=1)]
Flag = Annotated[bool, Strict()]
Count = Annotated[int, Strict(), Field(ge=1, le=1000)]  # a thousand a side is more than any memory holds
Size = Annotated[float, Quantity("m", gt=0, lt=math.inf)]
Length = Annotated[float, Quantity("m", **_FINITE)]
Angle = Annotated[float, Quantity("rad", **_FINITE)]
Force = Annotated[float, Quantity("N", **_FINITE)]
Moment = Annotated[float, Quantity("N m", **_FINITE)]
Pressure = Annotated[float, Quantity("Pa", **_FINITE)]
ElectricPotential = Annotated[float, Quantity("V", **_FINITE)]
MagneticPotential = Annotated[float, Quantity("A", **_FINITE)]
ElectricFlux = Annotated[float, Quantity("C/m^2", **_FINITE)]
MagneticFlux = Annotated[float, Quantity("Wb/m^2", **_FINITE)]
Charge = Annotated[float, Quantity("C", **_FINITE)]
TotalMagneticFlux = Annotated[float, Quantity("Wb", **_FINITE)]
Ratio = Annotated[float, Quantity("", **_FINITE)]

_FREE: Final = BeforeValidator(lambda value: None if value == "free" else value)
FreeLength = Annotated[Length | None, _FREE]
FreePressure = Annotated[Pressure | None, _FREE]


def _by_name(contract: type, unit: str = "") -> BeforeValidator:
    """Makes the object that a table names, by the registry that is the context of the validation; unit: as there."""
    return BeforeValidator(lambda table, info: replace(_registry(info), unit=unit).create(CONTRACTS[contract], table))


def _registry(info: ValidationInfo) -> Registry:
    registry: Registry = info.context  # type: ignore[assignment]  # load_case sees to it
    return registry


class Table(BaseModel):
    """Base of all tables: frozen, no unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)


def _pair(check: Callable[[Any], Any]) -> BeforeValidator:
    """One number stands for two equal ones, (x1, x2)."""
    return BeforeValidator(lambda value: value if isinstance(value, list | tuple) else (check(value),) * 2)


SizePair = Annotated[tuple[Size, Size], _pair(Quantity("m", gt=0, lt=math.inf).check)]
CountPair = Annotated[tuple[Count, Count], _pair(TypeAdapter(Count).validate_python)]


class GradedTable(Table):
    """What a graded block and a half space have in common; keys as of meeframe.geometry.half_space_mesh and Grading."""

    half_width: SizePair
    contact_width: SizePair
    divisions: CountPair
    rings: Count
    element: Annotated[SurfaceElement, _by_name(SurfaceElement)] = Field(default="quad4", validate_default=True)
    first_ring: Annotated[float, Quantity("", gt=0, lt=math.inf)] = 1.0


class BlockTable(GradedTable):
    """[mesh] of a graded block; the keys are those of meeframe.geometry.block_mesh and its Grading."""

    type: Literal["block"] = "block"
    height: Size
    layers: Count
    layer_growth: Annotated[float, Quantity("", gt=0, lt=math.inf)] = 1.5


class HalfSpaceTable(GradedTable):
    """[mesh] on the plane that bounds a half space: a semi-infinite body, which needs no supports."""

    type: Literal["half-space"]


class FileTable(Table):
    """[mesh] read from a file; unit: of its coordinates; the other keys are those of meeframe.geometry.read_mesh."""

    type: Literal["file"] = "file"
    file: Text
    unit: Text = "m"
    merge_tolerance: Size | None = None
    group_data: Text | None = None
    reorient: Flag = False

    @property
    def scale(self) -> float:
        """Metres in the unit of the file."""
        return float(Quantity("m").convert(f"1 {self.unit}"))

    @model_validator(mode="after")
    def _unit_of_length(self) -> "FileTable":
        try:
            _ = self.scale
        except ValueError:
            raise TableError(Problem(("unit",), "should be a unit of length such as mm", self.unit)) from None
        return self


MeshTable = BlockTable | HalfSpaceTable | FileTable


def _mesh(value: Any, info: ValidationInfo) -> Any:
    """The model is chosen here and not by a union: errors then speak of the one that was meant."""
    if not isinstance(value, Mapping):
        return value
    models: dict[str, type[Table]] = {"block": BlockTable, "half-space": HalfSpaceTable, "file": FileTable}
    kind = value.get("type", "file" if "file" in value else "block")
    model = models.get(kind) if isinstance(kind, str) else None
    if model is None:
        raise TableError(Problem(("type",), f"should be one of {', '.join(models)}", kind))
    try:
        return model.model_validate(value, context=info.context)
    except ValidationError as error:
        raise TableError(*problems_of(error, model)) from None


_ONE_OR_MORE: Final = BeforeValidator(lambda value: (value,) if isinstance(value, str) else value)


class BoundaryTable(Table):
    """[[boundary]]: what is prescribed on face groups, in three independent parts; the rest has zero flux.

    displacement and traction: three components each, global axes, 'free' where nothing is prescribed.
    """

    group: Annotated[tuple[Text, ...], Field(min_length=1), _ONE_OR_MORE]
    displacement: tuple[FreeLength, FreeLength, FreeLength] | None = None
    traction: tuple[FreePressure, FreePressure, FreePressure] | None = None
    electric_potential: ElectricPotential | None = None
    electric_flux: ElectricFlux | None = None
    magnetic_potential: MagneticPotential | None = None
    magnetic_flux: MagneticFlux | None = None

    def conditions(self) -> tuple[BoundaryCondition, ...]:
        """Everything prescribed, on each group."""
        return tuple(BoundaryCondition(group, *prescribed) for group in self.group for prescribed in self._prescribed())

    def _prescribed(self) -> list[tuple[int, Literal["value", "flux"], float]]:
        """(field, kind, number in SI)."""
        values = (*(self.displacement or (None,) * 3), self.electric_potential, self.magnetic_potential)
        fluxes = (*(self.traction or (None,) * 3), self.electric_flux, self.magnetic_flux)
        return [
            *((field, "value", number) for field, number in enumerate(values) if number is not None),
            *((field, "flux", number) for field, number in enumerate(fluxes) if number is not None),
        ]


class CounterBodyTable(Table):
    """[counter_body]: the second of two deformable bodies in its own coordinates; keys as of the first body.

    zone: the face group that may come into contact.
    """

    material: dict[str, Any]
    mesh: Annotated[MeshTable, BeforeValidator(_mesh)]
    boundary: tuple[BoundaryTable, ...] = ()
    zone: Text = "contact"
    formulation: Annotated[Formulation, _by_name(Formulation)] = Field(default="dense-bem", validate_default=True)


def _axes(value: Any) -> Any:
    return build(FrictionAxes, value) if isinstance(value, Mapping) else value


class ContactTable(Table):
    """[contact]: the face group that may come into contact, its law, and the axes of its friction."""

    zone: Text = "contact"
    law: Annotated[ContactLaw, _by_name(ContactLaw)] = Field(default="signorini", validate_default=True)
    axes: Annotated[FrictionAxes | None, BeforeValidator(_axes)] = None


_INSULATING: Final = Field(default="insulating", validate_default=True)


class ConductivityTable(Table):
    """[conductivity]: laws of the contact zone; a field without one is insulated."""

    electric: Annotated[ConductivityLaw, _by_name(ConductivityLaw, "F/m^2")] = _INSULATING
    magnetic: Annotated[ConductivityLaw, _by_name(ConductivityLaw, "H/m^2")] = _INSULATING


def _divided(value: Any, info: ValidationInfo, contract: type, record: type, others: tuple[str, ...] = ()) -> Any:
    """Divides a flat table: keys of `record`, keys of the table itself (others), and the rest for the named object."""
    if isinstance(value, str):
        value = {"name": value}
    if not isinstance(value, Mapping):
        return value
    own = tuple(field.name for field in dataclasses.fields(record))
    rest = {key: item for key, item in value.items() if key not in (*own, *others)}
    return {
        "named": _registry(info).create(CONTRACTS[contract], rest, (*own, *others)),
        "record": build(record, {key: value[key] for key in own if key in value}),
        **{key: value[key] for key in others if key in value},
    }


class IndenterTable(Table):
    """[indenter]: a named shape with its keys, its placement and its potentials."""

    named: Indenter
    record: Placement
    electric_potential: ElectricPotential = 0.0
    magnetic_potential: MagneticPotential = 0.0

    @model_validator(mode="before")
    @classmethod
    def _flat(cls, value: Any, info: ValidationInfo) -> Any:
        return _divided(value, info, Indenter, Placement, ("electric_potential", "magnetic_potential"))


class SolverTable(Table):
    """[solver]: a named solver with its keys, and the limits of the iteration."""

    named: Solver
    record: Limits

    @model_validator(mode="before")
    @classmethod
    def _flat(cls, value: Any, info: ValidationInfo) -> Any:
        return _divided(value, info, Solver, Limits)


class StepTable(Table):
    """[[steps]]: what one load step prescribes, key by key as in meeframe.case.step.Step.

    direction: angle from e1 to e2 of those entries across the axis that are one number instead of two components.
    """

    approach: Length | None = None
    normal_force: Annotated[float, Quantity("N", ge=0, lt=math.inf)] | None = None
    translation: tuple[Length, Length] | None = None
    tangential_force: tuple[Force, Force] | None = None
    force_ratio: tuple[Ratio, Ratio] | None = None
    direction: Angle | None = None
    tilt: tuple[Angle, Angle] | None = None
    moment: tuple[Moment, Moment] | None = None
    twist: Angle | None = None
    torque: Moment | None = None
    electric_potential: ElectricPotential | None = None
    charge: Charge | None = None
    magnetic_potential: MagneticPotential | None = None
    magnetic_flux: TotalMagneticFlux | None = None
    increments: Count = 1

    @model_validator(mode="before")
    @classmethod
    def _directed(cls, value: Any) -> Any:
        """Sizes along `direction` become components."""
        if not isinstance(value, Mapping):
            return value
        sizes = {
            key: Quantity(unit, **_FINITE)
            for key, unit in (("translation", "m"), ("tangential_force", "N"), ("force_ratio", ""))
            if key in value and not isinstance(value[key], list | tuple)
        }
        if "direction" in value and not sizes:
            text = "needs the size of a translation, tangential_force or force_ratio; components have their direction"
            raise TableError(Problem(("direction",), text, value["direction"]))
        components = {}
        for key, size in sizes.items():
            if "direction" not in value:
                text = "should be a list of two components, or one number beside a direction"
                raise TableError(Problem((key,), text, value[key]))
            length, angle = _checked(key, size, value), _checked("direction", Quantity("rad", **_FINITE), value)
            components[key] = (length * math.cos(angle), length * math.sin(angle))
        return {**value, **components}

    @model_validator(mode="after")
    def _consistent(self) -> "StepTable":
        try:
            self.step()
        except CaseError as error:
            raise TableError(Problem((), str(error))) from None
        return self

    def step(self) -> Step:
        """The load step."""
        return Step(**self.model_dump(exclude={"direction"}))


def _checked(key: str, quantity: Quantity, table: Mapping[str, Any]) -> float:
    try:
        return quantity.check(table[key])
    except ValueError as error:
        raise TableError(Problem((key,), str(error), table[key])) from None


class RestartTable(Table):
    """[restart]: the folder of a run whose last converged increment is to be continued."""

    folder: Text = Field(alias="from")


class OutputTable(Table):
    """[output]: what is written beside result.h5 and summary.json."""

    figures: Flag = True
    vtu: Flag = True


class CaseTable(Table):
    """The whole case file."""

    title: Annotated[str, Strict()] = ""
    material: dict[str, Any]
    mesh: Annotated[MeshTable, BeforeValidator(_mesh)]
    boundary: tuple[BoundaryTable, ...] = ()
    counter_body: CounterBodyTable | None = None
    contact: ContactTable = Field(default_factory=dict, validate_default=True)
    conductivity: ConductivityTable = Field(default_factory=dict, validate_default=True)
    indenter: IndenterTable
    formulation: Annotated[Formulation, _by_name(Formulation)] = Field(default="dense-bem", validate_default=True)
    solver: SolverTable = Field(default="auto", validate_default=True)
    restart: RestartTable | None = None
    steps: tuple[StepTable, ...] = Field(min_length=1)
    output: OutputTable = OutputTable()
