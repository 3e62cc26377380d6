"""Stiffness and surface integrals, by batched products over all elements at once.

Symbols: C_iJKm extended stiffness; B gradients of shape functions times the square root of the measure.
"""

from typing import Final

import numpy as np
from scipy.sparse import bsr_array, csr_array

from meeframe.plugin import Array, Indices, SurfaceElement
from meeframe.plugin.surfaces import ORDER, gauss_rule, normal_vectors, shape_functions
from meeframe_skfem.elements import cell_rule, tabulate
from meeframe_skfem.volume import VolumeMesh

_BATCH: Final = 4_000_000  # numbers in the largest array of a batch


def stiffness_matrix(mesh: VolumeMesh, stiffness: Array) -> csr_array:
    """Assemble K = int N_a,i C_iJKm N_b,m dV, (f p, f p), with the unknowns f a + J.

    stiffness: (3, f, f, 3) of f fields, in the units of the points.
    """
    n_points, (n_cells, n_nodes), n_fields = len(mesh.points), mesh.cells.shape, stiffness.shape[1]
    pairs = (mesh.cells[:, :, None] * n_points + mesh.cells[:, None, :]).ravel()
    keys, number = np.unique(pairs, return_inverse=True)
    number = number.reshape(n_cells, -1)
    blocks = np.zeros((n_fields**2, len(keys)))
    law = stiffness.transpose(0, 3, 1, 2).reshape(9, n_fields**2)
    step = max(1, _BATCH // (n_nodes**2 * n_fields**2))
    for start in range(0, n_cells, step):
        part = slice(start, start + step)
        entries = _products(mesh, mesh.cells[part]) @ law
        where = number[part].ravel()
        touched, local = np.unique(where, return_inverse=True)
        for component in range(n_fields**2):
            blocks[component, touched] += np.bincount(local, entries[:, component])
    starts = np.searchsorted(keys, np.arange(n_points + 1) * n_points)
    data = blocks.T.reshape(-1, n_fields, n_fields)
    return csr_array(bsr_array((data, keys % n_points, starts), shape=(n_fields * n_points,) * 2))


def gradients(nodes: Array, slopes: Array) -> tuple[Array, Array]:
    """Derivatives of shape functions (e, m, n, 3) by position, and Jacobians (e, m).

    nodes: (e, n, 3) positions; slopes: (m, n, 3) derivatives by reference coordinates.
    """
    maps = np.einsum("mnk,enx->emkx", slopes, nodes)
    return np.einsum("emxk,mnk->emnx", np.linalg.inv(maps), slopes), np.linalg.det(maps)


def _products(mesh: VolumeMesh, cells: Indices) -> Array:
    """int N_a,i N_b,m dV of each cell, a row for each (cell, a, b), columns (i, m)."""
    xi, weights = cell_rule(mesh.element)
    slopes, jacobians = gradients(mesh.points[cells], tabulate(mesh.element, xi)[1])
    n_cells, n_rule, n_nodes, _ = slopes.shape
    b = (slopes * np.sqrt(jacobians * weights)[..., None, None]).reshape(n_cells, n_rule, 3 * n_nodes)
    products = (b.transpose(0, 2, 1) @ b).reshape(n_cells, n_nodes, 3, n_nodes, 3)
    return products.transpose(0, 1, 3, 2, 4).reshape(-1, 9)


def face_masses(points: Array, element: SurfaceElement, connectivity: Indices) -> Array:
    """int N_a N_b dS of each face, (f, k, k); connectivity (f, k)."""
    xi, weights = gauss_rule(element.reference, ORDER)
    shape = shape_functions(element, xi)
    measures = np.linalg.norm(normal_vectors(points, element, connectivity, xi), axis=-1) * weights
    masses: Array = np.einsum("fm,ma,mb->fab", measures, shape, shape, optimize=True)
    return masses
