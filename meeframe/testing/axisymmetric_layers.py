"""Frictionless contact of axisymmetric layers with a sphere or a flat punch, by Fredholm integral equations.

The transforms of the normal traction and of the fluxes of conducting fields are t^_J(k) = integral of chi_J(s) cos(k s)
over the contact, 0 < s < a, which leaves the surface beside it free. The displacement and the potentials in the contact
then give an equation of the second kind with the kernel m(z) = integral of (Y - Y of the top material) cos(k z) dk.
Source: Lebedev and Ufliand, J. Appl. Math. Mech. 22 (1958) 442; Dhaliwal and Rau, Int. J. Eng. Sci. 8 (1970) 843.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
import scipy  # submodules are loaded on first use

from meeframe.fields import MECHANICAL, NORMAL, Array
from meeframe.material.layers import LayerStack
from meeframe.material.surface_symbol import SurfaceSymbol

_GAUSS: Final = 20
_MAX_PHASE: Final = 8.0
_INTERPOLATED: Final = 24
_LOWEST, _HIGHEST = 1e-4, 60.0
"""Wave numbers times the thickness of all layers, or of the top layer, between which kernels are integrated."""


@dataclass(frozen=True)
class AxisymmetricContact:
    """Solution of a contact problem.

    Attributes
    ----------
    approach
        Approach of the indenter [m].
    radius
        Radius of the contact [m].
    force
        Normal force > 0 [N].
    fluxes
        Total flux of each conducting field, outward, by its column.
    centre
        (fields - 2,) normal displacement and potentials at the centre of the surface [SI].
    """

    approach: float
    radius: float
    force: float
    fluxes: Mapping[int, float]
    centre: Array


@dataclass(frozen=True, eq=False)
class AxisymmetricLayers:
    """Axisymmetric layers on a half space or a rigid base.

    Parameters
    ----------
    stiffness
        Stiffness below the layers, (3, fields, fields, 3) [SI]; the normal is e3.
    layers
        The layers.
    potentials
        Potentials of the indenter by the columns of the conducting fields; other fields are insulated.
    """

    stiffness: Array
    layers: LayerStack
    potentials: Mapping[int, float]

    def press_sphere(self, radius: float, contact_radius: float) -> AxisymmetricContact:
        """Return the solution for a paraboloid of this radius of curvature and a contact of that radius."""
        solution = _Equation(self, contact_radius)
        right = np.zeros((len(solution.points), solution.size, 2))
        right[:, 0, 0] = -1.0
        right[:, 0, 1] = solution.points**2 / radius
        for row, field in enumerate(solution.fields[1:], 1):
            right[:, row, 1] = self.potentials[field] / solution.factors[field]
        right[:, 0] /= solution.factors[NORMAL]
        chi = solution.solve(right)
        at_edge = solution.at_edge(
            chi, np.array([[-1.0, contact_radius**2 / radius]]) / solution.factors[NORMAL], self.potentials
        )
        approach = -at_edge[0, 1] / at_edge[0, 0]
        return solution.contact(approach, chi[..., 0] * approach + chi[..., 1])

    def press_sphere_by(self, radius: float, approach: float) -> AxisymmetricContact:
        """Return the solution for a paraboloid at this approach > 0 [m]."""

        def excess(contact_radius: float) -> float:
            return self.press_sphere(radius, contact_radius).approach / approach - 1.0

        first = np.sqrt(radius * approach)
        solution = scipy.optimize.root_scalar(excess, x0=first, x1=1.1 * first, xtol=1e-13 * first)
        return self.press_sphere(radius, float(solution.root))

    def press_punch(self, contact_radius: float, approach: float) -> AxisymmetricContact:
        """Return the solution for a flat punch."""
        solution = _Equation(self, contact_radius)
        right = np.zeros((len(solution.points), solution.size, 1))
        right[:, 0] = -approach / solution.factors[NORMAL]
        for row, field in enumerate(solution.fields[1:], 1):
            right[:, row] = self.potentials[field] / solution.factors[field]
        return solution.contact(approach, solution.solve(right)[..., 0])


class _Equation:
    """The integral equation on a contact, in scaled fields, by the Nystrom method on Gauss points."""

    def __init__(self, body: AxisymmetricLayers, radius: float) -> None:
        symbol = SurfaceSymbol.of(body.stiffness, body.layers, np.eye(3), np.zeros(1))
        self.factors, self.radius = symbol.factors, radius
        self.fields = [NORMAL, *sorted(body.potentials)]
        self.size = len(self.fields)
        self.all_fields = [NORMAL, *range(MECHANICAL.stop, len(self.factors))]
        depths = [layer.thickness for layer in body.layers.layers]
        depths += [] if body.layers.base is None else [body.layers.base.thickness]
        self.wave_numbers, self.weights_in_k = _wave_rule(sum(depths), depths[0], 2.0 * radius)
        picked = np.ix_(self.all_fields, self.all_fields)
        difference = symbol.difference(self.wave_numbers)[:, 0].real
        self.difference = difference[:, self.all_fields][:, :, self.all_fields]
        self.top = symbol.top[0].real[picked]
        x, w = np.polynomial.legendre.leggauss(24 + int(12 * radius / depths[0]))
        self.points, self.weights = 0.5 * radius * (1.0 + x), 0.5 * radius * w
        self.rows = [self.all_fields.index(field) for field in self.fields]
        inner = np.ix_(self.rows, self.rows)
        kernel = self._kernel(self.points, self.points)[:, :, self.rows][:, :, :, self.rows]
        n = len(self.points)
        matrix = np.einsum("xsJK,s->xJsK", kernel, self.weights)
        matrix[np.arange(n), :, np.arange(n)] += 0.5 * np.pi * self.top[inner]
        self.factorized = scipy.linalg.lu_factor(matrix.reshape(n * self.size, -1))

    def _kernel(self, x: Array, s: Array) -> Array:
        """Return (m(x - s) + m(x + s)) / 2 for all scalar fields, (x, s, fields, fields)."""
        weighted = self.difference * self.weights_in_k[:, None, None]
        along, other = np.cos(np.outer(x, self.wave_numbers)), np.cos(np.outer(s, self.wave_numbers))
        kernel = np.empty((len(x), len(s), *weighted.shape[1:]))
        for row, column in np.ndindex(*weighted.shape[1:]):
            kernel[:, :, row, column] = (along * weighted[:, row, column]) @ other.T
        return kernel

    def solve(self, right: Array) -> Array:
        """Return chi (points, fields, n) for right-hand sides (points, fields, n)."""
        chi = scipy.linalg.lu_solve(self.factorized, right.reshape(-1, right.shape[2]))
        return np.asarray(chi).reshape(right.shape)

    def at_edge(self, chi: Array, normal: Array, potentials: Mapping[int, float]) -> Array:
        """Return chi (fields, 2) at the border of the contact, by the integral equation itself."""
        right = np.zeros((self.size, 2))
        right[0] = normal
        right[1:, 1] = [potentials[field] / self.factors[field] for field in self.fields[1:]]
        inner = np.ix_(self.rows, self.rows)
        kernel = self._kernel(np.array([self.radius]), self.points)[0][:, self.rows][:, :, self.rows]
        right -= np.einsum("sJK,s,sKn->Jn", kernel, self.weights, chi)
        return np.asarray(np.linalg.solve(0.5 * np.pi * self.top[inner], right))

    def contact(self, approach: float, chi: Array) -> AxisymmetricContact:
        """Return the solution of densities chi (points, fields)."""
        totals = 2.0 * np.pi * self.weights @ chi / self.factors[self.fields]
        kernel = self._kernel(np.zeros(1), self.points)[0][:, :, self.rows]
        centre = np.einsum("sJK,s,sK->J", kernel, self.weights, chi)
        centre += 0.5 * np.pi * self.top[:, self.rows] @ self._at_centre(chi)
        fluxes = dict(zip(self.fields[1:], totals[1:].tolist(), strict=True))
        return AxisymmetricContact(
            approach, self.radius, -float(totals[0]), fluxes, centre * self.factors[self.all_fields]
        )

    def _at_centre(self, chi: Array) -> Array:
        """Return chi (fields,) at the centre, by interpolation of an even function between the closest points."""
        x, y = self.points[:_INTERPOLATED], chi[:_INTERPOLATED]
        both, values = np.concatenate([-x[::-1], x]), np.concatenate([y[::-1], y])
        return np.asarray(scipy.interpolate.BarycentricInterpolator(both, values)(0.0))


def _wave_rule(depth: float, thinnest: float, distance: float) -> tuple[Array, Array]:
    """Return nodes and weights of the integral over k."""
    edges = [0.0, _LOWEST / depth]
    while edges[-1] < _HIGHEST / thinnest:
        edges.append(1.6 * edges[-1])
    ends = [
        np.linspace(low, high, int(np.ceil((high - low) * distance / _MAX_PHASE)), endpoint=False)
        for low, high in pairwise(edges)
    ]
    all_ends = np.append(np.concatenate(ends), edges[-1])
    x, w = np.polynomial.legendre.leggauss(_GAUSS)
    half = 0.5 * np.diff(all_ends)
    return (all_ends[:-1, None] + half[:, None] * (1.0 + x)).ravel(), (half[:, None] * w).ravel()
