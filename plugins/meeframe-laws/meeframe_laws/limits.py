"""Functions of the friction laws, for pressures and for the return to a limit of the tangential traction."""

from typing import Final

import numpy as np

from meeframe.plugin import Array

MAX_STEPS: Final = 100
"""Largest number of steps of Newton's method with bisection; a dozen are typical, and 50 bisections reach round-off."""
ROUND_OFF: Final = 4.0 * float(np.finfo(float).eps)
"""Smallest relative step of Newton's method."""


def contact_pressure(trial: Array) -> Array:
    """Return the contact pressure (n,) >= 0 [Pa] of trials (n, 3) by eq. (11), zero where the contact is open."""
    pressure: Array = np.maximum(-trial[:, 2], 0.0)
    return pressure


def tangential_norm(trial: Array) -> Array:
    """Return the norm (n,) of the tangential components of vectors (n, 3)."""
    size: Array = np.hypot(trial[:, 0], trial[:, 1])
    return size


def return_to_disc(trial: Array, limit: Array | float) -> Array:
    """Return trials (n, 3) after radial return to |t_tau| <= limit (n,) [Pa], inf allowed; zero without pressure."""
    return with_tangential_norm(
        trial, np.where(contact_pressure(trial) > 0.0, np.minimum(tangential_norm(trial), limit), 0.0)
    )


def with_tangential_norm(trial: Array, size: Array) -> Array:
    """Return tractions (n, 3) with a tangential part of norm `size` (n,) along the trial, and the pressure of eq. (11).

    The tangential part is zero where that of the trial is zero.
    """
    length = tangential_norm(trial)
    factor = np.divide(size, length, out=np.zeros_like(length), where=length > 0.0)
    return np.column_stack([trial[:, :2] * factor[:, None], -contact_pressure(trial)])


def isotropic_scaling(largest: float) -> Array:
    """Return the tangential scaling (2, 2) of isotropic friction: the identity, or zero if the largest limit is."""
    return np.eye(2) if largest > 0.0 else np.zeros((2, 2))
