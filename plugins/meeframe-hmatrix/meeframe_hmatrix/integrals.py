"""Near and far parts of the collocated system: the quadrature of dense-bem, and cross approximation."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lstsq, qr

from meeframe.core.element import shape_derivatives, shape_functions
from meeframe.core.errors import MeshError
from meeframe.core.fields import N_FIELDS, Array
from meeframe.core.fundamental import Kernel
from meeframe.core.mesh import ElementBlock, Indices, SurfaceMesh
from meeframe.elements.quadrature import element_extents, gauss_table, shape_table
from meeframe.formulations.dense_bem.collocation import Sources
from meeframe.formulations.dense_bem.layout import NONE, Layout
from meeframe.kernels.assembly import Accuracy
from meeframe.kernels.quadrature import BUFFER_TOO_SMALL, shape_degree, tensor_rule
from meeframe_hmatrix.clusters import Cluster, ClusterTree, inverse
from meeframe_hmatrix.kernels import (
    Columns,
    Points,
    Rows,
    Rules,
    Window,
    accumulate,
    orders_from_box,
    orders_from_point,
    refined_points,
    spread_out,
    tabulated_points,
)

TABULATED_ORDERS = (2, 3, 4, 5, 6, 8, 10, 12)
FIRST_SAMPLES = 24
HELD_OUT = 4


@dataclass(frozen=True, eq=False)
class Integrals:
    """What every task reads; sources, rows and columns in the order of the tree.

    positions: (s, 3) of the collocation points; rows: (s, 5) of their equations, NONE where there is none; sources: the
    rest of them, in the order of `tree.sources`; first_element: (b + 1,) of each block of the mesh in the numbering of
    all elements; touching: elements at each site, starts (sites + 1,) and elements.
    """

    mesh: SurfaceMesh
    tree: ClusterTree
    sources: Sources
    kernel: Kernel
    accuracy: Accuracy
    positions: Array
    rows: Indices
    columns: Columns
    rules: Rules
    first_element: Indices
    touching: tuple[Indices, Indices]

    def elements(self, cluster: Cluster) -> Indices:
        """The elements that touch the sites of a cluster, rising."""
        starts, elements = self.touching
        return np.unique(elements[starts[cluster.sites.start] : starts[cluster.sites.stop]])


def prepare(
    mesh: SurfaceMesh, layout: Layout, sources: Sources, tree: ClusterTree, kernel: Kernel, accuracy: Accuracy
) -> Integrals:
    """Tables of rules and columns. mesh: in units of the system."""
    sizes = [len(block.connectivity) for block in mesh.blocks]
    rows = sources.row[tree.sources]
    rows = np.where(rows == NONE, NONE, tree.unknown_rank[rows])
    columns = _columns(mesh, layout, tree)
    site, element = columns.sites.ravel(), np.repeat(np.arange(sum(sizes)), columns.sites.shape[1])
    order = np.argsort(site, kind="stable")[np.count_nonzero(site < 0) :]
    starts = np.searchsorted(site[order], np.arange(len(mesh.points) + 1))
    return Integrals(
        mesh,
        tree,
        sources,
        kernel,
        accuracy,
        sources.position[tree.sources],
        rows,
        columns,
        _rules(mesh, accuracy.tolerance),
        np.concatenate([[0], np.cumsum(sizes)]),
        (starts, element[order]),
    )


def flux_unit(mesh: SurfaceMesh) -> float:
    """The unit of unknown fluxes that makes their coefficients as large as those of values, at the body's own distance.

    Truncation sees both in one block; without it the values would be left to the round-off of the fluxes.
    """
    return float(1.0 / np.ptp(mesh.points, axis=0).max())


def _columns(mesh: SurfaceMesh, layout: Layout, tree: ClusterTree) -> Columns:
    width = max(block.connectivity.shape[1] for block in mesh.blocks)

    def padded(parts: Sequence[Indices]) -> Indices:
        full = [np.pad(part, ((0, 0), (0, width - part.shape[1])), constant_values=NONE) for part in parts]
        return np.concatenate(full).astype(np.int64)

    def ranked(numbers: Indices, rank: Indices) -> Indices:
        return np.where(numbers == NONE, NONE, rank[numbers]) if len(rank) else numbers

    return Columns(
        padded([tree.rank[block.connectivity] for block in mesh.blocks]),
        padded(layout.patches.connectivity),
        ranked(layout.value_column, tree.unknown_rank)[tree.points],
        layout.value_data[tree.points],
        ranked(layout.flux_column, tree.unknown_rank),
        layout.flux_data,
        ranked(layout.load_column, inverse(tree.loads)),
        flux_unit(mesh),
    )


def _rules(mesh: SurfaceMesh, tolerance: float) -> Rules:
    """Tensor rules of the tabulated orders on all elements."""
    n_elements, width = mesh.n_elements, max(block.connectivity.shape[1] for block in mesh.blocks)
    starts = np.full((n_elements, max(TABULATED_ORDERS) + 1), -1)
    extents, degrees, tables = [], [], []
    first = row = 0
    for block in mesh.blocks:
        count = len(block.connectivity)
        extents.append(element_extents(block.element, mesh.points[block.connectivity], tolerance))
        degrees.append(np.full(count, shape_degree(shape_table(block.element))))
        for order in TABULATED_ORDERS:
            starts[first : first + count, order] = row + order**2 * np.arange(count)
            tables.append(_tensor_rules(block, mesh.points, order, width))
            row += order**2 * count
        first += count
    positions, normals, weights = (np.concatenate(part) for part in zip(*tables, strict=True))
    return Rules(
        np.concatenate([part.centres for part in extents]),
        np.concatenate([part.sizes for part in extents]),
        np.concatenate([part.least_orders for part in extents]),
        np.concatenate(degrees),
        starts,
        positions,
        normals,
        weights,
    )


def _tensor_rules(block: ElementBlock, points: Array, order: int, width: int) -> tuple[Array, Array, Array]:
    """Positions, normals (e * order^2, 3) and shape functions times measure (e * order^2, width) on all elements."""
    xi, weights = np.empty((order**2, 2)), np.empty(order**2)
    tensor_rule(order, block.element.reference == "triangle", gauss_table(), xi, weights)
    nodes = points[block.connectivity]
    shapes = shape_functions(block.element, xi)
    tangents = np.einsum("qak,eax->eqkx", shape_derivatives(block.element, xi), nodes)
    areas = np.cross(tangents[:, :, 0], tangents[:, :, 1])
    ratios = np.linalg.norm(areas, axis=2)
    shape_weights = np.zeros((*ratios.shape, width))
    shape_weights[..., : shapes.shape[1]] = shapes * (ratios * weights)[:, :, None]
    positions = np.einsum("qa,eax->eqx", shapes, nodes)
    return positions.reshape(-1, 3), (areas / ratios[:, :, None]).reshape(-1, 3), shape_weights.reshape(-1, width)


def reachable(integrals: Integrals, row: Cluster, column: Cluster) -> bool:
    """Whether tabulated rules serve all elements of a column cluster from everywhere in a row cluster."""
    return bool(_orders(integrals, row, integrals.elements(column)).all())


def near_rows(integrals: Integrals, row: Cluster, near: Sequence[Cluster]) -> Rows:
    """The equations of a leaf in the columns of near leaves, side by side, by the rules of dense-bem."""
    elements = np.unique(np.concatenate([integrals.elements(column) for column in near]))
    window, out = column_window(integrals, near), _output(row.unknowns.stop - row.unknowns.start, near)
    points = _room(integrals, 4096)
    orders = np.empty(len(elements), np.int64)
    accuracy = integrals.accuracy
    for source in range(row.sources.start, row.sources.stop):
        position = integrals.positions[source]
        orders_from_point(position, elements, integrals.rules, accuracy.tolerance, accuracy.anisotropy, orders)
        own, places = _own(integrals, source)
        held = np.isin(elements, own)
        orders[held] = 0
        if (orders**2).sum() > len(points.elements):
            points = _room(integrals, 2 * int((orders**2).sum()))
        count = tabulated_points(elements, orders, position, integrals.rules, points)
        near_elements = elements[(orders == 0) & ~held]
        for element, xi in [(e, None) for e in near_elements] + list(zip(own, places, strict=True)):
            points, count = _refined(integrals, int(element), position, xi, points, count)
        used = _first(points, count)
        u, t = integrals.kernel.evaluate(used.places, used.normals)
        rows = _local(integrals.rows[source], row)
        accumulate(u.reshape(-1, 25), t.reshape(-1, 25), used, rows, integrals.columns, window, out)
    return out


def far_block(integrals: Integrals, row: Cluster, column: Cluster, tolerance: float) -> tuple[Array, Rows]:
    """The equations of one cluster in the columns of another that is far away, as left (m, k) @ Rows of k equations.

    Cross approximation: some quadrature points of the elements give sample columns of all equations; a pivoted QR of
    them chooses k equations that the others are combinations of, and those are integrated over all elements. Points
    that are held out judge it; there are twice as many until the error there is below the tolerance.
    """
    elements = integrals.elements(column)
    orders = _orders(integrals, row, elements)
    points = _room(integrals, int((orders**2).sum()))
    tabulated_points(elements, orders, np.zeros(3), integrals.rules, points)
    rows = integrals.rows[row.sources]
    source, field = np.nonzero(rows != NONE)
    equations = rows[source, field] - row.unknowns.start
    left, chosen = _skeleton(integrals, row, points, (source, field), tolerance)
    window, out = column_window(integrals, [column]), _output(len(chosen), [column])
    for number in np.unique(source[chosen]):
        places = np.full(5, NONE)
        mine = np.flatnonzero(source[chosen] == number)
        places[field[chosen[mine]]] = mine
        offsets = points.places - integrals.positions[row.sources.start + number]
        u, t = integrals.kernel.evaluate(offsets, points.normals)
        accumulate(u.reshape(-1, 25), t.reshape(-1, 25), points, places, integrals.columns, window, out)
    placed = np.zeros((row.unknowns.stop - row.unknowns.start, len(chosen)))
    placed[equations] = left
    return placed, out


def _skeleton(
    integrals: Integrals, row: Cluster, points: Points, equations: tuple[Indices, Indices], tolerance: float
) -> tuple[Array, Indices]:
    """left (m, k) and k of the m equations (source, field), such that left times those is all of them."""
    positions = integrals.positions[row.sources]
    samples = FIRST_SAMPLES
    while True:
        spread = spread_out(points.places, row.row_box[0], row.row_box[1], samples + HELD_OUT)
        offsets = (points.places[spread] - positions[:, None]).reshape(-1, 3)
        normals = np.broadcast_to(points.normals[spread], (len(positions), len(spread), 3)).reshape(-1, 3)
        u, t = integrals.kernel.evaluate(offsets, normals)
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

    All rows of a source (m,) are taken together, because they cost as much as one; the next source is the one that is
    worst off (block Gram-Schmidt with pivoting).
    """
    rest, bases = sampled.copy(), list[Array]()
    chosen: list[int] = []
    limit = tolerance / 4.0 * np.linalg.norm(sampled)
    while True:
        squares = (rest**2).sum(axis=1)
        if squares.sum() <= limit**2 or len(chosen) == source[-1] + 1:
            break
        chosen.append(int(np.bincount(source, squares).argmax()))
        rows = rest[source == chosen[-1]]
        basis = qr(rows.T, mode="economic", check_finite=False)[0]
        rest -= (rest @ basis) @ basis.T
        rest[source == chosen[-1]] = 0.0
        bases.append(basis)
    places = np.flatnonzero(np.isin(source, chosen or [0]))
    basis = np.concatenate(bases, axis=1) if bases else np.zeros((sampled.shape[1], 0))
    parts = sampled @ basis
    left: Array = lstsq(parts[places].T, parts.T, cond=tolerance / 100.0, check_finite=False)[0].T
    left[places] = np.eye(len(places))
    return left, places


