"""Stroh eigenvalues of a medium in planes."""

import numpy as np

from meeframe.fields import N_FIELDS, Array


def stroh_eigenvalues(forms: Array) -> Array:
    """The five roots p of det(Q + p (R + R^T) + p^2 T) with positive imaginary part (eq. 46), (n, 5) complex.

    forms: (n, 3, 5, 5), Q, R + R^T and T of scaled stiffnesses. They are the eigenvalues of the companion matrix of the
    quadratic polynomial (eq. 44) rather than the roots of its determinant, which loses far more digits at multiple
    roots.
    """
    companion = np.zeros((len(forms), 2 * N_FIELDS, 2 * N_FIELDS))
    companion[:, :N_FIELDS, N_FIELDS:] = np.eye(N_FIELDS)
    companion[:, N_FIELDS:, :N_FIELDS] = -np.linalg.solve(forms[:, 2], forms[:, 0])
    companion[:, N_FIELDS:, N_FIELDS:] = -np.linalg.solve(forms[:, 2], forms[:, 1])
    roots = np.linalg.eigvals(companion).astype(complex)
    upper = np.argsort(-roots.imag, axis=1)[:, :N_FIELDS]
    result: Array = np.take_along_axis(roots, upper, axis=1)
    return result
