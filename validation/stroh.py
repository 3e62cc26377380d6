"""Surface compliance from Stroh's eigenproblem if it is not degenerate, independent of meeframe's integrals."""

import numpy as np

from meeframe.fields import Array, FieldScaling


def point_response(stiffness: Array) -> Array:
    """Return xi (3, 3) of an axisymmetric half space x3 < 0 with outward normal x3, for (u3, phi, psi), in SI units.

    u = A <exp(i k p x3)> f exp(i k x1) with the five eigenvalues p that decay downwards, Im p < 0; tractions on the
    surface are t = i k L f, so that u = Y t/k with Y = -i A L^-1 and xi = Y/(2 pi).
    """
    scaling = FieldScaling.of(stiffness)
    c = scaling.scale_stiffness(stiffness)
    q, r, t = c[0, :, :, 0], c[0, :, :, 2], c[2, :, :, 2]
    inverse = np.linalg.inv(t)
    upper = -inverse @ r.T
    matrix = np.block([[upper, inverse], [r @ inverse @ r.T - q, upper.T]])
    values, vectors = np.linalg.eig(matrix)
    decaying = vectors[:, values.imag < 0]
    y = -1j * decaying[:5] @ np.linalg.inv(decaying[5:])
    full = np.outer(scaling.factors, scaling.factors) * y / (2.0 * np.pi)
    return np.asarray(full.real[2:, 2:])
