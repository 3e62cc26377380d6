"""Blocks of a cluster and those far from it by cross approximation, from few of its equations."""

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from scipy.linalg import lstsq

from meeframe.plugin import Array, Indices
from meeframe.plugin.boundary_elements import NONE, Accuracy
from meeframe_hmatrix.clusters import Cluster
from meeframe_hmatrix.facets import Facets, interpolate
from meeframe_hmatrix.integrals import Integrals, Kind
from meeframe_hmatrix.kernels import QuadraturePoints, Rows, enter
from meeframe_hmatrix.rows import add, column_window, no_sums, orders_from, output, quadrature_points
from meeframe_hmatrix.skeleton import enter_samples, farthest_points, skeleton_sources
from meeframe_hmatrix.truncation import precision

INITIAL_SAMPLES = 64
"""Initial number of points that sample the columns."""
SAMPLES_PER_TEST = 4
"""Number of samples for each additional one that tests the result."""
SOURCES_PER_CALL = 16
"""Number of sources whose kernels at the first samples fit the second-level cache."""
MIN_SKETCHED_SIZE = 1 << 18
"""Number of samples beyond which they exceed the second-level cache; random sums of them then select the equations."""
INITIAL_SKETCH_WIDTH = 256
"""Initial number of random sums that represent all columns."""
FAR_ERROR_RATIO = 3.0
"""Ratio of the errors of integrals over far and near elements.

Rules for far elements have a much smaller error in the Frobenius norm, in which the blocks have their tolerance. It
also applies where tensor rules must be valid for a block to be far."""
MIN_RELATIVE_SIZE = 1e-2
"""Relative size, apart from the distance, below which columns need not be as accurate as others."""


def has_tensor_rules(integrals: Integrals, row_cluster: Cluster, column_cluster: Cluster) -> bool:
    """Return whether tensor rules are valid for all elements of a column cluster from everywhere in a row cluster."""
    return all(
        _orders(integrals, row_cluster, kind, numbers).all() for kind, numbers in integrals.elements([column_cluster])
    )


def _orders(integrals: Integrals, row_cluster: Cluster, kind: Kind, numbers: Indices) -> Indices:
    """Return orders (n, 2) of tensor rules valid for far elements from everywhere in a row cluster, else 0."""
    return orders_from(row_cluster.row_box, kind, numbers, _accuracy(integrals))


def _accuracy(integrals: Integrals) -> Accuracy:
    """Return the accuracy of integrals over far elements."""
    return integrals.accuracy._replace(tolerance=FAR_ERROR_RATIO * integrals.accuracy.tolerance)


def _far_quadrature(
    integrals: Integrals, row_cluster: Cluster, column_clusters: Sequence[Cluster]
) -> list[tuple[Kind, Indices, QuadraturePoints]]:
    """Return points on the elements of far clusters by kinds, for all sources of a row cluster.

    Offsets are relative to the origin.
    """
    quadrature_by_kind = []
    for kind, numbers in integrals.elements(column_clusters):
        orders = _orders(integrals, row_cluster, kind, numbers)
        quadrature, _ = quadrature_points(integrals, np.zeros(3), kind, numbers, orders, np.full(orders.shape, np.nan))
        quadrature_by_kind.append((kind, numbers, quadrature))
    return quadrature_by_kind


def far_rows(
    integrals: Integrals,
    facets_of_leaves: Facets,
    row_cluster: Cluster,
    column_clusters: Sequence[Cluster],
    tolerance: float,
) -> tuple[Array, Rows]:
    """Return the equations of one cluster in the columns of those far from it, side by side, as left (m, k) @ Rows.

    Parameters
    ----------
    integrals
        Data of the integrals.
    facets_of_leaves
        Facets of all leaves.
    row_cluster
        The row cluster.
    column_clusters
        The column clusters.
    tolerance
        Relative tolerance in the Frobenius norm.

    Notes
    -----
    Some quadrature points of the elements give sample columns of all equations. A pivoted QR factorization of them
    selects k equations of which the others are combinations, and those are integrated over all elements, with few
    values of the kernel where the elements of a leaf lie in planes. Additional points test the selection; the number of
    points is doubled until the error there is below the tolerance, or none are left: then all of them test it, and all
    equations are selected if the error is above.
    """
    quadrature_by_kind = _far_quadrature(integrals, row_cluster, column_clusters)
    sample_positions = np.concatenate([quadrature.offsets for _, _, quadrature in quadrature_by_kind])
    normals = np.concatenate([quadrature.normals for _, _, quadrature in quadrature_by_kind])
    rows = integrals.rows[row_cluster.sources]
    source, field = np.nonzero(rows != NONE)
    equations = rows[source, field] - row_cluster.unknowns.start
    left, selected = _skeleton(integrals, row_cluster, (sample_positions, normals), (source, field), tolerance)
    window, out = column_window(integrals, column_clusters), output(integrals, len(selected), column_clusters)
    sources = np.unique(source[selected])
    positions = integrals.positions[row_cluster.sources.start + sources]
    leaves = [leaf for column_cluster in column_clusters for leaf in column_cluster.leaves()]
    interpolated, other_leaves = interpolate(
        integrals, leaves, facets_of_leaves, positions, row_cluster.row_box, _accuracy(integrals), window
    )
    by_element = window
    if interpolated is not None:
        quadrature_by_kind = _far_quadrature(integrals, row_cluster, other_leaves)
        by_rule = np.zeros(len(window.site), bool)
        for leaf in other_leaves:
            by_rule[leaf.sites] = True
        by_element = window._replace(site=np.where(by_rule, window.site, NONE))
    for number, position in zip(sources, positions, strict=True):
        sums = no_sums(integrals, window)
        for kind, numbers, quadrature in quadrature_by_kind:
            add(integrals, kind, numbers, quadrature._replace(offsets=quadrature.offsets - position), by_element, sums)
        if interpolated is not None:
            interpolated.add(integrals.kernel, position, sums)
        local_rows = np.full(len(integrals.fields), NONE)
        indices = np.flatnonzero(source[selected] == number)
        local_rows[field[selected[indices]]] = indices
        enter(integrals.fields, sums, local_rows, integrals.columns, window, out)
    left_rows = np.zeros((row_cluster.unknowns.stop - row_cluster.unknowns.start, len(selected)), left.dtype)
    left_rows[equations] = left
    return left_rows, out