def _orders(integrals: Integrals, row: Cluster, elements: Indices) -> Indices:
    orders = np.empty(len(elements), np.int64)
    low, high = row.row_box
    accuracy = integrals.accuracy
    orders_from_box(low, high, elements, integrals.rules, accuracy.tolerance, accuracy.anisotropy, orders)
    return orders


def _own(integrals: Integrals, source: int) -> tuple[Indices, Array]:
    """Elements that hold a source and its places (o, 2) in them."""
    sources, number = integrals.sources, integrals.tree.sources[source]
    held = slice(sources.own_start[number], sources.own_start[number + 1])
    return integrals.first_element[sources.own_block[held]] + sources.own_element[held], sources.own_xi[held]


def _refined(
    integrals: Integrals, element: int, position: Array, xi: Array | None, points: Points, count: int
) -> tuple[Points, int]:
    """Append the adaptive rule of an element to the points, in a larger room if need be."""
    number = int(np.searchsorted(integrals.first_element, element, side="right")) - 1
    block = integrals.mesh.blocks[number]
    nodes = integrals.mesh.points[block.connectivity[element - integrals.first_element[number]]]
    own_shape = np.zeros(len(nodes)) if xi is None else shape_functions(block.element, xi[None])[0]
    place = np.full(2, np.nan) if xi is None else xi
    tolerance, anisotropy = integrals.accuracy
    while True:
        room = len(points.elements)
        scratch = (np.empty((room, 2)), np.empty(room), np.empty(room), np.empty((room, len(nodes))))
        table, gauss = shape_table(block.element), gauss_table()
        last = refined_points(
            position, nodes, place, own_shape, table, gauss, tolerance, anisotropy, element, scratch, points, count
        )
        if last >= 0:
            return points, last
        if last != BUFFER_TOO_SMALL:
            raise MeshError(
                f"the collocation point {np.array2string(position, precision=6)} (in units of the contact zone) lies "
                "on an element that does not hold it: the mesh overlaps itself"
            )
        larger = _room(integrals, 2 * room)
        for new, old in zip(larger, points, strict=True):
            new[:count] = old[:count]
        points = larger


