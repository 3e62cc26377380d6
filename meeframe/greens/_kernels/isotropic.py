"""H and its tangential derivatives for isotropic uncoupled media."""

import numpy as np
from numba import njit

from meeframe.greens._kernels.modulation import N_PACKED, PACKED


@njit(cache=True, nogil=True)
def isotropic_modulation(constants, triad):
    """Return the modulation (n, 3, 15) = H, A, B on triads (n, 3, 3).

    constants: c_1111, c_1212, and C_1441, C_1551 (negative). On the displacements H = alpha 1 + beta e e, so that
    A = beta (n e + e n) and B = beta (m e + e m).
    """
    p_wave, shear, electric, magnetic = constants
    alpha = 0.5 / shear + 0.5 / p_wave
    beta = 0.5 / shear - 0.5 / p_wave
    modulation = np.zeros((triad.shape[0], 3, N_PACKED))
    for point in range(triad.shape[0]):
        e = triad[point, 2]
        for i in range(3):
            for j in range(i, 3):
                modulation[point, 0, PACKED[i, j]] = beta * e[i] * e[j] + (alpha if i == j else 0.0)
                for tangent in range(2):
                    t = triad[point, tangent]
                    modulation[point, 1 + tangent, PACKED[i, j]] = beta * (t[i] * e[j] + e[i] * t[j])
        modulation[point, 0, PACKED[3, 3]] = 1.0 / electric
        modulation[point, 0, PACKED[4, 4]] = 1.0 / magnetic
    return modulation
