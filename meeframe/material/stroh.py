"""Stroh eigenvalues of a medium in given planes."""

import numpy as np

from meeframe.fields import N_FIELDS, Array


def stroh_eigenvalues(forms: Array) -> Array:
    """Compute the five roots p of det(Q + p (R + R^T) + p^2 T) with positive imaginary part (eq. 46).

    Parameters
    ----------
    forms : Array
        Q, R + R^T and T of scaled stiffnesses, (n, 3, 5, 5).

    Returns
    -------
    Array
        Roots, (n, 5), complex.

    Notes
    -----
    The roots are computed as eigenvalues of the companion matrix of the quadratic matrix polynomial (eq. 44). Multiple
    roots of its determinant, computed as roots of a polynomial, would lose far more digits.
    """
    companion = np.zeros((len(forms), 2 * N_FIELDS, 2 * N_FIELDS))
    companion[:, :N_FIELDS, N_FIELDS:] = np.eye(N_FIELDS)
    companion[:, N_FIELDS:, :N_FIELDS] = -np.linalg.solve(forms[:, 2], forms[:, 0])
    companion[:, N_FIELDS:, N_FIELDS:] = -np.linalg.solve(forms[:, 2], forms[:, 1])
    roots = np.linalg.eigvals(companion).astype(complex)
    upper = np.argsort(-roots.imag, axis=1)[:, :N_FIELDS]
    result: Array = np.take_along_axis(roots, upper, axis=1)
    return result
