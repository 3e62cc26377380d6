"""Frictionless unilateral contact."""

from dataclasses import dataclass
from typing import final

import numpy as np

from meeframe.common.arguments import checked_arguments
from meeframe.fields import Array
from meeframe.laws.base import ContactLaw


@final
@checked_arguments
@dataclass(frozen=True)
class Signorini(ContactLaw):
    """Unilateral contact without friction (eqs. 10, 11): p_nu = min(0, p_nu*), zero tangential traction."""

    def project(self, trial: Array) -> Array:
        """Return the normal component of trial tractions where it presses, min(0, t.nu).

        Parameters
        ----------
        trial : Array
            Trial tractions, (n, 3) [Pa], along e1, e2, nu.

        Returns
        -------
        Array
            Tractions (0, 0, min(0, t.nu)), (n, 3) [Pa].
        """
        traction = np.zeros_like(trial)
        traction[:, 2] = np.minimum(trial[:, 2], 0.0)
        return traction

    def tangential_scaling(self) -> Array:
        """Return zero, (2, 2), since tangential tractions are zero."""
        return np.zeros((2, 2))

    def tangent(self, trial: Array) -> Array:
        """Return the derivative of the projection.

        Parameters
        ----------
        trial : Array
            Trial tractions, (n, 3) [Pa].

        Returns
        -------
        Array
            Derivatives, (n, 3, 3): one in the normal direction where the contact is closed, else zero.
        """
        tangent = np.zeros((len(trial), 3, 3))
        tangent[:, 2, 2] = np.isfinite(trial).all(axis=1) & (trial[:, 2] < 0.0)
        return tangent
