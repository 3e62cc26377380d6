"""Definitive table of the quantities of a result: names, units, labels, shapes and their evaluation.

HDF5 files, summaries, VTK files, figures, studies and sweeps take names, units and labels from here. A row added to one
of these tables appears in all of them, except where `views` excludes it.
"""

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final

import numpy as np

from meeframe.fields import ELECTRIC_FIELD, MECHANICAL, MEE, N_MECHANICAL, Array, FieldSet, ScalarField
from meeframe.indenters.base import IndenterMotions
from meeframe.results.records import Region, RollingMotion, StepResult, Zone
from meeframe.results.resultants import Resultants, resultants


class StorageCondition(StrEnum):
    """Condition under which a result file holds a nodal field."""

    ALWAYS = "always"
    WITH_FRICTION = "with friction"
    ON_REQUEST = "on request"


class View(StrEnum):
    """View that shows quantities.

    Views are maps and sections of a run, fields.vtu, studies, sweeps, and tables of runs and of comparisons.
    """

    MAP = "map"
    VTK = "vtk"
    STUDY = "study"
    SWEEP = "sweep"
    COMPARISON = "comparison"
    SUMMARY = "summary"


FRICTION: Final = "friction"
SLIP: Final = "slip"
WEAR: Final = "wear"
EVERYWHERE: Final = frozenset(View)
NOWHERE: Final[frozenset[View]] = frozenset()


@dataclass(frozen=True)
class NodalField:
    """Field on the nodes of the contact zone.

    Parameters
    ----------
    name, unit, label : str
        Key in files and studies, SI unit, words for figures and tables.
    values : callable
        Function of the zone and an increment that returns an array (n,), or (n, k) for k components.
    components : int
        Number k of components along e1, e2, nu of the zone's frames; 0 for a scalar.
    stored : StorageCondition
        Condition under which result files hold it.
    views : frozenset of View
        Further outputs that show it.
    attribute, column : str and int or None
        Attribute of StepResult, and column of it, that a result file restores from it; "" if it follows from others.
    integer : bool
        True if its values are integers.
    phenomenon : str
        See `is_present`.
    """

    name: str
    unit: str
    label: str
    values: Callable[[Zone, StepResult], Array]
    components: int = 0
    stored: StorageCondition = StorageCondition.ON_REQUEST
    views: frozenset[View] = EVERYWHERE
    attribute: str = ""
    column: int | None = None
    integer: bool = False
    phenomenon: str = ""

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of its value at one node."""
        return (self.components,) if self.components else ()


def _state(
    name: str,
    unit: str,
    label: str,
    components: int = 0,
    stored: StorageCondition = StorageCondition.ALWAYS,
    views: frozenset[View] = NOWHERE,
    attribute: str = "",
    column: int | None = None,
    integer: bool = False,
    phenomenon: str = "",
) -> NodalField:
    """Return the field of an attribute of StepResult, by default the one of the same name, or of one column."""
    source = attribute or name

    def values(_: Zone, step: StepResult) -> Array:
        array: Array = getattr(step, source)
        return array if column is None else array[:, column]

    return NodalField(name, unit, label, values, components, stored, views, source, column, integer, phenomenon)


def _scalar_fields(fields: FieldSet) -> Iterator[NodalField]:
    """Yield the potentials and the fluxes of scalar fields, which are columns of the attributes of StepResult."""
    for column, scalar in enumerate(fields.scalars):
        names, views = (scalar.value_name, scalar.value_unit), _NUMERIC | {View.MAP}
        yield _of_scalar(scalar, *names, "potentials", column, views)
    for column, scalar in enumerate(fields.scalars):
        yield _of_scalar(scalar, scalar.flux_name, scalar.flux_unit, "fluxes", column, NOWHERE)


def _of_scalar(
    scalar: ScalarField, name: str, unit: str, attribute: str, column: int, views: frozenset[View]
) -> NodalField:
    label = name.replace("_", " ")
    return _state(name, unit, label, views=views, attribute=attribute, column=column, phenomenon=scalar.name)


def _pressure(_: Zone, step: StepResult) -> Array:
    return 0.0 - step.traction[:, 2]


def _tangential(zone: Zone, step: StepResult) -> Array:
    """Return the tangential traction along global x1 and x2, (n, 2)."""
    tangential: Array = np.einsum("na,nai->ni", step.traction[:, :2], zone.frames[:, :2, :2])
    return tangential


_NUMERIC: Final = frozenset({View.STUDY, View.SWEEP, View.COMPARISON})

TRACTION_FIELDS: Final[tuple[NodalField, ...]] = (
    NodalField("pressure", "Pa", "contact pressure", _pressure, views=_NUMERIC | {View.MAP}),
    NodalField("traction_x", "Pa", "traction x", lambda zone, step: _tangential(zone, step)[:, 0], views=_NUMERIC),
    NodalField("traction_y", "Pa", "traction y", lambda zone, step: _tangential(zone, step)[:, 1], views=_NUMERIC),
    NodalField(
        "tangential_traction", "Pa", "tangential traction", _tangential, components=2, views=frozenset({View.STUDY})
    ),
    NodalField(
        "stick",
        "1",
        "stick",
        lambda _, step: (step.region == Region.STICK).astype(float),
        views=frozenset({View.STUDY, View.SWEEP}),
    ),
)
"""Fields that follow from tractions and regions.

