"""Blocks of clusters that are far from each other, by cross approximation: from few of their equations."""

import numpy as np
from scipy.linalg import lstsq

from meeframe.core.fields import Array
from meeframe.core.mesh import Indices
from meeframe.formulations.dense_bem.layout import NONE
from meeframe_hmatrix.clusters import Cluster
from meeframe_hmatrix.integrals import Integrals
from meeframe_hmatrix.kernels import Rows, skeleton_rows, spread_out
from meeframe_hmatrix.rows import add, column_window, orders_from, output, placed

FIRST_SAMPLES = 16
HELD_OUT = 4


def reachable(integrals: Integrals, row: Cluster, column: Cluster) -> bool:
    """Whether tensor rules serve all elements of a column cluster from everywhere in a row cluster."""
    return all(
        orders_from(integrals, row.row_box, kind, numbers).all() for kind, numbers in integrals.elements([column])
    )


def far_block(integrals: Integrals, row: Cluster, column: Cluster, tolerance: float) -> tuple[Array, Rows]:
    """The equations of one cluster in the columns of another that is far away, as left (m, k) @ Rows of k equations.

    Cross approximation: some quadrature points of the elements give sample columns of all equations; a pivoted QR of
    them chooses k equations that the others are combinations of, and those are integrated over all elements. Points
    that are held out judge it; there are twice as many until the error there is below the tolerance.
    """
    origin, parts = np.zeros(3), []
    for kind, numbers in integrals.elements([column]):
        orders = orders_from(integrals, row.row_box, kind, numbers)
        points, _ = placed(integrals, origin, kind, numbers, orders, np.full(orders.shape, np.nan))
        parts.append((kind, numbers, points))
    positions = np.concatenate([points.offsets for _, _, points in parts])
    normals = np.concatenate([points.normals for _, _, points in parts])
    rows = integrals.rows[row.sources]
    source, field = np.nonzero(rows != NONE)
    equations = rows[source, field] - row.unknowns.start
    left, chosen = _skeleton(integrals, row, (positions, normals), (source, field), tolerance)
    window, out = column_window(integrals, [column]), output(len(chosen), [column])
    for number in np.unique(source[chosen]):
        places = np.full(5, NONE)
        mine = np.flatnonzero(source[chosen] == number)
        places[field[chosen[mine]]] = mine
        position = integrals.positions[row.sources.start + number]
        for kind, numbers, points in parts:
            add(integrals, kind, numbers, points._replace(offsets=points.offsets - position), places, window, out)
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

    points: places (c, 3) and normals (c, 3) on the elements of the columns.
    """
    places, normals = points
    positions = integrals.positions[row.sources]
    samples = FIRST_SAMPLES
    while True:
        spread = spread_out(places, row.row_box[0], row.row_box[1], samples + HELD_OUT)
        offsets = (places[spread] - positions[:, None]).reshape(-1, 3)
        at_points = np.broadcast_to(normals[spread], (len(positions), len(spread), 3)).reshape(-1, 3)
        u, t = integrals.kernel.evaluate(offsets, at_points)
        t *= float(np.sqrt((offsets**2).sum(axis=1).mean()))  # of the same unit as u
        both = np.stack([u, t]).reshape(2, len(positions), len(spread), 5, 5)[:, equations[0], :, :, equations[1]]
        sampled = both.transpose(0, 2, 1, 3).reshape(len(equations[0]), len(spread), -1)
        known = len(spread) if len(spread) < samples + HELD_OUT else samples
        left, chosen = _interpolation(sampled[:, :known].reshape(len(sampled), -1), equations[0], tolerance)
        test = sampled[:, known:].reshape(len(sampled), -1)
        if known == len(spread) or np.linalg.norm(left @ test[chosen] - test) <= tolerance * np.linalg.norm(test):
            return left, chosen
        samples *= 2


def _interpolation(sampled: Array, source: Indices, tolerance: float) -> tuple[Array, Indices]:
    """left (m, k) and k rows of a matrix (m, n), such that left times those rows is the matrix.

    source: (m,) of each row; of some sources all rows are taken.
    """
    chosen, basis = skeleton_rows(sampled.copy(), source, tolerance / 4.0 * np.linalg.norm(sampled))
    places = np.flatnonzero(np.isin(source, chosen if len(chosen) else [0]))
    parts = sampled @ basis.T
    # pivoted QR: singular values would cost most of the block
    solved = lstsq(parts[places].T, parts.T, cond=tolerance / 100.0, check_finite=False, lapack_driver="gelsy")
    left: Array = solved[0].T
    left[places] = np.eye(len(places))
    return left, places
