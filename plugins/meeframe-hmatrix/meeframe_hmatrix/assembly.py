"""Assembly of the collocated system in hierarchical form: leaves and pairs of clusters are shared out over threads."""

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
from meeframe_hmatrix.truncation import truncated

ADMISSIBLE = 3.0
"""Clusters are far from each other if the smaller of their diameters is less than so many times their distance."""

Pair = tuple[Cluster, Cluster]


@dataclass(frozen=True, eq=False)
class System:
    """matrix @ unknowns = rhs + load_matrix @ loads, all in the order of the cluster tree."""

    matrix: Block
    load_matrix: Split
    rhs: Array


def assemble(integrals: Integrals, tolerance: float, progress: Progress) -> System:
    """The boundary element system (eqs. 19, 20).

    Far blocks have a relative tolerance in the Frobenius norm, those of a row cluster together.
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
    # the largest first, so that threads end together
    clusters = sorted(partners, key=lambda row: row.sites.start - row.sites.stop)
    rows = [row for row in tree.root.leaves() if row.sites.start in neighbours]
    n_tasks, known = len(clusters) + len(rows), facets(integrals)
    with ExitStack() as at_end:
        pool = ThreadPoolExecutor(get_num_threads())
        at_end.callback(pool.shutdown, cancel_futures=True)
        far_found = pool.map(lambda row: _far(integrals, known, row, partners[row], tolerance), clusters)
        near_found = pool.map(lambda row: near_rows(integrals, row, neighbours[row.sites.start]), rows)
        for done, (row, (blocks, share)) in enumerate(zip(clusters, far_found, strict=True), 1):
            for column, (value, load) in zip(partners[row], blocks, strict=True):
                values[_key((row, column))], loads[_key((row, column))] = value, load
            rest[row.unknowns] += share
            progress("assembly", done / n_tasks)
        for line in near_found:
            lines.append(line)
            progress("assembly", (len(clusters) + len(lines)) / n_tasks)
    for row, line in zip(rows, lines, strict=True):
        rest[row.unknowns] += line.rest
    rhs = rest[:, 0].copy()
    _subtract_constants(integrals, rows, lines, neighbours, rest[:, 1:], rhs)
    for row, line in zip(rows, lines, strict=True):
        _enter(row, neighbours[row.sites.start], line, values, loads)
    lines_of_loads = tuple((_tree((part, tree.zone), loads),) for part in tree.root.children)
    load_matrix = Split(tree.root.unknowns, tree.zone.loads, lines_of_loads)
    return System(_tree((tree.root, tree.root), values), load_matrix, rhs)


def _partition(integrals: Integrals, row: Cluster, column: Cluster, far: list[Pair], near: list[Pair]) -> None:
    extent = min(diameter(row.row_box), diameter(column.column_box))
    if extent < ADMISSIBLE * distance(row.row_box, column.column_box) and reachable(integrals, row, column):
        far.append((row, column))
    elif row.children or column.children:
        for part in row.parts:
            for other in column.parts:
                _partition(integrals, part, other, far, near)
    else:
        near.append((row, column))


def _key(pair: Pair) -> tuple[int, int, int, int]:
    row, column = pair
    return row.sites.start, row.sites.stop, column.sites.start, column.sites.stop


def _far(
    integrals: Integrals, known: Facets, row: Cluster, columns: Sequence[Cluster], tolerance: float
) -> tuple[list[tuple[Block, Block]], Array]:
    """A cluster's equations in the columns of others: blocks of unknowns and loads, and the share of the rest."""
    left, chosen = far_rows(integrals, known, row, columns, tolerance)
    q, r = np.linalg.qr(left)

    def part(whole: Array, first: int, place: slice) -> tuple[LowRank, int]:
        last = first + place.stop - place.start
        factor, right = truncated(r @ whole[:, first:last].astype(r.dtype), tolerance)
        return LowRank(row.unknowns, place, (q @ factor).astype(float), right.astype(float)), last

    blocks: list[tuple[Block, Block]] = []
    unknown = load = 0
    for column in columns:
        value, unknown = part(chosen.unknown, unknown, column.unknowns)
        loads, load = part(chosen.load, load, column.loads)
        blocks.append((value, loads))
    return blocks, left @ chosen.rest


def _subtract_constants(
    integrals: Integrals,
    rows: Sequence[Cluster],
    lines: Sequence[Rows],
    neighbours: dict[int, list[Cluster]],
    constant: Array,
    rhs: Array,
) -> None:
    """Free term and principal value from the five constant fields: the rows of a closed surface annul them.

    constant: (u, 5) what each equation makes of them without.
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
                share = shape * constant[equations]
                columns = integrals.columns.value_column[tree.rank[point]]
                known = columns == NONE
                rhs[equations] += share[:, known] @ integrals.columns.value_data[tree.rank[point], known]
                places = window.unknown[columns[~known]]
                line.unknown[np.ix_(equations - row.unknowns.start, places)] -= share[:, ~known]


def _enter(
    row: Cluster,
    near: Sequence[Cluster],
    line: Rows,
    values: dict[tuple[int, int, int, int], Block],
    loads: dict[tuple[int, int, int, int], Block],
) -> None:
    """The near blocks of a leaf as parts of its line."""
    unknown = load = 0
    for column in near:
        key = _key((row, column))
        width, load_width = column.unknowns.stop - column.unknowns.start, column.loads.stop - column.loads.start
        values[key] = Dense(row.unknowns, column.unknowns, line.unknown[:, unknown : unknown + width])
        loads[key] = Dense(row.unknowns, column.loads, line.load[:, load : load + load_width])
        unknown, load = unknown + width, load + load_width


def _tree(pair: Pair, known: dict[tuple[int, int, int, int], Block]) -> Block:
    """The block of a pair of clusters from undivided ones."""
    found = known.get(_key(pair))
    if found is not None:
        return found
    row, column = pair
    parts = tuple(tuple(_tree((part, other), known) for other in column.parts) for part in row.parts)
    first, last = parts[0], parts[-1]
    rows = slice(first[0].rows.start, last[0].rows.stop)
    return Split(rows, slice(first[0].columns.start, first[-1].columns.stop), parts)
