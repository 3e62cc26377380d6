"""Exact solutions of the extended equations and the boundary value problems that have them."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, final

import numpy as np

from meeframe.elements.base import shape_derivatives
from meeframe.fields import N_FIELDS, Array, FieldScaling
from meeframe.greens import LineIntegral
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.mesh.surface import ElementBlock, SurfaceMesh
from meeframe.system.reduced import NodalFields


class ExactField(ABC):
    """A solution of the extended equations in a body, in SI units and global axes."""

    @abstractmethod
    def values(self, points: Array) -> Array:
        """Extended displacement (n, 5) at points (n, 3)."""

    @abstractmethod
    def fluxes(self, points: Array, normals: Array) -> Array:
        """Extended traction (n, 5) at points (n, 3) on unit normals (n, 3)."""


@final
@dataclass(frozen=True, eq=False)
class LinearField(ExactField):
    """u_J = gradient_Jm x_m + constant_J; stiffness (3, 5, 5, 3), gradient (5, 3), constant (5,)."""

    stiffness: Array
    gradient: Array
    constant: Array

    @classmethod
    def random(cls, stiffness: Array, seed: int, size: float = 1e-3) -> "LinearField":
        """A field whose scaled gradient and constant are of the given size in every entry."""
        scaling = FieldScaling.of(stiffness)
        rng = np.random.default_rng(seed)
        gradient = scaling.unscale_values(size * rng.normal(size=(3, N_FIELDS))).T
        return cls(stiffness, gradient, scaling.unscale_values(size * rng.normal(size=N_FIELDS)))

    def values(self, points: Array) -> Array:
        """Extended displacement (n, 5)."""
        values: Array = points @ self.gradient.T + self.constant
        return values

    def fluxes(self, points: Array, normals: Array) -> Array:
        """Extended traction (n, 5), the same at all points."""
        fluxes: Array = normals @ np.einsum("ijkm,km->ij", self.stiffness, self.gradient)
        return fluxes


@final
@dataclass(frozen=True, eq=False)
class PointSourceField(ExactField):
    """Field of an extended point source at a position (3,) outside the body; strength (5,) in scaled fields."""

    stiffness: Array
    position: Array
    strength: Array

    def values(self, points: Array) -> Array:
        """Extended displacement (n, 5), eq. (42)."""
        u, _ = self._kernels(points, np.broadcast_to([0.0, 0.0, 1.0], points.shape))
        return FieldScaling.of(self.stiffness).unscale_values(u @ self.strength)

    def fluxes(self, points: Array, normals: Array) -> Array:
        """Extended traction (n, 5), eq. (47)."""
        _, t = self._kernels(points, normals)
        return FieldScaling.of(self.stiffness).unscale_fluxes(t @ self.strength)

    def _kernels(self, points: Array, normals: Array) -> tuple[Array, Array]:
        scaled = FieldScaling.of(self.stiffness).scale_stiffness(self.stiffness)
        return LineIntegral().bind(scaled).evaluate(points - self.position, normals)


def prescribe(mesh: SurfaceMesh, field: ExactField, stiffness: Array, kinds: Mapping[str, str]) -> Body:
    """The body whose solution is a field.

    kinds: face group -> five letters, one a field: 'v' prescribes the value, 'f' the flux. Normals are the mean of the
    group's element normals at each point, so a group with prescribed fluxes must not have edges inside.
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
    """Root mean square errors of values and fluxes over the boundary nodes, worst field, relative to its own size."""
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
    """Unit normals at the nodes of each element, (e, n, 3)."""
    derivatives = shape_derivatives(block.element, block.element.nodes)
    tangents = np.einsum("ank,enx->eakx", derivatives, points[block.connectivity])
    normals = np.cross(tangents[:, :, 0], tangents[:, :, 1])
    return np.asarray(normals / np.linalg.norm(normals, axis=2, keepdims=True))
