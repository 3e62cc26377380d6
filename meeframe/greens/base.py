"""The contract of a fundamental solution, the response of an infinite body to extended point sources."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from meeframe.fields import Array, Indices


class Kernel(ABC):
    """A fundamental solution of one material, in scaled fields (see FieldScaling).

    Notes
    -----
    Index J is the responding field at x, index K the unit source at x'. Offsets are x - x', in any unit of length.
    """

    @abstractmethod
    def evaluate(self, offset: Array, normal: Array) -> tuple[Array, Array]:
        """Return the displacement and traction kernels U_JK and T_JK (eqs. 42, 47).

        Parameters
        ----------
        offset : Array
            Offsets, (n, 3), none of them zero.
        normal : Array
            Unit normals at x, (n, 3).

        Returns
        -------
        Array
            U, (n, fields, fields), C-contiguous; symmetric in J and K unless the temperature acts on other fields.
        Array
            T, (n, fields, fields), C-contiguous.

        Notes
        -----
        Implementations must allow calls from several threads at once.
        """

    def integrate(self, offset: Array, weights: Array, starts: Indices, normals: Array) -> tuple[Array, Array] | None:
        """Return weighted sums of U and T over the points of plane pieces of surface.

        Parameters
        ----------
        offset : Array
            Offsets of all points, (n, 3).
        weights : Array
            Weights, (n, k).
        starts : Indices
            First point of each piece, and n, (m + 1,).
        normals : Array
            Unit normals of the pieces, (m, 3).

        Returns
        -------
        tuple of Array or None
            Sums for U and for T, (m, k, fields^2) each, with entry (J, K) row by row. None, the default, if the caller
            must use `evaluate`.

        Notes
        -----
        A plane piece has one normal, so that the stiffness can be contracted with it once, not at every point.
        """
        return None

    def weakly_singular(self) -> Indices:
        """Return the entries f J + K of T that are integrable at the source, and have no part in its constant fields.

        Returns
        -------
        Indices
            Numbers of the entries; none by default: T is of order 1/r^2, and constant values are without flux.
        """
        return np.empty(0, np.int64)

    @abstractmethod
    def gradient(self, offset: Array) -> Array:
        """Return the derivatives U_PJ,q of the fundamental solution with respect to x (eq. 48).

        Parameters
        ----------
        offset : Array
            Offsets x - x', (n, 3).

        Returns
        -------
        Array
            Derivatives, (n, fields, fields, 3), with the direction q last.
        """


@dataclass(frozen=True)
class FundamentalSolution(ABC):
    """A method to compute the fundamental solution.

    The fields of a concrete class are its keys in case files.
    """

    def check(self, stiffness: Array) -> None:
        """Check that `bind` accepts a material; override it where that takes less than `bind`.

        Parameters
        ----------
        stiffness : Array
            Scaled extended stiffness C'_iJKm, (3, f, f, 3).

        Raises
        ------
        MaterialError
            If `bind` raises it.
        """
        self.bind(stiffness)

    @abstractmethod
    def bind(self, stiffness: Array) -> Kernel:
        """Return the kernel of a material.

        Parameters
        ----------
        stiffness : Array
            Scaled extended stiffness C'_iJKm, (3, f, f, 3).

        Returns
        -------
        Kernel
            The kernel.

        Raises
        ------
        MaterialError
            If this fundamental solution does not apply to the material.
        """
