"""Blocks of a cluster and those far from it, by cross approximation: from few of its equations."""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import lstsq

from meeframe.core.fields import N_FIELDS, Array
from meeframe.core.mesh import Indices
from meeframe.formulations.dense_bem.layout import NONE
from meeframe_hmatrix.clusters import Cluster
from meeframe_hmatrix.integrals import Integrals
from meeframe_hmatrix.kernels import Rows, enter, skeleton_rows, spread_out
from meeframe_hmatrix.rows import add, column_window, no_sums, orders_from, output, placed

FIRST_SAMPLES = 64
"""Points that sample the columns at first."""
HELD_OUT = 4
"""One more, held out, for so many of them."""
LEAST = 1e-2
"""Columns smaller than this part of the largest, distances apart, need not be as exact as others."""


def reachable(integrals: Integrals, row: Cluster, column: Cluster) -> bool:
    """Whether tensor rules serve all elements of a column cluster from everywhere in a row cluster."""
    return all(
        orders_from(integrals, row.row_box, kind, numbers).all() for kind, numbers in integrals.elements([column])
    )


def far_rows(integrals: Integrals, row: Cluster, columns: Sequence[Cluster], tolerance: float) -> tuple[Array, Rows]:
    """The equations of one cluster in the columns of those that are far from it, side by side, as left (m, k) @ Rows.

    Cross approximation: some quadrature points of the elements give sample columns of all equations; a pivoted QR of
    them chooses k equations that the others are combinations of, and those are integrated over all elements. Points
    that are held out judge it; there are twice as many until the error there is below the tolerance.
    """
    origin, parts = np.zeros(3), []
    for kind, numbers in integrals.elements(columns):
        orders = orders_from(integrals, row.row_box, kind, numbers)
        points, _ = placed(integrals, origin, kind, numbers, orders, np.full(orders.shape, np.nan))
        parts.append((kind, numbers, points))
    places = np.concatenate([points.offsets for _, _, points in parts])
    normals = np.concatenate([points.normals for _, _, points in parts])
    rows = integrals.rows[row.sources]
    source, field = np.nonzero(rows != NONE)
    equations = rows[source, field] - row.unknowns.start
    left, chosen = _skeleton(integrals, row, (places, normals), (source, field), tolerance)
    window, out = column_window(integrals, columns), output(len(chosen), columns)
    for number in np.unique(source[chosen]):
        position, sums = integrals.positions[row.sources.start + number], no_sums(window)
        for kind, numbers, points in parts:
            add(integrals, kind, numbers, points._replace(offsets=points.offsets - position), window, sums)
        own = np.full(N_FIELDS, NONE)
        mine = np.flatnonzero(source[chosen] == number)
        own[field[chosen[mine]]] = mine
        enter(sums, own, integrals.columns, window, out)
    placed_left = np.zeros((row.unknowns.stop - row.unknowns.start, len(chosen)))
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
    positions = integrals.positions[row.sources]
    centre = row.row_box.mean(axis=0)
    samples = FIRST_SAMPLES
    while True:
        held_out = samples // HELD_OUT
        spread = spread_out(places, row.row_box[0], row.row_box[1], samples + held_out)
        offsets = (places[spread] - positions[:, None]).reshape(-1, 3)
        at_points = np.broadcast_to(normals[spread], (len(positions), len(spread), 3)).reshape(-1, 3)
        away = np.linalg.norm(places[spread] - centre, axis=1)
        both = np.stack(integrals.kernel.evaluate(offsets, at_points)).reshape(2, len(positions), -1, 5, 5)
        both *= np.stack([away, away**2])[:, None, :, None, None]
        sizes = np.sqrt(np.einsum("xspjk,xspjk->xp", both, both))
        both /= np.maximum(sizes, LEAST * sizes.max(axis=1, keepdims=True))[:, None, :, None, None]
        sampled = both.transpose(1, 2, 0, 3, 4)[equations[0], ..., equations[1]].reshape(-1, len(spread), 10)
        known = samples if len(spread) == samples + held_out else len(spread)
        left, chosen = _interpolation(sampled[:, :known].reshape(len(sampled), -1), equations[0], tolerance)
        test = sampled[:, known:].reshape(len(sampled), -1)
        if np.linalg.norm(left @ test[chosen] - test) <= tolerance * np.linalg.norm(test):
            return left, chosen
        samples *= 2


def _interpolation(sampled: Array, source: Indices, tolerance: float) -> tuple[Array, Indices]:
    """left (m, k) and k rows of a matrix (m, n), such that left times those rows is the matrix.

    source: (m,) of each row; of some sources all rows are taken.
    """
    chosen, parts = skeleton_rows(sampled.copy(), source, tolerance / 2.0 * np.linalg.norm(sampled))
    places = np.flatnonzero(np.isin(source, chosen if len(chosen) else [0]))
    # pivoted QR: singular values would cost most of the block
    solved = lstsq(parts[places].T, parts.T, cond=tolerance / 100.0, check_finite=False, lapack_driver="gelsy")
    left: Array = solved[0].T
    left[places] = np.eye(len(places))
    return left, places
