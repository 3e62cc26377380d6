"""How much nearer an anisotropic medium brings the complex singularities of its fundamental solution."""

import numpy as np

from meeframe.core.fields import N_FIELDS, Array


def anisotropy(stiffness: Array, planes: int = 200) -> float:
    """Largest 1/|Im p| over Stroh eigenvalues p of a number of planes; about 1 for an isotropic medium.

    stiffness: scaled, C'_iJKm, (3, 5, 5, 3). The eigenvalues in a plane (m, n) are the roots of
    det C'_iJKm (m + p n)_i (m + p n)_m (paper, appendix B). The kernels have their singularities where p meets its
    conjugate: at a distance |Im p| from the real line where an isotropic medium has them at 1.
    """
    index = np.arange(planes) + 0.5
    height, turn = 1.0 - 2.0 * index / planes, np.pi * (3.0 - np.sqrt(5.0)) * index
    radius = np.sqrt(1.0 - height**2)
    normal = np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)
    # The plane turns about its normal by another irrational step.
    first = np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    angle = np.sqrt(2.0) * np.pi * index[:, None]
    m = np.cos(angle) * first + np.sin(angle) * np.cross(normal, first)
    n = np.cross(normal, m)
    roots = np.linalg.eigvals(_companion(stiffness, m, n))
    return float(1.0 / np.abs(roots.imag).min())


def _companion(stiffness: Array, m: Array, n: Array) -> Array:
    """Matrices (k, 10, 10) whose eigenvalues are p, for planes m, n (k, 3): Q + p (R + R^T) + p^2 T, linearised."""
    q, r, t = (np.einsum("ijkm,ni,nm->njk", stiffness, a, b) for a, b in ((m, m), (m, n), (n, n)))
    companion = np.zeros((len(m), 2 * N_FIELDS, 2 * N_FIELDS))
    companion[:, :N_FIELDS, N_FIELDS:] = np.eye(N_FIELDS)
    companion[:, N_FIELDS:, :N_FIELDS] = -np.linalg.solve(t, q)
    companion[:, N_FIELDS:, N_FIELDS:] = -np.linalg.solve(t, r + np.swapaxes(r, 1, 2))
    return companion
