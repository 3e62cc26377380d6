"""The potentials eliminated by iteration, for compliances without a matrix; and the choice between both ways."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from meeframe.core.contact import ContactProblem
from meeframe.core.fields import MECHANICAL, N_FIELDS, Array
from meeframe.core.formulation import ReducedSystem
from meeframe.core.law import conducts
from meeframe.core.mesh import Indices
from meeframe.solvers.conduction import Mask
from meeframe.solvers.elimination import EXACT, Conductors, DenseElimination, Elimination, Response, filled
from meeframe.solvers.floating import POTENTIALS, Floating
from meeframe.solvers.krylov import LEAST_FALL, gmres

ROUGH: Final = 1e-3
"""To which part single precision takes down what is left of the equations at once."""


@dataclass(frozen=True, eq=False)
class _Equations:
    """(C + R) flux = difference on the (node, potential) pairs that conduct (a of them), both sides divided by `size`.

    fields: those of 3 and 4 that conduct; conducting: (n, 2) the pairs; places: (a,) of them in (len(fields), n), one
    field after another; own: (a,) response to their own flux; resistance: (a,); size: (a,) roots of the sums of both;
    inverse: the system's approximate one, None if it has none.
    """

    system: ReducedSystem
    fields: list[int]
    conducting: Mask
    places: Indices
    own: Array
    resistance: Array
    size: Array
    inverse: Callable[[Array], Array] | None

    @classmethod
    def of(
        cls,
        system: ReducedSystem,
        fields: list[int],
        resistance: Array,
        own: Array,
        inverse: Callable[[Array], Array] | None,
    ) -> "_Equations":
        """Of resistances and own responses (n, 2)."""
        conducting = np.isfinite(resistance)
        nodes, potentials = np.nonzero(conducting)
        places = np.searchsorted(fields, potentials + POTENTIALS.start) * len(own) + nodes
        resistance, own = resistance[conducting], own[conducting]
        return cls(system, fields, conducting, places, own, resistance, np.sqrt(own + resistance), inverse)

    def spread(self, flux: Array) -> Array:
        """Of the pairs (a,): (n, k) in the fields, stored one after another."""
        block = np.zeros((len(self.fields), len(self.conducting)), flux.dtype)
        block.reshape(-1)[self.places] = flux
        return block.T

    def taken(self, moved: Array) -> Array:
        """Of a displacement (n, 5): that of the pairs (a,)."""
        return self._gathered(moved[:, self.fields])

    def _gathered(self, values: Array) -> Array:
        """Of (n, k) in the fields: those of the pairs (a,)."""
        gathered: Array = values.T.reshape(-1)[self.places]
        return gathered

    def left(self, moved: Array, flux: Array) -> Array:
        """What a displacement (n, 5) that is not to be there leaves of the equations (a,), with the flux (a,)."""
        return -(self.taken(moved) + self.resistance * flux) / self.size

    def solve(self, left: Array, goal: float) -> Array:
        """Flux (a,) that takes what is left (a,) down to a norm.

        By corrections in single precision; in double precision if these do not get anywhere.
        """
        found = np.zeros_like(left)
        while (norm := float(np.linalg.norm(left))) > goal:
            part = max(goal / norm, ROUGH)
            change, rest = gmres(self._multiply, self._precondition, left.astype(np.float32), part)
            found += change
            if rest <= goal:
                break
            left = left - self._multiply(change.astype(float))
            if not np.linalg.norm(left) < LEAST_FALL * norm:
                found += gmres(self._multiply, self._precondition, left, goal / float(np.linalg.norm(left)))[0]
                break
        return found / self.size

    def _multiply(self, scaled: Array) -> Array:
        flux = (scaled / self.size).astype(scaled.dtype)
        raised = self._gathered(self.system.block_response(self.spread(flux), self.fields, self.fields))
        product: Array = ((raised + self.resistance * flux) / self.size).astype(scaled.dtype)
        return product

    def _precondition(self, scaled: Array) -> Array:
        """Where a pair conducts well, which is where its own response exceeds its resistance, by the approximate
        inverse; elsewhere the sum of the two does."""
        well = self.own > self.resistance
        if self.inverse is None or not well.any():
            return scaled
        asked = np.where(well, scaled * self.size, 0.0).astype(scaled.dtype)
        found = self._gathered(self.inverse(self.spread(asked)))
        return np.where(well, found * self.size, scaled).astype(scaled.dtype)


@final
@dataclass(frozen=True, eq=False)
class KrylovElimination(Elimination):
    """Elimination by GMRES, for compliances without a matrix.

    mechanical: the fields, of 0 to 2, in which the law asks for tractions; conducting: those of 3 and 4 that the laws
    conduct; own: (n, 5) response of each node to its own load; inverse: the system's approximate one in the conducting
    fields, (n, k) of (n, k), None if it has none or nothing conducts. Products are of these fields alone.
    """

    mechanical: list[int]
    conducting: list[int]
    own: Array
    inverse: Callable[[Array], Array] | None

    @classmethod
    def of(cls, problem: ContactProblem) -> "KrylovElimination":
        """Of a problem."""
        laws = enumerate((problem.electric_law, problem.magnetic_law), POTENTIALS.start)
        conducting = [field for field, law in laws if conducts(law)]
        inverse = problem.system.approximate_inverse(conducting) if conducting else None
        frictional = problem.contact_law.tangential_scaling().any()
        own = np.diagonal(problem.system.diagonal_blocks(), axis1=1, axis2=2).copy()
        return cls(problem, [0, 1, 2] if frictional else [2], conducting, own, inverse)

    def prepare(self, resistance: Array, previous: Conductors | None) -> Conductors:
        """See Elimination."""
        if previous is not None and np.array_equal(previous.resistance, resistance):
            return previous
        system, own = self.problem.system, self.own[:, POTENTIALS]
        equations = _Equations.of(system, self.conducting, resistance, own, self.inverse)

        def solve(rise: Array) -> Array:
            left = rise / equations.size
            return equations.solve(left, EXACT * float(np.linalg.norm(left)))

        return Conductors(resistance, Floating.of(self.problem, equations.conducting, solve), equations)

    def respond(
        self, traction: Array, conductors: Conductors, guess: Array, rest: float = 0.0, enough: float = EXACT
    ) -> Response:
        """See Elimination. In the precision of the tractions."""
        nothing = np.zeros((N_FIELDS, len(guess))).T
        return self._found(traction, conductors, guess, (max(rest, EXACT), enough, 0.0), nothing, 0.0)

    def state(
        self,
        traction: Array,
        conductors: Conductors,
        flux: Array,
        potential: Array,
        rest: float = 0.0,
        enough: float = 0.0,
    ) -> Response:
        """See Elimination."""
        unloaded = self.problem.system.offset.copy(order="F")
        unloaded[:, POTENTIALS] += self.problem.potentials
        guess = conductors.fixed(flux, potential)
        equations: _Equations = conductors.parts
        # what potentials are made of, not displacements: these may be anything beside them where nothing couples both
        own = guess[equations.conducting] * equations.size
        terms = np.hypot(np.linalg.norm(own), np.linalg.norm(equations.taken(unloaded) / equations.size))
        parts = max(rest, EXACT), 0.0, max(enough, EXACT * float(terms))
        return self._found(traction, conductors, guess, parts, unloaded, conductors.floating.totals)

    def _found(
        self,
        traction: Array,
        conductors: Conductors,
        guess: Array,
        enough: tuple[float, float, float],
        unloaded: Array,
        totals: Array | float,
    ) -> Response:
        """Response with prescribed totals (j,); unloaded: (n, 5) what tractions and fluxes are not the cause of.

        enough: what may be left, as part of the guess's error, as part of the displacement, and by itself.
        """
        equations: _Equations = conductors.parts
        start = guess[equations.conducting]
        moved = unloaded + self._moved(traction, start, equations, self.mechanical + self.conducting)
        left, where = equations.left(moved, start), equations.conducting.any(axis=1)
        felt = moved[:, self.mechanical][where] / np.sqrt(self.own[:, self.mechanical][where])
        norms = float(np.linalg.norm(left)), float(np.linalg.norm(felt)), 1.0
        flux = start + equations.solve(left, max(part * norm for part, norm in zip(enough, norms, strict=True)))
        balanced, potential = conductors.floating.balance(flux, totals)
        moved += self._moved(np.zeros_like(traction), balanced - start, equations, self.mechanical)
        return Response(filled(equations.conducting, balanced), moved[:, MECHANICAL], potential)

    def _moved(self, traction: Array, flux: Array, equations: _Equations, fields: list[int]) -> Array:
        """Displacement (n, 5) in the given fields, zero in the others, of tractions (n, 3) and fluxes (a,), in the
        precision of the former.

        Fields are stored one after another, which systems may like better.
        """
        load: dict[int, Array] = {}
        if traction.any():
            load |= {field: traction[:, field] for field in self.mechanical}
        if flux.any():
            load |= dict(zip(self.conducting, equations.spread(flux.astype(traction.dtype)).T, strict=True))
        moved = np.zeros((N_FIELDS, len(self.own))).T
        if load:
            moved[:, fields] = self.problem.system.block_response(np.array(list(load.values())).T, list(load), fields)
        return moved


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
