"""Exact solutions of the extended equations, and boundary value problems with these solutions."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, final

import numpy as np

from meeframe.elements.base import shape_derivatives
from meeframe.fields import Array, FieldScaling
from meeframe.greens import LineIntegral
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.mesh.surface import ElementBlock, SurfaceMesh
from meeframe.system.reduced import NodalFields


class ExactField(ABC):
    """Abstract solution of the extended equations in a body, in SI units and global axes."""

    @abstractmethod
    def values(self, points: Array) -> Array:
        """Return the extended displacement (n, f) at points (n, 3)."""

    @abstractmethod
    def fluxes(self, points: Array, normals: Array) -> Array:
        """Return the extended traction (n, f) at points (n, 3) with unit normals (n, 3)."""


@final
@dataclass(frozen=True, eq=False)
class LinearField(ExactField):
    """Linear field u_J = gradient_Jm x_m + constant_J.

    Attributes
    ----------
    stiffness
        Extended stiffness (3, f, f, 3).
    gradient
        Gradient (f, 3).
    constant
        Constant (f,).
    """

    stiffness: Array
    gradient: Array
    constant: Array

    @classmethod
    def random(cls, stiffness: Array, seed: int, size: float = 1e-3) -> "LinearField":
        """Return a random field whose scaled gradient and constant have entries of the given size."""
        scaling = FieldScaling.of(stiffness)
        rng = np.random.default_rng(seed)
        n_fields = stiffness.shape[1]
        gradient = scaling.unscale_values(size * rng.normal(size=(3, n_fields))).T
        return cls(stiffness, gradient, scaling.unscale_values(size * rng.normal(size=(n_fields,))))

    def values(self, points: Array) -> Array:
        """Return the extended displacement (n, f)."""
        values: Array = points @ self.gradient.T + self.constant
        return values

    def fluxes(self, points: Array, normals: Array) -> Array:
        """Return the extended traction (n, f), which is uniform."""
        fluxes: Array = normals @ np.einsum("ijkm,km->ij", self.stiffness, self.gradient)
        return fluxes


@final
@dataclass(frozen=True, eq=False)
class PointSourceField(ExactField):
    """Field of an extended point source outside the body.

    Attributes
    ----------
    stiffness
        Extended stiffness (3, 5, 5, 3).
    position
        Position (3,) of the source.
    strength
        Strength (5,) in scaled fields.
    """

    stiffness: Array
    position: Array
    strength: Array

    def values(self, points: Array) -> Array:
        """Return the extended displacement (n, 5), eq. (42)."""
        u, _ = self._kernels(points, np.broadcast_to([0.0, 0.0, 1.0], points.shape))
        return FieldScaling.of(self.stiffness).unscale_values(u @ self.strength)

    def fluxes(self, points: Array, normals: Array) -> Array:
        """Return the extended traction (n, 5), eq. (47)."""
        _, t = self._kernels(points, normals)
        return FieldScaling.of(self.stiffness).unscale_fluxes(t @ self.strength)

    def _kernels(self, points: Array, normals: Array) -> tuple[Array, Array]:
        scaled = FieldScaling.of(self.stiffness).scale_stiffness(self.stiffness)
        return LineIntegral().bind(scaled).evaluate(points - self.position, normals)


def prescribe(mesh: SurfaceMesh, field: ExactField, stiffness: Array, kinds: Mapping[str, str]) -> Body:
    """Return the body with boundary conditions that have a field as solution.

    Parameters
    ----------
    mesh
        Surface mesh.
    field
        The solution.
    stiffness
        Extended stiffness (3, 5, 5, 3).
    kinds
        Five letters for each face group, one for each field: 'v' prescribes the value, 'f' the flux. Normals are
        averaged over the elements of the group at each point, so that a group with prescribed fluxes must not contain
        edges.
    """
    conditions = []
    for name, letters in kinds.items():
        points = mesh.points[mesh.group_points(name)]
        data = {"v": field.values(points), "f": field.fluxes(points, _group_normals(mesh, name))}
        for number, letter in enumerate(letters):
            kind: Literal["value", "flux"] = "value" if letter == "v" else "flux"
            conditions.append(BoundaryCondition(name, number, kind, data[letter][:, number]))
    return Body(stiffness, mesh, tuple(conditions), None)


def relative_errors(mesh: SurfaceMesh, field: ExactField, computed: NodalFields) -> tuple[float, float]:
    """Return the root mean square errors of values and fluxes over the boundary nodes.

    Each is that of the worst field, relative to the size of the exact field.
    """
    normals = np.zeros_like(computed.points)
    for block, (_, connectivity) in zip(mesh.blocks, computed.cells, strict=True):
        np.add.at(normals, connectivity, _corner_normals(block, mesh.points))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)

    def worst(approximate: Array, exact: Array) -> float:
        return float((np.linalg.norm(approximate - exact, axis=0) / np.linalg.norm(exact, axis=0)).max())

    return (
        worst(computed.values, field.values(computed.points)),
        worst(computed.fluxes, field.fluxes(computed.points, normals)),
    )


def _group_normals(mesh: SurfaceMesh, name: str) -> Array:
    normals = np.zeros_like(mesh.points)
    index = mesh.group(name)
    for block in mesh.blocks:
        members = block.groups == index
        np.add.at(normals, block.connectivity[members], _corner_normals(block, mesh.points)[members])
    normals = normals[mesh.group_points(name)]
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def _corner_normals(block: ElementBlock, points: Array) -> Array:
    """Return the unit normals at the nodes of each element, (e, n, 3)."""
    derivatives = shape_derivatives(block.element, block.element.nodes)
    tangents = np.einsum("ank,enx->eakx", derivatives, points[block.connectivity])
    normals = np.cross(tangents[:, :, 0], tangents[:, :, 1])
    return np.asarray(normals / np.linalg.norm(normals, axis=2, keepdims=True))
