"""Elimination of the potentials at contact size: system (30) between tractions and displacements alone.

On the set A of (node, potential) pairs that conduct, flux density f and potential obey, with resistance R = 1/kappa,
    (C_AA + R) f = -(potential_o + offset)_A - C_Am p;
the displacement is then offset_m + C_mm p + C_mA f. A perfect conductor is R = 0 exactly; insulated pairs are not in A.
C_AA has a positive-definite symmetric part, so that the system is regular for any R >= 0.

Potentials of the indenter that follow from prescribed totals are additional unknowns
(meeframe.solvers.conduction.floating).
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from meeframe.contact.conduction import Mask
from meeframe.contact.problem import ContactProblem
from meeframe.fields import MECHANICAL, POTENTIALS, Array, Indices
from meeframe.solvers.conduction.floating import Floating

DEFAULT_TOLERANCE: Final = 1e-13
"""Default relative tolerance of iterations for the flux equations."""


@dataclass(frozen=True, eq=False)
class Response:
    """Response of a body to tractions, or its change.

    Attributes
    ----------
    flux : Array
        (n, channels), flux densities.
    displacement : Array
        (n, 3), displacement [m].
    potential : Array
        (j,), potentials of the floating conductors [V], [A].
    """

    flux: Array
    displacement: Array
    potential: Array


@dataclass(frozen=True, eq=False)
class Conductors:
    """Contact with given resistances, prepared for repeated responses.

    Attributes
    ----------
    resistance : Array
        (n, channels), 1/kappa, inf where insulated.
    floating : Floating
        Floating conductors.
    data : object
        Further data that the elimination stores for later use.
    """

    resistance: Array
    floating: Floating
    data: Any

    def without_floating(self, flux: Array, potential: Array) -> Array:
        """Return the flux (n, channels) less the contribution of potentials (j,) of the floating conductors."""
        if potential.size == 0:
            return flux
        return flux - scatter_flux(np.isfinite(self.resistance), self.floating.flux @ potential)


@dataclass(frozen=True, eq=False)
class Elimination(ABC):
    """Mechanical response of a problem's contact zone with the potentials eliminated."""

    problem: ContactProblem

    @abstractmethod
    def prepare(self, resistance: Array, previous: Conductors | None) -> Conductors:
        """Return conductors of the resistances (n, channels), with the data of `previous` as far as applicable."""

    @abstractmethod
    def respond(
        self,
        traction: Array,
        conductors: Conductors,
        guess: Array,
        reduction: float = 0.0,
        allowed_error: float = DEFAULT_TOLERANCE,
    ) -> Response:
        """Return the response to tractions alone.

        Parameters
        ----------
        traction : Array
            (n, 3) [Pa], admissible: tangential only if the law has some, none where there is no indenter above. With
            tractions in single precision the response may be in single precision.
        conductors : Conductors
            Conductors in force.
        guess : Array
            (n, channels), approximate flux, as from Conductors.without_floating.
        reduction : float, optional
            Part of the guess's error that may remain: iterations whose guesses improve need no more.
        allowed_error : float, optional
            Allowed error of the potential, relative to the displacement with the guess where something conducts, both
            in square roots of the nodes' self-compliances.

        Returns
        -------
        Response
            Displacements that no contact condition needs may be left zero.
        """

    @abstractmethod
    def state(
        self,
        traction: Array,
        conductors: Conductors,
        flux: Array,
        potential: Array,
        reduction: float = 0.0,
        allowed_error: float = 0.0,
    ) -> Response:
        """Return the total response, including offset, potentials of the indenter and prescribed totals.

        Parameters
        ----------
        traction, conductors, reduction
            As in `respond`.
        flux : Array
            (n, channels), approximate flux.
        potential : Array
            (j,), approximate potentials of the floating conductors.
        allowed_error : float, optional
            Allowed norm of the error of the potential, divided by square roots of the nodes' self-compliances.

        Returns
        -------
        Response
            As in `respond`.
        """


@dataclass(frozen=True, eq=False)
class _Blocks:
    """Blocks of the compliance between the tractions and the fluxes that conduct.

    pairs: (a,) flat numbers of the conducting (node, field) pairs; to_flux: (a, k); from_flux: (k, a);
    self_compliance: (a, a).
    """

    pairs: Indices
    to_flux: Array
    from_flux: Array
    self_compliance: Array


@dataclass(frozen=True, eq=False)
class _Factor:
    """Factorised flux equations.

    scale: (a,) roots of the Jacobi scaling, which makes the equations independent of units.
    """

    blocks: _Blocks
    scale: Array
    lu: tuple[Array, Array]

    def solve(self, difference: Array) -> Array:
        """Return the flux densities (a,) that raise (-phi, -psi) by the differences (a,)."""
        flux: Array = self.scale * lu_solve(self.lu, self.scale * difference, check_finite=False)
        return flux


