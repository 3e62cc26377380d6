"""Tensor rules on all elements of a block, for distant sources."""

import numpy as np

from meeframe.elements._kernels.quadrature import rectangular_rule, shape_degree
from meeframe.elements.base import shape_derivatives, shape_functions
from meeframe.elements.quadrature import element_extents, gauss_table, shape_table
from meeframe.fields import Array
from meeframe.formulations.dense_bem._kernels.assembly import RuleTable
from meeframe.mesh.surface import ElementBlock

TABULATED_ORDERS = (2, 3, 4, 5, 6, 8)
PLANE_TOLERANCE = 1e-12  # of unit normals


def tabulate(block: ElementBlock, points: Array, tolerance: float) -> RuleTable:
    """Return the tensor rules of the tabulated orders on all elements of a block.

    Parameters
    ----------
    block : ElementBlock
        The elements. Triangles have the same order in both directions.
    points : Array
        Points of the mesh, (p, 3), in units of the system.
    tolerance : float
        Relative error of each element integral.
    """
    triangle = block.element.reference == "triangle"
    orders = [(xi, eta) for xi in TABULATED_ORDERS for eta in TABULATED_ORDERS if xi == eta or not triangle]
    starts = np.full((max(TABULATED_ORDERS) + 1, max(TABULATED_ORDERS) + 1), -1)
    nodes = np.ascontiguousarray(points[block.connectivity])
    n_elements, n_nodes = block.connectivity.shape
    n_rows = n_elements * sum(xi * eta for xi, eta in orders)
    positions, normals, shape_weights = np.empty((n_rows, 3)), np.empty((n_rows, 3)), np.empty((n_rows, n_nodes))
    start = 0
    for xi, eta in orders:
        starts[xi, eta] = start
        rule, weights = np.empty((xi * eta, 2)), np.empty(xi * eta)
        rectangular_rule(xi, eta, triangle, gauss_table(), rule, weights)
        shapes, slopes = shape_functions(block.element, rule), shape_derivatives(block.element, rule)
        jacobians = np.cross(slopes[:, :, 0] @ nodes, slopes[:, :, 1] @ nodes)
        areas = np.linalg.norm(jacobians, axis=2, keepdims=True)
        rows = slice(start, start + n_elements * xi * eta)
        positions[rows] = (shapes @ nodes).reshape(-1, 3)
        normals[rows] = (jacobians / areas).reshape(-1, 3)
        shape_weights[rows] = (weights[:, None] * areas * shapes).reshape(-1, n_nodes)
        start = rows.stop
    extents = element_extents(block.element, nodes, tolerance)
    degree = shape_degree(shape_table(block.element))
    table = positions, normals, shape_weights
    return RuleTable(extents.centres, extents.sizes, extents.min_orders, degree, triangle, starts, *table)


def plane_normals(rules: RuleTable) -> Array | None:
    """Return the normals (e, 3) of the elements of a block if they are all plane, else None."""
    order = max(TABULATED_ORDERS)
    first = rules.starts[order, order]
    normals = rules.normals[first : first + order**2 * len(rules.centres)].reshape(-1, order**2, 3)
    plane = bool((np.abs(normals - normals[:, :1]) < PLANE_TOLERANCE).all())
    return np.ascontiguousarray(normals[:, 0]) if plane else None
