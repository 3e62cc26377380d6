"""The explicit fundamental solution of Buroni and Saez, by residues at the Stroh eigenvalues."""

from dataclasses import dataclass
from functools import partial
from typing import final

from meeframe.fields import Array
from meeframe.greens._kernels.residue import characteristic_forms, residue_modulation
from meeframe.greens.base import FundamentalSolution, Kernel
from meeframe.greens.modulated import ModulatedKernel, validate_stiffness
from meeframe.material.stroh import stroh_eigenvalues


@final
@dataclass(frozen=True)
class Residue(FundamentalSolution):
    """The explicit form, eqs. 43-54, for Stroh eigenvalues that may be multiple or nearly so.

    Notes
    -----
    The sum over the distinct eigenvalues in eqs. 43 and 50, derivatives included, is the confluent divided difference
    of the numerator over the conjugate factors at the five upper eigenvalues, each repeated in eq. 50. The theorem of
    Opitz evaluates it without division by a difference of eigenvalues (meeframe.greens._kernels.residue). The result
    agrees with eqs. 43 and 50 for distinct and for repeated eigenvalues, without a distinction of cases.

    Residues do not depend on the variable. They are computed in w = (i - p) / (i + p), which maps the upper half plane
    to the unit disc, so that powers of p, and with them most of the rounding in anisotropic materials, stay bounded.

    References
    ----------
    Buroni and Saez, Proc. R. Soc. A 466 (2010) 515. Opitz, Z. Angew. Math. Mech. 44 (1964) T52.
    """

    def bind(self, stiffness: Array) -> Kernel:
        """Return the kernel of a material.

        Parameters
        ----------
        stiffness : Array
            Scaled extended stiffness, (3, 5, 5, 3).

        Raises
        ------
        MaterialError
            If the stiffness is not symmetric or not elliptic.
        """
        stiffness = validate_stiffness(stiffness)
        return ModulatedKernel(stiffness, partial(_modulation, stiffness))


def _modulation(stiffness: Array, triad: Array) -> Array:
    forms = characteristic_forms(stiffness, triad)
    modulation: Array = residue_modulation(stiffness, triad, forms, stroh_eigenvalues(forms))
    return modulation
