"""Newton steps without a matrix: Krylov iteration, preconditioned by an approximate inverse of the compliance.

Coupled rows are of two kinds. Those of sticking and pressed nodes and of conductors ask for a displacement or a
potential: to them the approximate inverse answers, restricted to where they are. Those of the others have mostly to do
with loads of their own node, as friction has that follows the pressure: to them the inverse of the node's own block.
Free motions are unknowns beside the loads; that a motion is resisted by the contact is part of the preconditioner.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from meeframe.core.fields import N_FIELDS, Array
from meeframe.solvers.conduction import Mask
from meeframe.solvers.krylov import Linear, gmres
from meeframe.solvers.nonsmooth import CLOSED, Blocks, Equation

UNRESISTED: Final = 1e-12
"""Stiffness against a motion, as a fraction of the largest one, that is none."""


@dataclass(frozen=True, eq=False)
class Rows:
    """The linearised equations on the coupled rows (n, 6), by dimensionless unknowns (k,) in units (n, 6)."""

    equation: Equation
    blocks: Blocks
    coupled: Mask
    units: Array

    @classmethod
    def of(cls, equation: Equation, blocks: Blocks, coupled: Mask) -> "Rows":
        """Of the blocks of an equation."""
        units = np.broadcast_to(np.append(equation.scales.load, 1.0), coupled.shape)
        return cls(equation, blocks, coupled, units)

    def full(self, values: Array) -> Array:
        """Values (k,) among all rows, (n, 6)."""
        filled = np.zeros(self.coupled.shape)
        filled[self.coupled] = values
        return filled

    def multiply(self, values: Array) -> Array:
        """Product (k,) of the equations with unknowns (k,)."""
        return np.asarray(product(self.equation, self.blocks, self.units * self.full(values))[self.coupled])


def product(equation: Equation, blocks: Blocks, step: Array) -> Array:
    """(A + B C) step, (n, 6)."""
    asked = np.flatnonzero(blocks.b.any(axis=(0, 1))).tolist()
    moved = equation.problem.system.response(step[:, :N_FIELDS], asked)
    return np.asarray((blocks.a @ step[:, :, None] + blocks.b[:, :, asked] @ moved[:, :, None])[:, :, 0])


def krylov_step(
    equation: Equation, blocks: Blocks, coupled: Mask, given: Array, tolerance: float
) -> tuple[Array, Array]:
    """Step (n, 6) and amounts (m,) of the motions, with what is given of the step (n, 6) off the coupled rows.

    The residual that is left is that fraction of the one before.
    """
    rows = Rows.of(equation, blocks, coupled)
    right = -blocks.residual - (product(equation, blocks, given) if given.any() else 0.0)
    precondition = _preconditioner(rows)
    border = _Border.of(rows, precondition)
    balance = -blocks.balance - np.einsum("kni,ni->k", equation.measures, given[:, :N_FIELDS])
    weight = np.sqrt(len(given))  # as the merit weighs the balance
    size = int(coupled.sum())

    def multiply(values: Array) -> Array:
        loads, amounts = values[:size], values[size:]
        left = rows.multiply(loads) - border.columns @ amounts
        return np.concatenate([left, weight * (border.totals @ loads)])

    def solve(values: Array) -> Array:
        loads = precondition(values[:size])
        amounts = (values[size:] / weight - border.totals @ loads) / border.stiffness
        return np.concatenate([loads + border.responses @ amounts, amounts])

    rights = np.concatenate([right[coupled], weight * border.turned(balance)])
    found = gmres(multiply, solve, rights, tolerance)
    amounts = border.motions @ found[size:]
    farthest = float(np.abs(amounts).max(initial=0.0))
    if farthest > blocks.farthest:
        amounts *= blocks.farthest / farthest
        moved = right + (blocks.b @ (equation.modes @ amounts)[:, :, None])[:, :, 0]
        found = gmres(rows.multiply, precondition, moved[coupled], tolerance)
    return given + rows.units * rows.full(found[:size]), amounts


@dataclass(frozen=True, eq=False)
class _Border:
    """The r combinations of motions that something resists, as columns and rows of the equations.

    motions: (m, r) amounts in them; columns: (k, r) what they add to the right-hand side; responses: (k, r) loads that
    they roughly cause; totals: (r, k) resultants of loads, combined likewise, and stiffness: (r,) those of the
    responses; left: (m, r) the combinations of resultants.
    """

    motions: Array
    columns: Array
    responses: Array
    totals: Array
    stiffness: Array
    left: Array

    @classmethod
    def of(cls, rows: Rows, precondition: Linear) -> "_Border":
        equation, coupled = rows.equation, rows.coupled
        columns = (rows.blocks.b @ equation.modes)[coupled]
        responses = np.column_stack([precondition(column) for column in columns.T]) if columns.size else columns
        extended = np.zeros((len(columns.T), *coupled.shape))
        extended[:, :, :N_FIELDS] = equation.measures
        totals = (extended * rows.units)[:, coupled]
        left, stiffness, right = np.linalg.svd(totals @ responses)
        resisted = stiffness > UNRESISTED * stiffness.max(initial=0.0)
        motions, left = right[resisted].T, left[:, resisted]
        return cls(motions, columns @ motions, responses @ motions, left.T @ totals, stiffness[resisted], left)

    def turned(self, resultants: Array) -> Array:
        """Combinations (r,) of resultants (m,)."""
        return np.asarray(self.left.T @ resultants)


def _preconditioner(rows: Rows) -> Linear:
    """Roughly the inverse of the coupled rows, (k,) of (k,): first of those that ask for displacements, then of the
    others, node by node."""
    inverse, fields = rows.equation.inverse, rows.equation.loaded
    asking = _asking(rows) if inverse else np.zeros_like(rows.coupled[:, :N_FIELDS])
    others = rows.coupled.copy()
    others[:, :N_FIELDS] &= ~asking
    own = _inverse_of_own(rows, others)
    if inverse is None or not asking.any():
        return lambda values: np.asarray((own @ rows.full(values)[:, :, None])[:, :, 0][rows.coupled])
    both = asking[:, :, None] & asking[:, None, :]
    units = rows.equation.scales.displacement
    ask = units[:, None] * np.linalg.pinv(np.where(both, rows.blocks.b[:, :N_FIELDS] * units, np.eye(N_FIELDS)))

    def precondition(values: Array) -> Array:
        rest = rows.full(values)
        asked = np.where(asking, (ask @ np.where(asking, rest[:, :N_FIELDS], 0.0)[:, :, None])[:, :, 0], 0.0)
        found = np.zeros(rows.coupled.shape)
        found[:, fields] = np.where(asking[:, fields], inverse(asked[:, fields]), 0.0)
        rest -= (rows.blocks.a @ found[:, :, None])[:, :, 0]
        found /= rows.units
        found += (own @ rest[:, :, None])[:, :, 0]
        return np.asarray(found[rows.coupled])

    return precondition


def _asking(rows: Rows) -> Mask:
    """Rows (n, 5) that ask for displacements: those in which a node's own response outweighs its own load."""
    own = rows.equation.blocks
    load, moved = (np.abs(_diagonal(part[:, :N_FIELDS, :N_FIELDS])) for part in (rows.blocks.a, rows.blocks.b))
    asking: Mask = rows.coupled[:, :N_FIELDS] & (moved * np.abs(_diagonal(own)) > load)
    asking[:, np.setdiff1d(np.arange(N_FIELDS), rows.equation.loaded)] = False
    return asking


def _diagonal(blocks: Array) -> Array:
    return np.asarray(np.diagonal(blocks, axis1=1, axis2=2))


def _inverse_of_own(rows: Rows, which: Mask) -> Array:
    """Inverses (n, 6, 6) of each node's own block on the rows (n, 6) which, dimensionless; zero elsewhere."""
    both = which[:, :, None] & which[:, None, :]
    extended = np.zeros((len(which), N_FIELDS, CLOSED + 1))
    extended[:, :, :N_FIELDS] = rows.equation.blocks
    own = np.where(both, (rows.blocks.a + rows.blocks.b @ extended) * rows.units[:, None, :], np.eye(6))
    # the own block of a grazing node says nothing on its closed fraction
    own[:, np.arange(6), np.arange(6)] += _diagonal(own) == 0.0
    return np.where(both, np.linalg.pinv(own), 0.0)
