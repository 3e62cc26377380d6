# mypy: ignore-errors
"""Kernels of the integrals over facets: orders of interpolation, weights of its points, and weighted sums."""

from math import sqrt

import numpy as np
from numba import njit

from meeframe.plugin.boundary_elements import order_for


@njit(cache=True, nogil=True)
def orders_of_facet(positions, centre, axes, half_sides, accuracy):
    """Return the numbers of Gauss points along both axes for the interpolation of kernels.

    accuracy: relative to the largest value. The numbers are those that integrate to the square of it: interpolation
    with n points is as accurate as integration with n / 2. positions: (s, 3) of the sources; centre (3,), axes (2, 3),
    half_sides (2,) of the rectangle.
    """
    local = (positions - centre) @ axes.T
    first = second = np.inf
    for i in range(len(positions)):
        square = 0.0
        for axis in range(3):
            square += (positions[i, axis] - centre[axis]) ** 2
        x, y = abs(local[i, 0]), abs(local[i, 1])
        z = max(0.0, square - x * x - y * y)
        distance = max(0.0, y - half_sides[1]) ** 2 + z
        first = min(
            first,
            (sqrt((x - half_sides[0]) ** 2 + distance) + sqrt((x + half_sides[0]) ** 2 + distance))
            / (2.0 * half_sides[0]),
        )
        distance = max(0.0, x - half_sides[0]) ** 2 + z
        second = min(
            second,
            (sqrt((y - half_sides[1]) ** 2 + distance) + sqrt((y + half_sides[1]) ** 2 + distance))
            / (2.0 * half_sides[1]),
        )
    tolerance, anisotropy = accuracy.tolerance**2, accuracy.anisotropy
    return order_for(first, 0, tolerance, anisotropy), order_for(second, 0, tolerance, anisotropy)


@njit(cache=True, nogil=True)
def _lagrange(nodes, x, out):
    """Set out (n,) to the values at x of the Lagrange polynomials of the nodes (n,)."""
    for i in range(len(nodes)):
        out[i] = 1.0
        for j in range(len(nodes)):
            if j != i:
                out[i] *= (x - nodes[j]) / (nodes[i] - nodes[j])


@njit(cache=True, nogil=True)
def add_weights(quadrature, numbers, sites, patches, centre, axes, half_sides, first, second, values, fluxes):
    """Add integrals of shape functions times interpolating polynomials to values (s, p) and fluxes (f, p).

    quadrature: points of the rules on elements, whose nodes have the positions sites and patches (e, k) in the output,
    negative if not needed; first (m,), second (n,): the nodes of interpolation on [-1, 1], p = m n.
    """
    along_first, along_second = np.empty(len(first)), np.empty(len(second))
    for element in range(len(numbers)):
        for q in range(quadrature.starts[element], quadrature.starts[element + 1]):
            x = y = 0.0
            for axis in range(3):
                offset = quadrature.offsets[q, axis] - centre[axis]
                x += offset * axes[0, axis]
                y += offset * axes[1, axis]
            _lagrange(first, x / half_sides[0], along_first)
            _lagrange(second, y / half_sides[1], along_second)
            for a in range(sites.shape[1]):
                site, patch, weight = sites[element, a], patches[element, a], quadrature.weights[q, a]
                if site >= 0:
                    for i in range(len(first)):
                        for j in range(len(second)):
                            contribution = weight * along_first[i] * along_second[j]
                            values[site, i * len(second) + j] += contribution
                            fluxes[patch, i * len(second) + j] += contribution


@njit(cache=True, nogil=True)
def add_products(fields, u, t, starts, weights, sites, site_starts, patches, patch_starts, sums):
    """Add weights times kernels u, t (c, f^2) to the sums of nodes, facet by facet.

    Facet g has the points from starts[g] to starts[g + 1], likewise the positions of its sites and patches in the sums,
    and, after those of the previous facets, weights (sites, points) and (patches, points).
    """
    offset = 0
    for g in range(len(starts) - 1):
        facet_points = slice(starts[g], starts[g + 1])
        n = starts[g + 1] - starts[g]
        for kernel, positions, out in (
            (t, sites[site_starts[g] : site_starts[g + 1]], sums.values),
            (u, patches[patch_starts[g] : patch_starts[g + 1]], sums.fluxes),
        ):
            size = len(positions) * n
            integrals = np.dot(weights[offset : offset + size].reshape(len(positions), n), kernel[facet_points])
            for i in range(len(positions)):
                for k in range(len(fields) ** 2):
                    out[positions[i], k] += integrals[i, k]
            offset += size
