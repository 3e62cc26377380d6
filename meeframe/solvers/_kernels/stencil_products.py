"""Products with the responses of lattice nodes to each other, which depend on the lattice offset alone."""

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, error_model="numpy")
def neighbours(number, places, periodic, reach):
    """Return for each of m nodes the neighbour at every lattice offset, (m, (2 reach + 1)^2), m where there is none.

    number: (nx, ny) of the nodes at their places (m, 2), -1 of the others. Offsets are those from the neighbour to the
    node.
    """
    nx, ny = number.shape
    m, width = len(places), 2 * reach + 1
    found = np.full((m, width * width), m, np.int32)
    for node in range(m):
        for di in range(width):
            for dj in range(width):
                i, j = places[node, 0] - di + reach, places[node, 1] - dj + reach
                if periodic:
                    i, j = i % nx, j % ny
                if 0 <= i < nx and 0 <= j < ny and number[i, j] >= 0:
                    found[node, di * width + dj] = number[i, j]
    return found


@njit(cache=True, nogil=True, error_model="numpy")
def stencil_products(around, responses, load, found):
    """Set `found` (m, 2) to the displacements that the loads of m nodes cause at these nodes.

    around: (m, k) of `neighbours`; responses: (k, 2, 2) to them; load: (m + 1, 2), its last row zero.
    """
    for node in range(len(around)):
        x = y = 0.0
        for k in range(around.shape[1]):
            other = around[node, k]
            a, b = load[other, 0], load[other, 1]
            x += responses[k, 0, 0] * a + responses[k, 0, 1] * b
            y += responses[k, 1, 0] * a + responses[k, 1, 1] * b
        found[node, 0], found[node, 1] = x, y
