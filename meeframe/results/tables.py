"""Results as tables of pandas and datasets of xarray."""

from collections.abc import Collection, Mapping, Sequence
from importlib import import_module
from typing import Any, Final

import numpy as np

from meeframe.common.errors import ResultError
from meeframe.fields import Array, FieldSet, ScalarField
from meeframe.indenters.base import IndenterMotions
from meeframe.results import schema
from meeframe.results.overview import fields_of, peaks
from meeframe.results.records import Region, Result, StepResult, Zone

_ROTATIONS: Final = {"tilt": "moment", "twist": "torque"}
"""Motions, with their resultants, that tables show only where they are free or not zero."""
_COORDINATE_TOLERANCE: Final = 1e-6
"""Distance of coordinates that count as the same, as a fraction of the extent of the zone."""
_REPEATED: Final = ("tangential_traction", "stick")
"""Nodal fields that repeat the tractions and the region."""
_COMPONENTS: Final = ("e1", "e2", "nu")


def library(name: str, extra: str) -> Any:
    """Return an optional library; raise ResultError with the command that installs it if it is missing."""
    try:
        return import_module(name)
    except ImportError as error:
        raise ResultError(f"{name} is needed ({error}); install the extra: pip install 'meeframe[{extra}]'") from None


def dataframe(result: Result) -> Any:
    """Return a pandas.DataFrame with one row for each finished increment.

    Columns are named as in summary.json, with a suffix for each component; `attrs["units"]` has their SI units. Scalar
    fields that are zero throughout are left out.
    """
    pandas = library("pandas", "data")
    fields = fields_of(result)
    totals = [_totals(result.zone, step) for step in result.steps]
    columns = _columns(totals, fields)
    absent = _absent_scalars(result, columns, fields)
    hidden = _fixed_rotations(result, totals) | absent_names(columns, fields, absent) | _names_of_wear(result)
    table = pandas.DataFrame(
        [
            {"step": step.step, "increment": step.increment}
            | {name: value for name, value in row.items() if name not in hidden}
            | _outcome(step)
            for step, row in zip(result.steps, totals, strict=True)
        ]
    )
    table.attrs["title"] = result.provenance.title
    table.attrs["units"] = {
        name: quantity.unit
        for quantity in schema.all_totals(fields)
        for name in quantity.names
        if name in table.columns
    }
    return table


def absent_scalars(values: Mapping[str, Array], fields: FieldSet) -> list[ScalarField]:
    """Return the scalar fields whose potentials and total fluxes, and those of the indenter, are zero throughout.

    Parameters
    ----------
    values : mapping of str to Array
        Values of all totals, motions and measures by name, nan where there are none.
    fields : FieldSet
        Field set of the bodies.
    """
    return [
        scalar
        for scalar in fields.scalars
        if not any(np.nan_to_num(values[name]).any() for name in _names(scalar, fields))
    ]


def absent_names(values: Mapping[str, Array], fields: FieldSet, absent: Sequence[ScalarField]) -> set[str]:
    """Return the names that tables leave out: of absent scalar fields; conductances, rolling and duration if all nan.

    Parameters
    ----------
    values, fields
        As of absent_scalars.
    absent : sequence of ScalarField
        Scalar fields that are absent.
    """
    conductances = map(schema.conductance_name, fields.scalars)
    rolling = (name for total in schema.ROLLING_TOTALS for name in total.names)
    return {name for scalar in absent for name in _names(scalar, fields)} | {
        name for name in ("duration", *conductances, *rolling) if np.isnan(values[name]).all()
    }


def _names(scalar: ScalarField, fields: FieldSet) -> list[str]:
    return [name for row in schema.all_totals(fields) if row.phenomenon == scalar.name for name in row.names]


def _absent_scalars(result: Result, columns: Mapping[str, Array], fields: FieldSet) -> list[ScalarField]:
    """Return the absent scalar fields of a result, in which also the fluxes are zero at each node."""
    phenomena = peaks(result).phenomena
    return [scalar for scalar in absent_scalars(columns, fields) if scalar.name not in phenomena]


def _names_of_wear(result: Result) -> set[str]:
    """Return the names of the totals of wear if there is none."""
    phenomena = peaks(result).phenomena
    wear = (row for row in schema.TOTALS if row.phenomenon == schema.WEAR)
    return {name for row in wear if not schema.is_present(row, phenomena) for name in row.names}


def _fixed_rotations(result: Result, totals: Sequence[Mapping[str, float]]) -> set[str]:
    """Return the names of rotations that are zero throughout and not free, with those of their moments."""
    hidden: set[str] = set()
    for motion, moment in _ROTATIONS.items():
        rows = [row for row in schema.all_totals() if row.name in (motion, moment)]
        turns = any(row[name] for row in totals for each in rows if each.name == motion for name in each.names)
        if not turns and not any(moment in step.loading.prescribed for step in result.steps):
            hidden.update(name for each in rows for name in each.names)
    return hidden


def _totals(zone: Zone, step: StepResult) -> dict[str, float]:
    """Return all numbers of an increment, in the order of tables."""
    quantities = _quantities(step.fields)
    known = schema.totals(zone, step)
    values = {
        quantity.name: known[quantity.name]
        if quantity.name in known
        else quantity.value(zone, step)
        if quantity.value is not None
        else getattr(step.loading, quantity.name)
        for quantity in quantities
    }
    return schema.numbers(quantities, values)