@dataclass(frozen=True, eq=False)
class _Prepared:
    """Factorised equations, None if nothing conducts; unloaded: the state without tractions."""

    factor: _Factor | None
    unloaded: Response


@final
@dataclass(frozen=True, eq=False)
class DenseElimination(Elimination):
    """Elimination by LU factorisation.

    matrix: (n fields, n fields) compliance; dofs: (k,) flat numbers of the (node, field) pairs that can carry a
    traction; mechanical: (k, k) their block of the matrix.
    """

    matrix: Array
    dofs: Indices
    mechanical: Array

    def prepare(self, resistance: Array, previous: Conductors | None) -> Conductors:
        """Return the conductors of resistances (n, channels).

        The factorisation is reused while the resistances stay, its blocks while the set of conducting pairs stays.
        """
        if previous is not None and np.array_equal(previous.resistance, resistance):
            return previous
        factor = self._factor(resistance, None if previous is None else previous.data.factor)
        conducts = np.isfinite(resistance)
        floating = Floating.of(self.problem, conducts, factor.solve if factor else np.zeros_like)
        flux, displacement = np.zeros((2, *self.problem.system.offset.shape))
        potential = np.zeros(0)
        if factor is not None:
            unloaded_flux = factor.solve(difference(self.problem)[conducts])
            balanced, potential = floating.balance(unloaded_flux, floating.totals)
            flux.flat[factor.blocks.pairs] = balanced
            displacement.flat[self.dofs] = factor.blocks.from_flux @ balanced
        displacement += self.problem.system.offset
        unloaded = Response(flux[:, POTENTIALS], displacement[:, MECHANICAL], potential)
        return Conductors(resistance, floating, _Prepared(factor, unloaded))

    def respond(
        self,
        traction: Array,
        conductors: Conductors,
        guess: Array,
        reduction: float = 0.0,
        allowed_error: float = DEFAULT_TOLERANCE,
    ) -> Response:
        """Return the response to tractions, as in Elimination; the guess is not used."""
        factor: _Factor | None = conductors.data.factor
        potential = np.zeros(0)
        load, flux, displacement = np.zeros((3, *self.problem.system.offset.shape))
        load[:, MECHANICAL] = traction
        active = load.flat[self.dofs]
        response = self.mechanical @ active
        if factor is not None:
            fixed_flux = factor.solve(-(factor.blocks.to_flux @ active))
            balanced, potential = conductors.floating.balance(fixed_flux, 0.0)
            flux.flat[factor.blocks.pairs] = balanced
            response += factor.blocks.from_flux @ balanced
        displacement.flat[self.dofs] = response
        return Response(flux[:, POTENTIALS], displacement[:, MECHANICAL], potential)

    def state(
        self,
        traction: Array,
        conductors: Conductors,
        flux: Array,
        potential: Array,
        reduction: float = 0.0,
        allowed_error: float = 0.0,
    ) -> Response:
        """Return the total response, as in Elimination; the initial guesses are not used."""
        change, unloaded = self.respond(traction, conductors, flux), conductors.data.unloaded
        displacement, potential = change.displacement + unloaded.displacement, change.potential + unloaded.potential
        return Response(change.flux + unloaded.flux, displacement, potential)

    def _factor(self, resistance: Array, previous: _Factor | None) -> _Factor | None:
        full = np.full(self.problem.system.offset.shape, np.inf)
        full[:, POTENTIALS] = resistance
        pairs = np.flatnonzero(np.isfinite(full))
        if pairs.size == 0:
            return None
        blocks = previous.blocks if previous and np.array_equal(previous.blocks.pairs, pairs) else self._blocks(pairs)
        equations = blocks.self_compliance + np.diag(full.flat[pairs])
        scale = np.diag(equations) ** -0.5
        lu = lu_factor(scale[:, None] * equations * scale, overwrite_a=True, check_finite=False)
        return _Factor(blocks, scale, lu)

    def _blocks(self, pairs: Indices) -> _Blocks:
        return _Blocks(
            pairs,
            self.matrix[np.ix_(pairs, self.dofs)],
            self.matrix[np.ix_(self.dofs, pairs)],
            self.matrix[np.ix_(pairs, pairs)],
        )


def scatter_flux(conducts: Mask, flux: Array) -> Array:
    """Return the flux (n, channels) of the pairs (n, channels) that conduct (a of them), zero elsewhere."""
    scattered = np.zeros(conducts.shape)
    scattered[conducts] = flux
    return scattered


def difference(problem: ContactProblem) -> Array:
    """Return the rise of (-phi, -psi), (n, channels), that brings the unloaded surface to the indenter's potentials."""
    difference: Array = -problem.potentials - problem.system.offset[:, POTENTIALS]
    return difference
