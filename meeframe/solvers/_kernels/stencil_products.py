"""Products with the responses of lattice nodes to each other, which depend on the lattice offset alone."""

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, error_model="numpy")
def neighbours(number, positions, periodic, radius):
    """Return for each of m nodes the neighbour at every lattice offset, (m, (2 radius + 1)^2), m where there is none.

    number: (nx, ny) of the nodes at their places (m, 2), -1 of the others. Offsets are those from the neighbour to the
    node.
    """
    nx, ny = number.shape
    m, count = len(positions), 2 * radius + 1
    result = np.full((m, count * count), m, np.int32)
    for node in range(m):
        for di in range(count):
            for dj in range(count):
                i, j = positions[node, 0] - di + radius, positions[node, 1] - dj + radius
                if periodic:
                    i, j = i % nx, j % ny
                if 0 <= i < nx and 0 <= j < ny and number[i, j] >= 0:
                    result[node, di * count + dj] = number[i, j]
    return result


@njit(cache=True, nogil=True, error_model="numpy")
def stencil_products(around, responses, load, result):
    """Set `result` (m, 2) to the displacements that the loads of m nodes cause at these nodes.

    around: (m, k) of `neighbours`; responses: (k, 2, 2) to them; load: (m + 1, 2), its last row zero.
    """
    for node in range(len(around)):
        x = y = 0.0
        for k in range(around.shape[1]):
            other = around[node, k]
            a, b = load[other, 0], load[other, 1]
            x += responses[k, 0, 0] * a + responses[k, 0, 1] * b
            y += responses[k, 1, 0] * a + responses[k, 1, 1] * b
        result[node, 0], result[node, 1] = x, y
