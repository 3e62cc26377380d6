"""Shared functions of the friction laws: pressures, and the return to a limit of the tangential traction."""

from typing import Final

import numpy as np

from meeframe.plugin import Array

ROUNDS: Final = 100
"""Of Newton's method, bisection included; it needs a dozen, to halve an interval down to round-off half of them."""
ROUND_OFF: Final = 4.0 * float(np.finfo(float).eps)
"""Smallest step of Newton's method, as a fraction."""


def pressing(trial: Array) -> Array:
    """Return the contact pressure (n,) >= 0 [Pa] of trials (n, 3) by Signorini's law (eq. 11): zero where the contact
    is open."""
    pressure: Array = np.maximum(-trial[:, 2], 0.0)
    return pressure


def sheared(trial: Array) -> Array:
    """Return the size (n,) [Pa] of the tangential traction of trials (n, 3)."""
    size: Array = np.hypot(trial[:, 0], trial[:, 1])
    return size


def returned_to_disc(trial: Array, limit: Array | float) -> Array:
    """Return the trials (n, 3) brought back radially to |t_tau| <= limit (n,) [Pa], inf allowed; zero without
    pressure."""
    return along(trial, np.where(pressing(trial) > 0.0, np.minimum(sheared(trial), limit), 0.0))


def along(trial: Array, size: Array) -> Array:
    """Return the tractions (n, 3) of size (n,) along the tangential trial, none if that is zero, and of Signorini's
    pressure."""
    length = sheared(trial)
    factor = np.divide(size, length, out=np.zeros_like(length), where=length > 0.0)
    return np.column_stack([trial[:, :2] * factor[:, None], -pressing(trial)])


def isotropic_scaling(largest: float) -> Array:
    """Return the tangential scaling (2, 2) of isotropic friction: the identity, zero if its largest limit is."""
    return np.eye(2) if largest > 0.0 else np.zeros((2, 2))
