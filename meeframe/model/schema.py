"""Schema of a case file: one frozen model for each table. Documented in docs/reference/case-files.md."""

import dataclasses
import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Annotated, Any, Final

from pydantic import (
    BeforeValidator,
    Field,
    Strict,
    ValidationInfo,
    field_validator,
    model_validator,
)

from meeframe.common.errors import CaseError
from meeframe.contact.problem import Solver
from meeframe.fields import FieldSet, ScalarField
from meeframe.fields.units import Quantity
from meeframe.formulations.base import Formulation
from meeframe.indenters import Placement
from meeframe.indenters.base import Indenter, IndenterMotions
from meeframe.laws.base import ConductivityLaw, ContactLaw
from meeframe.laws.wear import WearLaw
from meeframe.mesh import FrictionAxes
from meeframe.model.body_tables import (
    BY_NAME,
    MESH_BY_TYPE,
    BoundaryTable,
    MeshTable,
    SecondBodyTable,
    body_keys,
)
from meeframe.model.layer_tables import BaseTable, LayerTable
from meeframe.model.rolling import MAX_CELLS, Rolling
from meeframe.model.step import MAX_SLIDING, Step
from meeframe.model.values import (
    DEFAULT_FORMULATION,
    DEFAULT_SOLVER,
    FINITE,
    Angle,
    Count,
    Flag,
    Force,
    Length,
    Moment,
    Ratio,
    Table,
    Text,
    Time,
    by_name,
    finite,
    named,
    with_keys,
)
from meeframe.plugin.registry import CONTRACTS, registry_of
from meeframe.plugin.validation import Problem, TableError, build, choices, field_choices
from meeframe.results.schema import optional_fields
from meeframe.results.selection import ALLOWED, NAMED, load_steps_in_words, step_numbers
from meeframe.solvers import StoppingCriteria


def _axes(value: Any) -> Any:
    return build(FrictionAxes, value) if isinstance(value, Mapping) else value


class ContactTable(Table):
    """Table [contact]: the face group that may come into contact, its laws, and the axes of its friction."""

    zone: Text = "contact"
    law: Annotated[ContactLaw, by_name(ContactLaw)] = Field(default="signorini", validate_default=True)
    axes: Annotated[FrictionAxes | None, BeforeValidator(_axes)] = None
    friction_heat: Annotated[float, Quantity("", ge=0, le=1)] = 0.0
    joule_heat: Annotated[float, Quantity("", ge=0, le=1)] = 0.0
    wear: Annotated[WearLaw | None, by_name(WearLaw)] = None
    surface: Annotated[Indenter | None, by_name(Indenter)] = None


_INSULATING: Final = Field(default="insulating", validate_default=True)


class ConductivityTable(Table):
    """Table [conductivity]: laws of the contact zone, one for each scalar field; a field without one is insulated."""

    @classmethod
    def of(cls, fields: FieldSet) -> "type[ConductivityTable]":
        """Return the table with the names of scalar fields as keys."""
        keys = {scalar.name: (_law_of(scalar), _INSULATING) for scalar in fields.scalars}
        return with_keys(cls, fields, keys)

    @property
    def laws(self) -> dict[str, ConductivityLaw]:
        """Laws by the name of their field."""
        return {name: getattr(self, name) for name in self.field_set.names}


def _law_of(scalar: ScalarField) -> Any:
    units = scalar.conductance_unit, scalar.coefficient_unit, scalar.strength_unit
    return Annotated[ConductivityLaw, by_name(ConductivityLaw, " ".join(units))]


