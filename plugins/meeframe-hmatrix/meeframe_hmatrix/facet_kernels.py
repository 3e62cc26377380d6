# mypy: ignore-errors
"""Kernels of the integrals over facets: orders of interpolation, weights of its points, and sums by these."""

from math import sqrt

import numpy as np
from numba import njit

from meeframe.plugin.boundary_elements import order_for


@njit(cache=True, nogil=True)
def orders_of_facet(positions, centre, axes, half, accuracy):
    """Gauss points along both axes between which kernels are interpolated; accuracy: relative to their largest value.

    They are those that integrate to its square: n points to interpolate between leave as much as n / 2 to integrate
    with. positions: (s, 3) of the sources; centre (3,), axes (2, 3), half (2,) of the rectangle.
    """
    local = (positions - centre) @ axes.T
    first = second = np.inf
    for i in range(len(positions)):
        square = 0.0
        for axis in range(3):
            square += (positions[i, axis] - centre[axis]) ** 2
        x, y = abs(local[i, 0]), abs(local[i, 1])
        z = max(0.0, square - x * x - y * y)
        beside = max(0.0, y - half[1]) ** 2 + z
        first = min(first, (sqrt((x - half[0]) ** 2 + beside) + sqrt((x + half[0]) ** 2 + beside)) / (2.0 * half[0]))
        beside = max(0.0, x - half[0]) ** 2 + z
        second = min(second, (sqrt((y - half[1]) ** 2 + beside) + sqrt((y + half[1]) ** 2 + beside)) / (2.0 * half[1]))
    tolerance, anisotropy = accuracy.tolerance**2, accuracy.anisotropy
    return order_for(first, 0, tolerance, anisotropy), order_for(second, 0, tolerance, anisotropy)


@njit(cache=True, nogil=True)
def _lagrange(nodes, x, out):
    """Fill out (n,) with the polynomials that are one at one of the nodes (n,) and zero at the others, at x."""
    for i in range(len(nodes)):
        out[i] = 1.0
        for j in range(len(nodes)):
            if j != i:
                out[i] *= (x - nodes[j]) / (nodes[i] - nodes[j])


@njit(cache=True, nogil=True)
def add_weights(points, numbers, sites, patches, centre, axes, half, first, second, values, fluxes):
    """Add integrals of shape functions times interpolating polynomials to values (s, p) and fluxes (f, p).

    points: of the rules on elements, whose nodes have the places sites and patches (e, k), negative if not wanted;
    first (m,), second (n,): the nodes of interpolation on [-1, 1], p = m n.
    """
    along, across = np.empty(len(first)), np.empty(len(second))
    for element in range(len(numbers)):
        for q in range(points.starts[element], points.starts[element + 1]):
            x = y = 0.0
            for axis in range(3):
                offset = points.offsets[q, axis] - centre[axis]
                x += offset * axes[0, axis]
                y += offset * axes[1, axis]
            _lagrange(first, x / half[0], along)
            _lagrange(second, y / half[1], across)
            for a in range(sites.shape[1]):
                site, patch, weight = sites[element, a], patches[element, a], points.weights[q, a]
                if site >= 0:
                    for i in range(len(first)):
                        for j in range(len(second)):
                            share = weight * along[i] * across[j]
                            values[site, i * len(second) + j] += share
                            fluxes[patch, i * len(second) + j] += share


@njit(cache=True, nogil=True)
def add_products(u, t, starts, weights, sites, site_starts, patches, patch_starts, sums):
    """Add weights times kernels u, t (c, 25) to the sums of nodes, facet by facet.

    Facet g has the points from starts[g] to starts[g + 1], the places of its sites and patches in the sums likewise,
    and, after those of the facets before it, weights (sites, points) and (patches, points).
    """
    at = 0
    for g in range(len(starts) - 1):
        own = slice(starts[g], starts[g + 1])
        n = starts[g + 1] - starts[g]
        for kernel, places, out in (
            (t, sites[site_starts[g] : site_starts[g + 1]], sums.values),
            (u, patches[patch_starts[g] : patch_starts[g + 1]], sums.fluxes),
        ):
            size = len(places) * n
            found = np.dot(weights[at : at + size].reshape(len(places), n), kernel[own])
            for i in range(len(places)):
                for k in range(25):
                    out[places[i], k] += found[i, k]
            at += size
