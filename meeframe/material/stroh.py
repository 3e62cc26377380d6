"""Stroh eigenvalues of a medium in given planes."""

import numpy as np

from meeframe.fields import Array


def stroh_eigenvalues(forms: Array) -> Array:
    """Compute the roots p of det(Q + p (R + R^T) + p^2 T) with positive imaginary part (eq. 46).

    Parameters
    ----------
    forms : Array
        Q, R + R^T and T of scaled stiffnesses, (n, 3, fields, fields).

    Returns
    -------
    Array
        Roots, (n, fields), complex.

    Notes
    -----
    The roots are computed as eigenvalues of the companion matrix of the quadratic matrix polynomial (eq. 44). Multiple
    roots of its determinant, computed as roots of a polynomial, would lose far more digits.
    """
    size = forms.shape[-1]
    companion = np.zeros((len(forms), 2 * size, 2 * size))
    companion[:, :size, size:] = np.eye(size)
    companion[:, size:, :size] = -np.linalg.solve(forms[:, 2], forms[:, 0])
    companion[:, size:, size:] = -np.linalg.solve(forms[:, 2], forms[:, 1])
    roots = np.linalg.eigvals(companion).astype(complex)
    upper = np.argsort(-roots.imag, axis=1)[:, :size]
    result: Array = np.take_along_axis(roots, upper, axis=1)
    return result
