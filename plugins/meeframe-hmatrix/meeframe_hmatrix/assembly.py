"""Assembly of the collocated system in hierarchical form; leaves and block clusters are distributed over threads."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np
from numba import get_num_threads

from meeframe.plugin import Array, Progress
from meeframe.plugin.boundary_elements import NONE, exterior_terms
from meeframe_hmatrix.blocks import Block, Dense, LowRank, Split
from meeframe_hmatrix.clusters import Cluster, diameter, distance
from meeframe_hmatrix.cross_approximation import far_rows, has_tensor_rules
from meeframe_hmatrix.facets import Facets, facets
from meeframe_hmatrix.integrals import Integrals
from meeframe_hmatrix.kernels import Rows
from meeframe_hmatrix.rows import column_window, near_rows
from meeframe_hmatrix.truncation import truncate

ADMISSIBILITY = 3.0
"""Clusters are far from each other if the smaller diameter is less than this multiple of their distance."""

BlockCluster = tuple[Cluster, Cluster]


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
    admissible: list[BlockCluster] = []
    inadmissible: list[BlockCluster] = []
    _partition(integrals, tree.root, tree.root, admissible, inadmissible)
    far_columns: dict[Cluster, list[Cluster]] = {}
    for row_cluster, column_cluster in admissible:
        far_columns.setdefault(row_cluster, []).append(column_cluster)
    near_columns: dict[int, list[Cluster]] = {}
    for row_cluster, column_cluster in inadmissible:
        near_columns.setdefault(row_cluster.sites.start, []).append(column_cluster)
    known_terms = np.zeros((len(tree.unknowns), 1 + len(integrals.fields)))
    value_blocks: dict[tuple[int, int, int, int], Block] = {}
    load_blocks: dict[tuple[int, int, int, int], Block] = {}
    near_results: list[Rows] = []
    # the largest first, so that threads finish together
    clusters = sorted(far_columns, key=lambda cluster: cluster.sites.start - cluster.sites.stop)
    row_leaves = [leaf for leaf in tree.root.leaves() if leaf.sites.start in near_columns]
    n_tasks, facets_of_leaves = len(clusters) + len(row_leaves), facets(integrals)
    with ExitStack() as stack:
        pool = ThreadPoolExecutor(get_num_threads())
        stack.callback(pool.shutdown, cancel_futures=True)
        far_results = pool.map(
            lambda cluster: _far(integrals, facets_of_leaves, cluster, far_columns[cluster], tolerance),
            clusters,
        )
        pending_rows = pool.map(lambda leaf: near_rows(integrals, leaf, near_columns[leaf.sites.start]), row_leaves)
        for done, (row_cluster, (blocks, contribution)) in enumerate(zip(clusters, far_results, strict=True), 1):
            for column_cluster, (value, load) in zip(far_columns[row_cluster], blocks, strict=True):
                key = _key((row_cluster, column_cluster))
                value_blocks[key], load_blocks[key] = value, load
            known_terms[row_cluster.unknowns] += contribution
            progress("assembly", done / n_tasks)
        for near_result in pending_rows:
            near_results.append(near_result)
            progress("assembly", (len(clusters) + len(near_results)) / n_tasks)
    for row_cluster, near_result in zip(row_leaves, near_results, strict=True):
        known_terms[row_cluster.unknowns] += near_result.known_terms
    rhs = known_terms[:, 0].copy()
    _subtract_constants(integrals, row_leaves, near_results, near_columns, known_terms[:, 1:], rhs)
    for row_cluster, near_result in zip(row_leaves, near_results, strict=True):
        _enter(row_cluster, near_columns[row_cluster.sites.start], near_result, value_blocks, load_blocks)
    load_rows = tuple((_tree((child, tree.zone), load_blocks),) for child in tree.root.children)
    load_matrix = Split(tree.root.unknowns, tree.zone.loads, load_rows)
    return System(_tree((tree.root, tree.root), value_blocks), load_matrix, rhs)


def _partition(
    integrals: Integrals,
    row_cluster: Cluster,
    column_cluster: Cluster,
    admissible: list[BlockCluster],
    inadmissible: list[BlockCluster],
) -> None:
    extent = min(diameter(row_cluster.row_box), diameter(column_cluster.column_box))
    if extent < ADMISSIBILITY * distance(row_cluster.row_box, column_cluster.column_box) and has_tensor_rules(
        integrals, row_cluster, column_cluster
    ):
        admissible.append((row_cluster, column_cluster))
    elif row_cluster.children or column_cluster.children:
        for row_child in row_cluster.divisions:
            for column_child in column_cluster.divisions:
                _partition(integrals, row_child, column_child, admissible, inadmissible)
    else:
        inadmissible.append((row_cluster, column_cluster))


def _key(block_cluster: BlockCluster) -> tuple[int, int, int, int]:
    row_cluster, column_cluster = block_cluster
    return row_cluster.sites.start, row_cluster.sites.stop, column_cluster.sites.start, column_cluster.sites.stop


def _far(
    integrals: Integrals,
    facets_of_leaves: Facets,
    row_cluster: Cluster,
    column_clusters: Sequence[Cluster],
    tolerance: float,
) -> tuple[list[tuple[Block, Block]], Array]:
    """Return the far blocks of a cluster, of unknowns and of loads, and its contribution to the known data."""
    left, skeleton_rows = far_rows(integrals, facets_of_leaves, row_cluster, column_clusters, tolerance)
    q, r = np.linalg.qr(left)

    def truncated_block(rows_of_skeleton: Array, first: int, column_range: slice) -> tuple[LowRank, int]:
        last = first + column_range.stop - column_range.start
        factor, right = truncate(r @ rows_of_skeleton[:, first:last].astype(r.dtype), tolerance)
        return LowRank(row_cluster.unknowns, column_range, (q @ factor).astype(float), right.astype(float)), last

    blocks: list[tuple[Block, Block]] = []
    unknown = load = 0
    for column_cluster in column_clusters:
        value, unknown = truncated_block(skeleton_rows.unknown, unknown, column_cluster.unknowns)
        load_block, load = truncated_block(skeleton_rows.load, load, column_cluster.loads)
        blocks.append((value, load_block))
    return blocks, left @ skeleton_rows.known_terms


def _subtract_constants(
    integrals: Integrals,
    row_leaves: Sequence[Cluster],
    near_results: Sequence[Rows],
    near_columns: dict[int, list[Cluster]],
    constant: Array,
    rhs: Array,
) -> None:
    """Subtract free term and principal value, such that rows of a closed surface vanish for constant fields.

    constant: (u, f) product of each equation with the f constant fields without them; weakly singular entries have
    none.
    """
    tree, sources = integrals.tree, integrals.sources
    for field, equation in zip(*np.divmod(integrals.kernel.weakly_singular(), len(integrals.fields)), strict=True):
        rows = integrals.rows[:, equation]
        constant[rows[rows != NONE], field] = 0.0
    if integrals.mesh.semi_infinite:
        n_fields = len(integrals.fields)
        exterior = exterior_terms(integrals.kernel, integrals.mesh, integrals.positions).reshape(-1, n_fields, n_fields)
        used = integrals.rows != NONE
        constant[integrals.rows[used]] -= exterior.transpose(0, 2, 1)[used]
    for row_cluster, near_result in zip(row_leaves, near_results, strict=True):
        window = column_window(integrals, near_columns[row_cluster.sites.start])
        for source in range(row_cluster.sources.start, row_cluster.sources.stop):
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
                near_result.unknown[np.ix_(equations - row_cluster.unknowns.start, unknown_positions)] -= contribution[
                    :, ~prescribed
                ]


def _enter(
    row_cluster: Cluster,
    near_columns: Sequence[Cluster],
    near_result: Rows,
    value_blocks: dict[tuple[int, int, int, int], Block],
    load_blocks: dict[tuple[int, int, int, int], Block],
) -> None:
    """Enter the near blocks of a leaf."""
    unknown = load = 0
    for column_cluster in near_columns:
        key = _key((row_cluster, column_cluster))
        width, load_width = (
            column_cluster.unknowns.stop - column_cluster.unknowns.start,
            column_cluster.loads.stop - column_cluster.loads.start,
        )
        value_blocks[key] = Dense(
            row_cluster.unknowns, column_cluster.unknowns, near_result.unknown[:, unknown : unknown + width]
        )
        load_blocks[key] = Dense(
            row_cluster.unknowns, column_cluster.loads, near_result.load[:, load : load + load_width]
        )
        unknown, load = unknown + width, load + load_width


def _tree(block_cluster: BlockCluster, leaf_blocks: dict[tuple[int, int, int, int], Block]) -> Block:
    """Return the block of a block cluster from undivided ones."""
    block = leaf_blocks.get(_key(block_cluster))
    if block is not None:
        return block
    row_cluster, column_cluster = block_cluster
    children = tuple(
        tuple(_tree((row_child, column_child), leaf_blocks) for column_child in column_cluster.divisions)
        for row_child in row_cluster.divisions
    )
    first, last = children[0], children[-1]
    rows = slice(first[0].rows.start, last[0].rows.stop)
    return Split(rows, slice(first[0].columns.start, first[-1].columns.stop), children)
