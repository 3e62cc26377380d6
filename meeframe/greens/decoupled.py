"""Fundamental solutions of other field sets than that for which the kernels are compiled."""

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

    inverse: (3, 3) of k; root: the root of its determinant.
    """

    inverse: Array
    root: float

    @classmethod
    def of(cls, coefficient: Array) -> "LaplaceKernel":
        """Return the kernel of a coefficient k (3, 3), symmetric and positive definite."""
        return cls(np.asarray(np.linalg.inv(coefficient)), float(np.sqrt(np.linalg.det(coefficient))))

    def evaluate(self, offset: Array, normal: Array) -> tuple[Array, Array]:
        """Return U and T, (n,) each, for offset (n, 3) and unit normal (n, 3)."""
        distance = np.sqrt(np.einsum("ni,ij,nj->n", offset, self.inverse, offset, optimize=True))
        u = -1.0 / (4.0 * np.pi * self.root * distance)
        return u, u * (offset * normal).sum(axis=1) / distance**2

    def gradient(self, offset: Array) -> Array:
        """Return U,q (n, 3) for offset (n, 3)."""
        reduced = offset @ self.inverse
        distance = np.sqrt((offset * reduced).sum(axis=1))
        gradient: Array = reduced / (4.0 * np.pi * self.root * distance**3)[:, None]
        return gradient


@final
@dataclass(frozen=True, eq=False)
class DecoupledKernel(Kernel):
    """Kernel of fields of which the last are coupled neither to each other nor to the others.

    coupled: kernel of N_FIELDS fields, of which the first `count` are used; scalars: those of the last fields.
    """

    coupled: Kernel
    count: int
    scalars: tuple[LaplaceKernel, ...]

    def evaluate(self, offset: Array, normal: Array) -> tuple[Array, Array]:
        """Return U and T, (n, fields, fields) each; see Kernel."""
        columns = [scalar.evaluate(offset, normal) for scalar in self.scalars]
        first = self.coupled.evaluate(offset, normal)
        return self._joined(first[0], [u for u, _ in columns]), self._joined(first[1], [t for _, t in columns])

    def integrate(self, offset: Array, weights: Array, starts: Indices, normals: Array) -> tuple[Array, Array] | None:
        """Return weighted sums of U and T over the points of plane pieces; see Kernel."""
        first = self.coupled.integrate(offset, weights, starts, normals)
        if first is None:
            return None
        points = slice(starts[0], starts[-1])
        at, shares = offset[points], weights[points]
        normal = np.repeat(normals, np.diff(starts), axis=0)
        columns = [scalar.evaluate(at, normal) for scalar in self.scalars]
        sums = [[np.add.reduceat(shares * part[:, None], starts[:-1] - starts[0]) for part in pair] for pair in columns]
        u, t = (part.reshape(*part.shape[:-1], N_FIELDS, N_FIELDS) for part in first)
        both = self._joined(u, [pair[0] for pair in sums]), self._joined(t, [pair[1] for pair in sums])
        return both[0].reshape(*u.shape[:-2], -1), both[1].reshape(*u.shape[:-2], -1)

    def gradient(self, offset: Array) -> Array:
        """Return U,q (n, fields, fields, 3) for offset (n, 3)."""
        count, size = self.count, self.count + len(self.scalars)
        gradient = np.zeros((len(offset), size, size, 3))
        gradient[:, :count, :count] = self.coupled.gradient(offset)[:, :count, :count]
        for column, scalar in enumerate(self.scalars, count):
            gradient[:, column, column] = scalar.gradient(offset)
        return gradient

    def _joined(self, coupled: Array, scalars: list[Array]) -> Array:
        count, size = self.count, self.count + len(scalars)
        joined = np.zeros((*coupled.shape[:-2], size, size))
        joined[..., :count, :count] = coupled[..., :count, :count]
        for column, scalar in enumerate(scalars, count):
            joined[..., column, column] = scalar
        return joined


def bind_fields(fundamental_solution: FundamentalSolution, stiffness: Array) -> Kernel:
    """Return the kernel of a scaled extended stiffness (3, fields, fields, 3) of any number of fields.

    Kernels of coupled fields are compiled for N_FIELDS. Fewer fields are complemented by decoupled ones; fields after
    these have the closed form of a scalar field, if they are not coupled. Raises MaterialError as `bind`, and if they
    are.
    """
    size = stiffness.shape[1]
    if size == N_FIELDS:
        return fundamental_solution.bind(stiffness)
    count = min(size, N_FIELDS)
    others = stiffness[:, count:].copy()
    for column in range(size - count):
        others[:, column, count + column] = 0.0
    if others.any():
        raise MaterialError("a further scalar field is coupled to others; allowed: decoupled ones")
    whole = np.zeros((3, N_FIELDS, N_FIELDS, 3))
    whole[:, :count, :count] = stiffness[:, :count, :count]
    for column in range(count, N_FIELDS):
        whole[:, column, column] = -np.eye(3)
    scalars = tuple(LaplaceKernel.of(-stiffness[:, column, column]) for column in range(count, size))
    return DecoupledKernel(fundamental_solution.bind(whole), count, scalars)
