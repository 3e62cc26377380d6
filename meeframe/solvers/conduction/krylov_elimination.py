"""Elimination of the potentials by iteration, for compliances without a matrix; and the choice of a method."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np

from meeframe.contact.conduction import Mask
from meeframe.contact.problem import ContactProblem
from meeframe.fields import N_MECHANICAL, POTENTIALS, Array, Indices
from meeframe.solvers.conduction.elimination import EXACT, Conductors, DenseElimination, Elimination, Response, filled
from meeframe.solvers.conduction.floating import Floating
from meeframe.solvers.krylov import LEAST_FALL, gmres
from meeframe.system.capabilities import ApproximateInverse, Restriction, apply_fields, diagonal
from meeframe.system.reduced import ReducedSystem

MIN_SINGLE_TOLERANCE: Final = 1e-3
"""Factor by which one solution in single precision reduces the residual of the equations."""
SINGLE: Final = 1e-5
"""Allowed relative error of the change above which round-off of single precision in its effect does not matter."""


@dataclass(frozen=True, eq=False)
class _Places:
    """Positions of pairs (a of them) of nodes and k fields.

    numbers: (a,) among `shape`, (k, n), one field after another.
    """

    numbers: Indices
    shape: tuple[int, int]

    def spread(self, flux: Array) -> Array:
        """Return the flux of the pairs (a,) as (k, n), stored one field after another."""
        block = np.zeros(self.shape, flux.dtype)
        block.reshape(-1)[self.numbers] = flux
        return block.T

    def taken(self, values: Array) -> Array:
        """Return the values of the pairs (a,) among those of all nodes, (k, n)."""
        taken: Array = values.reshape(-1)[self.numbers]
        return taken


@dataclass(frozen=True, eq=False)
class _Equations:
    """Equations (C + R) flux = difference on the (node, potential) pairs that conduct (a of them).

    Both sides are divided by `size`. system: the part of the body's that contains the pairs, if it has one; fields:
    those that conduct; conducting: (n, channels) the pairs; nodes: those of the pairs; places, inner: positions of the
    pairs in the zone and in that part; own: (a,) response to their own flux; resistance: (a,); size: (a,) roots of the
    sums of both; inverse: the body's approximate one, None if it has none.
    """

    system: ReducedSystem
    fields: list[int]
    conducting: Mask
    nodes: Indices
    places: _Places
    inner: _Places
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
        """Return the equations of resistances and own responses (n, channels)."""
        conducting = np.isfinite(resistance)
        at, potentials = np.nonzero(conducting)
        chosen, n = np.searchsorted(fields, potentials + N_MECHANICAL), len(own)
        nodes = np.flatnonzero(conducting.any(axis=1))
        places = inner = _Places(chosen * n + at, (len(fields), n))
        restriction = system.capability(Restriction)
        part = None if restriction is None else restriction.restrict(nodes)
        if part is not None:
            system, m, number = part.system, len(part.nodes), np.empty(n, np.int64)
            number[part.nodes] = np.arange(m)
            inner = _Places(chosen * m + number[at], (len(fields), m))
        resistance, own = resistance[conducting], own[conducting]
        size = np.sqrt(own + resistance)
        return cls(system, fields, conducting, nodes, places, inner, own, resistance, size, inverse)

    def left(self, moved: Array, flux: Array) -> Array:
        """Return the residual (a,) of the equations with the flux (a,), for a displacement (k, n) to be eliminated."""
        return -(self.places.taken(moved) + self.resistance * flux) / self.size

    def solve(self, left: Array, goal: float) -> Array:
        """Return the flux (a,) that reduces a residual (a,) to a norm.

        It is found by corrections in single precision; in double precision if these stagnate.
        """
        found = np.zeros_like(left)
        while (norm := float(np.linalg.norm(left))) > goal:
            part = max(goal / norm, MIN_SINGLE_TOLERANCE)
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
        raised = self.inner.taken(apply_fields(self.system, self.inner.spread(flux), self.fields, self.fields).T)
        product: Array = ((raised + self.resistance * flux) / self.size).astype(scaled.dtype)
        return product

    def _precondition(self, scaled: Array) -> Array:
        """Apply the approximate inverse to well-conducting pairs, and the diagonal to the others.

        A pair conducts well where its own response exceeds its resistance.
        """
        well = self.own > self.resistance
        if self.inverse is None or not well.any():
            return scaled
        asked = np.where(well, scaled * self.size, 0.0).astype(scaled.dtype)
        found = self.places.taken(self.inverse(self.places.spread(asked)).T)
        return np.where(well, found * self.size, scaled).astype(scaled.dtype)


@final
@dataclass(frozen=True, eq=False)
class KrylovElimination(Elimination):
    """Elimination by GMRES, for compliances without a matrix.

    mechanical: the fields, of 0 to 2, in which the law needs tractions; conducting: those that the laws conduct; own:
    (n, channels) response of each node's potentials to their own flux; root: (n, m) roots of that of the mechanical
    fields; inverse: the system's approximate one in the conducting fields, (n, k) of (n, k), None if it has none or
    nothing conducts. Products involve these fields alone, which are stored one after another.
    """

    mechanical: list[int]
    conducting: list[int]
    own: Array
    root: Array
    inverse: Callable[[Array], Array] | None

    @classmethod
    def of(cls, problem: ContactProblem) -> "KrylovElimination":
        """Return the elimination of a problem."""
        conducting = [field for field, channel in enumerate(problem.channels, N_MECHANICAL) if channel.is_conducting]
        approximate = problem.system.capability(ApproximateInverse) if conducting else None
        inverse = None if approximate is None else approximate.approximate_inverse(conducting)
        mechanical = [0, 1, 2] if problem.contact_law.tangential_scaling().any() else [2]
        own = diagonal(problem.system, range(problem.fields.size))
        return cls(problem, mechanical, conducting, own[:, POTENTIALS], np.sqrt(own[:, mechanical]), inverse)

    def prepare(self, resistance: Array, previous: Conductors | None) -> Conductors:
        """Return the conductors of resistances (n, channels), as in Elimination."""
        if previous is not None and np.array_equal(previous.resistance, resistance):
            return previous
        equations = _Equations.of(self.problem.system, self.conducting, resistance, self.own, self.inverse)

        def solve(rise: Array) -> Array:
            left = rise / equations.size
            return equations.solve(left, EXACT * float(np.linalg.norm(left)))

        return Conductors(resistance, Floating.of(self.problem, equations.conducting, solve), equations)

    def respond(
        self, traction: Array, conductors: Conductors, guess: Array, rest: float = 0.0, enough: float = EXACT
    ) -> Response:
        """Return the response to tractions, as in Elimination, in the precision of the tractions."""
        equations: _Equations = conductors.parts
        start = guess[equations.conducting]
        moved = self._moved(traction, start, equations)
        mechanical = np.take(moved[: len(self.mechanical)], equations.nodes, axis=1)
        felt = float(np.linalg.norm(mechanical / self.root[equations.nodes].T))
        return self._found(conductors, start, moved, (rest, enough * felt), 0.0, traction.dtype)

    def state(
        self,
        traction: Array,
        conductors: Conductors,
        flux: Array,
        potential: Array,
        rest: float = 0.0,
        enough: float = 0.0,
    ) -> Response:
        """Return the total response, as in Elimination.

        The effect of the fluxes is computed in single precision where its error is allowed.
        """
        equations: _Equations = conductors.parts
        start = conductors.fixed(flux, potential)[equations.conducting]
        unloaded = self.problem.system.offset.T[self.mechanical + self.conducting]
        potentials = unloaded[len(self.mechanical) :]
        potentials += self.problem.potentials.T[[field - N_MECHANICAL for field in self.conducting]]
        # the part of potentials, not of displacements: their ratio is arbitrary where nothing couples them
        terms = np.hypot(
            np.linalg.norm(start * equations.size), np.linalg.norm(equations.places.taken(potentials) / equations.size)
        )
        moved = unloaded + self._moved(traction, start, equations)
        totals, enough = conductors.floating.totals, max(enough, EXACT * float(terms))
        return self._found(conductors, start, moved, (rest, enough), totals)

    def _found(
        self,
        conductors: Conductors,
        start: Array,
        moved: Array,
        enough: tuple[float, float],
        totals: Array | float,
        precision: np.dtype[Any] | None = None,
    ) -> Response:
        """Return the response with prescribed totals (j,).

        start, moved: fluxes (a,) to start with, and the displacement (m + k, n) of tractions and these fluxes; enough:
        allowed residual of the equations, relative to that of the start, and absolute; precision: of the effect of the
        change of the fluxes, by default single where more than its round-off is allowed in the absolute residual.
        """
        equations: _Equations = conductors.parts
        count = len(self.mechanical)
        left = equations.left(moved[count:], start)
        flux = start + equations.solve(left, max(max(enough[0], EXACT) * float(np.linalg.norm(left)), enough[1]))
        balanced, potential = conductors.floating.balance(flux, totals)
        change = balanced - start
        found = moved[:count].astype(float, copy=False)
        if change.any():
            rough = enough[1] > SINGLE * float(np.linalg.norm(change * equations.size))
            load = equations.places.spread(change.astype(precision or (np.float32 if rough else np.float64)))
            found = found + apply_fields(self.problem.system, load, self.conducting, self.mechanical).T
        displacement = np.zeros((3, len(self.own))).T
        displacement[:, self.mechanical] = found.T
        return Response(filled(equations.conducting, balanced), displacement, potential)

    def _moved(self, traction: Array, flux: Array, equations: _Equations) -> Array:
        """Return the displacement of tractions (n, 3) and fluxes (a,), (m + k, n), in the precision of the former."""
        fields = self.mechanical + self.conducting
        load = {field: traction[:, field] for field in self.mechanical}
        if flux.any():
            load |= dict(zip(self.conducting, equations.places.spread(flux.astype(traction.dtype)).T, strict=True))
        return apply_fields(self.problem.system, np.array(list(load.values())).T, list(load), fields).T


def eliminate(problem: ContactProblem) -> Elimination:
    """Return a factorisation if the compliance is held as a matrix, otherwise a Krylov iteration."""
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
