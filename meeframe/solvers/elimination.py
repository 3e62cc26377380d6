"""The potentials eliminated at contact size: system (30) as a relation between tractions and displacements alone.

On the set A of (node, potential) pairs that conduct, flux density f and potential obey, with resistance R = 1/kappa,
    (C_AA + R) f = -(potential_o + offset)_A - C_Am p;
the displacement is then offset_m + C_mm p + C_mA f. A perfect conductor is R = 0 exactly; insulated pairs are not in A.
C_AA has a positive-definite symmetric part, so that the system is regular for any R >= 0.

Potentials of the indenter that follow from prescribed totals are unknowns besides (meeframe.solvers.floating).
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, final

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from meeframe.core.contact import ContactProblem
from meeframe.core.fields import MECHANICAL, N_FIELDS, Array
from meeframe.core.law import conducts
from meeframe.core.mesh import Indices
from meeframe.solvers.conduction import Mask, own_response
from meeframe.solvers.floating import POTENTIALS, Floating
from meeframe.solvers.krylov import Linear, gmres

KRYLOV_TOLERANCE: Final = 1e-13
ROUGH: Final = 1e-3
"""Part of a guess's error that single precision can do without."""
HARDLY: Final = 1e6
"""A resistance so many times a node's own response."""


@dataclass(frozen=True, eq=False)
class Response:
    """What tractions alone cause: flux (n, 2), displacement (n, 3), and change of the floating potentials (j,)."""

    flux: Array
    displacement: Array
    potential: Array


@dataclass(frozen=True, eq=False)
class Conductors:
    """The contact with given resistances, prepared for repeated responses.

    resistance: (n, 2) 1/kappa, inf where insulated; flux: (n, 2), displacement: (n, 3) and potential: (j,) of the
    floating conductors without tractions, due to the offset, the indenter's potentials and prescribed totals; floating:
    see there; parts: what else the elimination that made it wants to find again.
    """

    resistance: Array
    flux: Array
    displacement: Array
    potential: Array
    floating: Floating
    parts: Any

    def fixed(self, flux: Array, potential: Array) -> Array:
        """Flux (n, 2) less what potentials (j,) of the floating conductors add to it."""
        if potential.size == 0:
            return flux
        return flux - _filled(np.isfinite(self.resistance), self.floating.flux @ potential)


@dataclass(frozen=True, eq=False)
class Elimination(ABC):
    """Mechanical response of a problem's contact zone with the potentials eliminated."""

    problem: ContactProblem

    @abstractmethod
    def prepare(self, resistance: Array, previous: Conductors | None) -> Conductors:
        """Conductors of the resistances (n, 2); those of `previous` are used again as far as they fit."""

    @abstractmethod
    def respond(self, traction: Array, conductors: Conductors, guess: Array, rest: float = 0.0) -> Response:
        """Response to tractions (n, 3) alone; guess: (n, 2), a flux near the answer, as of Conductors.fixed.

        rest: part of the guess's error that may be left: iterations whose guesses get better need no more.
        Tractions are admissible: tangential ones only if the law has some, none where there is no indenter above. Of
        those in single precision the response need be no more precise.
        Displacements that no contact condition asks for may be left zero.
        """


def eliminate(problem: ContactProblem) -> Elimination:
    """By factorisation if the compliance is held as a matrix, otherwise by Krylov iteration."""
    matrix = problem.system.dense()
    if matrix is None:
        return KrylovElimination.of(problem)
    size = problem.system.offset.size
    matrix = matrix.reshape(size, size)
    loaded = np.zeros(problem.system.offset.shape, bool)
    frictional = problem.contact_law.tangential_scaling().any()
    loaded[np.isfinite(problem.gap), 0 if frictional else 2 : 3] = True
    dofs = np.flatnonzero(loaded)
    return DenseElimination(problem, matrix, dofs, np.ascontiguousarray(matrix[np.ix_(dofs, dofs)]))


@dataclass(frozen=True, eq=False)
class _Blocks:
    """Blocks of the compliance between the tractions and the fluxes that conduct.

    pairs: (a,) flat numbers of the conducting (node, field) pairs; to_flux: (a, k); from_flux: (k, a); own: (a, a).
    """

    pairs: Indices
    to_flux: Array
    from_flux: Array
    own: Array


