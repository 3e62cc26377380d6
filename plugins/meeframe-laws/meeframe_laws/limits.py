"""Functions of the friction laws, for pressures and for the return to a limit of the tangential traction."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from meeframe.plugin import Array

MAX_STEPS: Final = 100
"""Largest number of steps of Newton's method with bisection; a dozen are typical, and 50 bisections reach round-off."""
ROUND_OFF: Final = 4.0 * float(np.finfo(float).eps)
"""Smallest relative step of Newton's method."""
_LIMIT_ROUND_OFF: Final = 1e-12
"""Relative excess of a trial over the limit of friction that may be round-off."""


def contact_pressure(trial: Array) -> Array:
    """Return the contact pressure (n,) >= 0 [Pa] of trials (n, 3) by eq. (11), zero where the contact is open."""
    pressure: Array = np.maximum(-trial[:, 2], 0.0)
    return pressure


def in_contact(trial: Array) -> NDArray[np.bool_]:
    """Return where trials (n, 3) are pressed and finite, (n,)."""
    return np.asarray(np.isfinite(trial).all(axis=1) & (trial[:, 2] < 0.0))


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


def disc_tangent(trial: Array, limit: Array | float, by_pressure: Array | float = 0.0) -> Array:
    """Return the derivative (n, 3, 3) of `return_to_disc`, for a limit with the derivative `by_pressure` (n,).

    On the limit, to round-off, the derivative is that of stick.
    """
    sticks, limit = is_within_disc(trial, limit), np.broadcast_to(limit, len(trial))
    size = np.where(sticks, tangential_norm(trial), limit)
    return radial_tangent(trial, size, sticks, np.where(sticks, 0.0, by_pressure))


def is_within_disc(trial: Array, limit: Array | float) -> NDArray[np.bool_]:
    """Return where trials (n, 3) have |t_tau| <= limit (n,) [Pa] to round-off, and the limit is not zero."""
    return np.asarray((tangential_norm(trial) <= (1.0 + _LIMIT_ROUND_OFF) * limit) & (np.asarray(limit) > 0.0))


def radial_tangent(trial: Array, size: Array, by_length: Array | NDArray[np.bool_], by_pressure: Array) -> Array:
    """Return the derivative (n, 3, 3) of `with_tangential_norm`, zero where there is no pressure.

    Parameters
    ----------
    trial : Array
        Trial tractions, (n, 3) [Pa].
    size : Array
        Norm of the tangential traction, (n,) [Pa].
    by_length, by_pressure : Array
        Derivatives of that norm by the norm of the tangential trial, and by the contact pressure, (n,).
    """
    length, is_pressed = tangential_norm(trial), in_contact(trial)
    factor = np.divide(size, length, out=by_length.astype(float), where=is_pressed & (length > 0.0))
    unit, tangent = direction(trial), np.zeros((3, 3, len(trial))).transpose(2, 0, 1)
    for i, j in np.ndindex(2, 2):
        tangent[:, i, j] = (by_length - factor) * unit[i] * unit[j] + (factor if i == j else 0.0)
    for i in range(2):
        tangent[:, i, 2] = -by_pressure * unit[i]
    tangent[:, 2, 2] = 1.0
    tangent[~is_pressed] = 0.0
    return tangent


def direction(vectors: Array) -> Array:
    """Return unit vectors (2, n) along the tangential components of vectors (n, 3), zero where these are zero."""
    length = tangential_norm(vectors)
    is_positive = (length > 0.0) & np.isfinite(length)
    return np.array(
        [np.divide(component, length, out=np.zeros_like(length), where=is_positive) for component in vectors[:, :2].T]
    )


def isotropic_scaling(largest: float) -> Array:
    """Return the tangential scaling (2, 2) of isotropic friction: the identity, or zero if the largest limit is."""
    return np.eye(2) if largest > 0.0 else np.zeros((2, 2))
