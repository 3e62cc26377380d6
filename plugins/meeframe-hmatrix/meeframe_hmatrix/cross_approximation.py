"""Blocks of a cluster and those far from it, by cross approximation: from few of its equations."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from scipy.linalg import lstsq

from meeframe.plugin import N_FIELDS, Array, Indices
from meeframe.plugin.boundary_elements import NONE, Accuracy
from meeframe_hmatrix.clusters import Cluster
from meeframe_hmatrix.facets import Facets, interpolated
from meeframe_hmatrix.integrals import Integrals, Kind
from meeframe_hmatrix.kernels import Points, Rows, enter
from meeframe_hmatrix.rows import add, column_window, no_sums, orders_from, output, placed
from meeframe_hmatrix.skeleton import enter_samples, skeleton_sources, spread_out
from meeframe_hmatrix.truncation import precision

FIRST_SAMPLES = 64
"""Points that sample the columns at first."""
HELD_OUT = 4
"""One more, held out, for so many of them."""
SOURCES_PER_CALL = 16
"""Their kernels at the first samples fit the second-level cache."""
LARGE = 1 << 18
"""More samples than that leave the second-level cache; random sums of them then show which equations are chosen."""
FIRST_SUMS = 256
"""Random sums of columns that stand for all of them at first."""
FAR = 3.0
"""Error of an integral over a far element in terms of that over a near one: rules for it err by far less in the
Frobenius norm, in which the blocks have their tolerance. It counts where tensor rules must serve for a block to be far,
too."""
LEAST = 1e-2
"""Columns smaller than this part of the largest, distances apart, need not be as exact as others."""


def reachable(integrals: Integrals, row: Cluster, column: Cluster) -> bool:
    """Return True if tensor rules serve all elements of a column cluster from everywhere in a row cluster."""
    return all(_orders(integrals, row, kind, numbers).all() for kind, numbers in integrals.elements([column]))


def _orders(integrals: Integrals, row: Cluster, kind: Kind, numbers: Indices) -> Indices:
    """Orders (n, 2) of tensor rules that serve far elements from everywhere in a row cluster, 0 where none does."""
    return orders_from(row.row_box, kind, numbers, _accuracy(integrals))


def _accuracy(integrals: Integrals) -> Accuracy:
    """Of integrals over far elements."""
    return integrals.accuracy._replace(tolerance=FAR * integrals.accuracy.tolerance)


def _placed(integrals: Integrals, row: Cluster, columns: Sequence[Cluster]) -> list[tuple[Kind, Indices, Points]]:
    """Points on the elements of far clusters by kinds, for all sources of a row cluster; offsets from the origin."""
    parts = []
    for kind, numbers in integrals.elements(columns):
        orders = _orders(integrals, row, kind, numbers)
        points, _ = placed(integrals, np.zeros(3), kind, numbers, orders, np.full(orders.shape, np.nan))
        parts.append((kind, numbers, points))
    return parts


def far_rows(
    integrals: Integrals, known: Facets, row: Cluster, columns: Sequence[Cluster], tolerance: float
) -> tuple[Array, Rows]:
    """The equations of one cluster in the columns of those that are far from it, side by side, as left (m, k) @ Rows.

    Cross approximation: some quadrature points of the elements give sample columns of all equations; a pivoted QR of
    them chooses k equations that the others are combinations of, and those are integrated over all elements, by few
    values of the kernel where the elements of a leaf lie in planes. Points that are held out judge the choice; there
    are twice as many until the error there is below the tolerance, or none are left: then all of them judge it, and it
    is all equations if the error is above. known: the plane parts of all leaves.
    """
    parts = _placed(integrals, row, columns)
    places = np.concatenate([points.offsets for _, _, points in parts])
    normals = np.concatenate([points.normals for _, _, points in parts])
    rows = integrals.rows[row.sources]
    source, field = np.nonzero(rows != NONE)
    equations = rows[source, field] - row.unknowns.start
    left, chosen = _skeleton(integrals, row, (places, normals), (source, field), tolerance)
    window, out = column_window(integrals, columns), output(len(chosen), columns)
    sources = np.unique(source[chosen])
    positions = integrals.positions[row.sources.start + sources]
    leaves = [leaf for column in columns for leaf in column.leaves()]
    smooth, others = interpolated(integrals, leaves, known, positions, row.row_box, _accuracy(integrals), window)
    by_element = window
    if smooth is not None:
        parts, there = _placed(integrals, row, others), np.zeros(len(window.site), bool)
        for leaf in others:
            there[leaf.sites] = True
        by_element = window._replace(site=np.where(there, window.site, NONE))
    for number, position in zip(sources, positions, strict=True):
        sums = no_sums(window)
        for kind, numbers, points in parts:
            add(integrals, kind, numbers, points._replace(offsets=points.offsets - position), by_element, sums)
        if smooth is not None:
            smooth.add(integrals.kernel, position, sums)
        own = np.full(N_FIELDS, NONE)
        mine = np.flatnonzero(source[chosen] == number)
        own[field[chosen[mine]]] = mine
        enter(sums, own, integrals.columns, window, out)
    placed_left = np.zeros((row.unknowns.stop - row.unknowns.start, len(chosen)), left.dtype)
    placed_left[equations] = left
    return placed_left, out


def _skeleton(
    integrals: Integrals,
    row: Cluster,
    points: tuple[Array, Array],
    equations: tuple[Indices, Indices],
    tolerance: float,
) -> tuple[Array, Indices]:
    """left (m, k) and k of the m equations (source, field), such that left times those is all of them.

    points: places (c, 3) and normals (c, 3) on the elements of the columns. Their columns count alike at any distance,
    and those of values like those of fluxes.
    """
    places, normals = points
    source, field = equations
    rows = np.full((row.sources.stop - row.sources.start, N_FIELDS), NONE)
    rows[source, field] = np.arange(len(source))
    centre = row.row_box.mean(axis=0)
    raw, sizes = np.empty((len(source), 0, 2 * N_FIELDS), precision(tolerance)), np.empty((0, 2))
    samples = FIRST_SAMPLES
    while True:
        held_out = samples // HELD_OUT
        spread = spread_out(places, row.row_box[0], row.row_box[1], samples + held_out)
        new = spread[len(sizes) :]
        more = np.empty((len(source), len(new), 2 * N_FIELDS), raw.dtype)
        norms = _samples(integrals, integrals.positions[row.sources], rows, places[new], normals[new], more)
        raw, sizes = np.concatenate((raw, more), axis=1), np.concatenate((sizes, norms))
        away = np.linalg.norm(places[spread] - centre, axis=1, keepdims=True) ** [1, 2]
        factors = 1.0 / np.maximum(sizes, LEAST * (away * sizes).max(axis=0) / away)
        sampled = raw * np.repeat(factors, N_FIELDS, axis=1).astype(raw.dtype)
        exhausted = len(spread) < samples + held_out
        known = len(spread) if exhausted else samples
        left, chosen = interpolation(sampled[:, :known].reshape(len(source), -1), source, tolerance)
        test = sampled[:, 0 if exhausted else known :].reshape(len(source), -1)
        if np.linalg.norm(left @ test[chosen] - test) <= tolerance * np.linalg.norm(test):
            return left, chosen
        if exhausted:
            return np.eye(len(source)), np.arange(len(source))
        samples *= 2


def _samples(
    integrals: Integrals, positions: Array, rows: Indices, places: Array, normals: Array, samples: Array
) -> Array:
    """Fill samples (m, p, 10) of u and t in m equations, rows (s, 5) of the positions (s, 3); their norms (p, 2)."""
    squares = np.zeros((len(places), 2))
    for first in range(0, len(positions), SOURCES_PER_CALL):
        part = positions[first : first + SOURCES_PER_CALL]
        offsets = (places - part[:, None]).reshape(-1, 3)
        u, t = integrals.kernel.evaluate(offsets, np.tile(normals, (len(part), 1)))
        own = rows[first : first + SOURCES_PER_CALL]
        enter_samples(u.reshape(-1, 25), t.reshape(-1, 25), own, samples, squares)
    norms: Array = np.sqrt(squares)
    return norms


def interpolation(sampled: Array, source: Indices, tolerance: float) -> tuple[Array, Indices]:
    """left (m, k) and k rows of a matrix (m, n), such that left times those rows is the matrix.

    source: (m,) of each row; of some sources all rows are taken. Random sums of columns show which, if the matrix is
    large.
    """
    limit, n, width, enough = tolerance / 2.0 * np.linalg.norm(sampled), sampled.shape[1], FIRST_SUMS, False
    while not enough:
        mean = sampled.size > LARGE and width < n
        sums = sampled @ _random(n, width).astype(sampled.dtype) if mean else sampled.copy()
        chosen, parts, enough = skeleton_sources(sums, source, limit, mean)
        width *= 2
    places = np.flatnonzero(np.isin(source, chosen if len(chosen) else [0]))
    if mean:
        basis, _ = np.linalg.qr(sampled[places].T)
        parts = sampled @ basis
    # pivoted QR: singular values would cost most of the block
    least = max(tolerance / 100.0, 8.0 * float(np.finfo(parts.dtype).eps))
    solved = lstsq(parts[places].T, parts.T, cond=least, check_finite=False, lapack_driver="gelsy")
    left: Array = solved[0].T
    left[places] = np.eye(len(places), dtype=left.dtype)
    return left, places


@lru_cache(maxsize=16)
def _random(n: int, width: int) -> Array:
    """Random vectors (n, width); the norm of what they are multiplied with is kept in the mean."""
    found: Array = np.random.default_rng(0).normal(size=(n, width)) / np.sqrt(width)
    return found