These are the pressure, the tractions on the body along global x1 and x2, and stick 1 or 0.
"""

NODAL_FIELDS: tuple[NodalField, ...] = (
    _state("initial_gap", "m", "initial gap"),
    NodalField("gap", "m", "gap", lambda _, step: step.gap, views=NOWHERE),
    _state("traction", "Pa", "traction", 3),
    _state("displacement", "m", "displacement", 3),
    _state("contact_fraction", "1", "contact fraction"),
    _state(
        "wear",
        "m",
        "worn depth",
        views=frozenset({View.MAP, View.VTK, View.STUDY, View.COMPARISON}),
        phenomenon=WEAR,
    ),
    _state("dissipation", "J/m^2", "dissipation", phenomenon=FRICTION),
    _state("region", "1", "region", views=frozenset({View.VTK}), integer=True),
    _state("slip", "m", "slip", 2, StorageCondition.WITH_FRICTION, frozenset({View.VTK}), phenomenon=SLIP),
    _state("total_slip", "m", "total slip", 2, StorageCondition.WITH_FRICTION, frozenset({View.VTK}), phenomenon=SLIP),
    _state("slip_path", "m", "slip path", stored=StorageCondition.WITH_FRICTION, phenomenon=SLIP),
)
"""Further fields that do not belong to a scalar field, as in StepResult."""

ZONE_UNITS: Final = {"points": "m", "frames": "1", "weights": "m^2"}
INCREMENT_UNITS: Final = dict.fromkeys(("step", "increment", "history", "residual", "iterations", "area_fraction"), "1")
LOADING_UNITS: Final = {"reference": "m", "axes": "1", "duration": "s", "travel": "m"}
ROLLING_UNITS: Final = {"direction": "1", "creepage": "1", "spin": "1/m", "cell": "m", "distance": "m", "cycles": "1"}
"""Units of further attributes of Zone, StepResult, Loading and RollingMotion that result files hold, by name."""

BOUNDARY: Final = "boundary"
"""Name in `[output] fields` for the fields on the whole boundary."""


def nodal_fields(fields: FieldSet = MEE) -> tuple[NodalField, ...]:
    """Return the fields on the contact zone, among them potential of the body and outward flux of each scalar field.

    Parameters
    ----------
    fields : FieldSet, optional
        Field set of the body.

    Returns
    -------
    tuple of NodalField
        The fields.
    """
    return (*TRACTION_FIELDS, *_scalar_fields(fields), *NODAL_FIELDS)


def nodal(view: View, fields: FieldSet = MEE) -> dict[str, NodalField]:
    """Return the nodal fields that are shown in a view.

    Parameters
    ----------
    view : View
        The view.
    fields : FieldSet, optional
        Field set of the body.

    Returns
    -------
    dict of str to NodalField
        The fields by name.
    """
    return {field.name: field for field in nodal_fields(fields) if view in field.views}


def optional_fields() -> tuple[str, ...]:
    """Return the names that `[output] fields` may hold."""
    return (*(field.name for field in nodal_fields() if field.stored is not StorageCondition.ALWAYS), BOUNDARY)


def loaded_fields(friction: bool) -> frozenset[str]:
    """Return the optional fields that a result file holds unless its case selects others.

    Parameters
    ----------
    friction : bool
        True if the contact law resists slip, or the case continues a run whose law may have resisted it.

    Returns
    -------
    frozenset of str
        Names of the fields.
    """
    kinds = {StorageCondition.WITH_FRICTION} if friction else set()
    return frozenset({field.name for field in nodal_fields() if field.stored in kinds} | {BOUNDARY})


@dataclass(frozen=True)
class BoundaryField:
    """Field on the whole boundary, in global axes.

    Attributes
    ----------
    name, unit : str
        Key in files, SI unit.
    source : str
        Attribute of NodalFields that holds it, "values" or "fluxes".
    columns : slice
        Its columns there.
    phenomenon : str
        See `is_present`.
    """

    name: str
    unit: str
    source: str
    columns: slice
    phenomenon: str = ""

    @property
    def is_scalar(self) -> bool:
        """True if it has one column."""
        return bool(self.columns.stop - self.columns.start == 1)

    @property
    def label(self) -> str:
        """Name in fields.vtu."""
        return f"{self.name.replace('_', ' ')} [{self.unit}]"


def _boundary_fields(
    fields: FieldSet, names: tuple[str, ...], units: tuple[str, ...], source: str
) -> Iterator[BoundaryField]:
    yield BoundaryField(names[0].removesuffix("_1"), units[0], source, MECHANICAL)
    for column, scalar in enumerate(fields.scalars, N_MECHANICAL):
        yield BoundaryField(names[column], units[column], source, slice(column, column + 1), scalar.name)


def boundary_fields(fields: FieldSet = MEE) -> tuple[BoundaryField, ...]:
    """Return the fields on the whole boundary.

    Parameters
    ----------
    fields : FieldSet, optional
        Field set of the body.

    Returns
    -------
    tuple of BoundaryField
        The fields.
    """
    return (
        *_boundary_fields(fields, fields.value_names, fields.value_units, "values"),
        *_boundary_fields(fields, fields.flux_names, fields.flux_units, "fluxes"),
    )


@dataclass(frozen=True)
class Total:
    """Number, or one for each of some components, that summarises an increment.

    Parameters
    ----------
    name, unit, label : str
        Key in files and studies, SI unit, words for tables.
    components : tuple of str
        Suffixes of its components, () for a single number.
    value : callable or None
        Function of the zone and an increment that returns the number, or an array of numbers; None for the entry of
        `resultants` under this name.
    phenomenon : str
        See `is_present`.
    views : frozenset of View
        Tables that show it: files and sweeps hold every total.
    """

    name: str
    unit: str
    label: str
    components: tuple[str, ...] = ()
    value: Callable[[Zone, StepResult], Any] | None = None
    phenomenon: str = ""
    views: frozenset[View] = EVERYWHERE

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its components as separate numbers."""
        return tuple(f"{self.name}_{component}" for component in self.components) or (self.name,)

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of its components."""
        return tuple(f"{self.label} {component}" for component in self.components) or (self.label,)


_XYZ: Final = ("x", "y", "z")
_IN_PLANE: Final = ("1", "2")

_SUMMARY: Final = frozenset({View.SUMMARY})


def _scalar_totals(scalar: ScalarField) -> Iterator[Total]:
    """Yield the total flux of a scalar field and its largest potential."""
    flux, potential = (name.replace("_", " ") for name in (scalar.resultant, scalar.value_name))
    yield Total(scalar.resultant, scalar.resultant_unit, f"{flux} out of the body", phenomenon=scalar.name)
    name = f"max_abs_{scalar.value_name}"
    yield Total(name, scalar.value_unit, f"largest |{potential}|", phenomenon=scalar.name)


FORCES: Final[tuple[Total, ...]] = (
    Total("force", "N", "force", _XYZ),
    Total("normal_force", "N", "normal force", views=NOWHERE),
    Total("tangential_force", "N", "tangential force", _IN_PLANE, views=NOWHERE),
    Total("moment", "N m", "moment", _IN_PLANE, views=NOWHERE),
    Total("torque", "N m", "torque", views=NOWHERE),
)
"""Resultants of the tractions; see `meeframe.results.resultants` for axes and signs."""

TOTALS: tuple[Total, ...] = (
    Total("contact_area", "m^2", "contact area"),
    Total("stick_area", "m^2", "sticking area", phenomenon=FRICTION, views=_SUMMARY),
    Total("slip_area", "m^2", "slipping area", views=NOWHERE),
    Total("dissipated_energy", "J", "dissipated energy", phenomenon=FRICTION, views=_SUMMARY),
    Total("worn_volume", "m^3", "worn volume", phenomenon=WEAR, views=_SUMMARY | {View.COMPARISON}),
    Total("max_pressure", "Pa", "largest pressure"),
    Total("max_tension", "Pa", "largest tension", phenomenon="attraction"),
)
"""Further numbers that do not belong to a scalar field."""


def _motion(name: str) -> Callable[[Zone, StepResult], Any]:
    return lambda _, step: getattr(step.loading, name)


def total_rows(fields: FieldSet = MEE) -> tuple[Total, ...]:
    """Return resultants and maxima of an increment, among them those of each scalar field.

    Parameters
    ----------
    fields : FieldSet, optional
        Field set of the body.

    Returns
    -------
    tuple of Total
        The totals.
    """
    return (*FORCES, *(total for scalar in fields.scalars for total in _scalar_totals(scalar)), *TOTALS)


def motion_totals(fields: FieldSet = MEE) -> tuple[Total, ...]:
    """Return the motions and potentials of the indenter, as in Loading.

    Parameters
    ----------
    fields : FieldSet, optional
        Field set of the body.

    Returns
    -------
    tuple of Total
        The totals.
    """
    motions = IndenterMotions(fields)
    phenomena = {scalar.value_name: scalar.name for scalar in fields.scalars}
    return tuple(
        Total(
            name,
            motions.units[name],
            name.replace("_", " "),
            _IN_PLANE if columns.stop - columns.start == 2 else (),
            _motion(name),
            phenomena.get(name, ""),
        )
        for name, columns in motions.motions.items()
    )


def conductance_name(scalar: ScalarField) -> str:
    """Return the name of the conductance of the contact for a scalar field.

    Parameters
    ----------
    scalar : ScalarField
        The field.

    Returns
    -------
    str
        The name.
    """
    return "conductance" if scalar == ELECTRIC_FIELD else f"{scalar.name}_conductance"


def _conductance(scalar: ScalarField) -> Total:
    """Return the total flux into the body over the potential of the indenter, nan if that is zero."""

    def value(zone: Zone, step: StepResult) -> float:
        potential = float(step.loading.scalars[scalar.value_name])
        return -resultants(zone, step).scalars[scalar.resultant] / potential if potential else math.nan

    name = conductance_name(scalar)
    per_area = scalar.conductance_unit
    unit = per_area.replace("/m^2", "", 1) if "/m^2" in per_area else f"{scalar.resultant_unit}/{scalar.value_unit}"
    return Total(name, unit, name.replace("_", " "), value=value, phenomenon=scalar.name)


def _of_rolling(value: Callable[[RollingMotion, Resultants, StepResult], Any]) -> Callable[[Zone, StepResult], Any]:
    """Return the evaluation of a total of increments that roll; it is nan for others."""

    def evaluate(zone: Zone, step: StepResult) -> Any:
        rolling = step.loading.rolling
        return math.nan if rolling is None else value(rolling, resultants(zone, step), step)

    return evaluate


def _creep_force(rolling: RollingMotion, summed: Resultants, step: StepResult) -> Array:
    """Return the tangential force on the body along the rolling direction and across it, (2,) [N]."""
    return np.stack([rolling.direction, np.cross(step.loading.axes[2], rolling.direction)]) @ summed.force


def _creep_work(rolling: RollingMotion, summed: Resultants, step: StepResult) -> float:
    """Return force times creepage plus torque times spin [J/m]."""
    return float(_creep_force(rolling, summed, step) @ rolling.creepage) + summed.torque * rolling.spin


def _friction_power(rolling: RollingMotion, summed: Resultants, step: StepResult) -> float:
    """Return the work of friction over the duration of the increment [W], nan without a duration."""
    return summed.dissipated_energy / _duration(step)


def _duration(step: StepResult) -> float:
    """Return the duration of an increment [s], nan if it has none."""
    return math.nan if step.loading.duration is None else step.loading.duration


_IN_ROLLING: Final = ("longitudinal", "lateral")

ROLLING_TOTALS: Final[tuple[Total, ...]] = (
    Total("creepage", "1", "creepage", _IN_ROLLING, _of_rolling(lambda rolling, *_: rolling.creepage)),
    Total("spin", "1/m", "spin", value=_of_rolling(lambda rolling, *_: rolling.spin)),
    Total("rolled_distance", "m", "rolled distance", value=_of_rolling(lambda rolling, *_: rolling.distance)),
    Total("cycles", "1", "cycles of wear", value=_of_rolling(lambda rolling, *_: rolling.cycles or math.nan)),
    Total("creep_force", "N", "creep force", _IN_ROLLING, _of_rolling(_creep_force)),
    Total("creep_work", "J/m", "work of creepage per distance", value=_of_rolling(_creep_work)),
    Total(
        "friction_work",
        "J/m",
        "work of friction per distance",
        value=_of_rolling(lambda rolling, summed, _: summed.dissipated_energy / rolling.cell),
    ),
    Total("friction_power", "W", "power of friction", value=_of_rolling(_friction_power)),
)
"""Numbers of increments in which the contact rolls, nan in others; see docs/explanation/rolling.md for signs."""


def rolling_totals(zone: Zone, step: StepResult) -> dict[str, Any]:
    """Return the numbers of ROLLING_TOTALS of an increment.

    Parameters
    ----------
    zone : Zone
        Contact zone.
    step : StepResult
        The increment.

    Returns
    -------
    dict of str to object
        Numbers by name; empty unless the contact rolls.
    """
    if step.loading.rolling is None:
        return {}
    return {total.name: total.value(zone, step) for total in ROLLING_TOTALS if total.value is not None}


def measures(fields: FieldSet = MEE) -> tuple[Total, ...]:
    """Return further numbers of an increment, which sweeps and tables of Python collect.

    These are the duration, nan without one; the largest slip since the beginning of nodes in contact and the longest
    path slipped; the conductance for each scalar field (docs/howto/contact-resistance.md); those of rolling; 1 if the
    contact reaches the boundary of its zone, iterations and residual.

    Parameters
    ----------
    fields : FieldSet, optional
        Field set of the body.

    Returns
    -------
    tuple of Total
        The measures.
    """
    return (
        Total("duration", "s", "duration", value=lambda _, step: _duration(step)),
        Total(
            "max_slip",
            "m",
            "largest slip",
            value=lambda _, step: _largest(np.linalg.norm(step.total_slip, axis=1)[step.touching]),
        ),
        Total("max_slip_path", "m", "longest slip path", value=lambda _, step: _largest(step.slip_path)),
        *map(_conductance, fields.scalars),
        *ROLLING_TOTALS,
        Total(
            "contact_at_zone_boundary",
            "1",
            "contact at zone boundary",
            value=lambda _, step: float(step.contact_at_zone_boundary),
        ),
        Total("iterations", "1", "iterations", value=lambda _, step: float(step.iterations)),
        Total("residual", "1", "residual", value=lambda _, step: step.residual),
    )


def all_totals(fields: FieldSet = MEE) -> tuple[Total, ...]:
    """Return all totals, motions of the indenter and measures of an increment.

    Parameters
    ----------
    fields : FieldSet, optional
        Field set of the body.

    Returns
    -------
    tuple of Total
        Those of `total_rows`, `motion_totals` and `measures`.
    """
    return (*total_rows(fields), *motion_totals(fields), *measures(fields))


def _largest(values: Array) -> float:
    return float(values.max(initial=0.0))


def totals(zone: Zone, step: StepResult) -> dict[str, Any]:
    """Return the totals of an increment.

    Parameters
    ----------
    zone : Zone
        Contact zone.
    step : StepResult
        The increment.

    Returns
    -------
    dict of str to object
        Number or array of numbers of each of `total_rows`, by name, SI units.
    """
    summed = resultants(zone, step)
    return {
        total.name: getattr(summed, total.name) if total.value is None else total.value(zone, step)
        for total in total_rows(step.fields)
    }


def numbers(rows: Iterable[Total], values: Mapping[str, Any]) -> dict[str, float]:
    """Return the components of totals as single numbers.

    Parameters
    ----------
    rows : iterable of Total
        The totals.
    values : dict of str to object
        Their values by name, as of `totals`; nan stands for all components.

    Returns
    -------
    dict of str to float
        Numbers by the names of the components.
    """
    result: dict[str, float] = {}
    for row in rows:
        components = np.broadcast_to(values[row.name], len(row.names))  # nan where there are none
        result.update(zip(row.names, components.tolist(), strict=True))
    return result


def total_named(name: str, fields: FieldSet = MEE) -> Total | None:
    """Return the total, motion or measure of a name.

    Parameters
    ----------
    name : str
        Name of the total or of one of its components.
    fields : FieldSet, optional
        Field set of the body.

    Returns
    -------
    Total or None
        The total; None if there is none of this name.
    """
    return next((row for row in all_totals(fields) if name in (row.name, *row.names)), None)


def label_of(name: str, fields: FieldSet = MEE) -> str:
    """Return the label of a quantity.

    Parameters
    ----------
    name : str
        Name of a total, a component of one or a nodal field.
    fields : FieldSet, optional
        Field set of the body.

    Returns
    -------
    str
        The label; for other names, the name with blanks.
    """
    field = next((row for row in nodal_fields(fields) if row.name == name), None)
    row = total_named(name, fields)
    if row is not None:
        return row.label if name == row.name else row.labels[row.names.index(name)]
    return name.replace("_", " ") if field is None else field.label


def shown_totals(view: View, values: Sequence[Mapping[str, Any]], fields: FieldSet = MEE) -> list[Total]:
    """Return the totals that a table shows.

    Parameters
    ----------
    view : View
        The table.
    values : sequence of dict
        Values of each increment, as of `totals`.
    fields : FieldSet, optional
        Field set of the body.

    Returns
    -------
    list of Total
        Totals of this view, without those of absent phenomena.
    """
    rows = total_rows(fields)
    there = {total.phenomenon for total in rows if any(np.any(each[total.name]) for each in values)}
    return [total for total in rows if view in total.views and is_present(total, there)]


def is_present(row: NodalField | BoundaryField | Total, phenomena: Collection[str]) -> bool:
    """Return whether a quantity belongs to one of the phenomena of a result.

    Parameters
    ----------
    row : NodalField, BoundaryField or Total
        The quantity. If its phenomenon is "", it always is present.
    phenomena : collection of str
        Scalar fields, by name, FRICTION, SLIP, WEAR and "attraction", as far as the result has them.

    Returns
    -------
    bool
        True if it does.
    """
    return row.phenomenon in {"", *phenomena}
