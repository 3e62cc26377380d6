"""Contract of a fundamental solution: the response of an infinite body to extended point sources."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

from meeframe.fields import Array, Indices


class Kernel(ABC):
    """A fundamental solution bound to one material; all fields scaled (see FieldScaling).

    Index J is the responding field at x, K the unit source at x'. offset = x - x', any length unit.
    """

    @abstractmethod
    def evaluate(self, offset: Array, normal: Array) -> tuple[Array, Array]:
        """Return the displacement and traction kernels U_JK and T_JK (eqs. 42, 47).

        offset: (n, 3), nowhere zero; normal: (n, 3) unit normals at x. Returns U (n, fields, fields), symmetric in J
        and K, and T (n, fields, fields); C-contiguous. Safe to call from several threads.
        """

    def integrate(self, offset: Array, weights: Array, starts: Indices, normals: Array) -> tuple[Array, Array] | None:
        """Return the sums of U and T times weights over the points of plane pieces of surface; None if `evaluate` has
        to serve.

        offset: (n, 3); weights: (n, k); starts: (m + 1,), piece e has the points from starts[e] to starts[e + 1];
        normals: (m, 3) unit normals of the pieces. Returns sums for U and T, (m, k, fields^2), entry (J, K) row
        by row.
        A plane has one normal, with which the stiffness need be contracted once and not at every point.
        """
        return None

    @abstractmethod
    def gradient(self, offset: Array) -> Array:
        """Return the derivatives U_PJ,q with respect to x (eq. 48), (n, fields, fields, 3), for offset (n, 3)."""


@dataclass(frozen=True)
class FundamentalSolution(ABC):
    """A way of computing the fundamental solution; the fields of a concrete class are its case-file keys."""

    @abstractmethod
    def bind(self, stiffness: Array) -> Kernel:
        """Return the kernel for one scaled extended stiffness C'_iJKm, (3, fields, fields, 3).

        Raises MaterialError if this fundamental solution does not apply to the material.
        """
