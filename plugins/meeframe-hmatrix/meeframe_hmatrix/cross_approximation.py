"""Blocks of a cluster and those far from it by cross approximation, from few of its equations."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from scipy.linalg import lstsq

from meeframe.plugin import N_FIELDS, Array, Indices
from meeframe.plugin.boundary_elements import NONE, Accuracy
from meeframe_hmatrix.clusters import Cluster
from meeframe_hmatrix.facets import Facets, interpolate
from meeframe_hmatrix.integrals import Integrals, Kind
from meeframe_hmatrix.kernels import Points, Rows, enter
from meeframe_hmatrix.rows import add, column_window, no_sums, orders_from, output, quadrature_points
from meeframe_hmatrix.skeleton import enter_samples, skeleton_sources, spread_out
from meeframe_hmatrix.truncation import precision

FIRST_SAMPLES = 64
"""Initial number of points that sample the columns."""
SAMPLES_PER_TEST = 4
"""Number of samples for each additional one that tests the result."""
SOURCES_PER_CALL = 16
"""Number of sources whose kernels at the first samples fit the second-level cache."""
LARGE = 1 << 18
"""Number of samples beyond which they exceed the second-level cache; random sums of them then select the equations."""
FIRST_SUMS = 256
"""Initial number of random sums that represent all columns."""
FAR = 3.0
"""Ratio of the errors of integrals over far and near elements.

Rules for far elements have a much smaller error in the Frobenius norm, in which the blocks have their tolerance. It
also applies where tensor rules must be valid for a block to be far."""
MIN_SIZE = 1e-2
"""Relative size, apart from the distance, below which columns need not be as accurate as others."""


def reachable(integrals: Integrals, row: Cluster, column: Cluster) -> bool:
    """Return whether tensor rules are valid for all elements of a column cluster from everywhere in a row cluster."""
    return all(_orders(integrals, row, kind, numbers).all() for kind, numbers in integrals.elements([column]))


def _orders(integrals: Integrals, row: Cluster, kind: Kind, numbers: Indices) -> Indices:
    """Return orders (n, 2) of tensor rules valid for far elements from everywhere in a row cluster, else 0."""
    return orders_from(row.row_box, kind, numbers, _accuracy(integrals))


def _accuracy(integrals: Integrals) -> Accuracy:
    """Return the accuracy of integrals over far elements."""
    return integrals.accuracy._replace(tolerance=FAR * integrals.accuracy.tolerance)


def _far_points(integrals: Integrals, row: Cluster, columns: Sequence[Cluster]) -> list[tuple[Kind, Indices, Points]]:
    """Return points on the elements of far clusters by kinds, for all sources of a row cluster.

    Offsets are relative to the origin.
    """
    points_by_kind = []
    for kind, numbers in integrals.elements(columns):
        orders = _orders(integrals, row, kind, numbers)
        points, _ = quadrature_points(integrals, np.zeros(3), kind, numbers, orders, np.full(orders.shape, np.nan))
        points_by_kind.append((kind, numbers, points))
    return points_by_kind


def far_rows(
    integrals: Integrals, facets_of_leaves: Facets, row: Cluster, columns: Sequence[Cluster], tolerance: float
) -> tuple[Array, Rows]:
    """Return the equations of one cluster in the columns of those far from it, side by side, as left (m, k) @ Rows.

    Parameters
    ----------
    integrals
        Data of the integrals.
    facets_of_leaves
        Facets of all leaves.
    row
        The row cluster.
    columns
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
    points_by_kind = _far_points(integrals, row, columns)
    positions_of_points = np.concatenate([points.offsets for _, _, points in points_by_kind])
    normals = np.concatenate([points.normals for _, _, points in points_by_kind])
    rows = integrals.rows[row.sources]
    source, field = np.nonzero(rows != NONE)
    equations = rows[source, field] - row.unknowns.start
    left, selected = _skeleton(integrals, row, (positions_of_points, normals), (source, field), tolerance)
    window, out = column_window(integrals, columns), output(len(selected), columns)
    sources = np.unique(source[selected])
    positions = integrals.positions[row.sources.start + sources]
    leaves = [leaf for column in columns for leaf in column.leaves()]
    smooth, others = interpolate(
        integrals, leaves, facets_of_leaves, positions, row.row_box, _accuracy(integrals), window
    )
    by_element = window
    if smooth is not None:
        points_by_kind, by_rule = _far_points(integrals, row, others), np.zeros(len(window.site), bool)
        for leaf in others:
            by_rule[leaf.sites] = True
        by_element = window._replace(site=np.where(by_rule, window.site, NONE))
    for number, position in zip(sources, positions, strict=True):
        sums = no_sums(window)
        for kind, numbers, points in points_by_kind:
            add(integrals, kind, numbers, points._replace(offsets=points.offsets - position), by_element, sums)
        if smooth is not None:
            smooth.add(integrals.kernel, position, sums)
        local_rows = np.full(N_FIELDS, NONE)
        indices = np.flatnonzero(source[selected] == number)
        local_rows[field[selected[indices]]] = indices
        enter(sums, local_rows, integrals.columns, window, out)
    left_rows = np.zeros((row.unknowns.stop - row.unknowns.start, len(selected)), left.dtype)
    left_rows[equations] = left
    return left_rows, out


