"""Matrix-free Newton steps: Krylov iteration, with the free motions as unknowns beside the loads.

The resistance of the contact to the motions is part of the preconditioner. Components come before nodes: numpy is much
faster along the longer axis. A step of which a few digits are required is computed in single precision; the residual
that decides on its quality is not.
"""

from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np
from numpy.linalg import LinAlgError

from meeframe.contact.conduction import Mask
from meeframe.fields import Array
from meeframe.solvers.krylov import Linear, gmres
from meeframe.solvers.newton.jacobian import ReducedJacobian
from meeframe.solvers.newton.preconditioner import preconditioner
from meeframe.solvers.newton.residual import FRACTION, ContactResidual, Linearization

MIN_STIFFNESS_RATIO: Final = 1e-12
"""Largest stiffness against a motion, relative to the largest one, that counts as zero."""
ROUND_OFF_FACTOR: Final = 10.0
"""Bound on the round-off of products of a vector, in units of the round-off of the vector."""
MIN_SINGLE_TOLERANCE: Final = 3e-5
"""Smallest tolerance for which single precision suffices."""
MIN_APPROXIMATE_TOLERANCE: Final = 5e-4
"""Smallest tolerance for which approximate responses of the system suffice."""
MIN_TOLERANCE_FACTOR: Final = 1e-3
"""Smallest factor by which a large given part of a step reduces the tolerance of the solution.

It applies to right-hand sides far below the given part.
"""
NEGLIGIBLE_FRACTION: Final = 0.1
"""Largest given part of a step, relative to the residual that may be left, that is negligible elsewhere."""


@dataclass(frozen=True, eq=False)
class Inverse:
    """Approximate inverse of the equations of some rows, with its responses (m, r c) to the motions.

    It remains useful as long as the same rows are coupled, and the same nodes stick: all other changes are small.
    """

    rows: ReducedJacobian
    precondition: Linear
    responses: Array

    @classmethod
    def of(cls, rows: ReducedJacobian, columns: Array, before: "Inverse | None") -> "Inverse":
        """Return the approximate inverse of rows, or `before` if that still serves.

        columns: (m, r c) contribution of the motions to the right-hand side.
        """
        if before is not None and before.rows.has_same_pattern(rows):
            return before
        precondition = preconditioner(rows)
        responses = np.empty_like(columns)
        for response, column in zip(responses, columns, strict=True):
            response[:] = precondition(column)
        return cls(rows, precondition, responses)


def krylov_step(
    equation: ContactResidual,
    blocks: Linearization,
    coupled: Mask,
    prescribed: Array,
    tolerance: float,
    before: Inverse | None = None,
) -> tuple[Array, Array, Inverse]:
    """Return the Newton step by Krylov iteration.

    Parameters
    ----------
    equation : ContactResidual
        Equation of n nodes.
    blocks : Linearization
        Its linearisation.
    coupled : Mask
        (n, fields + 1), coupled rows.
    prescribed : Array
        (n, fields + 1), step in the decoupled rows.
    tolerance : float
        Fraction of the residual that may be left.
    before : Inverse, optional
        Approximate inverse of the last step.

    Returns
    -------
    step : Array
        (n, fields + 1).
    amounts : Array
        (m,), amounts of the free motions, in characteristic units.
    inverse : Inverse
        Approximate inverse for the next step.

    Raises
    ------
    LinAlgError
        If the equations are not finite.
    """
    rows = ReducedJacobian.of(
        equation, blocks, coupled, np.dtype(np.float32 if tolerance >= MIN_SINGLE_TOLERANCE else np.float64)
    )
    right = rows.select(-blocks.residual).astype(rows.precision)
    if not (np.isfinite(prescribed).all() and rows.a.finite and rows.b.finite and np.isfinite(right).all()):
        raise LinAlgError("equations of what is no number")
    multiplication, columns = (
        rows.multiplication(tolerance >= MIN_APPROXIMATE_TOLERANCE),
        rows.motion_columns(equation.modes),
    )
    inverse = Inverse.of(rows, columns, before)
    precondition, border = inverse.precondition, BorderedSystem.of(rows, inverse.responses)
    balance = -blocks.balance - np.einsum("kni,ni->k", equation.measures, prescribed[:, :FRACTION])
    weight = np.sqrt(equation.count, dtype=rows.precision)  # as the merit weighs the balance
    size = len(right)

    def bordered(product: Linear) -> Linear:
        def multiply(values: Array) -> Array:
            loads, amounts, full = values[:size], values[size:], np.empty_like(values)
            np.subtract(product(loads), (border.motions @ amounts) @ columns, out=full[:size])
            full[size:] = weight * border.resultants(loads)
            return full

        return multiply

    def solve(values: Array) -> Array:
        loads, full = precondition(values[:size]), np.empty_like(values)
        full[size:] = (values[size:] / weight - border.resultants(loads)) / border.stiffness
        np.add(loads, (border.motions @ full[size:]) @ inverse.responses, out=full[:size])
        return full

    product = bordered(multiplication)
    image: Linear | None = None
    if _is_significant(rows, prescribed, tolerance * float(np.linalg.norm(right))):
        image = partial(rows.image, blocks, prescribed)
    full = np.concatenate([right, weight * border.combine(balance)]).astype(rows.precision)
    solution = _solution(product, bordered(image) if image else None, solve, full, tolerance)
    amounts = (border.motions @ solution[size:]).astype(float)
    largest_motion = float(np.abs(amounts).max(initial=0.0))
    if largest_motion > blocks.max_motion:
        amounts *= blocks.max_motion / largest_motion
        motion_right = (amounts @ columns).astype(rows.precision)
        solution = _solution(multiplication, image, precondition, right + motion_right, tolerance)
    return rows.step(solution[:size], prescribed), amounts, inverse


