"""Surfaces that attract each other: DMT and Dugdale adhesion, and friction with an adhesive offset."""

import math
from dataclasses import dataclass
from typing import Annotated, final

import numpy as np

from meeframe.plugin import Array, ContactLaw, IsotropicCoulomb, Quantity, check_quantities
from meeframe_laws.coulomb_contact import CoulombContact


@final
@dataclass(frozen=True)
class DMT(CoulombContact):
    """Hard contact and the van der Waals attraction sigma(g) = (2 w / z_0) (1 + g / z_0)^-3 across the gap g.

    Its work from contact to infinity is w. In contact the surfaces press on each other with |p_nu| = -t_nu + sigma(0),
    and friction is Coulomb's of that pressure: |t_tau| <= mu (-t_nu + 2 w / z_0). The DMT theory is the limit for stiff
    bodies (small Tabor parameter); soft ones jump as in the JKR theory.

    work_of_adhesion w [J/m^2 = N/m], >= 0; equilibrium_distance z_0 [m], > 0; mu: friction coefficient, inf allowed.
    Raises CaseError if one is out of bounds.
    Source: Derjaguin, Muller & Toporov, J. Colloid Interface Sci. 53 (1975) 314; attraction of half spaces, the inverse
    cube of the distance: Israelachvili, Intermolecular and Surface Forces (2011).
    """

    work_of_adhesion: Annotated[float, Quantity("J/m^2", ge=0, lt=math.inf)]
    equilibrium_distance: Annotated[float, Quantity("m", gt=0, lt=math.inf)]

    def adhesion(self, gap: Array) -> Array:
        """Return sigma(g), (n,) [Pa], of gaps (n,) >= 0 [m]; 0 at inf."""
        apart = np.maximum(gap, 0.0) / self.equilibrium_distance
        return np.asarray(2.0 * self.work_of_adhesion / self.equilibrium_distance / (1.0 + apart) ** 3)


@final
@dataclass(frozen=True)
class Dugdale(CoulombContact):
    """Hard contact and a constant attraction sigma_0 across gaps up to h_0 = w / sigma_0, none across wider ones.

    The drop at h_0 is spread as a cubic over h_0 (1 -+ transition / 2), with the same work w. Friction is Coulomb's of
    the pressure of the contact, |t_tau| <= mu (-t_nu + sigma_0).

    work_of_adhesion w [J/m^2 = N/m], >= 0; adhesive_stress sigma_0 [Pa], > 0; transition: width of the drop as a
    fraction of h_0, in (0, 2]; mu: friction coefficient, inf allowed. Raises CaseError if one is out of bounds.
    Source: Maugis, J. Colloid Interface Sci. 150 (1992) 243.
    """

    work_of_adhesion: Annotated[float, Quantity("J/m^2", ge=0, lt=math.inf)]
    adhesive_stress: Annotated[float, Quantity("Pa", gt=0, lt=math.inf)]
    transition: Annotated[float, Quantity("", gt=0, le=2)] = 0.2

    def adhesion(self, gap: Array) -> Array:
        """Return sigma_0 up to h_0, 0 beyond, (n,) [Pa], of gaps (n,) >= 0 [m]."""
        beyond = np.maximum(gap, 0.0) * self.adhesive_stress - self.work_of_adhesion
        width = self.transition * self.work_of_adhesion
        # without work of adhesion there is no range either
        way = np.clip(0.5 + np.divide(beyond, width, out=np.full_like(gap, np.inf), where=width > 0.0), 0.0, 1.0)
        return np.asarray(self.adhesive_stress * (1.0 - way**2 * (3.0 - 2.0 * way)))


@final
@dataclass(frozen=True)
class DMTCoulomb(ContactLaw):
    """Signorini's contact with the friction limit mu (|p_nu| + p_adh) where the surfaces touch.

    The attraction acts in the contact alone and is left out of the normal traction, as in the DMT theory, which adds
    its resultant to the load: surfaces slide over each other as if they were pressed by p_adh besides. The limit jumps
    where contact begins: a node at the edge that shear lifts off, and that would touch without it, has no state.

    mu: friction coefficient, adhesive_pressure p_adh [Pa]: >= 0, finite. Raises CaseError if one is out of bounds.
    Source: Derjaguin, Z. Phys. 88 (1934) 661.
    """

    mu: Annotated[float, Quantity("", ge=0, lt=math.inf)]
    adhesive_pressure: Annotated[float, Quantity("Pa", ge=0, lt=math.inf)]

    def __post_init__(self) -> None:
        check_quantities(self)

    def project(self, trial: Array) -> Array:
        """Return the radial return to the disc of radius mu (|p_nu| + p_adh) where the trial presses, (n, 3) [Pa]."""
        pressed = trial[:, 2] < 0.0
        traction = IsotropicCoulomb(self.mu).project(trial - np.array([0.0, 0.0, self.adhesive_pressure]))
        traction[:, 2] = trial[:, 2]
        traction[~pressed] = 0.0
        return traction

    def tangential_scaling(self) -> Array:
        """Return the scaling of isotropic-coulomb, (2, 2)."""
        return IsotropicCoulomb(self.mu).tangential_scaling()
