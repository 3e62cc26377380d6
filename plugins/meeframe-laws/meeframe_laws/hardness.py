"""Contact whose pressure is limited by the hardness, a model of perfectly plastic asperities."""

from dataclasses import dataclass
from typing import Annotated, final

import numpy as np

from meeframe.plugin import Array, Quantity, check_quantities
from meeframe_laws.coulomb_contact import CoulombContact


@final
@dataclass(frozen=True)
class Hardness(CoulombContact):
    """Unilateral contact with pressures up to the hardness, |p_nu| <= H, under which the surfaces overlap.

    Attributes
    ----------
    hardness : float
        H > 0 [Pa]; with inf the contact is that of Signorini.
    mu : float
        Coefficient of Coulomb friction on the pressure, inf allowed.

    Raises
    ------
    CaseError
        If one of them is out of bounds.

    Notes
    -----
    Where the pressure is below H the gap is zero; where it is H the nominal surfaces may overlap, and the overlap is
    the depth by which asperities have yielded. The contact area is at least F / H, and equal to it where the whole
    contact has yielded. The law has no memory: unloading closes the overlap again, so apply loads that increase.

    References
    ----------
    Almqvist, Sahlin, Larsson & Glavatskih, Tribol. Int. 40 (2007) 574. Bowden & Tabor, The Friction and Lubrication of
    Solids (1950).
    """

    hardness: Annotated[float, Quantity("Pa", gt=0)]

    def __post_init__(self) -> None:
        check_quantities(self)

    def project(self, trial: Array) -> Array:
        """Return the traction with the pressure limited, after radial return to radius mu |p_nu|, (n, 3) [Pa]."""
        return CoulombContact.project(self, self._limited(trial))

    def tangent(self, trial: Array) -> Array:
        """Return the derivative, (n, 3, 3), which does not depend on the normal trial where the pressure is H."""
        tangent = CoulombContact.tangent(self, self._limited(trial))
        tangent[trial[:, 2] < -self.hardness, :, 2] = 0.0
        return tangent

    def _limited(self, trial: Array) -> Array:
        """Return the trial (n, 3) with its normal traction no lower than -H."""
        limited = np.array(trial)
        np.maximum(limited[:, 2], -self.hardness, out=limited[:, 2])
        return limited
