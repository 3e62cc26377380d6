"""Rows of the system: integrals over near and far elements, entered in the columns of clusters."""

from collections.abc import Sequence

import numpy as np

from meeframe.plugin import Array, Indices, MeshError
from meeframe.plugin.boundary_elements import BUFFER_TOO_SMALL, NONE, Accuracy
from meeframe.plugin.surfaces import gauss_table, shape_functions, shape_table
from meeframe_hmatrix.clusters import Cluster
from meeframe_hmatrix.integrals import Integrals, Kind
from meeframe_hmatrix.kernels import (
    QuadraturePoints,
    Rows,
    Sums,
    Window,
    accumulate,
    enter,
    fill_quadrature_points,
    orders_from_box,
    sums_by_element,
)

ELEMENTS_PER_CALL = 256
"""Number of elements whose sums fit the second-level cache."""
ADAPTIVE = 128
"""Initial capacity for the points of an adaptive rule."""


def near_rows(integrals: Integrals, row_cluster: Cluster, column_clusters: Sequence[Cluster]) -> Rows:
    """Return the equations of a leaf in the columns of near leaves, side by side, by the rules of dense-bem."""
    window = column_window(integrals, column_clusters)
    out = output(integrals, row_cluster.unknowns.stop - row_cluster.unknowns.start, column_clusters)
    sums, element_groups = no_sums(integrals, window), list(integrals.elements(column_clusters))
    work_arrays: dict[Kind, QuadraturePoints] = {}
    for source in range(row_cluster.sources.start, row_cluster.sources.stop):
        position = integrals.positions[source]
        for array in sums:
            array[:] = 0.0
        for kind, elements in element_groups:
            singular, xi = _containing_elements(integrals, source, kind)
            regular = elements[~np.isin(elements, singular)]
            orders = orders_from(np.stack([position, position]), kind, regular, integrals.accuracy)
            work = work_arrays.get(kind)
            quadrature, work = quadrature_points(
                integrals, position, kind, regular, orders, np.full(orders.shape, np.nan), work
            )
            add(integrals, kind, regular, quadrature, window, sums)
            if len(singular):
                adaptive = np.zeros((len(singular), 2), np.int64)
                quadrature, work = quadrature_points(integrals, position, kind, singular, adaptive, xi, work)
                _add_singular(integrals, kind, singular, xi, quadrature, window, sums)
            work_arrays[kind] = work
        enter(integrals.fields, sums, local(integrals.rows[source], row_cluster), integrals.columns, window, out)
    return out


def orders_from(box: Array, kind: Kind, elements: Indices, accuracy: Accuracy) -> Indices:
    """Return orders (n, 2) of tensor rules valid for elements seen from anywhere in a box (2, 3), else 0."""
    orders, table = np.empty((len(elements), 2), np.int64), shape_table(kind.element)
    orders_from_box(box, elements, kind.elements, table, accuracy, gauss_table(), orders)
    return orders


def quadrature_points(
    integrals: Integrals,
    source: Array,
    kind: Kind,
    elements: Indices,
    orders: Indices,
    xi: Array,
    work: QuadraturePoints | None = None,
) -> tuple[QuadraturePoints, QuadraturePoints]:
    """Return points on elements as given by fill_quadrature_points, and their work arrays, which can be reused.

    Raises MeshError if the source lies on an element that does not contain it as a node.
    """
    required = int(np.where(orders[:, 0] > 0, orders.prod(axis=1), ADAPTIVE).sum())
    table, gauss = shape_table(kind.element), gauss_table()
    while True:
        if work is None or len(work.measures) < required or len(work.starts) <= len(elements):
            work = _work_arrays(required, len(elements), kind)
        count = fill_quadrature_points(
            source, elements, orders, xi, kind.elements, table, integrals.accuracy, gauss, work
        )
        if count >= 0:
            return QuadraturePoints(work.starts[: len(elements) + 1], *(array[:count] for array in work[1:])), work
        if count != BUFFER_TOO_SMALL:
            raise MeshError(
                f"the collocation point {np.array2string(source, precision=6)} (in units of the contact zone) lies "
                "on an element that does not hold it: the mesh overlaps itself"
            )
        required = 2 * len(work.measures)


def _work_arrays(capacity: int, n_elements: int, kind: Kind) -> QuadraturePoints:
    offsets, normals = np.empty((2, capacity, 3))
    measures, reference_weights = np.empty((2, capacity))
    weights = np.empty((capacity, kind.sites.shape[1]))
    starts = np.empty(n_elements + 1, np.int64)
    return QuadraturePoints(starts, offsets, normals, weights, measures, np.empty((capacity, 2)), reference_weights)