def _quantities(fields: FieldSet) -> tuple[schema.Total, ...]:
    return (*schema.motion_totals(fields), *schema.total_rows(fields), *schema.measures(fields))


def _columns(totals: Sequence[Mapping[str, float]], fields: FieldSet) -> dict[str, Array]:
    names = [name for row in _quantities(fields) for name in row.names]
    return {name: np.array([row[name] for row in totals]) for name in names}


def _outcome(step: StepResult) -> dict[str, Any]:
    return {
        "iterations": step.iterations,
        "contact_at_zone_boundary": step.contact_at_zone_boundary,
        "status": str(step.status),
    }


def dataset(result: Result) -> Any:
    """Return an xarray.Dataset of the nodal fields and the totals of all finished increments.

    Fields have the dimensions increment and node, or increment, x and y if the nodes are a grid; vectors have
    components along e1, e2 and nu of the frames of the zone. Units and labels are attributes. Scalar fields that are
    zero throughout are left out.
    """
    xarray = library("xarray", "data")
    zone, steps = result.zone, result.steps
    fields = fields_of(result)
    grid = _grid(zone)
    coordinates: dict[str, Any]
    dimensions: tuple[str, ...]
    shape: tuple[int, ...]
    if grid is None:
        dimensions, shape, order = ("node",), (len(zone.points),), np.arange(len(zone.points))
        coordinates = {name: (dimensions, zone.points[:, i], {"units": "m"}) for i, name in enumerate("xyz")}
    else:
        x, y, order = grid
        dimensions, shape = ("x", "y"), (len(x), len(y))
        coordinates = {"x": ("x", x, {"units": "m"}), "y": ("y", y, {"units": "m"})}

    def nodal(values: Array) -> Array:
        return values[:, order].reshape(len(steps), *shape, *values.shape[2:])

    columns = _columns([_totals(zone, step) for step in steps], fields)
    absent = _absent_scalars(result, columns, fields)
    variables: dict[str, Any] = {}
    present = peaks(result).phenomena | {scalar.name for scalar in fields.scalars if scalar not in absent}
    for field in _fields(fields, present):
        values = np.array([field.values(zone, step) for step in steps]).reshape(len(steps), len(order), *field.shape)
        across = {0: (), 2: ("tangent",), 3: ("component",)}[field.components]
        notes = {"units": field.unit, "long_name": field.label}
        if field.name == "region":
            notes["meaning"] = ", ".join(f"{region.value} {region.name.lower()}" for region in Region)
        variables[field.name] = ("increment", *dimensions, *across), nodal(values), notes
    variables["weights"] = dimensions, zone.weights[order].reshape(shape), {"units": "m^2", "long_name": "nodal area"}
    hidden = absent_names(columns, fields, absent) | _names_of_wear(result)
    for quantity in _quantities(fields):
        for name, label in zip(quantity.names, quantity.labels, strict=True):
            if name in hidden:
                continue
            key = name
            if name in variables:  # the potential of the body and that of the indenter, flux density and total flux
                key = f"indenter_{name}" if quantity.name in IndenterMotions(fields).motions else f"total_{name}"
            variables[key] = "increment", columns[name], {"units": quantity.unit, "long_name": label}
    variables["status"] = "increment", np.array([str(step.status) for step in steps])
    coordinates |= {
        "increment": np.arange(len(steps)),
        "step": ("increment", np.array([step.step for step in steps], int)),
        "increment_of_step": ("increment", np.array([step.increment for step in steps], int)),
        "component": list(_COMPONENTS),
        "tangent": list(_COMPONENTS[:2]),
    }
    return xarray.Dataset(variables, coordinates, {"title": result.provenance.title, "status": str(result.status)})


def _fields(fields: FieldSet, phenomena: Collection[str]) -> list[schema.NodalField]:
    """Return the nodal fields of datasets: numbers of present phenomena, in SI units, that do not repeat each other."""
    return [
        field
        for field in schema.nodal_fields(fields)
        if field.name not in _REPEATED and schema.is_present(field, phenomena)
    ]


def _grid(zone: Zone) -> tuple[Array, Array, Any] | None:
    """Return x (nx,), y (ny,) and the order (nx * ny,) of the nodes, x first, if they are a plane rectangular grid."""
    extent = np.ptp(zone.points, axis=0)
    if extent[2] > _COORDINATE_TOLERANCE * extent.max():
        return None
    numbers, lines = zip(
        *(_lines(zone.points[:, i], _COORDINATE_TOLERANCE * extent.max()) for i in (0, 1)), strict=True
    )
    if len(lines[0]) * len(lines[1]) != len(zone.points):
        return None
    order = np.lexsort((numbers[1], numbers[0]))
    filled = np.array_equal(numbers[0][order] * len(lines[1]) + numbers[1][order], np.arange(len(order)))
    return (lines[0], lines[1], order) if filled else None


def _lines(coordinates: Array, tolerance: float) -> tuple[Any, Array]:
    """Return the number of the grid line of each coordinate, and the coordinates of the lines."""
    order = np.argsort(coordinates)
    starts = np.concatenate([[True], np.diff(coordinates[order]) > tolerance])
    numbers = np.empty(len(order), int)
    numbers[order] = np.cumsum(starts) - 1
    return numbers, coordinates[order][starts]
