"""Products of the responses of nodes on a lattice to each other, by how many places lie between them."""

from numba import njit


@njit(cache=True, nogil=True, error_model="numpy")
def stencil_products(number, places, periodic, responses, load, found):
    """found = what loads (m, k) of m nodes cause at these nodes alone, (m, k).

    number: (nx, ny) of the nodes at their places (m, 2), -1 of the others; responses: (2 s + 1, 2 s + 1, k, k) of a
    node to the load of another, by the places from that to this one.
    """
    nx, ny = number.shape
    reach, width = responses.shape[0] // 2, load.shape[1]
    found[:] = 0.0
    for node in range(len(places)):
        for di in range(-reach, reach + 1):
            for dj in range(-reach, reach + 1):
                i, j = places[node, 0] + di, places[node, 1] + dj
                if periodic:
                    i, j = i % nx, j % ny
                if 0 <= i < nx and 0 <= j < ny and number[i, j] >= 0:
                    other = number[i, j]
                    for row in range(width):
                        for column in range(width):
                            found[other, row] += responses[reach + di, reach + dj, row, column] * load[node, column]
