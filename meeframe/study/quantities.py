"""The quantities that a study can show."""

from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from meeframe.fields import MEE, Array
from meeframe.results.records import Region, Resultants, StepResult, Zone


def _total(name: str) -> Callable[[Resultants], float]:
    return lambda totals: totals.scalars[name]


def _potential(column: int) -> Callable[[Zone, StepResult], Array]:
    return lambda _, step: step.potentials[:, column]


TOTALS: Final[Mapping[str, Callable[[Resultants], float]]] = {
    "force": lambda totals: float(-totals.force[2]),
    "force_x": lambda totals: float(totals.force[0]),
    "force_y": lambda totals: float(totals.force[1]),
    **{scalar.resultant: _total(scalar.resultant) for scalar in MEE.scalars},
    "contact_area": lambda totals: totals.contact_area,
    "max_pressure": lambda totals: totals.max_pressure,
    **{f"max_{scalar.value_name}": _total(f"max_abs_{scalar.value_name}") for scalar in MEE.scalars},
}
"""Totals of a step: force of the indenter against x3 and of the indenter on the body along x1, x2 [N], charge [C],
magnetic flux [Wb], contact area [m^2], largest pressure [Pa] and absolute potentials [V], [A]."""


def _pressure(_zone: Zone, step: StepResult) -> Array:
    return 0.0 - step.traction[:, 2]


def _tangential(zone: Zone, step: StepResult) -> Array:
    """Return components along global x1, x2, (n, 2)."""
    tangential: Array = np.einsum("na,nai->ni", step.traction[:, :2], zone.frames[:, :2, :2])
    return tangential


NODAL: Final[Mapping[str, Callable[[Zone, StepResult], Array]]] = {
    "pressure": _pressure,
    "traction_x": lambda zone, step: _tangential(zone, step)[:, 0],
    "traction_y": lambda zone, step: _tangential(zone, step)[:, 1],
    "tangential_traction": _tangential,
    "stick": lambda _, step: (step.region == Region.STICK).astype(float),
    **{scalar.value_name: _potential(column) for column, scalar in enumerate(MEE.scalars)},
}
"""Fields on the contact zone, (n,), the tangential traction (n, 2): pressure and tractions on the body [Pa], in global
axes, stick 1 or 0, potentials of the body [V], [A]."""

_TRACTIONS: Final = ("traction_x", "traction_y", "tangential_traction")


def largest(quantity: str, zone: Zone, step: StepResult) -> float:
    """Return what a nodal quantity is measured by: its value of largest modulus, with sign; tractions: the top
    pressure."""
    values = NODAL["pressure" if quantity in _TRACTIONS else quantity](zone, step)
    return float(values[np.abs(values).argmax()])