def _room(integrals: Integrals, capacity: int) -> Points:
    width = integrals.columns.sites.shape[1]
    flux_weights, value_weights = np.zeros((2, capacity, width))
    places, normals = np.empty((2, capacity, 3))
    return Points(places, normals, flux_weights, value_weights, np.empty(capacity, np.int64))


def _first(points: Points, count: int) -> Points:
    return Points(*(part[:count] for part in points))


def _local(rows: Indices, cluster: Cluster) -> Indices:
    return np.where(rows == NONE, NONE, rows - cluster.unknowns.start)


def column_window(integrals: Integrals, clusters: Sequence[Cluster]) -> Window:
    """The columns of some clusters, side by side."""
    tree = integrals.tree
    window = Window(*(np.full(len(part), NONE) for part in (tree.unknowns, tree.loads, tree.points)))
    for number, name in enumerate(("unknowns", "loads", "sites")):
        size = 0
        for cluster in clusters:
            part = getattr(cluster, name)
            window[number][part] = size + np.arange(part.stop - part.start)
            size += part.stop - part.start
    return window


def _output(n_rows: int, clusters: Sequence[Cluster]) -> Rows:
    """Zeros for n_rows equations in the columns of some clusters."""
    unknowns = sum(cluster.unknowns.stop - cluster.unknowns.start for cluster in clusters)
    loads = sum(cluster.loads.stop - cluster.loads.start for cluster in clusters)
    return Rows(np.zeros((n_rows, unknowns)), np.zeros((n_rows, loads)), np.zeros((n_rows, 1 + N_FIELDS)))
