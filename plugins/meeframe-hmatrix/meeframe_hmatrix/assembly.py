"""Assembly of the collocated system in hierarchical form; leaves and pairs of clusters are distributed over threads."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np
from numba import get_num_threads

from meeframe.plugin import N_FIELDS, Array, Progress
from meeframe.plugin.boundary_elements import NONE, exterior_terms
from meeframe_hmatrix.blocks import Block, Dense, LowRank, Split
from meeframe_hmatrix.clusters import Cluster, diameter, distance
from meeframe_hmatrix.cross_approximation import far_rows, reachable
from meeframe_hmatrix.facets import Facets, facets
from meeframe_hmatrix.integrals import Integrals
from meeframe_hmatrix.kernels import Rows
from meeframe_hmatrix.rows import column_window, near_rows
from meeframe_hmatrix.truncation import truncate

ADMISSIBLE = 3.0
"""Clusters are far from each other if the smaller diameter is less than this multiple of their distance."""

Pair = tuple[Cluster, Cluster]


@dataclass(frozen=True, eq=False)
class System:
    """System matrix @ unknowns = rhs + load_matrix @ loads, all in the order of the cluster tree."""

    matrix: Block
    load_matrix: Split
    rhs: Array


def assemble(integrals: Integrals, tolerance: float, progress: Progress) -> System:
    """Assemble the boundary element system (eqs. 19, 20).

    Parameters
    ----------
    integrals
        Data of the integrals.
    tolerance
        Relative tolerance of far blocks in the Frobenius norm, for those of a row cluster together.
    progress
        Called with the stage and the fraction of it that is done.
    """
    tree = integrals.tree
    far: list[Pair] = []
    near: list[Pair] = []
    _partition(integrals, tree.root, tree.root, far, near)
    partners: dict[Cluster, list[Cluster]] = {}
    for row, column in far:
        partners.setdefault(row, []).append(column)
    neighbours: dict[int, list[Cluster]] = {}
    for row, column in near:
        neighbours.setdefault(row.sites.start, []).append(column)
    rest = np.zeros((len(tree.unknowns), 1 + N_FIELDS))
    values: dict[tuple[int, int, int, int], Block] = {}
    loads: dict[tuple[int, int, int, int], Block] = {}
    lines: list[Rows] = []
    # the largest first, so that threads finish together
    clusters = sorted(partners, key=lambda row: row.sites.start - row.sites.stop)
    rows = [row for row in tree.root.leaves() if row.sites.start in neighbours]
    n_tasks, facets_of_leaves = len(clusters) + len(rows), facets(integrals)
    with ExitStack() as at_end:
        pool = ThreadPoolExecutor(get_num_threads())
        at_end.callback(pool.shutdown, cancel_futures=True)
        far_results = pool.map(lambda row: _far(integrals, facets_of_leaves, row, partners[row], tolerance), clusters)
        near_results = pool.map(lambda row: near_rows(integrals, row, neighbours[row.sites.start]), rows)
        for done, (row, (blocks, contribution)) in enumerate(zip(clusters, far_results, strict=True), 1):
            for column, (value, load) in zip(partners[row], blocks, strict=True):
                values[_key((row, column))], loads[_key((row, column))] = value, load
            rest[row.unknowns] += contribution
            progress("assembly", done / n_tasks)
        for line in near_results:
            lines.append(line)
            progress("assembly", (len(clusters) + len(lines)) / n_tasks)
    for row, line in zip(rows, lines, strict=True):
        rest[row.unknowns] += line.rest
    rhs = rest[:, 0].copy()
    _subtract_constants(integrals, rows, lines, neighbours, rest[:, 1:], rhs)
    for row, line in zip(rows, lines, strict=True):
        _enter(row, neighbours[row.sites.start], line, values, loads)
    lines_of_loads = tuple((_tree((child, tree.zone), loads),) for child in tree.root.children)
    load_matrix = Split(tree.root.unknowns, tree.zone.loads, lines_of_loads)
    return System(_tree((tree.root, tree.root), values), load_matrix, rhs)


def _partition(integrals: Integrals, row: Cluster, column: Cluster, far: list[Pair], near: list[Pair]) -> None:
    extent = min(diameter(row.row_box), diameter(column.column_box))
    if extent < ADMISSIBLE * distance(row.row_box, column.column_box) and reachable(integrals, row, column):
        far.append((row, column))
    elif row.children or column.children:
        for child in row.divisions:
            for other in column.divisions:
                _partition(integrals, child, other, far, near)
    else:
        near.append((row, column))


def _key(pair: Pair) -> tuple[int, int, int, int]:
    row, column = pair
    return row.sites.start, row.sites.stop, column.sites.start, column.sites.stop


def _far(
    integrals: Integrals, facets_of_leaves: Facets, row: Cluster, columns: Sequence[Cluster], tolerance: float
) -> tuple[list[tuple[Block, Block]], Array]:
    """Return the far blocks of a cluster, of unknowns and of loads, and its contribution to the known data."""
    left, skeleton_rows = far_rows(integrals, facets_of_leaves, row, columns, tolerance)
    q, r = np.linalg.qr(left)

    def child(rows_of_skeleton: Array, first: int, column_range: slice) -> tuple[LowRank, int]:
        last = first + column_range.stop - column_range.start
        factor, right = truncate(r @ rows_of_skeleton[:, first:last].astype(r.dtype), tolerance)
        return LowRank(row.unknowns, column_range, (q @ factor).astype(float), right.astype(float)), last

    blocks: list[tuple[Block, Block]] = []
    unknown = load = 0
    for column in columns:
        value, unknown = child(skeleton_rows.unknown, unknown, column.unknowns)
        loads, load = child(skeleton_rows.load, load, column.loads)
        blocks.append((value, loads))
    return blocks, left @ skeleton_rows.rest


def _subtract_constants(
    integrals: Integrals,
    rows: Sequence[Cluster],
    lines: Sequence[Rows],
    neighbours: dict[int, list[Cluster]],
    constant: Array,
    rhs: Array,
) -> None:
    """Subtract free term and principal value, such that rows of a closed surface vanish for constant fields.

    constant: (u, 5) product of each equation with the five constant fields without them.
    """
    tree, sources = integrals.tree, integrals.sources
    if integrals.mesh.semi_infinite:
        exterior = exterior_terms(integrals.kernel, integrals.mesh, integrals.positions).reshape(-1, N_FIELDS, N_FIELDS)
        used = integrals.rows != NONE
        constant[integrals.rows[used]] -= exterior.transpose(0, 2, 1)[used]
    for row, line in zip(rows, lines, strict=True):
        window = column_window(integrals, neighbours[row.sites.start])
        for source in range(row.sources.start, row.sources.stop):
            equations = integrals.rows[source][integrals.rows[source] != NONE]
            number = tree.sources[source]
            for point, shape in zip(sources.mesh_points[number], sources.shape[number], strict=True):
                if shape == 0.0:
                    continue
                contribution = shape * constant[equations]
                columns = integrals.columns.value_column[tree.rank[point]]
                prescribed = columns == NONE
                rhs[equations] += (
                    contribution[:, prescribed] @ integrals.columns.value_data[tree.rank[point], prescribed]
                )
                unknown_positions = window.unknown[columns[~prescribed]]
                line.unknown[np.ix_(equations - row.unknowns.start, unknown_positions)] -= contribution[:, ~prescribed]


def _enter(
    row: Cluster,
    near: Sequence[Cluster],
    line: Rows,
    values: dict[tuple[int, int, int, int], Block],
    loads: dict[tuple[int, int, int, int], Block],
) -> None:
    """Enter the near blocks of a leaf."""
    unknown = load = 0
    for column in near:
        key = _key((row, column))
        width, load_width = column.unknowns.stop - column.unknowns.start, column.loads.stop - column.loads.start
        values[key] = Dense(row.unknowns, column.unknowns, line.unknown[:, unknown : unknown + width])
        loads[key] = Dense(row.unknowns, column.loads, line.load[:, load : load + load_width])
        unknown, load = unknown + width, load + load_width


def _tree(pair: Pair, blocks_by_pair: dict[tuple[int, int, int, int], Block]) -> Block:
    """Return the block of a pair of clusters from undivided ones."""
    block = blocks_by_pair.get(_key(pair))
    if block is not None:
        return block
    row, column = pair
    children = tuple(
        tuple(_tree((child, other), blocks_by_pair) for other in column.divisions) for child in row.divisions
    )
    first, last = children[0], children[-1]
    rows = slice(first[0].rows.start, last[0].rows.stop)
    return Split(rows, slice(first[0].columns.start, first[-1].columns.stop), children)
