"""Numbers that a sweep stores for each increment of a point."""

from meeframe.fields import MEE, FieldSet
from meeframe.results import schema
from meeframe.results.records import StepResult, Zone


def units(fields: FieldSet = MEE) -> dict[str, str]:
    """Return the units of all numbers of an increment, and of `seconds` for each point."""
    totals = schema.all_totals(fields)
    return {name: quantity.unit for quantity in totals for name in quantity.names} | {"seconds": "s"}


def field_units(fields: FieldSet = MEE) -> dict[str, str]:
    """Return the units of the nodal fields that sweeps can store, with one value for each node."""
    return {name: quantity.unit for name, quantity in schema.nodal(schema.View.SWEEP, fields).items()}


def numbers_of(zone: Zone, step: StepResult) -> dict[str, float]:
    """Return all numbers of an increment except `seconds`."""
    other_quantities = (*schema.motion_totals(step.fields), *schema.measures(step.fields))
    values = schema.totals(zone, step) | {
        quantity.name: quantity.value(zone, step) for quantity in other_quantities if quantity.value is not None
    }
    return schema.numbers((*schema.total_rows(step.fields), *other_quantities), values)
