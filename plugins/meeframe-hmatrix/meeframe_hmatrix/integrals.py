"""Data of the integrals of the assembly: elements by kind, equations and columns in the order of the tree."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from meeframe.plugin import Array, Indices, Kernel, SurfaceElement, SurfaceMesh
from meeframe.plugin.boundary_elements import NONE, Accuracy, Layout, Sources
from meeframe.plugin.surfaces import element_extents, shape_derivatives
from meeframe_hmatrix.clusters import Cluster, ClusterTree, inverse
from meeframe_hmatrix.kernels import Columns, Elements

PLANARITY_TOLERANCE = 1e-12


@dataclass(frozen=True, eq=False)
class Kind:
    """The elements of one block of the mesh.

    Attributes
    ----------
    block
        Number of the block.
    element
        Type of element.
    first
        Number of its first element among all.
    elements
        Geometry of the elements.
    sites, patches
        Sites and patches (e, k) of the nodes, sites in the order of the tree.
    planes
        Normals (e, 3) if all elements are planar.
    """

    block: int
    element: SurfaceElement
    first: int
    elements: Elements
    sites: Indices
    patches: Indices
    planes: Array | None


@dataclass(frozen=True, eq=False)
class Integrals:
    """Data read by every task; sources, rows and columns are in the order of the tree.

    Attributes
    ----------
    mesh, tree
        Surface mesh in units of the system, and cluster tree.
    sources
        Collocation, in the order of `tree.sources`.
    kernel, accuracy
        Fundamental solution and accuracy of the rules.
    positions
        Collocation points (s, 3).
    rows
        Their equations (s, f), NONE where there is none.
    columns
        Columns of unknowns and loads.
    kinds
        Elements by kind.
    patch_sites
        Sites (p,) of the patches.
    elements_at_sites
        Elements at each site: starts (sites + 1,) and elements.
    """

    mesh: SurfaceMesh
    tree: ClusterTree
    sources: Sources
    kernel: Kernel
    accuracy: Accuracy
    positions: Array
    rows: Indices
    columns: Columns
    kinds: tuple[Kind, ...]
    patch_sites: Indices
    elements_at_sites: tuple[Indices, Indices]

    @cached_property
    def fields(self) -> tuple[int, ...]:
        """Numbers of the fields."""
        return tuple(range(self.rows.shape[1]))

    def elements(self, clusters: Sequence[Cluster]) -> Iterator[tuple[Kind, Indices]]:
        """Yield the elements that touch the sites of clusters, by kind, with ascending numbers."""
        starts, elements = self.elements_at_sites
        touched = [elements[starts[cluster.sites.start] : starts[cluster.sites.stop]] for cluster in clusters]
        numbers = np.unique(np.concatenate(touched)) if touched else elements[:0]
        for kind in self.kinds:
            low, high = np.searchsorted(numbers, [kind.first, kind.first + len(kind.sites)])
            if low < high:
                yield kind, numbers[low:high] - kind.first


def tabulate_integrals(
    mesh: SurfaceMesh, layout: Layout, sources: Sources, tree: ClusterTree, kernel: Kernel, accuracy: Accuracy
) -> Integrals:
    """Return the tables of elements and columns; the mesh is in units of the system."""
    rows = sources.row[tree.sources]
    rows = np.where(rows == NONE, NONE, tree.unknown_rank[rows])
    kinds = tuple(_kinds(mesh, layout, tree, accuracy.tolerance))
    site = np.concatenate([kind.sites.ravel() for kind in kinds])
    element = np.concatenate([kind.first + np.indices(kind.sites.shape)[0].ravel() for kind in kinds])
    order = np.argsort(site, kind="stable")
    starts = np.searchsorted(site[order], np.arange(len(mesh.points) + 1))
    return Integrals(
        mesh,
        tree,
        sources,
        kernel,
        accuracy,
        sources.position[tree.sources],
        rows,
        _columns(mesh, layout, tree),
        kinds,
        tree.rank[layout.patches.point],
        (starts, element[order]),
    )


def flux_unit(mesh: SurfaceMesh) -> float:
    """Return the unit of unknown fluxes for which their coefficients are as large as those of values.

    It refers to distances of the size of the body. Truncation includes both in one block; without this unit the values
    would be lost in the round-off of the fluxes.
    """
    return float(1.0 / np.ptp(mesh.points, axis=0).max())


def _columns(mesh: SurfaceMesh, layout: Layout, tree: ClusterTree) -> Columns:
    def rank_numbers(numbers: Indices, rank: Indices) -> Indices:
        return np.where(numbers == NONE, NONE, rank[numbers]) if len(rank) else numbers

    return Columns(
        rank_numbers(layout.value_column, tree.unknown_rank)[tree.points],
        layout.value_data[tree.points],
        rank_numbers(layout.flux_column, tree.unknown_rank),
        layout.flux_data,
        rank_numbers(layout.load_column, inverse(tree.loads)),
        flux_unit(mesh),
    )


def _kinds(mesh: SurfaceMesh, layout: Layout, tree: ClusterTree, tolerance: float) -> Iterator[Kind]:
    first = 0
    for number, (block, patches) in enumerate(zip(mesh.blocks, layout.patches.connectivity, strict=True)):
        nodes = np.ascontiguousarray(mesh.points[block.connectivity])
        extents = element_extents(block.element, nodes, tolerance)
        elements = Elements(nodes, extents.centres, extents.sizes, extents.min_orders)
        sites, planes = tree.rank[block.connectivity], _planes(block.element, nodes)
        yield Kind(number, block.element, first, elements, sites, patches, planes)
        first += len(nodes)


def _planes(element: SurfaceElement, nodes: Array) -> Array | None:
    """Return the normals (e, 3) of elements with nodes (e, k, 3) if each is planar."""
    middle = element.nodes.mean(axis=0, keepdims=True)
    xi, eta = np.einsum("ak,eax->kex", shape_derivatives(element, middle)[0], nodes)
    normals = np.cross(xi, eta)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    offsets = nodes - nodes[:, :1]
    heights = np.abs(np.einsum("eax,ex->ea", offsets, normals)).max(axis=1)
    return normals if bool((heights <= PLANARITY_TOLERANCE * np.abs(offsets).max(axis=(1, 2))).all()) else None
