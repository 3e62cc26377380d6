"""Cluster tree on the nodes of the surface mesh, and the corresponding order of unknowns and loads.

Every mesh point is a site. It has its unknown values, the unknown fluxes of its patches, the loads of the contact zone
there, and the equations of the same numbers. The contact zone is the last child of the root, so that elimination ends
with it; below, clusters are halved along their longest side, into leaves of equal size.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from meeframe.plugin import Array, Indices, SurfaceMesh
from meeframe.plugin.boundary_elements import NONE, Layout, Sources


@dataclass(frozen=True, eq=False)
class Cluster:
    """Neighbouring sites.

    Attributes
    ----------
    sites, sources, unknowns, loads
        Ranges of sites, sources, unknowns (and equations) and loads in the order of the tree.
    row_box, column_box
        Lowest and highest coordinates (2, 3) of the collocation points, and of the elements that touch the sites.
    children
        Child clusters; none for a leaf.
    """

    sites: slice
    sources: slice
    unknowns: slice
    loads: slice
    row_box: Array
    column_box: Array
    children: tuple["Cluster", ...]

    @property
    def divisions(self) -> tuple["Cluster", ...]:
        """The children, or a leaf itself."""
        return self.children or (self,)

    def leaves(self) -> Iterator["Cluster"]:
        """Yield the leaves below, in order."""
        if not self.children:
            yield self
        for child in self.children:
            yield from child.leaves()


@dataclass(frozen=True, eq=False)
class ClusterTree:
    """The cluster tree of a mesh.

    Attributes
    ----------
    root
        Cluster of all sites.
    zone
        Cluster of the contact zone.
    points, sources, unknowns, loads
        Numbers in mesh, collocation and layout, in the order of the tree.
    """

    root: Cluster
    zone: Cluster
    points: Indices
    sources: Indices
    unknowns: Indices
    loads: Indices

    @cached_property
    def rank(self) -> Indices:
        """Position of each mesh point in the order of the tree."""
        return inverse(self.points)

    @cached_property
    def unknown_rank(self) -> Indices:
        """Position of each unknown in the order of the tree."""
        return inverse(self.unknowns)


def inverse(order: Indices) -> Indices:
    """Return the inverse of a permutation."""
    positions = np.empty_like(order)
    positions[order] = np.arange(len(order))
    return positions


def cluster_tree(mesh: SurfaceMesh, layout: Layout, sources: Sources, leaf_size: int) -> ClusterTree:
    """Return the tree with at most leaf_size sites in a leaf; the contact zone must not be the whole mesh."""
    in_zone = np.zeros(len(mesh.points), bool)
    in_zone[layout.zone] = True
    branches = [
        _bisect(mesh.points, np.flatnonzero(subset), -(-int(subset.sum()) // leaf_size))
        for subset in (~in_zone, in_zone)
    ]
    points = np.concatenate([leaf for branch in branches for leaf in _leaves_of(branch)])
    rank = inverse(points)
    unknown_point, load_point = _points_of(layout)
    source_rank = rank[unknown_point[sources.row.max(axis=1)]]
    tree_positions = (source_rank, rank[unknown_point], rank[load_point])
    orders = [np.argsort(ranks, kind="stable").astype(np.int64) for ranks in tree_positions]
    sorted_ranks = [ranks[order] for ranks, order in zip(tree_positions, orders, strict=True)]
    positions = sources.position[orders[0]]
    low, high = _element_boxes(mesh)

    def cluster(start: int, stop: int, children: tuple[Cluster, ...]) -> Cluster:
        source_range, unknowns, loads = (
            slice(*np.searchsorted(ranks, (start, stop)).tolist()) for ranks in sorted_ranks
        )
        members = points[start:stop]
        column_box = np.stack([low[members].min(axis=0), high[members].max(axis=0)])
        has_sources = source_range.stop > source_range.start
        row_box = _box(positions[source_range]) if has_sources else column_box
        return Cluster(slice(start, stop), source_range, unknowns, loads, row_box, column_box, children)

    start, children = 0, []
    for branch in branches:
        child, start = _number_clusters(branch, start, cluster)
        children.append(child)
    root = cluster(0, len(points), tuple(children))
    return ClusterTree(root, children[1], points, *orders)


_Bisection = Indices | tuple["_Bisection", "_Bisection"]


def _bisect(points: Array, members: Indices, n_leaves: int) -> _Bisection:
    """Return nested halves that end in this number of leaves of equal size."""
    if n_leaves <= 1:
        return members
    coordinates = points[members]
    order = np.argsort(coordinates[:, np.ptp(coordinates, axis=0).argmax()], kind="stable")
    first = n_leaves // 2
    middle = len(members) * first // n_leaves
    low, high = members[order[:middle]], members[order[middle:]]
    return _bisect(points, low, first), _bisect(points, high, n_leaves - first)


def _leaves_of(branch: _Bisection) -> Iterator[Indices]:
    if isinstance(branch, tuple):
        for subset in branch:
            yield from _leaves_of(subset)
    else:
        yield branch


def _number_clusters(
    branch: _Bisection, start: int, create_cluster: Callable[[int, int, tuple[Cluster, ...]], Cluster]
) -> tuple[Cluster, int]:
    if not isinstance(branch, tuple):
        return create_cluster(start, start + len(branch), ()), start + len(branch)
    first, middle = _number_clusters(branch[0], start, create_cluster)
    second, stop = _number_clusters(branch[1], middle, create_cluster)
    return create_cluster(start, stop, (first, second)), stop


def _points_of(layout: Layout) -> tuple[Indices, Indices]:
    """Return the mesh point of each unknown and of each load."""
    unknown_point = np.empty(layout.n_unknowns, np.int64)
    point, field = np.nonzero(layout.value_column != NONE)
    unknown_point[layout.value_column[point, field]] = point
    patch, field = np.nonzero(layout.flux_column != NONE)
    unknown_point[layout.flux_column[patch, field]] = layout.patches.point[patch]
    return unknown_point, np.repeat(layout.zone, layout.load_column.shape[1])


def _element_boxes(mesh: SurfaceMesh) -> tuple[Array, Array]:
    """Return the lowest and highest coordinates (p, 3) of the elements that touch each point."""
    low, high = mesh.points.copy(), mesh.points.copy()
    for block in mesh.blocks:
        nodes = mesh.points[block.connectivity]
        for a in range(nodes.shape[1]):
            np.minimum.at(low, block.connectivity[:, a], nodes.min(axis=1))
            np.maximum.at(high, block.connectivity[:, a], nodes.max(axis=1))
    return low, high


def _box(points: Array) -> Array:
    box: Array = np.stack([points.min(axis=0), points.max(axis=0)])
    return box


def distance(first: Array, second: Array) -> float:
    """Return the distance of two boxes (2, 3)."""
    gap = np.maximum(0.0, np.maximum(first[0] - second[1], second[0] - first[1]))
    return float(np.linalg.norm(gap))


def diameter(box: Array) -> float:
    """Return the diameter of a box (2, 3)."""
    return float(np.linalg.norm(box[1] - box[0]))