def _divided(value: Any, info: ValidationInfo, contract: type, record: type, others: tuple[str, ...] = ()) -> Any:
    """Split a flat table into keys of `record`, keys of the table itself (others), and those of the named object."""
    if isinstance(value, str):
        value = {"name": value}
    if not isinstance(value, Mapping):
        return value
    names = tuple(field.name for field in dataclasses.fields(record))
    rest = {key: item for key, item in value.items() if key not in (*names, *others)}
    if isinstance(rest.get("name"), contract):  # an object, in a case that is built in Python
        made = rest.pop("name")
        if rest:
            key = next(iter(rest))
            raise TableError(Problem((key,), f"unknown key; {choices(key, (*names, *others))}", rest[key]))
    else:
        made = registry_of(info).create(CONTRACTS[contract], rest, (*names, *others))
    return {
        "named": made,
        "record": build(record, {key: value[key] for key in names if key in value}),
        **{key: value[key] for key in others if key in value},
    }


class IndenterTable(Table):
    """Table [indenter]: a named shape with its keys, its placement and its potentials."""

    named: Indenter
    record: Placement

    @classmethod
    def of(cls, fields: FieldSet) -> "type[IndenterTable]":
        """Return the table with the potentials of scalar fields as keys."""
        keys = {scalar.value_name: (finite(scalar.value_unit), 0.0) for scalar in fields.scalars}
        return with_keys(cls, fields, keys)

    @property
    def potentials(self) -> dict[str, float]:
        """Potentials of the indenter by name."""
        return {scalar.value_name: getattr(self, scalar.value_name) for scalar in self.field_set.scalars}

    @model_validator(mode="before")
    @classmethod
    def _flat(cls, value: Any, info: ValidationInfo) -> Any:
        names = tuple(scalar.value_name for scalar in cls.field_set.scalars)
        return _divided(value, info, Indenter, Placement, names)


class SolverTable(Table):
    """Table [solver]: a named solver with its keys, and the stopping criteria of the iteration."""

    named: Solver
    record: StoppingCriteria

    @model_validator(mode="before")
    @classmethod
    def _flat(cls, value: Any, info: ValidationInfo) -> Any:
        return _divided(named(value, DEFAULT_SOLVER), info, Solver, StoppingCriteria)


def _rolling(value: Any) -> Any:
    return build(Rolling, value) if isinstance(value, Mapping) else value