@dataclass(frozen=True, eq=False)
class _Factor:
    """The factorised flux equations. scale: (a,) roots of the Jacobi scaling, which rids the equations of units."""

    blocks: _Blocks
    scale: Array
    lu: tuple[Array, Array]

    def solve(self, difference: Array) -> Array:
        """Flux densities (a,) that raise (-phi, -psi) by the differences (a,)."""
        flux: Array = self.scale * lu_solve(self.lu, self.scale * difference, check_finite=False)
        return flux


@final
@dataclass(frozen=True, eq=False)
class DenseElimination(Elimination):
    """Elimination by LU factorisation.

    matrix: (5n, 5n) compliance; dofs: (k,) flat numbers of the (node, field) pairs that can carry a traction;
    mechanical: (k, k) their block of the matrix.
    """

    matrix: Array
    dofs: Indices
    mechanical: Array

    def prepare(self, resistance: Array, previous: Conductors | None) -> Conductors:
        """See Elimination. The factorisation is kept while the resistances stay, its blocks while the set stays."""
        if previous is not None and np.array_equal(previous.resistance, resistance):
            return previous
        factor = self._factor(resistance, None if previous is None else previous.parts)
        conducts = np.isfinite(resistance)
        floating = Floating.of(self.problem, conducts, factor.solve if factor else np.zeros_like)
        flux, moved = np.zeros((2, *self.problem.system.offset.shape))
        potential = np.zeros(0)
        if factor is not None:
            alone = factor.solve(_difference(self.problem)[conducts])
            balanced, potential = floating.balance(alone, floating.totals)
            flux.flat[factor.blocks.pairs] = balanced
            moved.flat[self.dofs] = factor.blocks.from_flux @ balanced
        moved += self.problem.system.offset
        return Conductors(resistance, flux[:, POTENTIALS], moved[:, MECHANICAL], potential, floating, factor)

    def respond(self, traction: Array, conductors: Conductors, guess: Array, rest: float = 0.0) -> Response:
        """See Elimination. The guess is not used."""
        factor: _Factor | None = conductors.parts
        potential = np.zeros(0)
        load, flux, moved = np.zeros((3, len(traction), N_FIELDS))
        load[:, MECHANICAL] = traction
        active = load.flat[self.dofs]
        response = self.mechanical @ active
        if factor is not None:
            alone = factor.solve(-(factor.blocks.to_flux @ active))
            balanced, potential = conductors.floating.balance(alone, 0.0)
            flux.flat[factor.blocks.pairs] = balanced
            response += factor.blocks.from_flux @ balanced
        moved.flat[self.dofs] = response
        return Response(flux[:, POTENTIALS], moved[:, MECHANICAL], potential)

    def _factor(self, resistance: Array, previous: _Factor | None) -> _Factor | None:
        full = np.full(self.problem.system.offset.shape, np.inf)
        full[:, POTENTIALS] = resistance
        pairs = np.flatnonzero(np.isfinite(full))
        if pairs.size == 0:
            return None
        blocks = previous.blocks if previous and np.array_equal(previous.blocks.pairs, pairs) else self._blocks(pairs)
        equations = blocks.own + np.diag(full.flat[pairs])
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


