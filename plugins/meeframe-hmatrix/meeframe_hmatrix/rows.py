"""Rows of the system: integrals over elements near and far, entered in the columns of clusters."""

from collections.abc import Sequence

import numpy as np

from meeframe.plugin import N_FIELDS, Array, Indices, MeshError
from meeframe.plugin.boundary_elements import BUFFER_TOO_SMALL, NONE, Accuracy
from meeframe.plugin.surfaces import gauss_table, shape_functions, shape_table
from meeframe_hmatrix.clusters import Cluster
from meeframe_hmatrix.integrals import Integrals, Kind
from meeframe_hmatrix.kernels import (
    Points,
    Rows,
    Sums,
    Window,
    accumulate,
    element_points,
    enter,
    orders_from_box,
    sums_by_element,
)

ELEMENTS_PER_CALL = 256
"""Their sums fit the second-level cache."""
ADAPTIVE = 128
"""Room at first for the points of an adaptive rule."""


def near_rows(integrals: Integrals, row: Cluster, near: Sequence[Cluster]) -> Rows:
    """The equations of a leaf in the columns of near leaves, side by side, by the rules of dense-bem."""
    window, out = column_window(integrals, near), output(row.unknowns.stop - row.unknowns.start, near)
    sums, kinds = no_sums(window), list(integrals.elements(near))
    rooms: dict[Kind, Points] = {}
    for source in range(row.sources.start, row.sources.stop):
        position = integrals.positions[source]
        for part in sums:
            part[:] = 0.0
        for kind, numbers in kinds:
            own, places = _own(integrals, source, kind)
            others = numbers[~np.isin(numbers, own)]
            orders = orders_from(np.stack([position, position]), kind, others, integrals.accuracy)
            room = rooms.get(kind)
            points, room = placed(integrals, position, kind, others, orders, np.full(orders.shape, np.nan), room)
            add(integrals, kind, others, points, window, sums)
            if len(own):
                adaptive = np.zeros((len(own), 2), np.int64)
                points, room = placed(integrals, position, kind, own, adaptive, places, room)
                _add_own(integrals, kind, own, places, points, window, sums)
            rooms[kind] = room
        enter(sums, local(integrals.rows[source], row), integrals.columns, window, out)
    return out


def orders_from(box: Array, kind: Kind, numbers: Indices, accuracy: Accuracy) -> Indices:
    """Orders (n, 2) of tensor rules that serve elements seen from anywhere in a box (2, 3), 0 where none does."""
    orders, table = np.empty((len(numbers), 2), np.int64), shape_table(kind.element)
    orders_from_box(box, numbers, kind.elements, table, accuracy, gauss_table(), orders)
    return orders


def placed(
    integrals: Integrals,
    source: Array,
    kind: Kind,
    numbers: Indices,
    orders: Indices,
    places: Array,
    room: Points | None = None,
) -> tuple[Points, Points]:
    """Points on elements as element_points gives them, and the room that they are in, which may be filled again.

    Raises MeshError if the source lies on an element that does not hold it.
    """
    needed = int(np.where(orders[:, 0] > 0, orders.prod(axis=1), ADAPTIVE).sum())
    table, gauss = shape_table(kind.element), gauss_table()
    while True:
        if room is None or len(room.measures) < needed or len(room.starts) <= len(numbers):
            room = _room(needed, len(numbers), kind)
        count = element_points(source, numbers, orders, places, kind.elements, table, integrals.accuracy, gauss, room)
        if count >= 0:
            return Points(room.starts[: len(numbers) + 1], *(part[:count] for part in room[1:])), room
        if count != BUFFER_TOO_SMALL:
            raise MeshError(
                f"the collocation point {np.array2string(source, precision=6)} (in units of the contact zone) lies "
                "on an element that does not hold it: the mesh overlaps itself"
            )
        needed = 2 * len(room.measures)


def _room(capacity: int, n_elements: int, kind: Kind) -> Points:
    offsets, normals = np.empty((2, capacity, 3))
    measures, reference_weights = np.empty((2, capacity))
    weights = np.empty((capacity, kind.sites.shape[1]))
    starts = np.empty(n_elements + 1, np.int64)
    return Points(starts, offsets, normals, weights, measures, np.empty((capacity, 2)), reference_weights)


