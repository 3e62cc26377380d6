"""Fundamental solutions of field sets with further scalar fields, which are decoupled from all others."""

from dataclasses import dataclass
from typing import final

import numpy as np

from meeframe.common.errors import MaterialError
from meeframe.fields import N_FIELDS, Array, Indices
from meeframe.greens.base import FundamentalSolution, Kernel


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
        Kernel of the first N_FIELDS fields.
    scalars : tuple of LaplaceKernel
        Kernels of the scalar fields.
    """

    coupled: Kernel
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
        size = N_FIELDS + len(self.scalars)
        gradient = np.zeros((len(offset), size, size, 3))
        gradient[:, :N_FIELDS, :N_FIELDS] = self.coupled.gradient(offset)
        for column, scalar in enumerate(self.scalars, N_FIELDS):
            gradient[:, column, column] = scalar.gradient(offset)
        return gradient

    def _combine(self, coupled: Array, scalars: list[Array]) -> Array:
        size = N_FIELDS + len(scalars)
        combined = np.zeros((*coupled.shape[:-2], size, size))
        combined[..., :N_FIELDS, :N_FIELDS] = coupled
        for column, scalar in enumerate(scalars, N_FIELDS):
            combined[..., column, column] = scalar
        return combined


def bind_fields(fundamental_solution: FundamentalSolution, stiffness: Array) -> Kernel:
    """Return the kernel of a material with further scalar fields.

    Parameters
    ----------
    fundamental_solution : FundamentalSolution
        Method for the coupled fields of the default field set.
    stiffness : Array
        Scaled extended stiffness, (3, fields, fields, 3), of a field set that begins with the default one.

    Raises
    ------
    MaterialError
        If a further field is coupled, or as `FundamentalSolution.bind`.

    Notes
    -----
    Kernels of coupled fields are compiled for the default field set. Decoupled scalar fields have a closed form.
    """
    size = stiffness.shape[1]
    if size <= N_FIELDS:
        return fundamental_solution.bind(stiffness)
    couplings = stiffness[:, N_FIELDS:].copy()
    for column in range(size - N_FIELDS):
        couplings[:, column, N_FIELDS + column] = 0.0
    if couplings.any() or stiffness[:, :N_FIELDS, N_FIELDS:].any():
        raise MaterialError("a further scalar field is coupled to others; allowed: decoupled fields")
    coupled = fundamental_solution.bind(np.ascontiguousarray(stiffness[:, :N_FIELDS, :N_FIELDS]))
    scalars = tuple(LaplaceKernel.of(-stiffness[:, column, column]) for column in range(N_FIELDS, size))
    return DecoupledKernel(coupled, scalars)
