"""Fundamental solutions of field sets other than the one for which the kernels are compiled."""

from dataclasses import dataclass
from typing import final

import numpy as np

from meeframe.common.errors import MaterialError
from meeframe.fields import N_FIELDS, Array, Indices
from meeframe.greens._kernels.decoupled import combine, laplace, laplace_sums
from meeframe.greens.base import FundamentalSolution, Kernel
from meeframe.greens.thermal import HeatSource, ThermalKernel


@final
@dataclass(frozen=True, eq=False)
class LaplaceKernel:
    """Fundamental solution of -k_im phi_,im = -delta for one scalar field, with the flux -k_im phi_,m n_i.

    Attributes
    ----------
    inverse : Array
        Inverse of k, (3, 3).
    root : float
        Square root of the determinant of k.
    """

    inverse: Array
    root: float

    @classmethod
    def of(cls, coefficient: Array) -> "LaplaceKernel":
        """Return the kernel of a coefficient k (3, 3), symmetric and positive definite."""
        return cls(np.asarray(np.linalg.inv(coefficient)), float(np.sqrt(np.linalg.det(coefficient))))

    def evaluate(self, offset: Array, normal: Array) -> tuple[Array, Array]:
        """Return U and T, (n,) each, for offsets (n, 3) and unit normals (n, 3)."""
        u, t = laplace(self.inverse, self._factor, offset, normal)
        return u, t

    def integrate(self, offset: Array, weights: Array, starts: Indices, normals: Array) -> tuple[Array, Array]:
        """Return weighted sums of U and T over the points of plane pieces, (m, k) each; see `Kernel.integrate`."""
        u, t = laplace_sums(self.inverse, self._factor, offset, weights, starts, normals)
        return u, t

    def gradient(self, offset: Array) -> Array:
        """Return U,q, (n, 3), for offsets (n, 3)."""
        reduced = offset @ self.inverse
        distance = np.sqrt((offset * reduced).sum(axis=1))
        gradient: Array = reduced / (4.0 * np.pi * self.root * distance**3)[:, None]
        return gradient

    @property
    def _factor(self) -> float:
        return -1.0 / (4.0 * np.pi * self.root)


@final
@dataclass(frozen=True, eq=False)
class DecoupledKernel(Kernel):
    """Kernel of coupled fields followed by decoupled scalar fields.

    Attributes
    ----------
    coupled : Kernel
        Kernel of N_FIELDS fields.
    count : int
        Number of these fields that are used, from the first one on.
    scalars : tuple of LaplaceKernel
        Kernels of the scalar fields.
    """

    coupled: Kernel
    count: int
    scalars: tuple[LaplaceKernel, ...]

    def evaluate(self, offset: Array, normal: Array) -> tuple[Array, Array]:
        """Return U and T, (n, fields, fields) each; see `Kernel.evaluate`."""
        offset, normal = (np.ascontiguousarray(array, dtype=float) for array in (offset, normal))
        scalars = [scalar.evaluate(offset, normal) for scalar in self.scalars]
        u, t = self.coupled.evaluate(offset, normal)
        size = self.count + len(scalars)
        u, t = self._combine(u, [each for each, _ in scalars]), self._combine(t, [each for _, each in scalars])
        return u.reshape(-1, size, size), t.reshape(-1, size, size)

    def integrate(self, offset: Array, weights: Array, starts: Indices, normals: Array) -> tuple[Array, Array] | None:
        """Return weighted sums of U and T over the points of plane pieces; see `Kernel.integrate`."""
        coupled = self.coupled.integrate(offset, weights, starts, normals)
        if coupled is None:
            return None
        scalars = [scalar.integrate(offset, weights, starts, normals) for scalar in self.scalars]
        u, t = (
            self._combine(coupled[0], [each for each, _ in scalars]),
            self._combine(coupled[1], [each for _, each in scalars]),
        )
        return u.reshape(len(normals), weights.shape[1], -1), t.reshape(len(normals), weights.shape[1], -1)

    def gradient(self, offset: Array) -> Array:
        """Return U,q, (n, fields, fields, 3), for offsets (n, 3)."""
        count, size = self.count, self.count + len(self.scalars)
        gradient = np.zeros((len(offset), size, size, 3))
        gradient[:, :count, :count] = self.coupled.gradient(offset)[:, :count, :count]
        for column, scalar in enumerate(self.scalars, count):
            gradient[:, column, column] = scalar.gradient(offset)
        return gradient

    def _combine(self, coupled: Array, scalars: list[Array]) -> Array:
        """Return matrices (points, fields^2) of those of the coupled fields, and of the scalar fields at the points."""
        matrices = np.ascontiguousarray(coupled).reshape(-1, N_FIELDS**2)
        diagonal = np.empty((len(scalars), len(matrices)))
        for row, scalar in zip(diagonal, scalars, strict=True):
            row[:] = scalar.ravel()
        result: Array = combine(matrices, self.count, diagonal)
        return result


