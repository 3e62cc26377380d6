"""The numbers of a point: what a sweep gathers of each increment."""

from meeframe.results import schema
from meeframe.results.records import StepResult, Zone


def units() -> dict[str, str]:
    """Return the units of all that is gathered of an increment, and of `seconds`, those of the point."""
    rows = (*schema.TOTALS, *schema.MOTION_TOTALS, *schema.MEASURES)
    return {name: row.unit for row in rows for name in row.names} | {"seconds": "s"}


def field_units() -> dict[str, str]:
    """Return the units of the nodal fields that sweeps gather, which have one value for each node."""
    return {name: row.unit for name, row in schema.nodal(schema.View.SWEEP).items()}


def numbers_of(zone: Zone, step: StepResult) -> dict[str, float]:
    """Return all numbers of an increment but `seconds`."""
    others = (*schema.MOTION_TOTALS, *schema.MEASURES)
    values = schema.totals(zone, step) | {row.name: row.value(zone, step) for row in others if row.value is not None}
    return schema.numbers((*schema.TOTALS, *others), values)
