"""Elimination of the potentials by iteration, for compliances without a matrix; and the choice of a method."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np

from meeframe.contact.conduction import Mask
from meeframe.contact.problem import ContactProblem
from meeframe.fields import N_MECHANICAL, POTENTIALS, Array, Indices
from meeframe.solvers.conduction.elimination import (
    DEFAULT_TOLERANCE,
    Conductors,
    DenseElimination,
    Elimination,
    Response,
    scatter_flux,
)
from meeframe.solvers.conduction.floating import Floating
from meeframe.solvers.krylov import MAX_REDUCTION, gmres
from meeframe.system.capabilities import ApproximateInverse, Restriction, apply_fields, diagonal
from meeframe.system.reduced import ReducedSystem

MIN_SINGLE_TOLERANCE: Final = 1e-3
"""Factor by which one solution in single precision reduces the residual of the equations."""
SINGLE_TOLERANCE: Final = 1e-5
"""Allowed relative error of the change above which round-off of single precision in its effect does not matter."""


@dataclass(frozen=True, eq=False)
class _Positions:
    """Positions of pairs (a of them) of nodes and k fields.

    numbers: (a,) among `shape`, (k, n), one field after another.
    """

    numbers: Indices
    shape: tuple[int, int]

    def scatter(self, flux: Array) -> Array:
        """Return the flux of the pairs (a,) as (k, n), stored one field after another."""
        block = np.zeros(self.shape, flux.dtype)
        block.reshape(-1)[self.numbers] = flux
        return block.T

    def gather(self, values: Array) -> Array:
        """Return the values of the pairs (a,) among those of all nodes, (k, n)."""
        gathered: Array = values.reshape(-1)[self.numbers]
        return gathered


@dataclass(frozen=True, eq=False)
class _Equations:
    """Equations (C + R) flux = difference on the (node, potential) pairs that conduct (a of them).

    Both sides are divided by `size`. system: the part of the body's that contains the pairs, if it has one; fields:
    those that conduct; conducting: (n, channels) the pairs; nodes: those of the pairs; positions, inner_positions:
    positions of the pairs in the zone and in that part; self_compliance: (a,) response to their own flux; resistance:
    (a,); size: (a,) roots of the sums of both; inverse: the body's approximate one, None if it has none.
    """

    system: ReducedSystem
    fields: list[int]
    conducting: Mask
    nodes: Indices
    positions: _Positions
    inner_positions: _Positions
    self_compliance: Array
    resistance: Array
    size: Array
    inverse: Callable[[Array], Array] | None

    @classmethod
    def of(
        cls,
        system: ReducedSystem,
        fields: list[int],
        resistance: Array,
        self_compliance: Array,
        inverse: Callable[[Array], Array] | None,
    ) -> "_Equations":
        """Return the equations of resistances and self-compliances (n, channels)."""
        conducting = np.isfinite(resistance)
        pair_nodes, potentials = np.nonzero(conducting)
        pair_fields, n = np.searchsorted(fields, potentials + N_MECHANICAL), len(self_compliance)
        nodes = np.flatnonzero(conducting.any(axis=1))
        positions = inner_positions = _Positions(pair_fields * n + pair_nodes, (len(fields), n))
        restriction = system.capability(Restriction)
        subsystem = None if restriction is None else restriction.restrict(nodes)
        if subsystem is not None:
            system, m, number = subsystem.system, len(subsystem.nodes), np.empty(n, np.int64)
            number[subsystem.nodes] = np.arange(m)
            inner_positions = _Positions(pair_fields * m + number[pair_nodes], (len(fields), m))
        resistance, self_compliance = resistance[conducting], self_compliance[conducting]
        size = np.sqrt(self_compliance + resistance)
        return cls(
            system, fields, conducting, nodes, positions, inner_positions, self_compliance, resistance, size, inverse
        )

    def residual(self, displacement: Array, flux: Array) -> Array:
        """Return the residual (a,) of the equations with the flux (a,), for a displacement (k, n) to be eliminated."""
        return -(self.positions.gather(displacement) + self.resistance * flux) / self.size

    def solve(self, residual: Array, target: float) -> Array:
        """Return the flux (a,) that reduces a residual (a,) to a norm.

        It is found by corrections in single precision; in double precision if these stagnate.
        """
        solution = np.zeros_like(residual)
        while (norm := float(np.linalg.norm(residual))) > target:
            tolerance = max(target / norm, MIN_SINGLE_TOLERANCE)
            change, remainder = gmres(self._multiply, self._precondition, residual.astype(np.float32), tolerance)
            solution += change
            if remainder <= target:
                break
            residual = residual - self._multiply(change.astype(float))
            if not np.linalg.norm(residual) < MAX_REDUCTION * norm:
                solution += gmres(
                    self._multiply, self._precondition, residual, target / float(np.linalg.norm(residual))
                )[0]
                break
        return solution / self.size

    def _multiply(self, scaled: Array) -> Array:
        flux = (scaled / self.size).astype(scaled.dtype)
        potential = self.inner_positions.gather(
            apply_fields(self.system, self.inner_positions.scatter(flux), self.fields, self.fields).T
        )
        product: Array = ((potential + self.resistance * flux) / self.size).astype(scaled.dtype)
        return product

    def _precondition(self, scaled: Array) -> Array:
        """Apply the approximate inverse to well-conducting pairs, and the diagonal to the others.

        A pair conducts well where its self-compliance exceeds its resistance.
        """
        is_good = self.self_compliance > self.resistance
        if self.inverse is None or not is_good.any():
            return scaled
        difference = np.where(is_good, scaled * self.size, 0.0).astype(scaled.dtype)
        flux = self.positions.gather(self.inverse(self.positions.scatter(difference)).T)
        return np.where(is_good, flux * self.size, scaled).astype(scaled.dtype)


@final
@dataclass(frozen=True, eq=False)
class KrylovElimination(Elimination):
    """Elimination by GMRES, for compliances without a matrix.

    mechanical: the fields, of 0 to 2, in which the law needs tractions; conducting: those that the laws conduct;
    self_compliance: (n, channels) response of each node's potentials to their own flux; root_compliance: (n, m) roots
    of that of the mechanical fields; inverse: the system's approximate one in the conducting fields, (n, k) of (n, k),
    None if it has none or nothing conducts. Products involve these fields alone, which are stored one after another.
    """

    mechanical: list[int]
    conducting: list[int]
    self_compliance: Array
    root_compliance: Array
    inverse: Callable[[Array], Array] | None

    @classmethod
    def of(cls, problem: ContactProblem) -> "KrylovElimination":
        """Return the elimination of a problem."""
        conducting = [field for field, channel in enumerate(problem.channels, N_MECHANICAL) if channel.is_conducting]
        approximate = problem.system.capability(ApproximateInverse) if conducting else None
        inverse = None if approximate is None else approximate.approximate_inverse(conducting)
        mechanical = [0, 1, 2] if problem.contact_law.tangential_scaling().any() else [2]
        self_compliance = diagonal(problem.system, range(problem.fields.size))
        return cls(
            problem,
            mechanical,
            conducting,
            self_compliance[:, POTENTIALS],
            np.sqrt(self_compliance[:, mechanical]),
            inverse,
        )

    def prepare(self, resistance: Array, previous: Conductors | None) -> Conductors:
        """Return the conductors of resistances (n, channels), as in Elimination."""
        if previous is not None and np.array_equal(previous.resistance, resistance):
            return previous
        equations = _Equations.of(self.problem.system, self.conducting, resistance, self.self_compliance, self.inverse)

        def solve(rise: Array) -> Array:
            scaled = rise / equations.size
            return equations.solve(scaled, DEFAULT_TOLERANCE * float(np.linalg.norm(scaled)))

        return Conductors(resistance, Floating.of(self.problem, equations.conducting, solve), equations)

    def respond(
        self,
        traction: Array,
        conductors: Conductors,
        guess: Array,
        reduction: float = 0.0,
        allowed_error: float = DEFAULT_TOLERANCE,
    ) -> Response:
        """Return the response to tractions, as in Elimination, in the precision of the tractions."""
        equations: _Equations = conductors.data
        start = guess[equations.conducting]
        displacement = self._displacement(traction, start, equations)
        mechanical = np.take(displacement[: len(self.mechanical)], equations.nodes, axis=1)
        displacement_norm = float(np.linalg.norm(mechanical / self.root_compliance[equations.nodes].T))
        return self._solve(
            conductors, start, displacement, (reduction, allowed_error * displacement_norm), 0.0, traction.dtype
        )

    def state(
        self,
        traction: Array,
        conductors: Conductors,
        flux: Array,
        potential: Array,
        reduction: float = 0.0,
        allowed_error: float = 0.0,
    ) -> Response:
        """Return the total response, as in Elimination.

        The effect of the fluxes is computed in single precision where its error is allowed.
        """
        equations: _Equations = conductors.data
        start = conductors.without_floating(flux, potential)[equations.conducting]
        unloaded = self.problem.system.offset.T[self.mechanical + self.conducting]
        potentials = unloaded[len(self.mechanical) :]
        potentials += self.problem.potentials.T[[field - N_MECHANICAL for field in self.conducting]]
        # the part of potentials, not of displacements: their ratio is arbitrary where nothing couples them
        terms = np.hypot(
            np.linalg.norm(start * equations.size),
            np.linalg.norm(equations.positions.gather(potentials) / equations.size),
        )
        displacement = unloaded + self._displacement(traction, start, equations)
        totals, allowed_error = conductors.floating.totals, max(allowed_error, DEFAULT_TOLERANCE * float(terms))
        return self._solve(conductors, start, displacement, (reduction, allowed_error), totals)

    def _solve(
        self,
        conductors: Conductors,
        start: Array,
        displaced: Array,
        allowed: tuple[float, float],
        totals: Array | float,
        precision: np.dtype[Any] | None = None,
    ) -> Response:
        """Return the response with prescribed totals (j,).

        start, displaced: fluxes (a,) to start with, and the displacement (m + k, n) of tractions and these fluxes;
        allowed: allowed residual of the equations, relative to that of the start, and absolute; precision: of the
        effect of the change of the fluxes, by default single where more than its round-off is allowed in the absolute
        residual.
        """
        equations: _Equations = conductors.data
        count = len(self.mechanical)
        residual = equations.residual(displaced[count:], start)
        flux = start + equations.solve(
            residual, max(max(allowed[0], DEFAULT_TOLERANCE) * float(np.linalg.norm(residual)), allowed[1])
        )
        balanced, potential = conductors.floating.balance(flux, totals)
        change = balanced - start
        mechanical = displaced[:count].astype(float, copy=False)
        if change.any():
            is_single = allowed[1] > SINGLE_TOLERANCE * float(np.linalg.norm(change * equations.size))
            load = equations.positions.scatter(change.astype(precision or (np.float32 if is_single else np.float64)))
            mechanical = mechanical + apply_fields(self.problem.system, load, self.conducting, self.mechanical).T
        displacement = np.zeros((3, len(self.self_compliance))).T
        displacement[:, self.mechanical] = mechanical.T
        return Response(scatter_flux(equations.conducting, balanced), displacement, potential)

    def _displacement(self, traction: Array, flux: Array, equations: _Equations) -> Array:
        """Return the displacement of tractions (n, 3) and fluxes (a,), (m + k, n), in the precision of the former."""
        fields = self.mechanical + self.conducting
        load = {field: traction[:, field] for field in self.mechanical}
        if flux.any():
            load |= dict(zip(self.conducting, equations.positions.scatter(flux.astype(traction.dtype)).T, strict=True))
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
