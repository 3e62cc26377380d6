"""Products of small matrices at many nodes with vectors, by their nonzero entries.

Entry k, (c,) at c nodes, belongs to row rows[k] and column columns[k]; vectors are (., c). The nodes are processed in
parts, all entries of a part in turn, so that the vectors of the part stay in cache.
"""

import numpy as np
from numba import njit

BLOCK_SIZE = 2048


@njit(cache=True, nogil=True)
def _multiply(entry, vector, to):
    for i in range(len(entry)):
        to[i] += entry[i] * vector[i]


@njit(cache=True, nogil=True)
def add_products(rows, columns, entries, vectors, to):
    """Add to `to` the products of the entries (k, c) with vectors (., c)."""
    for start in range(0, entries.shape[1], BLOCK_SIZE):
        end = start + BLOCK_SIZE
        for k in range(len(rows)):
            _multiply(entries[k, start:end], vectors[columns[k], start:end], to[rows[k], start:end])


@njit(cache=True, nogil=True)
def add_products_at(rows, columns, entries, vectors, nodes, to):
    """Add to `to` the products of the entries (k, c) with vectors (., n) taken at c of the n nodes, numbered (c,)."""
    gathered = np.empty((vectors.shape[0], BLOCK_SIZE), vectors.dtype)
    for start in range(0, len(nodes), BLOCK_SIZE):
        end = start + BLOCK_SIZE
        block = nodes[start:end]
        for j in range(len(gathered)):
            vector, values = vectors[j], gathered[j]
            for i in range(len(block)):
                values[i] = vector[block[i]]
        for k in range(len(rows)):
            _multiply(entries[k, start:end], gathered[columns[k]], to[rows[k], start:end])


@njit(cache=True, nogil=True)
def scatter_products(rows, columns, entries, vectors, nodes, to):
    """Set `to` (., n) at c of the n nodes, numbered (c,), to the products of the entries (k, c) with vectors (., c)."""
    products = np.empty((to.shape[0], BLOCK_SIZE), to.dtype)
    for start in range(0, len(nodes), BLOCK_SIZE):
        end = start + BLOCK_SIZE
        block = nodes[start:end]
        products[:] = 0.0
        for k in range(len(rows)):
            _multiply(entries[k, start:end], vectors[columns[k], start:end], products[rows[k]])
        for j in range(len(products)):
            out, values = to[j], products[j]
            for i in range(len(block)):
                out[block[i]] = values[i]


@njit(cache=True, nogil=True)
def scatter(values, units, nodes, to):
    """Set `to` (., n) at c of the n nodes, numbered (c,), to the units (l,) times the values (., c)."""
    for j in range(len(units)):
        value, out = values[j], to[j]
        for i in range(len(nodes)):
            out[nodes[i]] = units[j] * value[i]


@njit(cache=True, nogil=True)
def rotate(first, second, cosine, sine):
    """Return two components (c,) along axes rotated by the angles of these cosines and sines (c,)."""
    along, across = np.empty_like(first), np.empty_like(first)
    for i in range(len(first)):
        along[i] = cosine[i] * first[i] + sine[i] * second[i]
        across[i] = cosine[i] * second[i] - sine[i] * first[i]
    return along, across