def bind_fields(
    fundamental_solution: FundamentalSolution,
    stiffness: Array,
    moduli: Array | None = None,
    temperature: int = N_FIELDS,
) -> Kernel:
    """Return the kernel of a material with any number of fields.

    Parameters
    ----------
    fundamental_solution : FundamentalSolution
        Method for the coupled fields.
    stiffness : Array
        Scaled extended stiffness, (3, fields, fields, 3).
    moduli : Array, optional
        Scaled thermal moduli, (3, 5), by which a temperature acts on the coupled fields.
    temperature : int
        Column of the temperature, if there are moduli.

    Raises
    ------
    MaterialError
        If a field after the first N_FIELDS is coupled, or as `FundamentalSolution.bind` and `HeatSource.of`.

    Notes
    -----
    Kernels of coupled fields are compiled for N_FIELDS. Fewer fields are complemented by decoupled ones. Decoupled
    scalar fields after these have a closed form.
    """
    size = stiffness.shape[1]
    if size == N_FIELDS:
        return fundamental_solution.bind(stiffness)
    coupled, count = _coupled_fields(stiffness)
    scalars = tuple(LaplaceKernel.of(-stiffness[:, column, column]) for column in range(count, size))
    kernel = DecoupledKernel(fundamental_solution.bind(coupled), count, scalars)
    if moduli is None or not moduli.any():
        return kernel
    heat = HeatSource.of(coupled, moduli, -stiffness[:, temperature, temperature])
    return ThermalKernel(kernel, size, temperature, heat)


def check_fields(
    fundamental_solution: FundamentalSolution,
    stiffness: Array,
    moduli: Array | None = None,
    temperature: int = N_FIELDS,
) -> None:
    """Raise MaterialError if `bind_fields`, with the same arguments, does."""
    coupled, _ = _coupled_fields(stiffness)
    fundamental_solution.check(coupled)
    if moduli is not None and moduli.any():
        HeatSource.check(coupled, moduli, -stiffness[:, temperature, temperature])


def _coupled_fields(stiffness: Array) -> tuple[Array, int]:
    """Return the stiffness of N_FIELDS fields, (3, 5, 5, 3), and how many of these, the first ones, the material has.

    Raises MaterialError if a field after the first N_FIELDS is coupled.
    """
    size = stiffness.shape[1]
    count = min(size, N_FIELDS)
    couplings = stiffness[:, count:].copy()
    for column in range(size - count):
        couplings[:, column, count + column] = 0.0
    if couplings.any():
        raise MaterialError("a further scalar field is coupled to others; allowed: decoupled fields")
    coupled = np.zeros((3, N_FIELDS, N_FIELDS, 3))
    coupled[:, :count, :count] = stiffness[:, :count, :count]
    for column in range(count, N_FIELDS):
        coupled[:, column, column] = -np.eye(3)
    return coupled, count