def add(integrals: Integrals, kind: Kind, numbers: Indices, points: Points, window: Window, sums: Sums) -> None:
    """Add the integrals over elements to the sums of a source that none of them holds."""
    for first in range(0, len(numbers), ELEMENTS_PER_CALL):
        part = numbers[first : first + ELEMENTS_PER_CALL]
        starts = points.starts[first : first + len(part) + 1]
        found = None
        if kind.planes is not None:
            found = integrals.kernel.integrate(points.offsets, points.weights, starts, kind.planes[part])
        if found is None:
            found = _summed(integrals, points, starts, points.weights)
        accumulate(*found, kind.sites[part], kind.patches[part], window, sums)


def _add_own(
    integrals: Integrals, kind: Kind, own: Indices, places: Array, points: Points, window: Window, sums: Sums
) -> None:
    """As add for elements that hold the source at places (n, 2): t times N_a(x) - N_a(source), which is integrable."""
    at_source = np.repeat(shape_functions(kind.element, places), np.diff(points.starts), axis=0)
    found = _summed(integrals, points, points.starts, points.weights - points.measures[:, None] * at_source)
    accumulate(*found, kind.sites[own], kind.patches[own], window, sums)


def _summed(integrals: Integrals, points: Points, starts: Indices, value_weights: Array) -> tuple[Array, Array]:
    """Sums of u and t (m, k, 25) over elements with points from starts[i] to starts[i + 1]."""
    own = slice(starts[0], starts[-1])
    u, t = integrals.kernel.evaluate(points.offsets[own], points.normals[own])
    sums = np.zeros((2, len(starts) - 1, points.weights.shape[1], 25))
    weights = points.weights[own], value_weights[own]
    sums_by_element(u.reshape(-1, 25), t.reshape(-1, 25), *weights, starts - starts[0], *sums)
    return sums[0], sums[1]


def _own(integrals: Integrals, source: int, kind: Kind) -> tuple[Indices, Array]:
    """Elements of a kind that hold a source, and its places (n, 2) in them."""
    sources, number = integrals.sources, integrals.tree.sources[source]
    held = np.arange(sources.singular_start[number], sources.singular_start[number + 1])
    held = held[sources.singular_block[held] == kind.block]
    return sources.singular_element[held], sources.singular_xi[held]


def local(rows: Indices, cluster: Cluster) -> Indices:
    """Rows (5,) of a source counted from the first of a cluster."""
    return np.where(rows == NONE, NONE, rows - cluster.unknowns.start)


def column_window(integrals: Integrals, clusters: Sequence[Cluster]) -> Window:
    """The columns of some clusters, side by side."""

    def side_by_side(parts: list[slice], count: int) -> tuple[Indices, Indices]:
        numbers = np.concatenate([np.arange(part.start, part.stop) for part in parts])
        return numbers, _places(numbers, count)

    tree = integrals.tree
    _, unknown = side_by_side([cluster.unknowns for cluster in clusters], len(tree.unknowns))
    _, load = side_by_side([cluster.loads for cluster in clusters], len(tree.loads))
    sites, site = side_by_side([cluster.sites for cluster in clusters], len(tree.points))
    patches = np.flatnonzero(site[integrals.patch_sites] >= 0)
    return Window(unknown, load, site, _places(patches, len(integrals.patch_sites)), sites, patches)


def _places(numbers: Indices, count: int) -> Indices:
    """The place of each of count numbers among some of them, NONE for the others."""
    places = np.full(count, NONE)
    places[numbers] = np.arange(len(numbers))
    return places


def no_sums(window: Window) -> Sums:
    """Room for the sums of a source, zero."""
    return Sums(np.zeros((len(window.sites), N_FIELDS**2)), np.zeros((len(window.patches), N_FIELDS**2)))


def output(n_rows: int, clusters: Sequence[Cluster]) -> Rows:
    """Zeros for n_rows equations in the columns of some clusters."""
    unknowns = sum(cluster.unknowns.stop - cluster.unknowns.start for cluster in clusters)
    loads = sum(cluster.loads.stop - cluster.loads.start for cluster in clusters)
    return Rows(np.zeros((n_rows, unknowns)), np.zeros((n_rows, loads)), np.zeros((n_rows, 1 + N_FIELDS)))
