"""Anisotropy of a medium: the distance of its fundamental solution's complex singularities."""

import numpy as np

from meeframe.common.errors import MaterialError
from meeframe.fields import Array
from meeframe.greens.directions import spread_directions
from meeframe.material.stroh import stroh_eigenvalues


def anisotropy(stiffness: Array, planes: int = 200) -> float:
    """Return the largest 1/|Im p| over Stroh eigenvalues p of a number of planes; about 1 for an isotropic medium.

    stiffness: scaled, C'_iJKm, (3, 5, 5, 3). The eigenvalues in a plane (m, n) are the roots of
    det C'_iJKm (m + p n)_i (m + p n)_m (paper, appendix B). The kernels have their singularities where p meets its
    conjugate: at a distance |Im p| from the real line where an isotropic medium has them at 1. Raises MaterialError if
    round-off puts one of them on that line.
    """
    normal = spread_directions(planes)
    # The plane turns about its normal by another irrational step.
    first = np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    angle = np.sqrt(2.0) * np.pi * (np.arange(planes) + 0.5)[:, None]
    m = np.cos(angle) * first + np.sin(angle) * np.cross(normal, first)
    n = np.cross(normal, m)
    q, r, t = (np.einsum("ijkm,ni,nm->njk", stiffness, a, b) for a, b in ((m, m), (m, n), (n, n)))
    roots = stroh_eigenvalues(np.stack([q, r + np.swapaxes(r, 1, 2), t], axis=1))
    nearest = float(np.abs(roots.imag).min())
    if not nearest > 0.0:
        raise MaterialError(
            "a Stroh eigenvalue of the material is real but for round-off; allowed: stiffnesses less near to "
            "incompressible (of isotropic ones a smaller poisson_ratio) or to inadmissible"
        )
    return 1.0 / nearest
