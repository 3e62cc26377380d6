"""Built-in conductivity laws, electric, magnetic and thermal."""

from dataclasses import dataclass
from typing import Annotated, Final, final

import numpy as np

from meeframe.common.arguments import checked_arguments
from meeframe.fields import MEE, OPTIONAL_FIELDS, Array
from meeframe.fields.units import Quantity, check_quantities
from meeframe.laws.base import ConductivityLaw

_CONDUCTANCES: Final = (*(field.conductance_unit for field in (*MEE.scalars, *OPTIONAL_FIELDS)), "S/m^2")


@final
@checked_arguments
@dataclass(frozen=True)
class Insulating(ConductivityLaw):
    """Insulating contact: kappa = 0, without flux."""

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        """Return zero.

        Parameters
        ----------
        normal_traction : Array
            Normal traction of the contact, (n,) [Pa].
        gap, drop : Array
            Gap [m] and drop of the potential, (n,) each, on which the conductivity does not depend.

        Returns
        -------
        Array
            Zeros, (n,).
        """
        return np.zeros_like(normal_traction)


@final
@checked_arguments
@dataclass(frozen=True)
class StepConductivity(ConductivityLaw):
    """Constant conductivity where there is contact pressure, zero elsewhere (eqs. 17, 18).

    Attributes
    ----------
    kappa : float
        Conductivity >= 0, in F/m^2 for the electric field, H/m^2 for the magnetic one, W/(m^2 K) for heat and S/m^2 for
        currents; 0 insulates, inf conducts perfectly.

    Raises
    ------
    CaseError
        If it is negative or NaN.
    """

    kappa: Annotated[float, Quantity(*_CONDUCTANCES, ge=0)]

    def __post_init__(self) -> None:
        check_quantities(self)

    def conductivity(self, normal_traction: Array, gap: Array, drop: Array) -> Array:
        """Return kappa where there is pressure, else zero.

        Parameters
        ----------
        normal_traction : Array
            Normal traction of the contact, (n,) [Pa], < 0 in compression.
        gap, drop : Array
            Gap [m] and drop of the potential, (n,) each, on which the conductivity does not depend.

        Returns
        -------
        Array
            Conductivities, (n,), in the unit of kappa.
        """
        return np.where(normal_traction < 0.0, self.kappa, 0.0)
