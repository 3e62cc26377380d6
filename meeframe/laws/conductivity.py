"""Electric and magnetic conductivity of the contact."""

from dataclasses import dataclass
from typing import Annotated, final

import numpy as np

from meeframe.fields import Array
from meeframe.fields.units import Quantity, check_quantities
from meeframe.laws.base import ConductivityLaw


@final
@dataclass(frozen=True)
class Insulating(ConductivityLaw):
    """Insulating contact without flux: kappa = 0."""

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        """Return zero, (n,)."""
        return np.zeros_like(normal_traction)


@final
@dataclass(frozen=True)
class StepConductivity(ConductivityLaw):
    """kappa where there is contact pressure, zero elsewhere (eqs. 17, 18).

    kappa: >= 0 [F/m^2 as the electric law, H/m^2 as the magnetic one]; 0 insulates, inf conducts perfectly.
    Raises CaseError if it is negative or NaN.
    """

    kappa: Annotated[float, Quantity("F/m^2", "H/m^2", ge=0)]

    def __post_init__(self) -> None:
        check_quantities(self)

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        """Return kappa where normal_traction < 0, else 0, (n,)."""
        return np.where(normal_traction < 0.0, self.kappa, 0.0)
