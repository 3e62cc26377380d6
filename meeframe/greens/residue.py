"""The explicit fundamental solution of Buroni and Saez: residues at the Stroh eigenvalues."""

from dataclasses import dataclass
from functools import partial
from typing import final

from meeframe.fields import Array
from meeframe.greens._kernels.residue import characteristic_forms, residue_modulation
from meeframe.greens.base import FundamentalSolution, Kernel
from meeframe.greens.modulated import ModulatedKernel, checked_stiffness
from meeframe.material.stroh import stroh_eigenvalues


@final
@dataclass(frozen=True)
class Residue(FundamentalSolution):
    """The explicit form, eqs. 43-54, for Stroh eigenvalues of any multiplicity, equal or nearly equal.

    The sum over the distinct eigenvalues in eqs. 43 and 50, derivatives included, is the confluent divided difference
    of the numerator over the conjugate factors at the five upper eigenvalues, each taken twice in eq. 50. Opitz'
    theorem evaluates it without dividing by a difference of eigenvalues (meeframe.greens._kernels.residue). For
    distinct and for repeated eigenvalues this is eqs. 43 and 50 to the letter; between the two nothing has to be
    decided.

    Residues do not depend on the variable. They are taken in w = (i - p) / (i + p), which maps the upper half plane to
    the unit disc: powers of p, and with them most of the rounding in anisotropic materials, stay bounded.
    Source: Buroni and Saez, Proc. R. Soc. A 466 (2010) 515; Opitz, Z. Angew. Math. Mech. 44 (1964) T52.
    """

    def bind(self, stiffness: Array) -> Kernel:
        """Return the kernel for a scaled stiffness (3, 5, 5, 3); MaterialError if it is not symmetric or not
        elliptic."""
        checked = checked_stiffness(stiffness)
        return ModulatedKernel(checked, partial(_modulation, checked))


def _modulation(stiffness: Array, triad: Array) -> Array:
    forms = characteristic_forms(stiffness, triad)
    modulation: Array = residue_modulation(stiffness, triad, forms, stroh_eigenvalues(forms))
    return modulation
