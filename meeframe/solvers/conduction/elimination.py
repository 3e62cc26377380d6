"""Elimination of the potentials at contact size: system (30) between tractions and displacements alone.

On the set A of (node, potential) pairs that conduct, flux density f and potential obey, with resistance R = 1/kappa,
    (C_AA + R) f = -(potential_o + offset)_A - C_Am p + mode_A v;
the displacement is then offset_m + C_mm p + C_mA f. A perfect conductor is R = 0 exactly; insulated pairs are not in A.
C_AA has a positive-definite symmetric part, so that the system is regular for any R >= 0.

The potentials v of the indenter that follow from prescribed totals, measure_A : f = total, are eliminated by the
capacitance measure_A : (C_AA + R)^-1 mode_A, which has as many rows as there are of them. Where nothing conducts, or
nothing in contact with them, they are not determined and stay unchanged.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from meeframe.contact.conduction import Mask, potential_diagonal
from meeframe.contact.free_motion import potentials
from meeframe.contact.problem import ContactProblem
from meeframe.contact.residual import essential_fields
from meeframe.fields import MECHANICAL, N_MECHANICAL, POTENTIALS, Array, Indices
from meeframe.solvers.krylov import gmres
from meeframe.system.capabilities import ApproximateInverse, apply_fields

TOLERANCE: Final = 1e-13
"""Relative tolerance of iterations for the flux equations."""
MAX_RESISTANCE_RATIO: Final = 1e100
"""Multiple of its self-compliance from which a resistance insulates: prescribed totals would need infinite potentials.

