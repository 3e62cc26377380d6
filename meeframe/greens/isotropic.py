"""Closed forms for isotropic uncoupled media: Kelvin's solution and two of Laplace's equation."""

from dataclasses import dataclass
from functools import partial
from typing import final

import numpy as np

from meeframe.common.errors import MaterialError
from meeframe.fields import ELECTRIC, MAGNETIC, Array
from meeframe.greens._kernels.isotropic import isotropic_modulation
from meeframe.greens.base import FundamentalSolution, Kernel
from meeframe.greens.modulated import ModulatedKernel, checked_stiffness

TOLERANCE = 1e-12


@final
@dataclass(frozen=True)
class Isotropic(FundamentalSolution):
    """Kelvin's solution for the displacements, 1 / (4 pi r) for each potential, no coupling.

    Source: Love, A Treatise on the Mathematical Theory of Elasticity, article 130.
    """

    def bind(self, stiffness: Array) -> Kernel:
        """Return the kernel for a scaled stiffness (3, 5, 5, 3).

        Raises MaterialError that names what is anisotropic or coupled.
        """
        checked = checked_stiffness(stiffness)
        constants = np.array([checked[0, 0, 0, 0], checked[0, 1, 0, 1], checked[0, 3, 3, 0], checked[0, 4, 4, 0]])
        _require_isotropic(checked, constants)
        return ModulatedKernel(checked, partial(isotropic_modulation, constants))


def _require_isotropic(stiffness: Array, constants: Array) -> None:
    p_wave, shear, electric, magnetic = constants
    delta = np.eye(3)
    elastic = (p_wave - 2.0 * shear) * np.einsum("ij,km->ijkm", delta, delta) + shear * (
        np.einsum("ik,jm->ijkm", delta, delta) + np.einsum("im,jk->ijkm", delta, delta)
    )
    excess = {
        "elastic stiffness is not isotropic": stiffness[:, :3, :3] - elastic,
        "permittivity is not isotropic": stiffness[:, ELECTRIC, ELECTRIC] - electric * delta,
        "permeability is not isotropic": stiffness[:, MAGNETIC, MAGNETIC] - magnetic * delta,
        "piezoelectric coupling is not zero": stiffness[:, :3, ELECTRIC],
        "piezomagnetic coupling is not zero": stiffness[:, :3, MAGNETIC],
        "magneto-electric coupling is not zero": stiffness[:, ELECTRIC, MAGNETIC],
    }
    size = np.abs(stiffness).max()
    wrong = {name: np.abs(part).max() / size for name, part in excess.items()}
    found = [f"{name} (by {value:.1e})" for name, value in wrong.items() if value > TOLERANCE]
    if found:
        raise MaterialError(
            f"fundamental solution isotropic: {'; '.join(found)}; "
            f"allowed is {TOLERANCE:g} of the largest scaled constant"
        )
