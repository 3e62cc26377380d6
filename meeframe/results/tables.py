"""Results as tables of pandas and datasets of xarray."""

from importlib import import_module
from typing import Any, Final

import numpy as np

from meeframe.common.errors import ResultError
from meeframe.fields import MEE, Array, FieldSet
from meeframe.indenters.base import IndenterMotions
from meeframe.results import schema
from meeframe.results.records import Region, Result, StepResult, Zone

_ROTATIONS: Final = {"tilt": "moment", "twist": "torque"}
"""Motions, with their resultants, that tables show only where they are free or not zero."""
_SAME: Final = 1e-6
"""Distance of coordinates that count as the same, as a fraction of the extent of the zone."""
_FURTHER: Final = ("gap", "displacement", "traction", "initial_gap", "contact_fraction", "dissipation", "region")
_SLIPS: Final = ("slip", "total_slip", "slip_path")
_COMPONENTS: Final = ("e1", "e2", "nu")


def library(name: str, extra: str) -> Any:
    """Return an optional library; raise ResultError with the command that installs it if it is missing."""
    try:
        return import_module(name)
    except ImportError as error:
        raise ResultError(f"{name} is needed ({error}); install the extra: pip install 'meeframe[{extra}]'") from None


def dataframe(result: Result) -> Any:
    """Return a pandas.DataFrame with one row for each finished increment.

    Columns are named as in summary.json, with a suffix for each component; `attrs["units"]` has their SI units.
    """
    pandas = library("pandas", "data")
    rows = [_row(result.zone, step) for step in result.steps]
    hidden = {
        name
        for motion, moment in _ROTATIONS.items()
        if not any(np.any(values[motion]) or moment in step.loading.prescribed for step, values in rows)
        for name in (motion, moment)
    }
    table = pandas.DataFrame([_numbers(step, values, hidden) for step, values in rows])
    table.attrs["title"] = result.provenance.title
    fields = result.steps[0].fields if result.steps else MEE
    table.attrs["units"] = {
        name: quantity.unit for quantity in _quantities(fields) for name in quantity.names if name in table.columns
    }
    return table


def _quantities(fields: FieldSet) -> tuple[schema.Total, ...]:
    return (*schema.motion_totals(fields), *schema.total_rows(fields), *schema.MEASURES)


def _row(zone: Zone, step: StepResult) -> tuple[StepResult, dict[str, Any]]:
    totals = schema.totals(zone, step)
    values = {
        quantity.name: totals[quantity.name]
        if quantity.name in totals
        else quantity.value(zone, step)
        if quantity.value is not None
        else getattr(step.loading, quantity.name)
        for quantity in _quantities(step.fields)
    }
    return step, values


def _numbers(step: StepResult, values: dict[str, Any], hidden: set[str]) -> dict[str, Any]:
    quantities = [quantity for quantity in _quantities(step.fields) if quantity.name not in hidden]
    totals = {
        "iterations": step.iterations,
        "contact_at_zone_boundary": step.contact_at_zone_boundary,
        "status": str(step.status),
    }
    return {"step": step.step, "increment": step.increment, **schema.numbers(quantities, values), **totals}


def dataset(result: Result) -> Any:
    """Return an xarray.Dataset of the nodal fields and the totals of all finished increments.

    Fields have the dimensions increment and node, or increment, x and y if the nodes are a grid; vectors have
    components along e1, e2 and nu of the frames of the zone. Units and labels are attributes.
    """
    xarray = library("xarray", "data")
    zone, steps = result.zone, result.steps
    fields = steps[0].fields if steps else MEE
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

    variables: dict[str, Any] = {}
    for field in _fields(fields):
        values = np.array([field.values(zone, step) for step in steps]).reshape(len(steps), len(order), *field.shape)
        across = {0: (), 2: ("tangent",), 3: ("component",)}[field.components]
        notes = {"units": field.unit, "long_name": field.label}
        if field.name == "region":
            notes["meaning"] = ", ".join(f"{region.value} {region.name.lower()}" for region in Region)
        variables[field.name] = ("increment", *dimensions, *across), nodal(values), notes
    variables["weights"] = dimensions, zone.weights[order].reshape(shape), {"units": "m^2", "long_name": "nodal area"}
    totals = [schema.numbers(_quantities(fields), _row(zone, step)[1]) for step in steps]
    for quantity in _quantities(fields):
        for name, label in zip(quantity.names, quantity.labels, strict=True):
            key = name
            if name in variables:  # the potential of the body and that of the indenter, flux density and total flux
                key = f"indenter_{name}" if quantity.name in IndenterMotions(fields).motions else f"total_{name}"
            values = np.array([total[name] for total in totals])
            variables[key] = "increment", values, {"units": quantity.unit, "long_name": label}
    variables["status"] = "increment", np.array([str(step.status) for step in steps])
    coordinates |= {
        "increment": np.arange(len(steps)),
        "step": ("increment", np.array([step.step for step in steps], int)),
        "increment_of_step": ("increment", np.array([step.increment for step in steps], int)),
        "component": list(_COMPONENTS),
        "tangent": list(_COMPONENTS[:2]),
    }
    return xarray.Dataset(variables, coordinates, {"title": result.provenance.title, "status": str(result.status)})


def _fields(fields: FieldSet) -> list[schema.NodalField]:
    """Return the nodal fields of datasets: numbers, in SI units, that do not repeat each other."""
    chosen = {"pressure", "traction_x", "traction_y", *_FURTHER, *_SLIPS}
    scalars = {name for scalar in fields.scalars for name in (scalar.value_name, scalar.flux_name)}
    return [field for field in schema.nodal_fields(fields) if field.name in chosen | scalars]


def _grid(zone: Zone) -> tuple[Array, Array, Any] | None:
    """Return x (nx,), y (ny,) and the order (nx * ny,) of the nodes, x first, if they are a plane rectangular grid."""
    extent = np.ptp(zone.points, axis=0)
    if extent[2] > _SAME * extent.max():
        return None
    numbers, lines = zip(*(_lines(zone.points[:, i], _SAME * extent.max()) for i in (0, 1)), strict=True)
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
