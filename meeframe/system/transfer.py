"""A body on the nodes of another one whose contact zone is divided differently, by mortar transfer.

Tractions and fluxes t of the first body and displacements and potentials u of the second are projected in the mean
square on the shape functions of the other surface,

    M_2 t_2 = M_12^T t,    M_1 u = M_12 u_2,

with the integrals M of products of shape functions (`meeframe.mesh.mortar`), in axes that are common to both. Both
maps are adjoint: the work of a load on a displacement is the same on both surfaces, so that reciprocal compliances
remain so. Forces, fluxes and moments of normal tractions are conserved, and constant fields are transferred exactly.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, final

import numpy as np
import scipy  # its parts load where they are used

from meeframe.common.errors import MeshError
from meeframe.fields import MECHANICAL, Array
from meeframe.mesh.measures import corners, vector_areas
from meeframe.mesh.mortar import Mortar, find_mortar
from meeframe.mesh.regular import Cells
from meeframe.system.capabilities import AnyArray, FieldwiseApply, apply_fields
from meeframe.system.composed import Rotation
from meeframe.system.reduced import NodalFields, ReducedSystem

SAME_WEIGHTS: Final = 1e-6
"""Largest difference between the weights of a system and the integrals of its shape functions, relative to the largest
weight."""


@final
@dataclass(frozen=True, eq=False)
class Transfer:
    """Transfer of nodal values between two surfaces with different divisions and frames.

    Attributes
    ----------
    mortar
        Integrals over both surfaces.
    first, second
        Components in the local frames of either surface from those in the axes of the mortar.
    """

    mortar: Mortar
    first: Rotation
    second: Rotation

    def __getstate__(self) -> dict[str, Any]:
        return {name: self.__dict__[name] for name in ("mortar", "first", "second")}  # factors are not picklable

    @cached_property
    def _factors(self) -> tuple["scipy.sparse.linalg.SuperLU", "scipy.sparse.linalg.SuperLU"]:
        one, two = (scipy.sparse.linalg.splu(mass.tocsc()) for mass in (self.mortar.first, self.mortar.second))
        return one, two

    def project_load(self, values: Array) -> Array:
        """Return densities (m, k) on the second surface for densities (n, k) on the first, in common axes."""
        projected: Array = self._factors[1].solve(np.ascontiguousarray(self.mortar.mixed.T @ values))
        return projected

    def project_displacement(self, values: Array) -> Array:
        """Return displacements (n, k) on the first surface for displacements (m, k) of the second, in common axes."""
        projected: Array = self._factors[0].solve(np.ascontiguousarray(self.mortar.mixed @ values))
        return projected

    def body_fields(self, fields: Sequence[int]) -> list[int]:
        """Return the fields of the second body on which fields of the first depend."""
        return self.second.closure(self.first.closure(fields))

    def to_body(self, load: Array, source: Sequence[int], target: Sequence[int]) -> Array:
        """Return components of loads (n, l) on the first body at the nodes and in the frames of the second."""
        common = self.first.closure(source)
        projected = self.project_load(self.first.inverse.change(load.astype(np.float64), source, common))
        return self.second.change(projected, common, target)

    def from_body(self, displacement: AnyArray, source: Sequence[int], target: Sequence[int]) -> Array:
        """Return components of displacements (m, l) of the second body at the nodes and in the frames of the first."""
        common = self.first.closure(target)
        in_axes = self.second.inverse.change(displacement.astype(np.float64), source, common)
        return self.first.change(self.project_displacement(in_axes), common, target)

    def matrix(self, compliance: Array) -> Array:
        """Return the compliance (n, f, n, f) on the first surface for that of the second body, (m, f, m, f)."""
        second, first = self._blocks(self.second), self._blocks(self.first)
        in_axes = np.einsum("bji,bjck,ckl->bicl", second, compliance, second, optimize=True)
        n, size = len(first), compliance.shape[1]
        result = np.empty((n, size, n, size))
        for i, j in np.ndindex(size, size):
            rows = self.project_displacement(in_axes[:, i, :, j])
            result[:, i, :, j] = (self.mortar.mixed @ self._factors[1].solve(np.ascontiguousarray(rows.T))).T
        rotated: Array = np.einsum("aij,ajck,clk->aicl", first, result, first, optimize=True)
        return rotated

    def _blocks(self, rotation: Rotation) -> Array:
        n = self.mortar.mixed.shape[0 if rotation is self.first else 1]
        blocks = np.zeros((n, rotation.n_fields, rotation.n_fields))
        for (i, j), entry in rotation.entries.items():
            blocks[:, i, j] = entry
        return blocks


@final
@dataclass(frozen=True, eq=False)
class TransferredSystem(ReducedSystem, FieldwiseApply):
    """A body on the nodes and in the frames of another one.

    It has no capability but `FieldwiseApply`: grids, edges and parts of the zone belong to one of the divisions.

    Attributes
    ----------
    body
        The system of the body on its nodes.
    transfer
        The transfer to these.
    matrix
        (n, fields, n, fields), the compliance if the body has its own as a matrix.
    self_compliance
        (n, fields, fields), response of each node to its own load; an estimate if the body has no matrix: of the
        nearest node of the body, in proportion to the sizes of elements.
    """

    body: ReducedSystem
    transfer: Transfer
    matrix: Array | None
    self_compliance: Array

    def apply(self, load: Array) -> Array:
        """Return compliance(load), (n, fields), for a load (n, fields)."""
        if self.matrix is not None:
            response: Array = self.matrix.reshape(load.size, load.size) @ np.ravel(load)
            return response.reshape(load.shape)
        fields = range(self.n_fields)
        response = self.body.apply(self.transfer.to_body(load, fields, fields))
        return self.transfer.from_body(response, fields, fields)

    def apply_fields(self, load: Array, loaded: Sequence[int], fields: Sequence[int]) -> Array:
        """Return the displacement in some fields by a product of the body in those on which they depend."""
        inner_loaded, inner_fields = self.transfer.body_fields(loaded), self.transfer.body_fields(fields)
        response = apply_fields(
            self.body, self.transfer.to_body(load, loaded, inner_loaded), inner_loaded, inner_fields
        )
        return self.transfer.from_body(response, inner_fields, fields)

    def diagonal_blocks(self) -> Array:
        """Return the response of each node to its own load, (n, fields, fields); see `self_compliance`."""
        return self.self_compliance

    def diagonal(self, fields: Sequence[int]) -> Array:
        """Return the diagonals of `diagonal_blocks` in k fields, (n, k)."""
        return self.self_compliance[:, list(fields), list(fields)]

    def dense(self) -> Array | None:
        """Return the compliance, (n, fields, n, fields), if the body has its own as a matrix."""
        return self.matrix

    def recover(self, load: Array) -> NodalFields:
        """Return the fields on the whole boundary of the body, in its own coordinates."""
        fields = range(self.n_fields)
        return self.body.recover(self.transfer.to_body(load, fields, fields))


def transfer_body(first: ReducedSystem, body: ReducedSystem, axes: Array) -> TransferredSystem:
    """Return a body on the nodes and in the frames of another one.

    Parameters
    ----------
    first
        The system with the nodes and frames.
    body
        The body, in its own coordinates.
    axes
        (3,) signs that change the coordinates of the body to those of the first.

    Raises
    ------
    MeshError
        As `find_mortar`, and if the weights of a system are not the integrals of its shape functions.
    """
    mortar = find_mortar(first.points, first.cells, body.points * axes, body.cells)
    for system, mass, name in ((first, mortar.first, "first"), (body, mortar.second, "second")):
        if np.abs(mass.sum(axis=1) - system.weights).max() > SAME_WEIGHTS * np.abs(system.weights).max():
            raise MeshError(
                f"the contact zones of the two bodies are divided differently, and the formulation of the {name} body "
                "does not interpolate loads by the shape functions of its elements; allowed: the same nodes in both"
            )
    n_fields = first.n_fields
    transfer = Transfer(
        mortar,
        _frames_from_axes(first.frames, mortar.axes, n_fields),
        _frames_from_axes(body.frames * axes, mortar.axes, n_fields),
    )
    compliance = body.dense()
    matrix = None if compliance is None else transfer.matrix(compliance)
    nodes = np.arange(len(first.points))
    blocks = _estimated_blocks(first, body, transfer, axes) if matrix is None else matrix[nodes, :, nodes, :]
    offset = transfer.from_body(body.offset, range(n_fields), range(n_fields))
    geometry = (first.points, first.frames, first.weights, first.cells, offset)
    return TransferredSystem(*geometry, body, transfer, matrix, blocks)


def _frames_from_axes(frames: Array, axes: Array, n_fields: int) -> Rotation:
    blocks = np.tile(np.eye(n_fields), (len(frames), 1, 1))
    blocks[:, MECHANICAL, MECHANICAL] = frames @ axes.T
    return Rotation.of(blocks)


def _estimated_blocks(first: ReducedSystem, body: ReducedSystem, transfer: Transfer, axes: Array) -> Array:
    """Return the response of the nearest node of a body to its own load, in proportion to the sizes of elements."""
    _, nearest = scipy.spatial.cKDTree(body.points * axes).query(first.points)
    blocks = transfer.second.inverse.change_blocks(body.diagonal_blocks())[nearest]
    size, other_size = (_node_areas(system.points, system.cells) for system in (first, body))
    scaled: Array = blocks * np.sqrt(size / other_size[nearest])[:, None, None]
    return transfer.first.change_blocks(scaled)


def _node_areas(points: Array, cells: Cells) -> Array:
    """Return areas (n,) of elements shared among their nodes; unlike weights, all of them are positive."""
    areas = np.zeros(len(points))
    for (_, nodes), outline in zip(cells, corners(cells), strict=True):
        share = np.linalg.norm(vector_areas(points[outline]), axis=1, keepdims=True) / nodes.shape[1]
        np.add.at(areas, nodes, np.broadcast_to(share, nodes.shape))
    return areas
