"""Quantities that a study can show."""

from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from meeframe.fields import MEE, Array, FieldSet
from meeframe.results import schema
from meeframe.results.records import StepResult, Zone
from meeframe.results.resultants import Resultants


def _scalar(name: str) -> Callable[[Resultants], float]:
    return lambda totals: totals.scalars[name]


def totals(fields: FieldSet = MEE) -> Mapping[str, Callable[[Resultants], float]]:
    """Return the totals of a step by name, as functions of its resultants.

    These are the force of the indenter against x3 and along x1, x2 on the body [N], the total flux of each scalar
    field, the contact area [m^2], the largest pressure [Pa], and the largest absolute potential of each scalar field.
    """
    return {
        "force": lambda totals: float(-totals.force[2]),
        "force_x": lambda totals: float(totals.force[0]),
        "force_y": lambda totals: float(totals.force[1]),
        **{scalar.resultant: _scalar(scalar.resultant) for scalar in fields.scalars},
        "contact_area": lambda totals: totals.contact_area,
        "max_pressure": lambda totals: totals.max_pressure,
        **{f"max_{scalar.value_name}": _scalar(f"max_abs_{scalar.value_name}") for scalar in fields.scalars},
    }


def nodal(quantity: str, zone: Zone, step: StepResult) -> Array:
    """Return a field on the contact zone that studies show, (n,), or (n, 2) for the tangential traction."""
    return schema.nodal(schema.View.STUDY, step.fields)[quantity].values(zone, step)


_TRACTIONS: Final = ("traction_x", "traction_y", "tangential_traction")


def largest(quantity: str, zone: Zone, step: StepResult) -> float:
    """Return the value of largest modulus of a nodal quantity, with sign; of tractions the largest pressure."""
    values = nodal("pressure" if quantity in _TRACTIONS else quantity, zone, step)
    return float(values[np.abs(values).argmax()])