def _skeleton(
    integrals: Integrals,
    row: Cluster,
    points: tuple[Array, Array],
    equations: tuple[Indices, Indices],
    tolerance: float,
) -> tuple[Array, Indices]:
    """Return left (m, k) and k of the m equations (source, field), such that left times those is all of them.

    points: positions (c, 3) and normals (c, 3) on the elements of the columns. Their columns have equal weight at any
    distance, and those of values the same as those of fluxes.
    """
    positions_of_points, normals = points
    source, field = equations
    rows = np.full((row.sources.stop - row.sources.start, N_FIELDS), NONE)
    rows[source, field] = np.arange(len(source))
    centre = row.row_box.mean(axis=0)
    raw, sizes = np.empty((len(source), 0, 2 * N_FIELDS), precision(tolerance)), np.empty((0, 2))
    samples = FIRST_SAMPLES
    while True:
        n_test = samples // SAMPLES_PER_TEST
        spread = spread_out(positions_of_points, row.row_box[0], row.row_box[1], samples + n_test)
        new = spread[len(sizes) :]
        new_samples = np.empty((len(source), len(new), 2 * N_FIELDS), raw.dtype)
        norms = _sample(
            integrals, integrals.positions[row.sources], rows, positions_of_points[new], normals[new], new_samples
        )
        raw, sizes = np.concatenate((raw, new_samples), axis=1), np.concatenate((sizes, norms))
        distances = np.linalg.norm(positions_of_points[spread] - centre, axis=1, keepdims=True) ** [1, 2]
        factors = 1.0 / np.maximum(sizes, MIN_SIZE * (distances * sizes).max(axis=0) / distances)
        sampled = raw * np.repeat(factors, N_FIELDS, axis=1).astype(raw.dtype)
        exhausted = len(spread) < samples + n_test
        n_used = len(spread) if exhausted else samples
        left, selected = interpolation(sampled[:, :n_used].reshape(len(source), -1), source, tolerance)
        test = sampled[:, 0 if exhausted else n_used :].reshape(len(source), -1)
        if np.linalg.norm(left @ test[selected] - test) <= tolerance * np.linalg.norm(test):
            return left, selected
        if exhausted:
            return np.eye(len(source)), np.arange(len(source))
        samples *= 2


def _sample(
    integrals: Integrals, positions: Array, rows: Indices, positions_of_points: Array, normals: Array, samples: Array
) -> Array:
    """Fill samples (m, p, 10) of u and t in m equations, rows (s, 5) of the positions (s, 3); return norms (p, 2)."""
    squares = np.zeros((len(positions_of_points), 2))
    for first in range(0, len(positions), SOURCES_PER_CALL):
        group = positions[first : first + SOURCES_PER_CALL]
        offsets = (positions_of_points - group[:, None]).reshape(-1, 3)
        u, t = integrals.kernel.evaluate(offsets, np.tile(normals, (len(group), 1)))
        local_rows = rows[first : first + SOURCES_PER_CALL]
        enter_samples(u.reshape(-1, 25), t.reshape(-1, 25), local_rows, samples, squares)
    norms: Array = np.sqrt(squares)
    return norms


def interpolation(sampled: Array, source: Indices, tolerance: float) -> tuple[Array, Indices]:
    """Return left (m, k) and k rows of a matrix (m, n), such that left times those rows is the matrix.

    source: (m,) of each row; all rows of the selected sources are used. Random sums of columns select them if the
    matrix is large.
    """
    source = np.ascontiguousarray(source)  # the kernel is compiled for one layout
    limit, n, width, sufficient = tolerance / 2.0 * np.linalg.norm(sampled), sampled.shape[1], FIRST_SUMS, False
    while not sufficient:
        mean = sampled.size > LARGE and width < n
        sums = sampled @ _random(n, width).astype(sampled.dtype) if mean else sampled.copy()
        selected, projected, sufficient = skeleton_sources(sums, source, limit, mean)
        width *= 2
    indices = np.flatnonzero(np.isin(source, selected if len(selected) else [0]))
    if mean:
        basis, _ = np.linalg.qr(sampled[indices].T)
        projected = sampled @ basis
    # pivoted QR, as singular values would dominate the cost of the block
    cutoff = max(tolerance / 100.0, 8.0 * float(np.finfo(projected.dtype).eps))
    solved = lstsq(projected[indices].T, projected.T, cond=cutoff, check_finite=False, lapack_driver="gelsy")
    left: Array = solved[0].T
    left[indices] = np.eye(len(indices), dtype=left.dtype)
    return left, indices


@lru_cache(maxsize=16)
def _random(n: int, width: int) -> Array:
    """Return random vectors (n, width); products with them preserve the norm on average."""
    vectors: Array = np.random.default_rng(0).normal(size=(n, width)) / np.sqrt(width)
    return vectors
