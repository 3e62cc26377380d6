"""The contract of a surface element: nodes in a reference domain and monomials that span the shape functions."""

from abc import ABC, abstractmethod
from functools import lru_cache
from typing import Literal

import numpy as np

from meeframe.fields import Array

Reference = Literal["quadrilateral", "triangle"]
"""Reference cell of an element."""


class SurfaceElement(ABC):
    """An isoparametric Lagrange element, whose shape functions follow from its nodes and exponents.

    Notes
    -----
    The reference domain is the quadrilateral [-1, 1]^2 or the triangle with corners (0, 0), (1, 0) and (0, 1). Nodes
    are numbered as in meshio: corners counter-clockwise seen from outside the body, then mid-sides, then the centre.
    """

    @property
    @abstractmethod
    def name(self) -> str:
        """Short name, as in case files, for example 'quad4'."""

    @property
    @abstractmethod
    def meshio_type(self) -> str:
        """Name of the cell type in meshio, for example 'quad'."""

    @property
    @abstractmethod
    def reference(self) -> Reference:
        """The reference domain."""

    @property
    @abstractmethod
    def order(self) -> int:
        """Highest complete polynomial degree; the theoretical order of convergence in L2 is order + 1."""

    @property
    @abstractmethod
    def nodes(self) -> Array:
        """Reference coordinates of the nodes, (n, 2)."""

    @property
    @abstractmethod
    def exponents(self) -> Array:
        """Exponents (i, j) of the monomials xi^i eta^j that span the shape functions, (n, 2), integers."""


@lru_cache(maxsize=64)
def shape_coefficients(element: SurfaceElement) -> Array:
    """Return the coefficients of the shape functions in the monomials.

    Parameters
    ----------
    element : SurfaceElement
        Element type.

    Returns
    -------
    Array
        Coefficients a_nk with N_n = sum_k a_nk xi^i_k eta^j_k, (n, n), read-only, from N_n(node m) = delta_nm.
    """
    vandermonde = _monomials(element, element.nodes)
    coefficients: Array = np.ascontiguousarray(np.linalg.inv(vandermonde).T)
    coefficients.setflags(write=False)
    return coefficients


def shape_functions(element: SurfaceElement, xi: Array) -> Array:
    """Return the values of the shape functions.

    Parameters
    ----------
    element : SurfaceElement
        Element type.
    xi : Array
        Reference points, (m, 2).

    Returns
    -------
    Array
        Values N_n, (m, n).
    """
    values: Array = _monomials(element, np.asarray(xi, float)) @ shape_coefficients(element).T
    return values


def shape_derivatives(element: SurfaceElement, xi: Array) -> Array:
    """Return the derivatives of the shape functions.

    Parameters
    ----------
    element : SurfaceElement
        Element type.
    xi : Array
        Reference points, (m, 2).

    Returns
    -------
    Array
        Derivatives dN_n/dxi_k, (m, n, 2).
    """
    x, y = np.asarray(xi, float).T[:, :, None]
    i, j = element.exponents.T[:, None, :]
    along_x = i * x ** np.maximum(i - 1, 0) * y**j
    along_y = j * x**i * y ** np.maximum(j - 1, 0)
    coefficients = shape_coefficients(element).T
    return np.stack([along_x @ coefficients, along_y @ coefficients], axis=-1)


def _monomials(element: SurfaceElement, xi: Array) -> Array:
    x, y = xi.T[:, :, None]
    i, j = element.exponents.T[:, None, :]
    values: Array = x**i * y**j
    return values
