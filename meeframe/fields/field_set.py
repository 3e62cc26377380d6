"""The five extended fields, their units, and the one place where fields are scaled.

Extended displacement u = (u1, u2, u3, phi, psi), extended traction t = (t1, t2, t3, q, s) with q = D.nu, s = B.nu and
nu the outward unit normal (paper, appendix A). All arrays that carry an extended field index have length 5 along it.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

N_FIELDS: Final = 5
MECHANICAL: Final = slice(0, 3)
ELECTRIC: Final = 3
MAGNETIC: Final = 4

VALUE_NAMES: Final = ("displacement_1", "displacement_2", "displacement_3", "electric_potential", "magnetic_potential")
VALUE_UNITS: Final = ("m", "m", "m", "V", "A")
FLUX_NAMES: Final = ("traction_1", "traction_2", "traction_3", "electric_flux", "magnetic_flux")
FLUX_UNITS: Final = ("Pa", "Pa", "Pa", "C/m^2", "Wb/m^2")


@dataclass(frozen=True, eq=False)
class FieldScaling:
    """Factors s_J that make all entries of the extended stiffness of order one (docs/theory.md, Scaling).

    C'_iJKm = s_J s_K C_iJKm, u' = u / s, t' = s t, where primes mark scaled fields. In SI units the extended stiffness
    has a condition number near 1e19; scaled, near 10.

    factors: (5,) positive.
    """

    factors: Array

    @classmethod
    def of(cls, stiffness: Array) -> "FieldScaling":
        """Scaling for an extended stiffness C_iJKm, (3, 5, 5, 3) in SI units."""
        elastic = np.abs(stiffness[:, :3, :3, :]).max()
        electric = np.abs(stiffness[:, ELECTRIC, ELECTRIC, :]).max()
        magnetic = np.abs(stiffness[:, MAGNETIC, MAGNETIC, :]).max()
        factors = np.array([elastic, elastic, elastic, electric, magnetic]) ** -0.5
        factors.setflags(write=False)
        return cls(factors)

    def scale_stiffness(self, stiffness: Array) -> Array:
        """C'_iJKm of C_iJKm, (3, 5, 5, 3)."""
        scaled: Array = stiffness * self.factors[None, :, None, None] * self.factors[None, None, :, None]
        return scaled

    def scale_values(self, values: Array) -> Array:
        """u' of u (..., 5) in SI units."""
        return values / self.factors

    def unscale_values(self, values: Array) -> Array:
        """u (..., 5) in SI units of u'."""
        return values * self.factors

    def scale_fluxes(self, fluxes: Array) -> Array:
        """t' of t (..., 5) in SI units."""
        return fluxes * self.factors

    def unscale_fluxes(self, fluxes: Array) -> Array:
        """t (..., 5) in SI units of t'."""
        return fluxes / self.factors