def _is_significant(rows: ReducedJacobian, prescribed: Array, allowed: float) -> bool:
    """Return true if the prescribed step (n, fields + 1) is not negligible beside the allowed residual."""
    units = np.append(rows.equation.scales.load, 1.0)
    return float(np.linalg.norm(prescribed / units)) > NEGLIGIBLE_FRACTION * allowed


def _solution(multiply: Linear, image: Linear | None, precondition: Linear, right: Array, tolerance: float) -> Array:
    """Return the unknowns (k,) of a right-hand side (k,), of which the fraction `tolerance` may be left.

    image: of unknowns together with the given part of the step, None if that is negligible; multiply: without it. The
    product that the given part costs provides a first guess, too.
    """
    if image is None:
        return gmres(multiply, precondition, right, tolerance)[0]
    first = precondition(right)
    residual = right - image(first)
    before, after = (float(np.linalg.norm(vector)) for vector in (right, residual))
    if after <= tolerance * before:
        return first
    return first + gmres(multiply, precondition, residual, tolerance * max(before / after, MIN_TOLERANCE_FACTOR))[0]


@dataclass(frozen=True, eq=False)
class BorderedSystem:
    """Bordered part of the system: q combinations of motions with resistance, and of resultants that they change.

    Attributes
    ----------
    motions : Array
        (m, q), amounts of the motions in the combinations.
    combinations : Array
        (m, q), resultants in the combinations.
    totals : list
        Measures of the unknowns, as from ReducedJacobian.to_unknowns.
    stiffness : Array
        (q,), approximate stiffness of the contact against the combinations.
    """

    motions: Array
    combinations: Array
    totals: list[dict[int, Array]]
    stiffness: Array

    @classmethod
    def of(cls, rows: ReducedJacobian, responses: Array) -> "BorderedSystem":
        """Return the border of rows; responses: (m, r c) approximate responses to each motion."""
        totals = rows.to_unknowns(rows.equation.measures)
        matrix = np.array([_resultants(totals, response) for response in responses]).T
        combinations, stiffness, right = np.linalg.svd(matrix.reshape(len(totals), len(totals)))
        min_ratio = max(MIN_STIFFNESS_RATIO, ROUND_OFF_FACTOR * np.finfo(rows.precision).eps)
        is_resisted = stiffness > min_ratio * stiffness.max(initial=0.0)
        return cls(right[is_resisted].T, combinations[:, is_resisted], totals, stiffness[is_resisted])

    def resultants(self, loads: Array) -> Array:
        """Return the combinations (q,) of the resultants of loads (r c,)."""
        return self.combine(_resultants(self.totals, loads))

    def combine(self, resultants: Array) -> Array:
        """Return the combinations (q,) of resultants (m,)."""
        return np.asarray(self.combinations.T @ resultants)


def _resultants(totals: list[dict[int, Array]], loads: Array) -> Array:
    """Return the resultants (m,) of loads (r c,)."""
    resultants = np.zeros(len(totals), loads.dtype)
    for number, total in enumerate(totals):
        for row, weights in total.items():
            resultants[number] += weights @ loads[row * len(weights) : (row + 1) * len(weights)]
    return resultants