def _skeleton(
    integrals: Integrals,
    row_cluster: Cluster,
    quadrature: tuple[Array, Array],
    equations: tuple[Indices, Indices],
    tolerance: float,
) -> tuple[Array, Indices]:
    """Return left (m, k) and k of the m equations (source, field), such that left times those is all of them.

    quadrature: positions (c, 3) and normals (c, 3) on the elements of the columns. Their columns have equal weight at
    any distance, and those of values the same as those of fluxes.
    """
    sample_positions, normals = quadrature
    source, field = equations
    n_fields = len(integrals.fields)
    rows = np.full((row_cluster.sources.stop - row_cluster.sources.start, n_fields), NONE)
    rows[source, field] = np.arange(len(source))
    centre = row_cluster.row_box.mean(axis=0)
    unscaled, sizes = np.empty((len(source), 0, 2 * n_fields), precision(tolerance)), np.empty((0, 2))
    samples = INITIAL_SAMPLES
    while True:
        n_test = samples // SAMPLES_PER_TEST
        sample_indices = farthest_points(
            sample_positions, row_cluster.row_box[0], row_cluster.row_box[1], samples + n_test
        )
        new = sample_indices[len(sizes) :]
        new_samples = np.empty((len(source), len(new), 2 * n_fields), unscaled.dtype)
        norms = _sample(
            integrals, integrals.positions[row_cluster.sources], rows, sample_positions[new], normals[new], new_samples
        )
        unscaled, sizes = np.concatenate((unscaled, new_samples), axis=1), np.concatenate((sizes, norms))
        distances = np.linalg.norm(sample_positions[sample_indices] - centre, axis=1, keepdims=True) ** [1, 2]
        factors = 1.0 / np.maximum(sizes, MIN_RELATIVE_SIZE * (distances * sizes).max(axis=0) / distances)
        sampled = unscaled * np.repeat(factors, n_fields, axis=1).astype(unscaled.dtype)
        exhausted = len(sample_indices) < samples + n_test
        n_used = len(sample_indices) if exhausted else samples
        left, selected = interpolation(sampled[:, :n_used].reshape(len(source), -1), source, tolerance)
        test = sampled[:, 0 if exhausted else n_used :].reshape(len(source), -1)
        if np.linalg.norm(left @ test[selected] - test) <= tolerance * np.linalg.norm(test):
            return left, selected
        if exhausted:
            return np.eye(len(source)), np.arange(len(source))
        samples *= 2


def _sample(
    integrals: Integrals, positions: Array, rows: Indices, sample_positions: Array, normals: Array, samples: Array
) -> Array:
    """Fill samples (m, p, 2 f) of u and t in m equations, rows (s, f) of positions (s, 3); return norms (p, 2)."""
    squares = np.zeros((len(sample_positions), 2))
    for first in range(0, len(positions), SOURCES_PER_CALL):
        group = positions[first : first + SOURCES_PER_CALL]
        offsets = (sample_positions - group[:, None]).reshape(-1, 3)
        values = integrals.kernel.evaluate(offsets, np.tile(normals, (len(group), 1)))
        u, t = (array.reshape(len(offsets), math.prod(array.shape[1:])) for array in values)  # there may be no offsets
        enter_samples(integrals.fields, u, t, rows[first : first + SOURCES_PER_CALL], samples, squares)
    norms: Array = np.sqrt(squares)
    return norms


def interpolation(sampled: Array, source: Indices, tolerance: float) -> tuple[Array, Indices]:
    """Return left (m, k) and k rows of a matrix (m, n), such that left times those rows is the matrix.

    source: (m,) of each row; all rows of the selected sources are used. Random sums of columns select them if the
    matrix is large.
    """
    source = np.ascontiguousarray(source)  # the kernel is compiled for one layout
    limit, n = tolerance / 2.0 * np.linalg.norm(sampled), sampled.shape[1]
    width, sufficient = INITIAL_SKETCH_WIDTH, False
    while not sufficient:
        is_sketch = sampled.size > MIN_SKETCHED_SIZE and width < n
        sums = sampled @ _random(n, width).astype(sampled.dtype) if is_sketch else sampled.copy()
        selected, projected, sufficient = skeleton_sources(sums, source, limit, is_sketch)
        width *= 2
    indices = np.flatnonzero(np.isin(source, selected if len(selected) else [0]))
    if is_sketch:
        basis, _ = np.linalg.qr(sampled[indices].T)
        projected = sampled @ basis
    # pivoted QR, as singular values would dominate the cost of the block
    cutoff = max(tolerance / 100.0, 8.0 * float(np.finfo(projected.dtype).eps))
    least_squares = lstsq(projected[indices].T, projected.T, cond=cutoff, check_finite=False, lapack_driver="gelsy")
    left: Array = least_squares[0].T
    left[indices] = np.eye(len(indices), dtype=left.dtype)
    return left, indices


@lru_cache(maxsize=16)
def _random(n: int, width: int) -> Array:
    """Return random vectors (n, width); products with them preserve the norm on average."""
    vectors: Array = np.random.default_rng(0).normal(size=(n, width)) / np.sqrt(width)
    return vectors