def add(
    integrals: Integrals, kind: Kind, elements: Indices, quadrature: QuadraturePoints, window: Window, sums: Sums
) -> None:
    """Add the integrals over elements to the sums of a source that none of them contains."""
    for first in range(0, len(elements), ELEMENTS_PER_CALL):
        chunk = elements[first : first + ELEMENTS_PER_CALL]
        starts = quadrature.starts[first : first + len(chunk) + 1]
        sums_of_elements = None
        if kind.planes is not None:
            sums_of_elements = integrals.kernel.integrate(
                quadrature.offsets, quadrature.weights, starts, kind.planes[chunk]
            )
        if sums_of_elements is None:
            sums_of_elements = _sums(integrals, quadrature, starts, quadrature.weights)
        accumulate(integrals.fields, *sums_of_elements, kind.sites[chunk], kind.patches[chunk], window, sums)


def _add_singular(
    integrals: Integrals,
    kind: Kind,
    singular: Indices,
    xi: Array,
    quadrature: QuadraturePoints,
    window: Window,
    sums: Sums,
) -> None:
    """Add the integrals over elements that contain the source at reference coordinates xi (n, 2).

    t is multiplied by N_a(x) - N_a(source), which makes the integrals regular, where it is not weakly singular.
    """
    at_source = np.repeat(shape_functions(kind.element, xi), np.diff(quadrature.starts), axis=0)
    sums_of_elements = _sums(
        integrals, quadrature, quadrature.starts, quadrature.weights - quadrature.measures[:, None] * at_source
    )
    weak = integrals.kernel.weakly_singular()
    if len(weak):
        _, unreduced = _sums(integrals, quadrature, quadrature.starts, quadrature.weights)
        sums_of_elements[1][..., weak] = unreduced[..., weak]
    accumulate(integrals.fields, *sums_of_elements, kind.sites[singular], kind.patches[singular], window, sums)


def _sums(
    integrals: Integrals, quadrature: QuadraturePoints, starts: Indices, value_weights: Array
) -> tuple[Array, Array]:
    """Return sums of u and t (m, k, f^2) over elements with points from starts[i] to starts[i + 1]."""
    used = slice(starts[0], starts[-1])
    u, t = integrals.kernel.evaluate(quadrature.offsets[used], quadrature.normals[used])
    fields, n_points = integrals.fields, len(u)
    sums = np.zeros((2, len(starts) - 1, quadrature.weights.shape[1], len(fields) ** 2))
    weights = quadrature.weights[used], value_weights[used]
    sums_by_element(fields, u.reshape(n_points, -1), t.reshape(n_points, -1), *weights, starts - starts[0], *sums)
    return sums[0], sums[1]


def _containing_elements(integrals: Integrals, source: int, kind: Kind) -> tuple[Indices, Array]:
    """Return the elements of a kind that contain a source, and its reference coordinates (n, 2) in them."""
    sources, number = integrals.sources, integrals.tree.sources[source]
    indices = np.arange(sources.singular_start[number], sources.singular_start[number + 1])
    indices = indices[sources.singular_block[indices] == kind.block]
    return sources.singular_element[indices], sources.singular_xi[indices]


def local(rows: Indices, cluster: Cluster) -> Indices:
    """Return the rows (f,) of a source relative to the first row of a cluster."""
    return np.where(rows == NONE, NONE, rows - cluster.unknowns.start)


def column_window(integrals: Integrals, column_clusters: Sequence[Cluster]) -> Window:
    """Return the columns of some clusters, side by side."""

    def side_by_side(ranges: list[slice], count: int) -> tuple[Indices, Indices]:
        numbers = np.concatenate([np.arange(indices.start, indices.stop) for indices in ranges])
        return numbers, _positions(numbers, count)

    tree = integrals.tree
    _, unknown = side_by_side([cluster.unknowns for cluster in column_clusters], len(tree.unknowns))
    _, load = side_by_side([cluster.loads for cluster in column_clusters], len(tree.loads))
    sites, site = side_by_side([cluster.sites for cluster in column_clusters], len(tree.points))
    patches = np.flatnonzero(site[integrals.patch_sites] >= 0)
    return Window(unknown, load, site, _positions(patches, len(integrals.patch_sites)), sites, patches)


def _positions(numbers: Indices, count: int) -> Indices:
    """Return the position of each of `count` numbers among `numbers`, NONE for the others."""
    positions = np.full(count, NONE)
    positions[numbers] = np.arange(len(numbers))
    return positions


def no_sums(integrals: Integrals, window: Window) -> Sums:
    """Return zero sums for a source."""
    n_entries = len(integrals.fields) ** 2
    return Sums(np.zeros((len(window.sites), n_entries)), np.zeros((len(window.patches), n_entries)))


def output(integrals: Integrals, n_rows: int, column_clusters: Sequence[Cluster]) -> Rows:
    """Return zero rows for n_rows equations in the columns of some clusters."""
    unknowns = sum(cluster.unknowns.stop - cluster.unknowns.start for cluster in column_clusters)
    loads = sum(cluster.loads.stop - cluster.loads.start for cluster in column_clusters)
    return Rows(np.zeros((n_rows, unknowns)), np.zeros((n_rows, loads)), np.zeros((n_rows, 1 + len(integrals.fields))))
