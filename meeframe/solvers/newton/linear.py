"""Newton steps of the nonsmooth equation: by factorisation at contact size, or by Krylov iteration.

Rows that determine one unknown of a single node (open nodes, insulated potentials, contact fractions of nodes that are
not biactive) are eliminated beforehand: the remaining system has the size of the contact.

Where the compliance is not stored as a matrix, the free motions are unknowns like the loads, and the resistance of
the contact to them is part of the preconditioner. Components come before nodes: numpy is faster along the longer axis.
A step of which a few digits are required is computed in single precision; the residual that decides on it is not.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg import LinAlgError, lu_factor, lu_solve

from meeframe.common.memory import release_freed_memory, stack_columns
from meeframe.contact.conduction import Mask
from meeframe.fields import Array
from meeframe.solvers.krylov import gmres
from meeframe.solvers.newton.jacobian import ReducedJacobian
from meeframe.solvers.newton.preconditioner import preconditioner
from meeframe.solvers.newton.residual import FRACTION, ContactResidual, Linearization

DEFAULT_TOLERANCE: Final = 1e-10
"""Fraction of the residual that linear iterations leave by default."""
MIN_STIFFNESS_RATIO: Final = 1e-12
"""Largest stiffness against a motion, relative to the largest one, that counts as zero."""
ROUND_OFF_FACTOR: Final = 10.0
"""Bound on the round-off of products of a vector, in units of the round-off of the vector."""
MIN_SINGLE_TOLERANCE: Final = 3e-5
"""Smallest tolerance for which single precision suffices."""
MIN_TOLERANCE_FACTOR: Final = 1e-3
"""Smallest factor by which a large prescribed part of a step reduces the tolerance of the solution."""


@dataclass(frozen=True, eq=False)
class Step:
    """Newton step of the loads, the contact fractions and the free motions.

    Attributes
    ----------
    local : Array
        (n, fields + 1), step of the load and the contact fraction.
    motion : Array
        (m,), step of the free motions.
    """

    local: Array
    motion: Array

    @property
    def finite(self) -> bool:
        """True if the equations were regular."""
        return bool(np.isfinite(self.local).all() and np.isfinite(self.motion).all())


def newton_step(equation: ContactResidual, blocks: Linearization, tolerance: float = DEFAULT_TOLERANCE) -> Step:
    """Return the step that solves the linearised equations; it is not finite if they are singular.

    A motion without resistance is left unchanged.

    Parameters
    ----------
    equation : ContactResidual
        Equation of n nodes.
    blocks : Linearization
        Its linearisation.
    tolerance : float, optional
        Fraction of the residual that may be left where there is no matrix.

    Returns
    -------
    Step
        Step of all unknowns.
    """
    coupled = coupled_rows(blocks)
    prescribed = decoupled_rows(blocks, coupled)
    matrix = equation.problem.system.dense()
    if matrix is None:
        try:
            solve = _krylov_step(equation, blocks, coupled, prescribed, tolerance)
            del blocks, coupled  # arrays of all rows take more memory than the iteration
            local, amounts = solve()
        except LinAlgError:  # tangents that are not finite
            local, amounts = np.full_like(prescribed, np.nan), np.full_like(equation.units, np.nan)
    else:
        size = equation.problem.system.offset.size
        local, amounts = _direct_step(equation, blocks, coupled, prescribed, matrix.reshape(size, size))
    return Step(local, equation.units * amounts)


def _direct_step(
    equation: ContactResidual, blocks: Linearization, coupled: Mask, prescribed: Array, matrix: Array
) -> tuple[Array, Array]:
    """Return the step (n, fields + 1) and the amounts (m,) of the motions by factorisation.

    The step with the indenter at rest comes first, then the responses to each motion. Free motions are eliminated,
    which leaves the stiffness of the contact against them. prescribed: (n, fields + 1), determined by the decoupled
    rows; matrix: (n fields, n fields) compliance.
    """
    right = -blocks.residual - (_product(equation, blocks, prescribed) if prescribed.any() else 0.0)
    by_motion = blocks.b.dense(equation.problem.fields.size) @ equation.modes
    rights = np.concatenate([right[:, :, None], by_motion], axis=2)[coupled]
    responses = np.zeros((*coupled.shape, rights.shape[1]))
    responses[:, :, 0] = prescribed
    if rights.size:
        responses[coupled] = _direct(equation, blocks, coupled, rights, matrix)
    amounts = _amounts(equation, blocks, responses)
    return responses[:, :, 0] + responses[:, :, 1:] @ amounts, amounts


def _product(equation: ContactResidual, blocks: Linearization, step: Array) -> Array:
    """Return (A + B C) step, (n, fields + 1)."""
    displacement = equation.problem.system.apply(step[:, :FRACTION])
    product = blocks.a.products(step.dtype).times(step.T)
    blocks.b.products(step.dtype).add(displacement.T, product)
    return product.T


def _amounts(equation: ContactResidual, blocks: Linearization, responses: Array) -> Array:
    """Return the motions (m,), in units of the equation, that restore the balance, limited to the largest step allowed.

    responses: (n, fields + 1, 1 + m), the step at rest followed by the responses to the motions.
    """
    if blocks.balance.size == 0 or not np.isfinite(responses).all():
        return np.full(blocks.balance.shape, np.nan)
    resultants = np.einsum("kni,nil->kl", equation.measures, responses[:, :FRACTION])
    right = -blocks.balance - resultants[:, 0]
    amounts = np.linalg.lstsq(resultants[:, 1:], right, rcond=MIN_STIFFNESS_RATIO)[0]
    return np.asarray(amounts * blocks.max_motion / np.abs(amounts).max(initial=blocks.max_motion))


def coupled_rows(blocks: Linearization) -> Mask:
    """Return the rows (n, fields + 1) that involve more than their own unknown.

    The row of the pressure is included where that of the contact fraction is, as the two belong together.
    """
    coupled = np.zeros(blocks.a.shape, bool)
    off_diagonal = [(row, entry) for (row, column), entry in blocks.a.entries.items() if row != column]
    for row, entry in [*off_diagonal, *((row, entry) for (row, _), entry in blocks.b.entries.items())]:
        coupled[row] |= entry != 0.0
    coupled[2] |= coupled[FRACTION]
    return coupled.T


def decoupled_rows(blocks: Linearization, coupled: Mask) -> Array:
    """Return the step (n, fields + 1) that the decoupled rows determine, zero on the coupled ones (n, fields + 1)."""

    def decoupled(row: int) -> Array:
        diagonal = np.where(coupled[:, row], 1.0, blocks.a.entry(row, row))
        return np.where(coupled[:, row], 0.0, -blocks.residual[:, row] / diagonal)

    return stack_columns(map(decoupled, range(coupled.shape[1])), blocks.residual.shape)


def _direct(equation: ContactResidual, blocks: Linearization, coupled: Mask, rights: Array, matrix: Array) -> Array:
    """Return the solutions by LU factorisation; matrix: (n fields, n fields) compliance."""
    # loads before contact fractions, so that the compliance fills a block
    n_fields = equation.problem.fields.size
    node, row = np.nonzero(coupled)
    order = np.argsort(row == n_fields, kind="stable")
    node, row = node[order], row[order]
    number = np.full(coupled.shape, -1)
    number[node, row] = np.arange(len(node))
    columns = np.flatnonzero(coupled[:, :FRACTION])
    jacobian = np.zeros((len(node), len(node)))
    by_unknown, by_displacement = blocks.a.dense(n_fields + 1), blocks.b.dense(n_fields)
    for field in range(n_fields):
        factor = by_displacement[node, row, field]
        rows = np.flatnonzero(factor)
        response = matrix.take(node[rows] * n_fields + field, axis=0).take(columns, axis=1)
        jacobian[rows, : len(columns)] += factor[rows, None] * response
    for unknown in range(n_fields + 1):
        rows = np.flatnonzero(coupled[node, unknown])
        jacobian[rows, number[node[rows], unknown]] += by_unknown[node[rows], row[rows], unknown]
    unit = equation.load_units[row]  # makes the equations dimensionless
    solved = np.empty_like(rights)
    try:
        factors = lu_factor(jacobian * unit, overwrite_a=True, check_finite=False)
    except LinAlgError:
        return np.full_like(rights, np.nan)
    solved[order] = unit[:, None] * lu_solve(factors, rights[order], check_finite=False)
    return solved


def _krylov_step(
    equation: ContactResidual, blocks: Linearization, coupled: Mask, prescribed: Array, tolerance: float
) -> Callable[[], tuple[Array, Array]]:
    """Return the function that finds the Newton step (n, fields + 1) and the amounts (m,) of the motions.

    It is a Krylov iteration, and is called once, because it frees the reduced equations when it has prepared itself.
    coupled: (n, fields + 1), coupled rows; prescribed: (n, fields + 1), step in the other rows; tolerance: fraction of
    the residual that may be left. Raises LinAlgError if the equations are not finite.
    """
    jacobian = ReducedJacobian.of(
        equation, blocks, coupled, np.dtype(np.float32 if tolerance >= MIN_SINGLE_TOLERANCE else np.float64)
    )
    residual = jacobian.select(-blocks.residual).astype(jacobian.precision)
    right = residual - jacobian.image(blocks, prescribed) if prescribed.any() else residual
    if not (np.isfinite(prescribed).all() and jacobian.a.finite and jacobian.b.finite and np.isfinite(right).all()):
        raise LinAlgError("the equations are not finite")
    # the tolerance refers to the residual, to which a large prescribed part adds
    before, after = float(np.linalg.norm(residual)), float(np.linalg.norm(right))
    tolerance *= max(before / after, MIN_TOLERANCE_FACTOR) if after > before else 1.0
    resultants = [each.of_load(prescribed[:, :FRACTION]) for each in equation.problem.prescribed_resultants]
    balance = -blocks.balance - np.array(resultants) / equation.scales.totals
    weight = np.sqrt(equation.count, dtype=jacobian.precision)  # as the merit weighs the balance
    size, max_motion, expand = len(right), blocks.max_motion, jacobian.expansion(prescribed)

    def iteration() -> tuple[Array, Array]:
        nonlocal jacobian
        multiplication, columns, measures = jacobian.multiplication(), jacobian.motion_columns(), jacobian.measures()
        precondition = preconditioner(jacobian)
        del jacobian  # its blocks take as much memory as some directions of the iteration
        release_freed_memory(equation.count)  # of the blocks and what they were computed from
        responses = np.empty_like(columns)
        for response, column in zip(responses, columns, strict=True):
            response[:] = precondition(column)
        border = BorderedSystem.of(measures, responses)

        def multiply(values: Array) -> Array:
            loads, amounts, product = values[:size], values[size:], np.empty_like(values)
            np.subtract(multiplication(loads), (border.motions @ amounts) @ columns, out=product[:size])
            product[size:] = weight * border.resultants(loads)
            return product

        def solve(values: Array) -> Array:
            loads, solution = precondition(values[:size]), np.empty_like(values)
            solution[size:] = (values[size:] / weight - border.resultants(loads)) / border.stiffness
            np.add(loads, (border.motions @ solution[size:]) @ responses, out=solution[:size])
            return solution

        bordered = np.concatenate([right, weight * border.combine(balance)]).astype(right.dtype)
        solution = gmres(multiply, solve, bordered, tolerance)[0]
        amounts = (border.motions @ solution[size:]).astype(float)
        largest_motion = float(np.abs(amounts).max(initial=0.0))
        if largest_motion > max_motion:
            amounts *= max_motion / largest_motion
            motion_right = (amounts @ columns).astype(right.dtype)
            solution = gmres(multiplication, precondition, right + motion_right, tolerance)[0]
        return solution[:size], amounts

    def step() -> tuple[Array, Array]:
        loads, amounts = iteration()
        release_freed_memory(equation.count)  # of the iteration
        return expand(loads), amounts

    return step


@dataclass(frozen=True, eq=False)
class BorderedSystem:
    """Bordered part of the system: q combinations of motions with resistance, and of resultants that they change.

    Attributes
    ----------
    motions : Array
        (m, q), amounts of the motions in the combinations.
    combinations : Array
        (m, q), resultants in the combinations.
    measures : list
        Measures of the unknowns, as from ReducedJacobian.measures.
    stiffness : Array
        (q,), approximate stiffness of the contact against the combinations.
    """

    motions: Array
    combinations: Array
    measures: list[dict[int, Array]]
    stiffness: Array

    @classmethod
    def of(cls, measures: list[dict[int, Array]], responses: Array) -> "BorderedSystem":
        """Return the border from the measures and the approximate responses (m, r c) to each motion."""
        matrix = np.array([_resultants(measures, response) for response in responses]).T
        combinations, stiffness, right = np.linalg.svd(matrix.reshape(len(measures), len(measures)))
        min_ratio = max(MIN_STIFFNESS_RATIO, ROUND_OFF_FACTOR * np.finfo(responses.dtype).eps)
        is_resisted = stiffness > min_ratio * stiffness.max(initial=0.0)
        return cls(right[is_resisted].T, combinations[:, is_resisted], measures, stiffness[is_resisted])

    def resultants(self, loads: Array) -> Array:
        """Return the combinations (q,) of the resultants of loads (r c,)."""
        return self.combine(_resultants(self.measures, loads))

    def combine(self, resultants: Array) -> Array:
        """Return the combinations (q,) of resultants (m,)."""
        return np.asarray(self.combinations.T @ resultants)


def _resultants(measures: list[dict[int, Array]], loads: Array) -> Array:
    """Return the resultants (m,) of loads (r c,)."""
    resultants = np.zeros(len(measures), loads.dtype)
    for number, measure in enumerate(measures):
        for row, weights in measure.items():
            resultants[number] += weights @ loads[row * len(weights) : (row + 1) * len(weights)]
    return resultants
