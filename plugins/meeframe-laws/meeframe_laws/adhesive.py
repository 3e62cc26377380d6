"""Adhesive contact laws: DMT and Dugdale adhesion, and friction with an adhesive offset."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, final

import numpy as np

from meeframe.plugin import Array, ContactLaw, IsotropicCoulomb, Quantity, check_quantities
from meeframe_laws.coulomb_contact import CoulombContact


@final
@dataclass(frozen=True)
class DMT(CoulombContact):
    """Hard contact with the van der Waals attraction sigma(g) = (2 w / z_0) (1 + g / z_0)^-3 across the gap g.

    Attributes
    ----------
    work_of_adhesion : float
        w >= 0 [J/m^2 = N/m], the work of the attraction from contact to infinity.
    equilibrium_distance : float
        z_0 > 0 [m].
    mu : float
        Friction coefficient, inf allowed.

    Raises
    ------
    CaseError
        If one of them is out of bounds.

    Notes
    -----
    The contact pressure is |p_nu| = -t_nu + sigma(0), and Coulomb friction acts on this pressure:
    |t_tau| <= mu (-t_nu + 2 w / z_0). The DMT theory is the limit for stiff bodies (small Tabor parameter); soft bodies
    jump into contact as in the JKR theory.

    References
    ----------
    Derjaguin, Muller & Toporov, J. Colloid Interface Sci. 53 (1975) 314. Attraction of half spaces with the inverse
    cube of the distance: Israelachvili, Intermolecular and Surface Forces (2011).
    """

    work_of_adhesion: Annotated[float, Quantity("J/m^2", ge=0, lt=math.inf)]
    equilibrium_distance: Annotated[float, Quantity("m", gt=0, lt=math.inf)]

    def adhesion(self, gap: Array) -> Array:
        """Return sigma(g), (n,) [Pa], at gaps (n,) >= 0 [m], zero at inf."""
        relative_gap = np.maximum(gap, 0.0) / self.equilibrium_distance
        return np.asarray(2.0 * self.work_of_adhesion / self.equilibrium_distance / (1.0 + relative_gap) ** 3)


@final
@dataclass(frozen=True)
class Dugdale(CoulombContact):
    """Hard contact with a constant attraction sigma_0 across gaps up to h_0 = w / sigma_0, and none across wider gaps.

    Attributes
    ----------
    work_of_adhesion : float
        w >= 0 [J/m^2 = N/m].
    adhesive_stress : float
        sigma_0 > 0 [Pa].
    transition : float
        Width of the transition at h_0 as a fraction of h_0, in (0, 2].
    mu : float
        Friction coefficient, inf allowed.

    Raises
    ------
    CaseError
        If one of them is out of bounds.

    Notes
    -----
    The attraction decreases as a cubic over h_0 (1 -+ transition / 2), with the same work w. Coulomb friction acts on
    the pressure of the contact, |t_tau| <= mu (-t_nu + sigma_0).

    References
    ----------
    Maugis, J. Colloid Interface Sci. 150 (1992) 243.
    """

    work_of_adhesion: Annotated[float, Quantity("J/m^2", ge=0, lt=math.inf)]
    adhesive_stress: Annotated[float, Quantity("Pa", gt=0, lt=math.inf)]
    transition: Annotated[float, Quantity("", gt=0, le=2)] = 0.2

    def adhesion(self, gap: Array) -> Array:
        """Return sigma_0 up to h_0 and zero beyond, (n,) [Pa], at gaps (n,) >= 0 [m]."""
        beyond = np.maximum(gap, 0.0) * self.adhesive_stress - self.work_of_adhesion
        width = self.transition * self.work_of_adhesion
        # without work of adhesion the range is zero
        fraction = np.clip(0.5 + np.divide(beyond, width, out=np.full_like(gap, np.inf), where=width > 0.0), 0.0, 1.0)
        return np.asarray(self.adhesive_stress * (1.0 - fraction**2 * (3.0 - 2.0 * fraction)))


@final
@dataclass(frozen=True)
class DMTCoulomb(ContactLaw):
    """Unilateral contact with the friction limit mu (|p_nu| + p_adh) where the surfaces touch.

    Attributes
    ----------
    mu : float
        Friction coefficient, >= 0 and finite.
    adhesive_pressure : float
        p_adh [Pa], >= 0 and finite.

    Raises
    ------
    CaseError
        If one of them is out of bounds.

    Notes
    -----
    The attraction acts in the contact alone and is not part of the normal traction, as in the DMT theory, which adds
    its resultant to the load: the surfaces slide as if an additional pressure p_adh acted. The limit jumps where
    contact begins. A node at the contact edge that opens under shear but would touch without shear has no solution.

    References
    ----------
    Derjaguin, Z. Phys. 88 (1934) 661.
    """

    mu: Annotated[float, Quantity("", ge=0, lt=math.inf)]
    adhesive_pressure: Annotated[float, Quantity("Pa", ge=0, lt=math.inf)]

    def __post_init__(self) -> None:
        check_quantities(self)

    @cached_property
    def _coulomb(self) -> IsotropicCoulomb:
        return IsotropicCoulomb(self.mu)

    def project(self, trial: Array) -> Array:
        """Return the radial return to the disc of radius mu (|p_nu| + p_adh) where p_nu < 0, (n, 3) [Pa]."""
        in_contact = trial[:, 2] < 0.0
        traction = self._coulomb.project(self._with_adhesion(trial))
        traction[:, 2] = trial[:, 2]
        traction[~in_contact] = 0.0
        return traction

    def tangential_scaling(self) -> Array:
        """Return the scaling of isotropic Coulomb friction, (2, 2)."""
        return self._coulomb.tangential_scaling()

    def tangent(self, trial: Array) -> Array:
        """Return the derivative of the radial return, (n, 3, 3), zero without contact."""
        tangent = self._coulomb.tangent(self._with_adhesion(trial))
        tangent[~(trial[:, 2] < 0.0)] = 0.0
        return tangent

    def _with_adhesion(self, trial: Array) -> Array:
        """Return trials (n, 3) [Pa] with the adhesive pressure added to that of the contact."""
        return trial - np.array([0.0, 0.0, self.adhesive_pressure])
