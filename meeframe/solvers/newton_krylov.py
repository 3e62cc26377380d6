"""Newton steps without a matrix: Krylov iteration, with the free motions as unknowns beside the loads.

That a motion is resisted by the contact is part of the preconditioner. Components come before nodes: numpy is much
faster along the longer axis. A step of which a few digits are asked for is found in single precision: the residual
that says whether it is good is not.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.linalg import LinAlgError

from meeframe.core.fields import N_FIELDS, Array
from meeframe.solvers.conduction import Mask
from meeframe.solvers.krylov import Linear, gmres
from meeframe.solvers.newton_preconditioner import preconditioner
from meeframe.solvers.newton_rows import Rows
from meeframe.solvers.nonsmooth import Blocks, Equation

UNRESISTED: Final = 1e-12
"""Stiffness against a motion, as a fraction of the largest one, that is none."""
ROUND_OFF: Final = 10.0
"""So many times the round-off of a vector its products with others are off."""
SINGLE: Final = 3e-5
"""Tolerance from which on single precision serves."""
UNNOTICED: Final = 0.1
"""Of what may be left of the residual: what is given of a step by less changes nothing elsewhere."""


@dataclass(frozen=True, eq=False)
class Inverse:
    """What is roughly the inverse of the equations of some rows, and responses (m, r c) of these to the motions.

    It serves as long as the same rows are coupled, and the same nodes stick: what else changes is then little.
    """

    rows: Rows
    precondition: Linear
    responses: Array

    @classmethod
    def of(cls, rows: Rows, before: "Inverse | None") -> "Inverse":
        """Of rows, that of those before if it serves."""
        if before is not None and before.rows.like(rows):
            return before
        precondition = preconditioner(rows)
        columns = rows.lifted(rows.equation.modes)
        responses = np.empty_like(columns)
        for response, column in zip(responses, columns, strict=True):
            response[:] = precondition(column)
        return cls(rows, precondition, responses)


def krylov_step(
    equation: Equation, blocks: Blocks, coupled: Mask, given: Array, tolerance: float, before: Inverse | None = None
) -> tuple[Array, Array, Inverse]:
    """Step (n, 6) and amounts (m,) of the motions, with what is given of the step (n, 6) off the coupled rows.

    Also what is roughly the inverse of the equations, for the next step; before: that of the last one. The residual
    that is left is that fraction of the one before. Raises LinAlgError if the equations are not finite.
    """
    rows = Rows.of(equation, blocks, coupled, np.dtype(np.float32 if tolerance >= SINGLE else np.float64))
    right = _right(rows, blocks, given, tolerance)
    if not (rows.a.finite and rows.b.finite and np.isfinite(right).all()):
        raise LinAlgError("equations of what is no number")
    multiplication, inverse = rows.multiplication(), Inverse.of(rows, before)
    precondition, border = inverse.precondition, _Border.of(rows, inverse.responses)
    balance = -blocks.balance - np.einsum("kni,ni->k", equation.measures, given[:, :N_FIELDS])
    weight = np.sqrt(equation.count, dtype=rows.precision)  # as the merit weighs the balance
    size = len(right)

    def multiply(values: Array) -> Array:
        loads, amounts = values[:size], values[size:]
        left = multiplication(loads) - amounts @ border.columns
        return np.concatenate([left, weight * (border.totals @ loads)])

    def solve(values: Array) -> Array:
        loads = precondition(values[:size])
        amounts = (values[size:] / weight - border.totals @ loads) / border.stiffness
        return np.concatenate([loads + amounts @ border.responses, amounts])

    whole = np.concatenate([right, weight * border.turned(balance)]).astype(rows.precision)
    found, _ = gmres(multiply, solve, whole, tolerance)
    amounts = (border.motions @ found[size:]).astype(float)
    farthest = float(np.abs(amounts).max(initial=0.0))
    if farthest > blocks.farthest:
        amounts *= blocks.farthest / farthest
        moved = (amounts @ rows.lifted(equation.modes)).astype(rows.precision)
        found, _ = gmres(multiplication, precondition, right + moved, tolerance)
    return rows.step(found[:size], given), amounts, inverse


def _right(rows: Rows, blocks: Blocks, given: Array, tolerance: float) -> Array:
    """Right-hand side (r c,) with what is given of the step (n, 6), where that counts."""
    right = rows.chosen(-blocks.residual)
    units = np.append(rows.equation.scales.load, 1.0)
    if np.linalg.norm(given / units) > UNNOTICED * tolerance * np.linalg.norm(right):
        right -= rows.image(blocks, given)
    return right.astype(rows.precision)


@dataclass(frozen=True, eq=False)
class _Border:
    """The q combinations of motions that something resists, as columns and rows of the equations.

    motions: (m, q) amounts in them; columns: (q, r c) what they add to the right-hand side; responses: (q, r c) loads
    that they roughly cause; totals: (q, r c) resultants of loads, combined likewise, and stiffness: (q,) those of the
    responses; left: (m, q) the combinations of resultants.
    """

    motions: Array
    columns: Array
    responses: Array
    totals: Array
    stiffness: Array
    left: Array

    @classmethod
    def of(cls, rows: Rows, responses: Array) -> "_Border":
        """Of rows; responses: (m, r c) roughly to each motion."""
        columns = rows.lifted(rows.equation.modes)
        totals = rows.combined(rows.equation.measures)
        left, stiffness, right = np.linalg.svd(totals @ responses.T)
        smallest = max(UNRESISTED, ROUND_OFF * np.finfo(rows.precision).eps)
        resisted = stiffness > smallest * stiffness.max(initial=0.0)
        right, left = right[resisted], left[:, resisted]
        return cls(right.T, right @ columns, right @ responses, left.T @ totals, stiffness[resisted], left)

    def turned(self, resultants: Array) -> Array:
        """Combinations (q,) of resultants (m,)."""
        return np.asarray(self.left.T @ resultants)
