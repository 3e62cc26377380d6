"""Anisotropy of a medium, a measure of how close the complex singularities of its fundamental solution lie."""

from functools import lru_cache

import numpy as np

from meeframe.common.errors import MaterialError
from meeframe.fields import Array
from meeframe.greens.directions import spread_directions
from meeframe.material.stroh import stroh_eigenvalues


def anisotropy(stiffness: Array, planes: int = 200) -> float:
    """Return the largest 1/|Im p| over the Stroh eigenvalues p in many planes.

    Parameters
    ----------
    stiffness : Array
        Scaled extended stiffness C'_iJKm, (3, 5, 5, 3).
    planes : int
        Number of planes.

    Returns
    -------
    float
        The anisotropy, about 1 for an isotropic medium.

    Raises
    ------
    MaterialError
        If an eigenvalue is real to round-off.

    Notes
    -----
    The eigenvalues in a plane (m, n) are the roots of det C'_iJKm (m + p n)_i (m + p n)_m (paper, appendix B). The
    singularities of the kernels lie where p meets its conjugate, at a distance |Im p| from the real line; in an
    isotropic medium this distance is 1.
    """
    return _of_content(np.asarray(stiffness, float).tobytes(), stiffness.shape, planes)


@lru_cache(maxsize=64)
def _of_content(content: bytes, shape: tuple[int, ...], planes: int) -> float:
    """Return the anisotropy of a stiffness with this content; the points of a study mostly share their materials."""
    stiffness = np.frombuffer(content).reshape(shape)
    normal = spread_directions(planes)
    # Successive planes are rotated about their normals by an irrational step, too.
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
            "a Stroh eigenvalue of the material is real to round-off; allowed: stiffnesses less close to "
            "incompressible (for isotropic materials a smaller poisson_ratio) or to inadmissible"
        )
    return 1.0 / nearest
