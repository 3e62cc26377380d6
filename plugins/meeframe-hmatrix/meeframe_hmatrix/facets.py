"""Integrals over plane parts of far leaves from few values of the kernel, by interpolation between Gauss points.

As seen from afar the kernel is smooth over all elements of a leaf together: on a rectangle around them it is a
polynomial to the tolerance, given by its values at the Gauss points of the rectangle. The integrals of that polynomial
times the shape functions need no kernel and serve every row cluster that is far enough away.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import prod

import numpy as np

from meeframe.plugin import Array, Indices, Kernel
from meeframe.plugin.boundary_elements import Accuracy
from meeframe.plugin.surfaces import gauss_table
from meeframe_hmatrix.clusters import Cluster
from meeframe_hmatrix.facet_kernels import add_products, add_weights, orders_of_facet
from meeframe_hmatrix.integrals import Integrals, Kind
from meeframe_hmatrix.kernels import Sums, Window
from meeframe_hmatrix.rows import orders_from, placed

WORTHWHILE = 0.7
"""A facet is interpolated if that takes at most so many times the points on its elements: more gain nothing, since all
elements of a leaf are integrated where one facet is not interpolated (measured)."""
ORDERS = (2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 14, 16)
"""Of interpolation: few, so that weights serve many row clusters."""
MIN_PLANE_ELEMENTS = 4
"""Smallest mean number of elements in each plane of a leaf for which facets are searched: on curved surfaces of plane
triangles each element has its plane."""
SAME_PLANE = 9
"""Digits to which normal and height of the elements of a plane agree."""

Orders = tuple[int, int]


@dataclass(frozen=True, eq=False)
class Facet:
    """The elements of one plane that touch the sites of a leaf.

    kind, numbers: the elements; normal: (3,); centre (3,), axes (2, 3), half (2,): the rectangle around them; sites,
    patches: those of the leaf that they touch; weights: integrals of the interpolating polynomials, (sites, p) and
    (patches, p), by the orders of interpolation and of the rules on elements.
    """

    kind: Kind
    numbers: Indices
    normal: Array
    centre: Array
    axes: Array
    half: Array
    sites: Indices
    patches: Indices
    weights: dict[tuple[Orders, Orders], tuple[Array, Array]] = field(default_factory=dict)

    def points(self, orders: Orders) -> Array:
        """Return the points at which the kernel is evaluated, (p, 3)."""
        first, second = (gauss_table().points[n, :n] for n in orders)
        places = np.stack(np.meshgrid(first, second, indexing="ij"), axis=-1).reshape(-1, 2)
        found: Array = self.centre + (places * self.half) @ self.axes
        return found

    def integrated(self, integrals: Integrals, orders: Orders, rules: Orders) -> tuple[Array, Array]:
        """Weights (sites, p), (patches, p) of the values at the points, by rules on the elements."""
        key = orders, rules
        if key not in self.weights:
            own = np.tile(rules, (len(self.numbers), 1))
            points, _ = placed(integrals, np.zeros(3), self.kind, self.numbers, own, np.full(own.shape, np.nan))
            found = np.zeros((len(self.sites), prod(orders))), np.zeros((len(self.patches), prod(orders)))
            places = (
                _places(self.sites, self.kind.sites[self.numbers]),
                _places(self.patches, self.kind.patches[self.numbers]),
            )
            nodes = (gauss_table().points[n, :n] for n in orders)
            add_weights(points, self.numbers, *places, self.centre, self.axes, self.half, *nodes, *found)
            self.weights[key] = found
        return self.weights[key]


Facets = Mapping[Cluster, Sequence[Facet]]


def facets(integrals: Integrals) -> Facets:
    """The plane parts of all leaves; none of a leaf with elements that are not plane, or with few in each plane."""
    return {leaf: _facets(integrals, leaf) for leaf in integrals.tree.root.leaves()}


def _facets(integrals: Integrals, leaf: Cluster) -> tuple[Facet, ...]:
    kinds, found = list(integrals.elements([leaf])), []
    for kind, numbers in kinds:
        if kind.planes is None:
            return ()
        normals, nodes = kind.planes[numbers], kind.elements.nodes[numbers]
        heights = np.einsum("ex,ex->e", normals, nodes[:, 0])
        digits = np.round(np.column_stack([normals, heights]), SAME_PLANE)
        planes, plane = np.unique(digits, axis=0, return_inverse=True)
        if len(planes) * MIN_PLANE_ELEMENTS > len(numbers):
            return ()
        for number in range(len(planes)):
            own = plane.ravel() == number
            found.append(_facet(leaf, kind, numbers[own], normals[own][0], nodes[own].reshape(-1, 3)))
    return tuple(found)


def _facet(leaf: Cluster, kind: Kind, numbers: Indices, normal: Array, nodes: Array) -> Facet:
    along = np.eye(3)[np.abs(normal).argmin()]
    first = along - (along @ normal) * normal
    first /= np.linalg.norm(first)
    axes = np.stack([first, np.cross(normal, first)])
    local = nodes @ axes.T
    low, high = local.min(axis=0), local.max(axis=0)
    centre = (0.5 * (low + high)) @ axes + (nodes[0] @ normal) * normal
    sites, patches = kind.sites[numbers].ravel(), kind.patches[numbers].ravel()
    own = (sites >= leaf.sites.start) & (sites < leaf.sites.stop)
    return Facet(
        kind, numbers, normal, centre, axes, 0.5 * (high - low), np.unique(sites[own]), np.unique(patches[own])
    )


def _places(chosen: Indices, numbers: Indices) -> Indices:
    """The place of each number in some that rise, negative if it is not there."""
    found = np.searchsorted(chosen, numbers)
    there = chosen[np.minimum(found, len(chosen) - 1)] == numbers
    return np.where(there, found, -1)


@dataclass(frozen=True, eq=False)
class Interpolated:
    """Interpolated facets as seen from all sources of a row cluster.

    points, normals: (c, 3), facet by facet from starts[g] to starts[g + 1]; weights: all of them, flat; sites, patches:
    their places in the sums, likewise.
    """

    points: Array
    normals: Array
    starts: Indices
    weights: Array
    sites: tuple[Indices, Indices]
    patches: tuple[Indices, Indices]

    def add(self, kernel: Kernel, position: Array, sums: Sums) -> None:
        """Add the integrals that a source sees to its sums."""
        u, t = kernel.evaluate(self.points - position, self.normals)
        kernels = u.reshape(-1, 25), t.reshape(-1, 25)
        add_products(*kernels, self.starts, self.weights, *self.sites, *self.patches, sums)


def interpolated(
    integrals: Integrals,
    leaves: Sequence[Cluster],
    known: Facets,
    positions: Array,
    box: Array,
    accuracy: Accuracy,
    window: Window,
) -> tuple[Interpolated | None, list[Cluster]]:
    """The facets that are interpolated for the sources at positions (s, 3) in a box (2, 3), and leaves that are not."""
    chosen: list[tuple[Facet, Orders, tuple[Array, Array]]] = []
    others: list[Cluster] = []
    for leaf in leaves:
        orders = _orders(known[leaf], positions, box, accuracy)
        if orders is None:
            others.append(leaf)
        else:
            chosen += [(facet, own, facet.integrated(integrals, own, rules)) for facet, own, rules in orders]
    if not chosen:
        return None, others
    points = [facet.points(orders) for facet, orders, _ in chosen]
    counts = [len(part) for part in points]
    return Interpolated(
        np.concatenate(points),
        np.repeat([facet.normal for facet, _, _ in chosen], counts, axis=0),
        _starts(counts),
        np.concatenate([part.ravel() for _, _, weights in chosen for part in weights]),
        _side_by_side([window.site[facet.sites] for facet, _, _ in chosen]),
        _side_by_side([window.patch[facet.patches] for facet, _, _ in chosen]),
    ), others


def _orders(
    known: Sequence[Facet], positions: Array, box: Array, accuracy: Accuracy
) -> list[tuple[Facet, Orders, Orders]] | None:
    """The facets of a leaf with orders of interpolation and of the rules on elements; None if one is not worth it."""
    found = []
    for facet in known:
        needed = orders_of_facet(positions, facet.centre, facet.axes, facet.half, accuracy)
        if max(needed) > ORDERS[-1]:
            return None
        first, second = (ORDERS[np.searchsorted(ORDERS, n)] for n in needed)
        rules = orders_from(box, facet.kind, facet.numbers, accuracy)
        if first * second > WORTHWHILE * rules.prod(axis=1).sum():
            return None
        xi, eta = rules.max(axis=0).tolist()
        found.append((facet, (first, second), (xi, eta)))
    return found or None


def _side_by_side(parts: Sequence[Indices]) -> tuple[Indices, Indices]:
    return np.concatenate(parts), _starts([len(part) for part in parts])


def _starts(counts: Sequence[int]) -> Indices:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
