"""Integrals over planar facets of far leaves from few values of the kernel, by interpolation between Gauss points.

Far away the kernel is smooth over all elements of a leaf together: on a rectangle around them it is a polynomial to the
tolerance, given by its values at the Gauss points of the rectangle. The integrals of that polynomial times the shape
functions need no kernel and serve every row cluster that is far enough away.
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
from meeframe_hmatrix.rows import orders_from, quadrature_points

MAX_POINT_RATIO = 0.7
"""Largest ratio of points of a facet and points on its elements for which it is interpolated.

A larger ratio has no advantage, since all elements of a leaf are integrated if one facet is not interpolated
(measured)."""
ORDERS = (2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 14, 16)
"""Orders of interpolation; few, so that weights serve many row clusters."""
MIN_ELEMENTS = 4
"""Smallest average number of elements in each plane of a leaf; on curved surfaces each plane triangle has its plane."""
PLANE_DIGITS = 9
"""Number of digits to which normal and height of the elements of a plane agree."""

Orders = tuple[int, int]


@dataclass(frozen=True, eq=False)
class Facet:
    """The elements of one plane that touch the sites of a leaf.

    Attributes
    ----------
    kind, numbers
        The elements.
    normal
        Normal (3,).
    centre, axes, half_sides
        The rectangle around the elements: centre (3,), axes (2, 3), half sides (2,).
    sites, patches
        Sites and patches of the leaf that the elements touch.
    weights
        Integrals of the interpolating polynomials, (sites, p) and (patches, p), by the orders of interpolation and of
        the rules on elements.
    """

    kind: Kind
    numbers: Indices
    normal: Array
    centre: Array
    axes: Array
    half_sides: Array
    sites: Indices
    patches: Indices
    weights: dict[tuple[Orders, Orders], tuple[Array, Array]] = field(default_factory=dict)

    def points(self, orders: Orders) -> Array:
        """Return the points (p, 3) at which the kernel is evaluated."""
        first, second = (gauss_table().points[n, :n] for n in orders)
        positions = np.stack(np.meshgrid(first, second, indexing="ij"), axis=-1).reshape(-1, 2)
        result: Array = self.centre + (positions * self.half_sides) @ self.axes
        return result

    def integrate(self, integrals: Integrals, orders: Orders, rules: Orders) -> tuple[Array, Array]:
        """Return the weights (sites, p), (patches, p) of the values at the points, by rules on the elements."""
        key = orders, rules
        if key not in self.weights:
            selection = np.tile(rules, (len(self.numbers), 1))
            quadrature, _ = quadrature_points(
                integrals, np.zeros(3), self.kind, self.numbers, selection, np.full(selection.shape, np.nan)
            )
            result = np.zeros((len(self.sites), prod(orders))), np.zeros((len(self.patches), prod(orders)))
            positions = (
                _find_positions(self.sites, self.kind.sites[self.numbers]),
                _find_positions(self.patches, self.kind.patches[self.numbers]),
            )
            nodes = (gauss_table().points[n, :n] for n in orders)
            add_weights(quadrature, self.numbers, *positions, self.centre, self.axes, self.half_sides, *nodes, *result)
            self.weights[key] = result
        return self.weights[key]


Facets = Mapping[Cluster, Sequence[Facet]]


def facets(integrals: Integrals) -> Facets:
    """Return the facets of all leaves; none for a leaf with elements that are not planar, or with few in each plane."""
    return {leaf: _facets(integrals, leaf) for leaf in integrals.tree.root.leaves()}


def _facets(integrals: Integrals, leaf: Cluster) -> tuple[Facet, ...]:
    kinds, result = list(integrals.elements([leaf])), []
    for kind, numbers in kinds:
        if kind.planes is None:
            return ()
        normals, nodes = kind.planes[numbers], kind.elements.nodes[numbers]
        heights = np.einsum("ex,ex->e", normals, nodes[:, 0])
        rounded = np.round(np.column_stack([normals, heights]), PLANE_DIGITS)
        planes, plane = np.unique(rounded, axis=0, return_inverse=True)
        if len(planes) * MIN_ELEMENTS > len(numbers):
            return ()
        for number in range(len(planes)):
            selection = plane.ravel() == number
            result.append(
                _facet(leaf, kind, numbers[selection], normals[selection][0], nodes[selection].reshape(-1, 3))
            )
    return tuple(result)


def _facet(leaf: Cluster, kind: Kind, numbers: Indices, normal: Array, nodes: Array) -> Facet:
    axis = np.eye(3)[np.abs(normal).argmin()]
    first = axis - (axis @ normal) * normal
    first /= np.linalg.norm(first)
    axes = np.stack([first, np.cross(normal, first)])
    local = nodes @ axes.T
    low, high = local.min(axis=0), local.max(axis=0)
    centre = (0.5 * (low + high)) @ axes + (nodes[0] @ normal) * normal
    sites, patches = kind.sites[numbers].ravel(), kind.patches[numbers].ravel()
    selection = (sites >= leaf.sites.start) & (sites < leaf.sites.stop)
    return Facet(
        kind,
        numbers,
        normal,
        centre,
        axes,
        0.5 * (high - low),
        np.unique(sites[selection]),
        np.unique(patches[selection]),
    )


def _find_positions(selected: Indices, numbers: Indices) -> Indices:
    """Return the position of each number among ascending ones, negative if it is not there."""
    result = np.searchsorted(selected, numbers)
    present = selected[np.minimum(result, len(selected) - 1)] == numbers
    return np.where(present, result, -1)


@dataclass(frozen=True, eq=False)
class InterpolatedFacets:
    """Interpolated facets, for all sources of a row cluster.

    Attributes
    ----------
    points, normals
        Points and normals (c, 3), facet by facet from starts[g] to starts[g + 1].
    starts
        First points of the facets.
    weights
        All weights, flat.
    sites, patches
        Positions in the sums, and their starts.
    """

    points: Array
    normals: Array
    starts: Indices
    weights: Array
    sites: tuple[Indices, Indices]
    patches: tuple[Indices, Indices]

    def add(self, kernel: Kernel, position: Array, sums: Sums) -> None:
        """Add the integrals seen from a source to its sums."""
        u, t = kernel.evaluate(self.points - position, self.normals)
        n_points, n_fields = len(u), u.shape[1]
        kernels = u.reshape(n_points, -1), t.reshape(n_points, -1)
        add_products(tuple(range(n_fields)), *kernels, self.starts, self.weights, *self.sites, *self.patches, sums)


def interpolate(
    integrals: Integrals,
    leaves: Sequence[Cluster],
    facets_of_leaves: Facets,
    positions: Array,
    box: Array,
    accuracy: Accuracy,
    window: Window,
) -> tuple[InterpolatedFacets | None, list[Cluster]]:
    """Return the facets that are interpolated for sources at positions (s, 3) in a box (2, 3), and the other leaves."""
    selected: list[tuple[Facet, Orders, tuple[Array, Array]]] = []
    other_leaves: list[Cluster] = []
    for leaf in leaves:
        orders = _orders(facets_of_leaves[leaf], positions, box, accuracy)
        if orders is None:
            other_leaves.append(leaf)
        else:
            selected += [
                (facet, selection, facet.integrate(integrals, selection, rules)) for facet, selection, rules in orders
            ]
    if not selected:
        return None, other_leaves
    points = [facet.points(orders) for facet, orders, _ in selected]
    counts = [len(array) for array in points]
    return InterpolatedFacets(
        np.concatenate(points),
        np.repeat([facet.normal for facet, _, _ in selected], counts, axis=0),
        _starts(counts),
        np.concatenate([array.ravel() for _, _, weights in selected for array in weights]),
        _side_by_side([window.site[facet.sites] for facet, _, _ in selected]),
        _side_by_side([window.patch[facet.patches] for facet, _, _ in selected]),
    ), other_leaves


def _orders(
    facets_of_leaves: Sequence[Facet], positions: Array, box: Array, accuracy: Accuracy
) -> list[tuple[Facet, Orders, Orders]] | None:
    """Return the facets of a leaf with orders of interpolation and of the rules on elements; None if inefficient."""
    result = []
    for facet in facets_of_leaves:
        required = orders_of_facet(positions, facet.centre, facet.axes, facet.half_sides, accuracy)
        if max(required) > ORDERS[-1]:
            return None
        first, second = (ORDERS[np.searchsorted(ORDERS, n)] for n in required)
        rules = orders_from(box, facet.kind, facet.numbers, accuracy)
        if first * second > MAX_POINT_RATIO * rules.prod(axis=1).sum():
            return None
        xi, eta = rules.max(axis=0).tolist()
        result.append((facet, (first, second), (xi, eta)))
    return result or None


def _side_by_side(arrays: Sequence[Indices]) -> tuple[Indices, Indices]:
    return np.concatenate(arrays), _starts([len(array) for array in arrays])


def _starts(counts: Sequence[int]) -> Indices:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
