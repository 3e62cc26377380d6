"""Exact solutions of the extended equations, and boundary value problems with these solutions."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, final

import numpy as np

from meeframe.elements.base import shape_derivatives
from meeframe.fields import N_FIELDS, Array, FieldScaling
from meeframe.greens import LineIntegral
from meeframe.greens.decoupled import LaplaceKernel
from meeframe.greens.thermal import HeatSource
from meeframe.material import Material
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.mesh.surface import ElementBlock, SurfaceMesh
from meeframe.system.reduced import NodalFields


class ExactField(ABC):
    """Abstract solution of the extended equations in a body, in SI units and global axes."""

    @abstractmethod
    def values(self, points: Array) -> Array:
        """Return the extended displacement.

        Parameters
        ----------
        points : Array
            Positions, (n, 3) [m].

        Returns
        -------
        Array
            Displacement and potentials, (n, f), SI units; potentials are not negated.
        """

    @abstractmethod
    def fluxes(self, points: Array, normals: Array) -> Array:
        """Return the extended traction.

        Parameters
        ----------
        points : Array
            Positions, (n, 3) [m].
        normals : Array
            Unit normals, (n, 3).

        Returns
        -------
        Array
            Tractions and fluxes along the normals, (n, f), SI units.
        """


@final
@dataclass(frozen=True, eq=False)
class LinearField(ExactField):
    """Linear field u_J = gradient_Jm x_m + constant_J.

    Attributes
    ----------
    stiffness : Array
        Extended stiffness (3, f, f, 3).
    gradient : Array
        Gradient (f, 3).
    constant : Array
        Constant (f,).
    """

    stiffness: Array
    gradient: Array
    constant: Array

    @classmethod
    def random(cls, stiffness: Array, seed: int, size: float = 1e-3) -> "LinearField":
        """Return a random field.

        Parameters
        ----------
        stiffness : Array
            Extended stiffness, (3, f, f, 3), SI units.
        seed : int
            Seed of the random numbers.
        size : float, optional
            Standard deviation of the entries of the scaled gradient and constant.

        Returns
        -------
        LinearField
            The field.
        """
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
    stiffness : Array
        Extended stiffness (3, 5, 5, 3).
    position : Array
        Position (3,) of the source.
    strength : Array
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


@final
@dataclass(frozen=True, eq=False)
class ThermalField(ExactField):
    """Temperature level + slope . x, and a displacement and potentials that are in equilibrium with it.

    With slope zero nothing is under stress or carries a flux; else u_K = a_Kmn x_m x_n / 2 with C_iJKm a_Kmi =
    beta_iJ slope_i.

    Attributes
    ----------
    material : Material
        Material with thermal moduli.
    level : float
        Temperature at the origin [K].
    slope : Array
        Gradient of the temperature (3,) [K/m].
    """

    material: Material
    level: float
    slope: Array

    def _coefficients(self) -> tuple[Array, Array]:
        """Return uniform gradients (5, 3) of the free expansion at the level, and a (5, 3, 3), symmetric."""
        c, beta = self.material.stiffness[:, :5, :5], thermal_moduli(self.material)
        scaling = self.material.scaling.factors[:5]
        # gradients with a symmetric displacement part; scaled unknowns, as the SI units differ by many decades
        scaled = c * scaling[:, None, None] * scaling[None, :, None]
        beta = beta * scaling
        gradient = np.linalg.lstsq(scaled.reshape(15, 15), self.level * beta.ravel(), rcond=1e-9)[0].reshape(5, 3)
        # the first component of least norm of a that satisfies equilibrium
        equations = np.zeros((5, 5, 3, 3))
        for i, m in np.ndindex(3, 3):
            equations[:, :, m, i] += scaled[i, :, :, m] / 2.0
            equations[:, :, i, m] += scaled[i, :, :, m] / 2.0
        a = np.linalg.lstsq(equations.reshape(5, 45), self.slope @ beta, rcond=1e-12)[0].reshape(5, 3, 3)
        a = (a + a.transpose(0, 2, 1)) / 2.0
        return scaling[:, None] * gradient, scaling[:, None, None] * a

    def values(self, points: Array) -> Array:
        """Return the extended displacement (n, 6)."""
        gradient, a = self._coefficients()
        values = np.empty((len(points), 6))
        values[:, :5] = points @ gradient.T + np.einsum("kmn,pm,pn->pk", a, points, points) / 2.0
        values[:, 5] = self.level + points @ self.slope
        return values

    def fluxes(self, points: Array, normals: Array) -> Array:
        """Return the extended traction (n, 6)."""
        gradient, a = self._coefficients()
        gradients = gradient + np.einsum("kmn,pn->pkm", a, points)
        c, beta = self.material.stiffness[:, :5, :5], thermal_moduli(self.material)
        fluxes = np.empty((len(points), 6))
        stress = np.einsum("ijkm,pkm->pij", c, gradients)
        temperature = self.level + points @ self.slope
        fluxes[:, :5] = np.einsum("pi,pij->pj", normals, stress - temperature[:, None, None] * beta)
        fluxes[:, 5] = -normals @ (self.material.decoupled[0][1] @ self.slope)
        return fluxes


@final
@dataclass(frozen=True, eq=False)
class HeatSourceField(ExactField):
    """Field of a heat source of 1 W outside the body.

    Attributes
    ----------
    material : Material
        Material with thermal moduli.
    position : Array
        Position (3,) of the source.
    """

    material: Material
    position: Array

    def values(self, points: Array) -> Array:
        """Return the extended displacement (n, 6)."""
        offset = points - self.position
        w, _ = self._source.evaluate(offset, offset)
        return np.column_stack([w * self._factors, self._temperature(offset)])

    def fluxes(self, points: Array, normals: Array) -> Array:
        """Return the extended traction (n, 6)."""
        offset = points - self.position
        gradients = self._source.gradient(offset) * self._factors[:, None]
        stress = np.einsum("iJKm,nKm->niJ", self.material.stiffness[:, :N_FIELDS, :N_FIELDS], gradients)
        stress -= self._temperature(offset)[:, None, None] * thermal_moduli(self.material)
        conducted = -self._conduction.evaluate(offset, normals)[1]
        return np.column_stack([np.einsum("ni,niJ->nJ", normals, stress), conducted])

    def _temperature(self, offset: Array) -> Array:
        return -self._conduction.evaluate(offset, offset)[0]

    @cached_property
    def _factors(self) -> Array:
        factors = self.material.scaling.factors
        result: Array = factors[:N_FIELDS] * factors[N_FIELDS]
        return result

    @cached_property
    def _source(self) -> HeatSource:
        factors, conductivity = self.material.scaling.factors, self.material.decoupled[0][1]
        stiffness = self.material.scaling.scale_stiffness(self.material.stiffness)[:, :N_FIELDS, :N_FIELDS]
        moduli = thermal_moduli(self.material) * self._factors
        return HeatSource.of(stiffness, moduli, conductivity * factors[N_FIELDS] ** 2)

    @cached_property
    def _conduction(self) -> LaplaceKernel:
        return LaplaceKernel.of(self.material.decoupled[0][1])


def thermal_moduli(material: Material) -> Array:
    """Return the thermal moduli of a material.

    Parameters
    ----------
    material : Material
        The material.

    Returns
    -------
    Array
        Moduli, (3, 5), SI units; zero if it has none.
    """
    return np.zeros((3, N_FIELDS)) if material.thermal_moduli is None else material.thermal_moduli


def with_heat(body: Body, material: Material) -> Body:
    """Return a body with the fields and thermal moduli of a material.

    Parameters
    ----------
    body : Body
        The body.
    material : Material
        The material.

    Returns
    -------
    Body
        The body with heat.
    """
    return replace(body, fields=material.fields, thermal_moduli=material.thermal_moduli)


def prescribe(mesh: SurfaceMesh, field: ExactField, stiffness: Array, kinds: Mapping[str, str]) -> Body:
    """Return the body with boundary conditions that have a field as solution.

    Parameters
    ----------
    mesh : SurfaceMesh
        Surface mesh.
    field : ExactField
        The solution.
    stiffness : Array
        Extended stiffness (3, 5, 5, 3).
    kinds : dict of str to str
        Five letters for each face group, one for each field: 'v' prescribes the value, 'f' the flux. Normals are
        averaged over the elements of the group at each point, so that a group with prescribed fluxes must not contain
        edges.

    Returns
    -------
    Body
        The body, without a contact zone.
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

    Parameters
    ----------
    mesh : SurfaceMesh
        Surface mesh.
    field : ExactField
        The exact field.
    computed : NodalFields
        The computed fields on the boundary.

    Returns
    -------
    float
        Error of the values in the worst field, relative to the size of the exact field.
    float
        Error of the fluxes, likewise.
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
