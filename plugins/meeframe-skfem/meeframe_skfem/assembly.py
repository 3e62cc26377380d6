"""Stiffness matrix and surface integrals, by batched products over elements.

Symbols: C_iJKm extended stiffness; B gradients of shape functions times the square root of the measure.
"""

from typing import Final

import numpy as np
from scipy.sparse import bsr_array, coo_array, csr_array

from meeframe.plugin import Array, Indices, SurfaceElement
from meeframe.plugin.surfaces import VOLUME_ORDER, gauss_rule, normal_vectors, shape_functions
from meeframe_skfem.elements import cell_rule, tabulate
from meeframe_skfem.volume import VolumeMesh

_BATCH: Final = 4_000_000  # numbers in the largest array of a batch


def stiffness_matrix(mesh: VolumeMesh, stiffness: Array) -> csr_array:
    """Assemble the stiffness matrix K = int N_a,i C_iJKm N_b,m dV.

    Parameters
    ----------
    mesh : VolumeMesh
        The volume mesh.
    stiffness : Array
        Extended stiffness, (3, f, f, 3) of f fields, in the units of the points.

    Returns
    -------
    csr_array
        K, (f p, f p), with unknown f a + J.
    """
    n_points, (n_cells, n_nodes), n_fields = len(mesh.points), mesh.cells.shape, stiffness.shape[1]
    keys_of_entries = (mesh.cells[:, :, None] * n_points + mesh.cells[:, None, :]).ravel()
    keys, number = np.unique(keys_of_entries, return_inverse=True)
    number = number.reshape(n_cells, -1)
    blocks = np.zeros((n_fields**2, len(keys)))
    law = stiffness.transpose(0, 3, 1, 2).reshape(9, n_fields**2)
    step = max(1, _BATCH // (n_nodes**2 * n_fields**2))
    for start in range(0, n_cells, step):
        batch = slice(start, start + step)
        entries = _products(mesh, mesh.cells[batch]) @ law
        indices = number[batch].ravel()
        block_numbers, local = np.unique(indices, return_inverse=True)
        for component in range(n_fields**2):
            blocks[component, block_numbers] += np.bincount(local, entries[:, component])
    starts = np.searchsorted(keys, np.arange(n_points + 1) * n_points)
    data = blocks.T.reshape(-1, n_fields, n_fields)
    return csr_array(bsr_array((data, keys % n_points, starts), shape=(n_fields * n_points,) * 2))


def gradients(nodes: Array, slopes: Array) -> tuple[Array, Array]:
    """Return derivatives of shape functions by position.

    Parameters
    ----------
    nodes : Array
        Positions of the nodes, (e, n, 3).
    slopes : Array
        Derivatives by reference coordinates, (m, n, 3).

    Returns
    -------
    Array
        Derivatives by position, (e, m, n, 3).
    Array
        Jacobians, (e, m).
    """
    maps = np.einsum("mnk,enx->emkx", slopes, nodes)
    return np.einsum("emxk,mnk->emnx", np.linalg.inv(maps), slopes), np.linalg.det(maps)


def _products(mesh: VolumeMesh, cells: Indices) -> Array:
    """Return int N_a,i N_b,m dV of each cell, with a row for each (cell, a, b) and columns (i, m)."""
    xi, weights = cell_rule(mesh.element)
    slopes, jacobians = gradients(mesh.points[cells], tabulate(mesh.element, xi)[1])
    n_cells, n_rule, n_nodes, _ = slopes.shape
    b = (slopes * np.sqrt(jacobians * weights)[..., None, None]).reshape(n_cells, n_rule, 3 * n_nodes)
    products = (b.transpose(0, 2, 1) @ b).reshape(n_cells, n_nodes, 3, n_nodes, 3)
    return products.transpose(0, 1, 3, 2, 4).reshape(-1, 9)


def face_masses(points: Array, element: SurfaceElement, connectivity: Indices) -> Array:
    """Return int N_a N_b dS over each face, (f, k, k), for connectivity (f, k)."""
    xi, weights = gauss_rule(element.reference, VOLUME_ORDER)
    shape = shape_functions(element, xi)
    measures = np.linalg.norm(normal_vectors(points, element, connectivity, xi), axis=-1) * weights
    masses: Array = np.einsum("fm,ma,mb->fab", measures, shape, shape, optimize=True)
    return masses


def mass_matrix(points: Array, element: SurfaceElement, connectivity: Indices) -> csr_array:
    """Return int N_a N_b dS over all faces, (n, n) for n points, for connectivity (f, k)."""
    masses, k = face_masses(points, element, connectivity), connectivity.shape[1]
    rows, columns = np.repeat(connectivity, k, axis=1).ravel(), np.tile(connectivity, k).ravel()
    return csr_array(coo_array((masses.ravel(), (rows, columns)), shape=(len(points),) * 2))