@final
@dataclass(frozen=True, eq=False)
class KrylovElimination(Elimination):
    """Elimination by GMRES, for compliances without a matrix.

    mechanical: the fields, of 0 to 2, in which the law asks for tractions; conducting: those of 3 and 4 that the laws
    conduct; inverse: the system's approximate one in these, (n, k) of (n, k), None if it has none or nothing conducts.
    Products are of these fields alone. Where a node conducts well, which is where its own response exceeds
    its resistance, that preconditions; elsewhere the sum of the two does.
    """

    mechanical: list[int]
    conducting: list[int]
    inverse: Callable[[Array], Array] | None

    @classmethod
    def of(cls, problem: ContactProblem) -> "KrylovElimination":
        """Of a problem."""
        laws = enumerate((problem.electric_law, problem.magnetic_law), POTENTIALS.start)
        conducting = [field for field, law in laws if conducts(law)]
        inverse = problem.system.approximate_inverse(conducting) if conducting else None
        frictional = problem.contact_law.tangential_scaling().any()
        return cls(problem, [0, 1, 2] if frictional else [2], conducting, inverse)

    def prepare(self, resistance: Array, previous: Conductors | None) -> Conductors:
        """See Elimination."""
        if previous is not None and np.array_equal(previous.resistance, resistance):
            return previous
        guess = np.zeros_like(resistance) if previous is None else previous.fixed(previous.flux, previous.potential)
        conducts = np.isfinite(resistance)
        own = own_response(self.problem)

        def solve(difference: Array, near: Array, rest: float = 0.0) -> Array:
            return self._solve(difference, resistance[conducts], own[conducts], conducts, near, rest)

        floating = Floating.of(self.problem, conducts, lambda mode: solve(mode, np.zeros_like(mode)))
        alone = solve(_difference(self.problem)[conducts], guess[conducts])
        balanced, potential = floating.balance(alone, floating.totals)
        flux = _filled(conducts, balanced)
        moved = self.problem.system.offset[:, MECHANICAL] + self._response(flux, self.mechanical)[:, MECHANICAL]
        return Conductors(resistance, flux, moved, potential, floating, solve)

    def respond(self, traction: Array, conductors: Conductors, guess: Array, rest: float = 0.0) -> Response:
        """See Elimination. In the precision of the tractions."""
        conducts = np.isfinite(conductors.resistance)
        moved = self._response(traction, self.mechanical + self.conducting)
        alone = conductors.parts(-moved[:, POTENTIALS][conducts], guess[conducts], rest)
        balanced, potential = conductors.floating.balance(alone, 0.0)
        flux = _filled(conducts, balanced)
        moved += self._response(flux.astype(traction.dtype, copy=False), self.mechanical)
        return Response(flux, moved[:, MECHANICAL], potential)

    def _response(self, load: Array, fields: list[int]) -> Array:
        """Displacement (n, 5) in the given fields, zero in the others, of tractions (n, 3) or fluxes (n, 2) alone.

        Fields are stored one after another, which systems may like better.
        """
        moved = np.zeros((N_FIELDS, len(load))).T
        first, loaded = (POTENTIALS.start, self.conducting) if load.shape[1] == 2 else (0, self.mechanical)
        block = np.empty((len(loaded), len(load)), load.dtype).T
        block[...] = load[:, [field - first for field in loaded]]
        if block.any():
            moved[:, fields] = self.problem.system.block_response(block, loaded, fields)
        return moved

    def _solve(
        self, difference: Array, resistance: Array, own: Array, conducts: Mask, guess: Array, rest: float
    ) -> Array:
        """Flux (a,) on the pairs (n, 2) that conduct with (C + R) flux = difference (a,); resistance, own: (a,)."""
        if difference.size == 0:
            return np.zeros(0)
        scale = (own + resistance) ** -0.5

        def equations(scaled: Array, precision: type[np.floating] = np.float64) -> Array:
            trial = scale * scaled
            flux = _filled(conducts, trial).astype(precision, copy=False)
            raised = self._response(flux, self.conducting)[:, POTENTIALS]
            left: Array = scale * (raised[conducts] + resistance * trial)
            return left

        # a pair that hardly conducts has hardly any flux, whatever it had before
        start = np.where(resistance < HARDLY * own, guess / scale, 0.0)
        precondition = self._preconditioner(own > resistance, scale, conducts)
        # what a guess leaves is looked at precisely, and then found to three digits at most
        roughly = partial(equations, precision=np.float32) if rest >= ROUGH else None
        solved = gmres(equations, precondition, scale * difference, KRYLOV_TOLERANCE, start, rest, roughly=roughly)
        return np.asarray(scale * solved)

    def _preconditioner(self, well: Mask, scale: Array, conducts: Mask) -> Linear:
        """Of the scaled equations; well: (a,) of the pairs that conduct, (n, 2), those that do so well."""
        inverse = self.inverse
        fields = [field - POTENTIALS.start for field in self.conducting]
        if inverse is None or not well.any():
            return lambda values: values

        def precondition(values: Array) -> Array:
            asked = _filled(conducts, np.where(well, values / scale, 0.0))[:, fields]
            found = np.zeros(conducts.shape)
            found[:, fields] = inverse(asked)
            return np.where(well, found[conducts] / scale, values)

        return precondition


def _filled(conducts: Mask, flux: Array) -> Array:
    """Flux (n, 2) of the pairs (n, 2) that conduct (a of them), zero elsewhere."""
    filled = np.zeros(conducts.shape)
    filled[conducts] = flux
    return filled


def _difference(problem: ContactProblem) -> Array:
    """Rise of (-phi, -psi), (n, 2), that brings the unloaded surface to the indenter's potentials."""
    difference: Array = -problem.potentials - problem.system.offset[:, POTENTIALS]
    return difference
