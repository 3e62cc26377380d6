"""The potentials eliminated at contact size: system (30) as a relation between tractions and displacements alone.

On the set A of (node, potential) pairs that conduct, flux density f and potential obey, with resistance R = 1/kappa,
    (C_AA + R) f = -(potential_o + offset)_A - C_Am p;
the displacement is then offset_m + C_mm p + C_mA f. A perfect conductor is R = 0 exactly; insulated pairs are not in A.
C_AA has a positive-definite symmetric part, so that the system is regular for any R >= 0.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np
from scipy.linalg import lu_factor, lu_solve
from scipy.sparse.linalg import LinearOperator, gmres

from meeframe.core.contact import ContactProblem
from meeframe.core.fields import MECHANICAL, N_FIELDS, Array
from meeframe.core.mesh import Indices

KRYLOV_TOLERANCE: Final = 1e-13
POTENTIALS: Final = slice(3, 5)


@dataclass(frozen=True, eq=False)
class Conductors:
    """The contact with given resistances, prepared for repeated responses.

    resistance: (n, 2) 1/kappa, inf where insulated; flux: (n, 2) and displacement: (n, 3) without tractions, due to the
    offset and the indenter's potentials; parts: what the elimination that made it wants to find again.
    """

    resistance: Array
    flux: Array
    displacement: Array
    parts: Any


@dataclass(frozen=True, eq=False)
class Elimination(ABC):
    """Mechanical response of a problem's contact zone with the potentials eliminated."""

    problem: ContactProblem

    @abstractmethod
    def prepare(self, resistance: Array, previous: Conductors | None) -> Conductors:
        """Conductors of the resistances (n, 2); those of `previous` are used again as far as they fit."""

    @abstractmethod
    def respond(self, traction: Array, conductors: Conductors, guess: Array) -> tuple[Array, Array]:
        """Flux (n, 2) and displacement (n, 3) due to tractions (n, 3) alone; guess: (n, 2), a flux near the answer.

        Tractions are admissible: tangential ones only if the law has some, none where there is no indenter above.
        Displacements that no contact condition asks for may be left zero.
        """


def eliminate(problem: ContactProblem) -> Elimination:
    """By factorisation if the compliance is held as a matrix, otherwise by Krylov iteration."""
    matrix = problem.system.dense()
    if matrix is None:
        return KrylovElimination(problem)
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
        flux, moved, difference = np.zeros((3, *self.problem.system.offset.shape))
        if factor is not None:
            blocks = factor.blocks
            difference[:, POTENTIALS] = _difference(self.problem)
            flux.flat[blocks.pairs] = factor.solve(difference.flat[blocks.pairs])
            moved.flat[self.dofs] = blocks.from_flux @ flux.flat[blocks.pairs]
        moved += self.problem.system.offset
        return Conductors(resistance, flux[:, POTENTIALS], moved[:, MECHANICAL], factor)

    def respond(self, traction: Array, conductors: Conductors, guess: Array) -> tuple[Array, Array]:
        """See Elimination. The guess is not used."""
        factor: _Factor | None = conductors.parts
        load, flux, moved = np.zeros((3, len(traction), N_FIELDS))
        load[:, MECHANICAL] = traction
        active = load.flat[self.dofs]
        response = self.mechanical @ active
        if factor is not None:
            solved = factor.solve(-(factor.blocks.to_flux @ active))
            flux.flat[factor.blocks.pairs] = solved
            response += factor.blocks.from_flux @ solved
        moved.flat[self.dofs] = response
        return flux[:, POTENTIALS], moved[:, MECHANICAL]

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
    """Elimination by GMRES with Jacobi scaling from the diagonal blocks, for compliances without a matrix."""

    def prepare(self, resistance: Array, previous: Conductors | None) -> Conductors:
        """See Elimination."""
        if previous is not None and np.array_equal(previous.resistance, resistance):
            return previous
        system = self.problem.system
        blocks = system.diagonal_blocks()
        own = np.stack([blocks[:, 3, 3], blocks[:, 4, 4]], axis=1)
        guess = np.zeros_like(resistance) if previous is None else previous.flux
        flux = self._solve(_difference(self.problem), resistance, own, guess)
        moved = system.offset + self._apply(np.zeros((len(flux), 3)), flux)
        return Conductors(resistance, flux, moved[:, MECHANICAL], own)

    def respond(self, traction: Array, conductors: Conductors, guess: Array) -> tuple[Array, Array]:
        """See Elimination."""
        unloaded = np.zeros_like(traction)
        moved = self._apply(traction, np.zeros_like(guess))
        flux = self._solve(-moved[:, POTENTIALS], conductors.resistance, conductors.parts, guess)
        if flux.any():
            moved += self._apply(unloaded, flux)
        return flux, moved[:, MECHANICAL]

    def _apply(self, traction: Array, flux: Array) -> Array:
        return self.problem.system.apply(np.concatenate([traction, flux], axis=1))

    def _solve(self, difference: Array, resistance: Array, own: Array, guess: Array) -> Array:
        """Flux (n, 2) with (C + R) flux = difference (n, 2) where the resistance is finite, zero elsewhere."""
        active = np.isfinite(resistance)
        flux = np.zeros_like(resistance)
        if not active.any():
            return flux
        scale = (own[active] + resistance[active]) ** -0.5

        def equations(scaled: Array) -> Array:
            trial = np.zeros_like(flux)
            trial[active] = scale * scaled
            potentials = self._apply(np.zeros((len(flux), 3)), trial)[:, POTENTIALS]
            left: Array = scale * (potentials[active] + resistance[active] * trial[active])
            return left

        operator = LinearOperator((len(scale), len(scale)), matvec=equations, dtype=np.float64)
        start = guess[active] / scale
        solved, _ = gmres(operator, scale * difference[active], start, rtol=KRYLOV_TOLERANCE, restart=60, maxiter=20)
        flux[active] = scale * solved
        return flux


def _difference(problem: ContactProblem) -> Array:
    """Rise of (-phi, -psi), (n, 2), that brings the unloaded surface to the indenter's potentials."""
    difference: Array = -problem.potentials - problem.system.offset[:, POTENTIALS]
    return difference
