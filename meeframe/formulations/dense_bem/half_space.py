"""Terms of the plane outside the mesh of a semi-infinite body, where fluxes vanish and values are neglected."""

import numpy as np

from meeframe.fields import Array
from meeframe.greens.base import Kernel
from meeframe.mesh.surface import SurfaceMesh
from meeframe.mesh.topology import boundary_polygon

GAUSS_POINTS = 24


def exterior_terms(kernel: Kernel, mesh: SurfaceMesh, positions: Array) -> Array:
    """Return the free term minus the integral of T over the plane outside the mesh.

    Parameters
    ----------
    kernel : Kernel
        Fundamental solution.
    mesh : SurfaceMesh
        The mesh, in units of the system.
    positions : Array
        Collocation points, (s, 3).

    Returns
    -------
    Array
        Terms, (s, fields^2), entry (J, K) row by row.

    Notes
    -----
    The value at the source is subtracted on the mesh. Over the entire plane the principal value of T vanishes, because
    T is odd, and the free term is one half. With T = t(theta) / rho^2 and the outer border at rho = R(theta), the
    integral outside is - int t ln R dtheta, here a line integral along that border.
    """
    sides = mesh.points[boundary_polygon(mesh)]
    abscissae, weights = np.polynomial.legendre.leggauss(GAUSS_POINTS)
    fractions = (1.0 + abscissae) / 2.0
    start, along = sides[:, 0], sides[:, 1] - sides[:, 0]
    points = (start[:, None] + fractions[:, None] * along[:, None]).reshape(-1, 3)
    steps = (weights[:, None] / 2.0 * along[:, None]).reshape(-1, 3)
    block = mesh.blocks[0]
    a, b, c = mesh.points[block.connectivity[0, :3]]
    normal = np.cross(b - a, c - a) / np.linalg.norm(np.cross(b - a, c - a))
    normals = np.broadcast_to(normal, points.shape)
    size = np.ptp(mesh.points, axis=0).max()
    terms = []
    for position in positions:
        offset = points - position
        sweep = np.cross(offset, steps) @ normal
        _, t = kernel.evaluate(offset, np.ascontiguousarray(normals))
        shares = sweep * np.log(np.linalg.norm(offset, axis=1) / size)
        terms.append(np.eye(t.shape[1]).ravel() / 2.0 + shares @ t.reshape(len(t), -1))
    return np.array(terms)
