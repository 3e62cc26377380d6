"""Fundamental solutions of field sets other than the one for which the kernels are compiled."""

from dataclasses import dataclass
from typing import final

import numpy as np

from meeframe.common.errors import MaterialError
from meeframe.fields import N_FIELDS, Array, Indices
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
        distance = np.sqrt(np.einsum("ni,ij,nj->n", offset, self.inverse, offset, optimize=True))
        u = -1.0 / (4.0 * np.pi * self.root * distance)
        return u, u * (offset * normal).sum(axis=1) / distance**2

    def gradient(self, offset: Array) -> Array:
        """Return U,q, (n, 3), for offsets (n, 3)."""
        reduced = offset @ self.inverse
        distance = np.sqrt((offset * reduced).sum(axis=1))
        gradient: Array = reduced / (4.0 * np.pi * self.root * distance**3)[:, None]
        return gradient


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
        columns = [scalar.evaluate(offset, normal) for scalar in self.scalars]
        first = self.coupled.evaluate(offset, normal)
        return self._combine(first[0], [u for u, _ in columns]), self._combine(first[1], [t for _, t in columns])

    def integrate(self, offset: Array, weights: Array, starts: Indices, normals: Array) -> tuple[Array, Array] | None:
        """Return weighted sums of U and T over the points of plane pieces; see `Kernel.integrate`."""
        first = self.coupled.integrate(offset, weights, starts, normals)
        if first is None:
            return None
        points = slice(starts[0], starts[-1])
        piece_offsets, shares = offset[points], weights[points]
        normal = np.repeat(normals, np.diff(starts), axis=0)
        columns = [scalar.evaluate(piece_offsets, normal) for scalar in self.scalars]
        sums = [[np.add.reduceat(shares * k[:, None], starts[:-1] - starts[0]) for k in kernels] for kernels in columns]
        u, t = (array.reshape(*array.shape[:-1], N_FIELDS, N_FIELDS) for array in first)
        u_all, t_all = self._combine(u, [u_sum for u_sum, _ in sums]), self._combine(t, [t_sum for _, t_sum in sums])
        return u_all.reshape(*u.shape[:-2], -1), t_all.reshape(*u.shape[:-2], -1)

    def gradient(self, offset: Array) -> Array:
        """Return U,q, (n, fields, fields, 3), for offsets (n, 3)."""
        count, size = self.count, self.count + len(self.scalars)
        gradient = np.zeros((len(offset), size, size, 3))
        gradient[:, :count, :count] = self.coupled.gradient(offset)[:, :count, :count]
        for column, scalar in enumerate(self.scalars, count):
            gradient[:, column, column] = scalar.gradient(offset)
        return gradient

    def _combine(self, coupled: Array, scalars: list[Array]) -> Array:
        count, size = self.count, self.count + len(scalars)
        combined = np.zeros((*coupled.shape[:-2], size, size))
        combined[..., :count, :count] = coupled[..., :count, :count]
        for column, scalar in enumerate(scalars, count):
            combined[..., column, column] = scalar
        return combined


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
    count = min(size, N_FIELDS)
    couplings = stiffness[:, count:].copy()
    for column in range(size - count):
        couplings[:, column, count + column] = 0.0
    if couplings.any():
        raise MaterialError("a further scalar field is coupled to others; allowed: decoupled fields")
    complemented = np.zeros((3, N_FIELDS, N_FIELDS, 3))
    complemented[:, :count, :count] = stiffness[:, :count, :count]
    for column in range(count, N_FIELDS):
        complemented[:, column, column] = -np.eye(3)
    scalars = tuple(LaplaceKernel.of(-stiffness[:, column, column]) for column in range(count, size))
    kernel = DecoupledKernel(fundamental_solution.bind(complemented), count, scalars)
    if moduli is None:
        return kernel
    heat = HeatSource.of(complemented, moduli, -stiffness[:, temperature, temperature])
    return ThermalKernel(kernel, temperature, heat)
