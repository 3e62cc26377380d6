"""Rotation matrices for the axes of a material."""

import numpy as np
import scipy  # submodules load on first use
from numpy.typing import ArrayLike

from meeframe.common.errors import MaterialError
from meeframe.fields import Array

_TOLERANCE = 1e-8


def validate_rotation(matrix: ArrayLike) -> Array:
    """Return a rotation matrix after checking it.

    Parameters
    ----------
    matrix : array_like
        Matrix, (3, 3).

    Raises
    ------
    MaterialError
        If the matrix is not finite and proper orthogonal; the message says which.
    """
    rotation = np.asarray(matrix, dtype=float)
    if rotation.shape != (3, 3) or not np.isfinite(rotation).all():
        raise MaterialError(f"a rotation must be a finite (3, 3) matrix, got {rotation.tolist()}")
    defect = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    if defect > _TOLERANCE:
        raise MaterialError(f"rotation is not orthogonal: R R^T differs from the identity by {defect:.3g}")
    if np.linalg.det(rotation) < 0.0:
        raise MaterialError("rotation is improper: its determinant is -1 (a reflection), must be +1")
    return rotation


def rotation_about(axis: ArrayLike, angle: float) -> Array:
    """Return the matrix (3, 3) of a right-handed rotation about an axis.

    Parameters
    ----------
    axis : array_like
        Direction of the axis, (3,), of any length but zero.
    angle : float
        Angle [rad].

    Returns
    -------
    Array
        (3, 3), proper orthogonal.

    Raises
    ------
    MaterialError
        If the axis or the angle is not finite, or the axis is zero.
    """
    direction = np.asarray(axis, dtype=float)
    length = np.linalg.norm(direction)
    if direction.shape != (3,) or not np.isfinite(length) or length == 0.0 or not np.isfinite(angle):
        raise MaterialError(
            f"a rotation needs a finite axis of three numbers, not all zero, and a finite angle; "
            f"got axis {direction.tolist()}, angle {angle}"
        )
    matrix: Array = scipy.spatial.transform.Rotation.from_rotvec(angle * direction / length).as_matrix()
    return matrix


def rotation_from_euler(angles: ArrayLike, sequence: str = "ZXZ") -> Array:
    """Return the rotation matrix (3, 3) of Euler angles.

    Parameters
    ----------
    angles : array_like
        Euler angles, (3,) [rad].
    sequence : str
        Axes as in SciPy: 'ZXZ' (Bunge) with capitals for rotating axes, 'xyz' with small letters for fixed axes.

    Returns
    -------
    Array
        (3, 3), proper orthogonal.

    Raises
    ------
    MaterialError
        If an angle is not finite or the sequence is unknown.
    """
    values = np.asarray(angles, dtype=float)
    valid = len(sequence) == 3 and (set(sequence) <= set("XYZ") or set(sequence) <= set("xyz"))
    if values.shape != (3,) or not np.isfinite(values).all() or not valid:
        raise MaterialError(
            f"Euler angles must be three finite numbers with a sequence such as 'ZXZ' or 'xyz'; "
            f"got {values.tolist()}, {sequence!r}"
        )
    try:
        matrix: Array = scipy.spatial.transform.Rotation.from_euler(sequence, values).as_matrix()
    except ValueError as error:
        raise MaterialError(f"Euler sequence {sequence!r}: {error}") from None
    return matrix