class StepTable(Table):
    """Table [[steps]]: prescribed quantities of one load step, key by key as in meeframe.model.step.Step.

    direction: angle from e1 to e2 of those entries across the axis that are one number instead of two components.
    """

    approach: Length | None = None
    normal_force: Force | None = None
    translation: tuple[Length, Length] | None = None
    tangential_force: tuple[Force, Force] | None = None
    force_ratio: tuple[Ratio, Ratio] | None = None
    direction: Angle | None = None
    tilt: tuple[Angle, Angle] | None = None
    moment: tuple[Moment, Moment] | None = None
    twist: Angle | None = None
    torque: Moment | None = None
    sliding: Annotated[float, Quantity("m", ge=0, le=MAX_SLIDING)] | None = None
    max_pressure_change: Annotated[float, Quantity("", gt=0, le=1)] | None = None
    duration: Time | None = None
    rolling: Annotated[Rolling | None, BeforeValidator(_rolling)] = None
    increments: Count = 1

    @classmethod
    def of(cls, fields: FieldSet) -> "type[StepTable]":
        """Return the table with the keys of scalar fields: the potential of the indenter or the total flux."""
        motions = IndenterMotions(fields)
        names = (name for scalar in fields.scalars for name in (scalar.value_name, scalar.resultant))
        return with_keys(cls, fields, {name: (finite(motions.units[name]) | None, None) for name in names})

    @model_validator(mode="before")
    @classmethod
    def _directed(cls, value: Any) -> Any:
        """Convert magnitudes along `direction` to components."""
        if not isinstance(value, Mapping):
            return value
        rolling = value.get("rolling")
        has_cycles = isinstance(rolling, Mapping) and "cycles" in rolling
        if rolling is not None and "increments" in value and not has_cycles:
            text = "is not allowed with rolling, which has one increment for each cell of its distance"
            raise TableError(Problem(("increments",), text, value["increments"]))
        sizes = {
            key: Quantity(unit, **FINITE)
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
            length, angle = _checked(key, size, value), _checked("direction", Quantity("rad", **FINITE), value)
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
        """Return the load step."""
        values = {name: getattr(self, name) for name in StepTable.model_fields if name != "direction"}
        names = (name for scalar in self.field_set.scalars for name in (scalar.value_name, scalar.resultant))
        scalars = {name: value for name in names if (value := getattr(self, name)) is not None}
        return Step(**values, scalars=scalars, fields=self.field_set)


def _checked(key: str, quantity: Quantity, table: Mapping[str, Any]) -> float:
    try:
        return quantity.check(table[key])
    except ValueError as error:
        raise TableError(Problem((key,), str(error), table[key])) from None


class RestartTable(Table):
    """Table [restart]: the folder of a run whose last converged increment is to be continued."""

    folder: Text = Field(alias="from")


class OutputTable(Table):
    """Table [output]: further files, the optional fields in result.h5, and the increment that the figures show."""

    figures: Flag = True
    vtu: Flag = True
    fields: tuple[Text, ...] | None = None
    step: Text = "peak"

    @field_validator("fields")
    @classmethod
    def _known(cls, names: tuple[str, ...] | None) -> tuple[str, ...] | None:
        allowed = optional_fields()
        for number, name in enumerate(names or ()):
            if name not in allowed:
                raise TableError(Problem((number,), f"is not an optional field; {field_choices(name, allowed)}", name))
        return names

    @field_validator("step")
    @classmethod
    def _increment(cls, step: str) -> str:
        if step not in NAMED and not step_numbers(step):
            raise TableError(Problem((), f"is not an increment; {ALLOWED}", step))
        return step


class CaseTable(Table):
    """Complete case file."""

    title: Annotated[str, Strict()] = ""
    material: dict[str, Any]
    mesh: Annotated[MeshTable, MESH_BY_TYPE]
    boundary: tuple[BoundaryTable, ...] = ()
    layers: tuple[LayerTable, ...] = ()
    base: BaseTable | None = None
    second_body: SecondBodyTable | None = None
    contact: ContactTable = Field(default_factory=dict, validate_default=True)
    conductivity: ConductivityTable = Field(default_factory=dict, validate_default=True)
    indenter: IndenterTable
    formulation: Annotated[Formulation, BY_NAME] = Field(default=DEFAULT_FORMULATION, validate_default=True)
    solver: SolverTable = Field(default=DEFAULT_SOLVER, validate_default=True)
    restart: RestartTable | None = None
    steps: tuple[StepTable, ...] = Field(min_length=1)
    output: OutputTable = OutputTable()

    @model_validator(mode="after")
    def _has_increment(self) -> "CaseTable":
        """Check that the increment of the figures is one of the load steps."""
        numbers = step_numbers(self.output.step)
        # the number of cells over which a step rolls is known with the mesh
        counts = {
            number: step.increments if step.rolling is None else MAX_CELLS for number, step in enumerate(self.steps, 1)
        }
        if numbers and not (numbers[0] in counts and all(1 <= one <= counts[numbers[0]] for one in numbers[1:])):
            text = f"is not an increment of the case; allowed: peak, last, and {load_steps_in_words(counts)}"
            raise TableError(Problem(("output", "step"), text, self.output.step))
        return self

    @classmethod
    @lru_cache(maxsize=8)
    def of(cls, fields: FieldSet) -> "type[CaseTable]":
        """Return the table for the fields of a case."""
        keys = {
            **body_keys(fields),
            "second_body": (SecondBodyTable.of(fields) | None, None),
            "conductivity": (ConductivityTable.of(fields), Field(default_factory=dict, validate_default=True)),
            "indenter": (IndenterTable.of(fields), ...),
            "steps": (tuple[StepTable.of(fields), ...], Field(min_length=1)),  # type: ignore[misc]
        }
        return with_keys(cls, fields, keys)
