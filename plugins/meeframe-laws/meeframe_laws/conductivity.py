"""Conductivity laws of rough surfaces."""

import math
from dataclasses import dataclass
from typing import Annotated, final

import numpy as np

from meeframe.core.fields import Array
from meeframe.core.law import ConductivityLaw
from meeframe.core.quantities import Quantity, check_quantities
from meeframe.plugin.hookspecs import Record


@final
@dataclass(frozen=True)
class PowerLaw(ConductivityLaw):
    """kappa(p) = reference_conductivity * (|p| / reference_pressure)^exponent in contact, 0 where the contact is open.

    The conductance of two rough surfaces grows nearly in proportion to the area that truly touches. The exponent 0.95
    is that of plastically deforming asperities (Cooper, Mikic & Yovanovich 1969, thermal contact conductance); an
    electric or magnetic contact is governed by the same potential problem.

    reference_conductivity: kappa at the reference pressure, F/m^2 (electric) or H/m^2 (magnetic); reference_pressure
    [Pa]; exponent: dimensionless. Raises CaseError if one is out of bounds.
    """

    reference_conductivity: Annotated[float, Quantity("F/m^2", "H/m^2", ge=0, lt=math.inf)]
    reference_pressure: Annotated[float, Quantity("Pa", gt=0, lt=math.inf)]
    exponent: Annotated[float, Quantity("", gt=0, lt=math.inf)] = 0.95

    def __post_init__(self) -> None:
        check_quantities(self)

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        """kappa (n,) of the normal traction (n,) [Pa], <= 0 in compression."""
        pressure = np.maximum(-normal_traction, 0.0)
        kappa: Array = self.reference_conductivity * (pressure / self.reference_pressure) ** self.exponent
        return kappa


RECORDS = [
    Record(
        "power-law",
        PowerLaw,
        "kappa_0 (|p| / p_0)^exponent in contact, growing with pressure like the real contact area",
        "Cooper, Mikic & Yovanovich, Int. J. Heat Mass Transfer 12 (1969) 279-300 (exponent 0.95)",
    ),
]
"""What this module registers."""
