"""Closed forms for isotropic uncoupled media: the solution of Kelvin and two of the Laplace equation."""

from dataclasses import dataclass
from functools import partial
from typing import final

import numpy as np

from meeframe.common.errors import MaterialError
from meeframe.fields import ELECTRIC, MAGNETIC, Array
from meeframe.greens._kernels.isotropic import isotropic_modulation
from meeframe.greens.base import FundamentalSolution, Kernel
from meeframe.greens.modulated import ModulatedKernel, validate_stiffness

TOLERANCE = 1e-12  # of the largest scaled constant


@final
@dataclass(frozen=True)
class Isotropic(FundamentalSolution):
    """The solution of Kelvin for the displacements and 1 / (4 pi r) for each potential, without coupling.

    References
    ----------
    Love, A Treatise on the Mathematical Theory of Elasticity, article 130.
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
            If the material is anisotropic or coupled; the message says in which constants.
        """
        stiffness = validate_stiffness(stiffness)
        constants = np.array(
            [stiffness[0, 0, 0, 0], stiffness[0, 1, 0, 1], stiffness[0, 3, 3, 0], stiffness[0, 4, 4, 0]]
        )
        _require_isotropic(stiffness, constants)
        return ModulatedKernel(stiffness, partial(isotropic_modulation, constants))


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
    deviations = {name: np.abs(block).max() / size for name, block in excess.items()}
    failures = [f"{name} (by {value:.1e})" for name, value in deviations.items() if value > TOLERANCE]
    if failures:
        raise MaterialError(
            f"fundamental solution isotropic: {'; '.join(failures)}; "
            f"allowed: {TOLERANCE:g} of the largest scaled constant"
        )