Power laws have such resistances under the smallest pressures.
"""
Solve = Callable[[Array, Array, float], Array]
"""Type of functions (difference (a,), guess (a,), reduction) -> flux (a,)."""


@dataclass(frozen=True, eq=False)
class Response:
    """Response of a body to tractions.

    Attributes
    ----------
    flux : Array
        (n, channels), flux densities.
    displacement : Array
        (n, 3), displacement [m]; components that no contact condition needs are zero.
    potential : Array
        (j,), potentials of the floating conductors [V], [A].
    """

    flux: Array
    displacement: Array
    potential: Array


@dataclass(frozen=True, eq=False)
class Floating:
    """Potentials of the indenter that prescribed total fluxes determine.

    Attributes
    ----------
    numbers : Indices
        (j,), numbers among the problem's prescribed resultants.
    totals : Array
        (j,), prescribed totals, SI units.
    flux : Array
        (a, j), flux densities on the conducting pairs due to unit potentials.
    measure : Array
        (j, a), weights of the totals.
    elastance : Array
        (j, j), potentials due to unit totals.
    """

    numbers: Indices
    totals: Array
    flux: Array
    measure: Array
    elastance: Array

    @classmethod
    def of(cls, problem: ContactProblem, conducts: Mask, solve: Solve) -> "Floating":
        """Return the floating conductors on the pairs (n, channels) that conduct."""
        modes = {i: problem.prescribed_resultants[i].mode[:, POTENTIALS][conducts] for i in potentials(problem)}
        numbers = np.array([i for i, mode in modes.items() if mode.any()], int)
        if numbers.size == 0:
            empty = np.zeros((0, 0))
            return cls(numbers, np.zeros(0), empty, empty, empty)
        resultants = [problem.prescribed_resultants[i] for i in numbers]
        flux = np.column_stack([solve(modes[i], np.zeros_like(modes[i]), 0.0) for i in numbers])
        measure = np.stack([resultant.measure[:, POTENTIALS][conducts] for resultant in resultants])
        capacitance = measure @ flux
        size = np.sqrt(np.abs(np.diag(capacitance)))
        size[size == 0.0] = 1.0
        elastance = np.linalg.pinv(capacitance / size[:, None] / size) / size[:, None] / size
        return cls(numbers, np.array([resultant.total for resultant in resultants]), flux, measure, elastance)

    def balance(self, flux: Array, totals: Array | float) -> tuple[Array, Array]:
        """Return flux densities (a,) with the totals (j,), and the potentials (j,).

        flux: densities (a,) without a potential.
        """
        if self.numbers.size == 0:
            return flux, np.zeros(0)
        potential = self.elastance @ (totals - self.measure @ flux)
        return flux + self.flux @ potential, potential


@dataclass(frozen=True, eq=False)
class Conductors:
    """Contact with given resistances, prepared for repeated responses.

    Attributes
    ----------
    resistance : Array
        (n, channels), 1/kappa, inf where insulated.
    conducts : Mask
        (n, channels), pairs that conduct.
    floating : Floating
        Floating conductors.
    solve : callable
        Function that returns the flux of the pairs (a,) that raises the negated potentials by differences (a,), with
        the floating conductors at zero. It is given an approximate flux and the part of its error that may remain.
    couplings : tuple of Array, optional
        (a, m n), compliance of the pairs in the m mechanical fields, and (m n, a), its counterpart; None if the
        compliance is not stored.
    """

    resistance: Array
    conducts: Mask
    floating: Floating
    solve: Solve
    couplings: tuple[Array, Array] | None

    def without_floating(self, flux: Array, potential: Array) -> Array:
        """Return the flux (n, channels) less the contribution of potentials (j,) of the floating conductors."""
        if potential.size == 0:
            return flux
        due = np.zeros(self.conducts.shape)
        due[self.conducts] = self.floating.flux @ potential
        return flux - due


@final
@dataclass(frozen=True, eq=False)
class Elimination:
    """Mechanical response of a problem's contact zone with the potentials eliminated.

    The flux equations are factorised where the compliance is stored as a matrix, and solved by GMRES elsewhere.

    Attributes
    ----------
    problem : ContactProblem
        Contact problem of n nodes.
    mechanical : list of int
        Fields, of 0 to 2, in which the law needs tractions or gaps.
    conducting : list of int
        Fields that the laws conduct.
    matrix : Array, optional
        (k n, k n), compliance in the k fields of both, one field after another; None if it is not stored.
    self_compliance : Array
        (n, channels), response of each node's potentials to their own flux.
    inverse : callable, optional
        Approximate inverse of the compliance in the conducting fields, (n, k) from (n, k).
    """

    problem: ContactProblem
    mechanical: list[int]
    conducting: list[int]
    matrix: Array | None
    self_compliance: Array
    inverse: Callable[[Array], Array] | None

    @classmethod
    def of(cls, problem: ContactProblem) -> "Elimination":
        """Return the elimination of a problem."""
        system = problem.system
        conducting = [field for field, channel in enumerate(problem.channels, N_MECHANICAL) if channel.is_conducting]
        mechanical = [field for field in essential_fields(problem) if field < N_MECHANICAL]
        matrix, fields, n = system.dense(), mechanical + conducting, len(problem.gap)
        if matrix is not None:
            blocks = matrix[:, fields][:, :, :, fields].transpose(1, 0, 3, 2)
            matrix = np.ascontiguousarray(blocks).reshape(len(fields) * n, len(fields) * n)
        approximate = system.capability(ApproximateInverse) if conducting and matrix is None else None
        inverse = None if approximate is None else approximate.approximate_inverse(conducting)
        return cls(problem, mechanical, conducting, matrix, potential_diagonal(problem), inverse)

    def prepare(self, resistance: Array, previous: Conductors | None) -> Conductors:
        """Return the conductors of resistances (n, channels); `previous` where these have not changed."""
        if previous is not None and np.array_equal(previous.resistance, resistance):
            return previous
        conducts = resistance < MAX_RESISTANCE_RATIO * self.self_compliance
        if self.matrix is None:
            solve, couplings = self._iterate(conducts, resistance), None
        else:
            (nodes, channels), n = np.nonzero(conducts), len(conducts)
            number = {field - N_MECHANICAL: k for k, field in enumerate(self.conducting, len(self.mechanical))}
            pairs, size = np.array([number[k] for k in channels.tolist()], int) * n + nodes, len(self.mechanical) * n
            solve = self._factorise(pairs, resistance[conducts])
            same = previous if previous is not None and np.array_equal(previous.conducts, conducts) else None
            couplings = same.couplings if same else (self.matrix[pairs, :size], self.matrix[:size, pairs])
        return Conductors(resistance, conducts, Floating.of(self.problem, conducts, solve), solve, couplings)

    def respond(self, traction: Array, conductors: Conductors, guess: Array, reduction: float = 0.0) -> Response:
        """Return the response to tractions alone.

        Parameters
        ----------
        traction : Array
            (n, 3) [Pa], admissible: tangential only if the law has some, none where there is no indenter above.
        conductors : Conductors
            Conductors in force.
        guess : Array
            (n, channels), approximate flux, as from Conductors.without_floating.
        reduction : float, optional
            Part of the guess's error that may remain: iterations whose guesses improve need no more.

        Returns
        -------
        Response
            Response, linear in the tractions.
        """
        return self._respond(traction, conductors, guess, reduction, total=False)

    def state(
        self, traction: Array, conductors: Conductors, flux: Array, potential: Array, reduction: float = 0.0
    ) -> Response:
        """Return the total response, including offset, potentials of the indenter and prescribed totals.

        flux: (n, channels), and potential: (j,), of the floating conductors, are approximate; the others as `respond`.
        """
        return self._respond(traction, conductors, conductors.without_floating(flux, potential), reduction, total=True)

    def _respond(
        self, traction: Array, conductors: Conductors, guess: Array, reduction: float, total: bool
    ) -> Response:
        conducts, floating = conductors.conducts, conductors.floating
        displacement, rise = self._response_to_tractions(traction, conductors)
        if total:
            displacement += self.problem.system.offset[:, MECHANICAL]
            rise -= (self.problem.potentials + self.problem.system.offset[:, POTENTIALS])[conducts]
        flux = np.zeros(conducts.shape)
        unbalanced = conductors.solve(rise, guess[conducts], reduction)
        flux[conducts], potential = floating.balance(unbalanced, floating.totals if total else 0.0)
        if flux.any():
            displacement[:, self.mechanical] += self._displacement_by_flux(flux, conductors)
        return Response(flux, displacement, potential)

    def _response_to_tractions(self, traction: Array, conductors: Conductors) -> tuple[Array, Array]:
        """Return the displacement (n, 3) and the rise (a,) of the negated potentials of the conducting pairs."""
        displacement, loads = np.zeros((self.problem.fields.size, len(traction))).T, traction.T[self.mechanical]
        if self.matrix is None or conductors.couplings is None:
            fields = self.mechanical + self.conducting
            displacement[:, fields] = apply_fields(self.problem.system, loads.T, self.mechanical, fields)
            return displacement[:, MECHANICAL], -displacement[:, POTENTIALS][conductors.conducts]
        size, values = loads.size, loads.ravel()
        displacement[:, self.mechanical] = (self.matrix[:size, :size] @ values).reshape(loads.shape).T
        return displacement[:, MECHANICAL], -(conductors.couplings[0] @ values)

    def _displacement_by_flux(self, flux: Array, conductors: Conductors) -> Array:
        """Return the displacement (n, m) in the mechanical fields due to fluxes (n, channels) of the pairs."""
        if conductors.couplings is None:
            channels = [field - N_MECHANICAL for field in self.conducting]
            return apply_fields(self.problem.system, flux[:, channels], self.conducting, self.mechanical)
        return (conductors.couplings[1] @ flux[conductors.conducts]).reshape(len(self.mechanical), len(flux)).T

    def _factorise(self, pairs: Indices, resistance: Array) -> Solve:
        """Return the solution of the flux equations by LU factorisation, scaled so that units do not matter.

        pairs: (a,), numbers of the conducting pairs in the stored matrix; resistance: (a,).
        """
        if not pairs.size:
            return lambda difference, guess, reduction: difference
        assert self.matrix is not None
        equations = self.matrix[np.ix_(pairs, pairs)]
        equations[np.diag_indices(len(pairs))] += resistance
        scale = np.diag(equations) ** -0.5
        factors = lu_factor(scale[:, None] * equations * scale, overwrite_a=True, check_finite=False)
        return lambda difference, guess, reduction: scale * lu_solve(factors, scale * difference, check_finite=False)

    def _iterate(self, conducts: Mask, resistance: Array) -> Solve:
        """Return the solution of the flux equations by GMRES.

        It is preconditioned with the approximate inverse on pairs that conduct well, that is where the self-compliance
        exceeds the resistance, and with the diagonal on the others.
        """
        system, fields = self.problem.system, self.conducting
        channels = [field - N_MECHANICAL for field in fields]
        resistances, compliance = resistance[conducts], self.self_compliance[conducts]
        size, is_good = np.sqrt(compliance + resistances), compliance > resistances

        def scatter(values: Array) -> Array:
            full = np.zeros(conducts.shape[::-1], values.dtype).T
            full[conducts] = values
            return full[:, channels]

        def gather(values: Array) -> Array:
            full = np.zeros(conducts.shape)
            full[:, channels] = values
            return full[conducts]

        def multiply(scaled: Array) -> Array:
            flux = scaled / size
            return (gather(apply_fields(system, scatter(flux), fields, fields)) + resistances * flux) / size

        def precondition(scaled: Array) -> Array:
            if self.inverse is None or not is_good.any():
                return scaled
            flux = gather(self.inverse(scatter(np.where(is_good, scaled * size, 0.0))))
            return np.where(is_good, flux * size, scaled)

        def solve(difference: Array, guess: Array, reduction: float) -> Array:
            right = difference / size
            start = guess * size
            residual = right - multiply(start) if start.any() else right
            norm = float(np.linalg.norm(residual))
            target = max(TOLERANCE * float(np.linalg.norm(right)), max(reduction, TOLERANCE) * norm)
            if norm <= target:
                return guess
            return (start + gmres(multiply, precondition, residual, target / norm)[0]) / size

        return solve
