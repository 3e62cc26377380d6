"""Cluster tree on the nodes of the surface mesh, and the numbering of unknowns and loads that follows it.

Every mesh point is a site. It carries its unknown values, the unknown fluxes of its patches, the loads of the contact
zone there, and the equations of the same numbers. The contact zone is split off first, as the last child of the root,
so that elimination ends with it; below, clusters are halved along their longest side, into leaves of equal size.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from meeframe.plugin import Array, Indices, SurfaceMesh
from meeframe.plugin.boundary_elements import NONE, Layout, Sources


@dataclass(frozen=True, eq=False)
class Cluster:
    """Neighbouring sites: slices of sites, sources, unknowns (and equations) and loads in the order of the tree.

    row_box, column_box: (2, 3) lowest and highest coordinates of the collocation points, and of the elements that
    touch the sites; children: none for a leaf.
    """

    sites: slice
    sources: slice
    unknowns: slice
    loads: slice
    row_box: Array
    column_box: Array
    children: tuple["Cluster", ...]

    @property
    def parts(self) -> tuple["Cluster", ...]:
        """The children, or a leaf itself."""
        return self.children or (self,)

    def leaves(self) -> Iterator["Cluster"]:
        """The leaves below, in order."""
        if not self.children:
            yield self
        for child in self.children:
            yield from child.leaves()


@dataclass(frozen=True, eq=False)
class ClusterTree:
    """root: of all sites; zone: the cluster of the contact zone.

    points, sources, unknowns, loads: the numbers in mesh, collocation and layout by the order of the tree.
    """

    root: Cluster
    zone: Cluster
    points: Indices
    sources: Indices
    unknowns: Indices
    loads: Indices

    @cached_property
    def rank(self) -> Indices:
        """Place of each mesh point in the order of the tree."""
        return inverse(self.points)

    @cached_property
    def unknown_rank(self) -> Indices:
        """Place of each unknown in the order of the tree."""
        return inverse(self.unknowns)


def inverse(order: Indices) -> Indices:
    """The inverse of a permutation."""
    places = np.empty_like(order)
    places[order] = np.arange(len(order))
    return places


def cluster_tree(mesh: SurfaceMesh, layout: Layout, sources: Sources, leaf_size: int) -> ClusterTree:
    """Tree with at most leaf_size sites in a leaf. The contact zone is some of the mesh, not all."""
    in_zone = np.zeros(len(mesh.points), bool)
    in_zone[layout.zone] = True
    halves = [
        _bisect(mesh.points, np.flatnonzero(part), -(-int(part.sum()) // leaf_size)) for part in (~in_zone, in_zone)
    ]
    points = np.concatenate([leaf for half in halves for leaf in _flat(half)])
    rank = inverse(points)
    unknown_point, load_point = _points_of(layout)
    source_rank = rank[unknown_point[sources.row.max(axis=1)]]
    ranks = (source_rank, rank[unknown_point], rank[load_point])
    orders = [np.argsort(places, kind="stable").astype(np.int64) for places in ranks]
    sorted_ranks = [places[order] for places, order in zip(ranks, orders, strict=True)]
    positions = sources.position[orders[0]]
    low, high = _element_boxes(mesh)

    def cluster(start: int, stop: int, children: tuple[Cluster, ...]) -> Cluster:
        cluster_sources, unknowns, loads = (
            slice(*np.searchsorted(places, (start, stop)).tolist()) for places in sorted_ranks
        )
        own = points[start:stop]
        column_box = np.stack([low[own].min(axis=0), high[own].max(axis=0)])
        has_sources = cluster_sources.stop > cluster_sources.start
        row_box = _box(positions[cluster_sources]) if has_sources else column_box
        return Cluster(slice(start, stop), cluster_sources, unknowns, loads, row_box, column_box, children)

    start, children = 0, []
    for half in halves:
        child, start = _number(half, start, cluster)
        children.append(child)
    root = cluster(0, len(points), tuple(children))
    return ClusterTree(root, children[1], points, *orders)


_Halves = Indices | tuple["_Halves", "_Halves"]


def _bisect(points: Array, members: Indices, n_leaves: int) -> _Halves:
    """Halves, and halves of these, that end in so many leaves of the same size."""
    if n_leaves <= 1:
        return members
    own = points[members]
    order = np.argsort(own[:, np.ptp(own, axis=0).argmax()], kind="stable")
    first = n_leaves // 2
    middle = len(members) * first // n_leaves
    low, high = members[order[:middle]], members[order[middle:]]
    return _bisect(points, low, first), _bisect(points, high, n_leaves - first)


def _flat(half: _Halves) -> Iterator[Indices]:
    if isinstance(half, tuple):
        for part in half:
            yield from _flat(part)
    else:
        yield half


def _number(half: _Halves, start: int, make: Callable[[int, int, tuple[Cluster, ...]], Cluster]) -> tuple[Cluster, int]:
    if not isinstance(half, tuple):
        return make(start, start + len(half), ()), start + len(half)
    first, middle = _number(half[0], start, make)
    second, stop = _number(half[1], middle, make)
    return make(start, stop, (first, second)), stop


def _points_of(layout: Layout) -> tuple[Indices, Indices]:
    """The mesh point of each unknown and of each load."""
    unknown_point = np.empty(layout.n_unknowns, np.int64)
    point, field = np.nonzero(layout.value_column != NONE)
    unknown_point[layout.value_column[point, field]] = point
    patch, field = np.nonzero(layout.flux_column != NONE)
    unknown_point[layout.flux_column[patch, field]] = layout.patches.point[patch]
    return unknown_point, np.repeat(layout.zone, layout.load_column.shape[1])


def _element_boxes(mesh: SurfaceMesh) -> tuple[Array, Array]:
    """Lowest and highest coordinates (p, 3) of the elements that touch each point."""
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
    """Distance of two boxes (2, 3)."""
    gap = np.maximum(0.0, np.maximum(first[0] - second[1], second[0] - first[1]))
    return float(np.linalg.norm(gap))


def diameter(box: Array) -> float:
    """Diameter of a box (2, 3)."""
    return float(np.linalg.norm(box[1] - box[0]))
