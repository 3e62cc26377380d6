"""Products of small matrices at many nodes with vectors, by the entries that are there.

Entry k, (c,) at c nodes, is that of rows[k] and columns[k]; vectors are (., c). All entries pass by once, part after
part of the nodes, whose vectors stay near the processor meanwhile.
"""

import numpy as np
from numba import njit

PART = 2048


@njit(cache=True, nogil=True)
def _multiply(entry, vector, to):
    for i in range(len(entry)):
        to[i] += entry[i] * vector[i]


@njit(cache=True, nogil=True)
def add_products(rows, columns, entries, vectors, to):
    """to += products of entries (k, c) with vectors (., c)."""
    for start in range(0, entries.shape[1], PART):
        end = start + PART
        for k in range(len(rows)):
            _multiply(entries[k, start:end], vectors[columns[k], start:end], to[rows[k], start:end])


@njit(cache=True, nogil=True)
def add_products_at(rows, columns, entries, vectors, nodes, to):
    """As add_products, of vectors (., n) of n nodes at those c of them that the entries are of, (c,)."""
    there = np.empty((vectors.shape[0], PART), vectors.dtype)
    for start in range(0, len(nodes), PART):
        end = start + PART
        some = nodes[start:end]
        for j in range(len(there)):
            vector, part = vectors[j], there[j]
            for i in range(len(some)):
                part[i] = vector[some[i]]
        for k in range(len(rows)):
            _multiply(entries[k, start:end], there[columns[k]], to[rows[k], start:end])


@njit(cache=True, nogil=True)
def spread_products(rows, columns, entries, vectors, nodes, to):
    """to (., n) of n nodes = products of entries (k, c) with vectors (., c) at c of them, (c,)."""
    here = np.empty((to.shape[0], PART), to.dtype)
    for start in range(0, len(nodes), PART):
        end = start + PART
        some = nodes[start:end]
        here[:] = 0.0
        for k in range(len(rows)):
            _multiply(entries[k, start:end], vectors[columns[k], start:end], here[rows[k]])
        for j in range(len(here)):
            out, part = to[j], here[j]
            for i in range(len(some)):
                out[some[i]] = part[i]


@njit(cache=True, nogil=True)
def spread(values, units, nodes, to):
    """to (., n) of n nodes = units (l,) times values (., c) at c of them, (c,)."""
    for j in range(len(units)):
        value, out = values[j], to[j]
        for i in range(len(nodes)):
            out[nodes[i]] = units[j] * value[i]


@njit(cache=True, nogil=True)
def turn(first, second, cosine, sine):
    """Two components along axes turned by angles, (c,) each."""
    along, across = np.empty_like(first), np.empty_like(first)
    for i in range(len(first)):
        along[i] = cosine[i] * first[i] + sine[i] * second[i]
        across[i] = cosine[i] * second[i] - sine[i] * first[i]
    return along, across
