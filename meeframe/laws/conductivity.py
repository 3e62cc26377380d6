"""Electric and magnetic conductivity of the contact."""

from dataclasses import dataclass
from typing import Annotated, final

import numpy as np

from meeframe.core.contact import ConductivityLaw
from meeframe.core.errors import CaseError
from meeframe.core.fields import Array
from meeframe.core.quantities import Quantity


@final
@dataclass(frozen=True)
class StepConductivity(ConductivityLaw):
    """kappa where there is contact pressure, zero elsewhere (eqs. 17, 18).

    kappa: >= 0 [F/m^2 as the electric law, H/m^2 as the magnetic one]; 0 insulates, inf conducts perfectly.
    """

    kappa: Annotated[float, Quantity("F/m^2", "H/m^2", ge=0)]

    def __post_init__(self) -> None:
        if not self.kappa >= 0.0:
            raise CaseError(f"kappa of the conductivity law is {self.kappa}; allowed: a number >= 0 or inf")

    def conductivity(self, normal_traction: Array) -> Array:
        """kappa where normal_traction < 0, else 0, (n,)."""
        return np.where(normal_traction < 0.0, self.kappa, 0.0)
