"""Newton steps of the nonsmooth equation: by factorisation at contact size, or by Krylov iteration without a matrix."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg import LinAlgError, lu_factor, lu_solve
from scipy.sparse.linalg import LinearOperator, gmres

from meeframe.core.fields import N_FIELDS, Array
from meeframe.core.mesh import Indices
from meeframe.solvers.conduction import Mask
from meeframe.solvers.nonsmooth import CLOSED, Blocks, Equation

KRYLOV_TOLERANCE: Final = 1e-8
RESTART: Final = 80
CYCLES: Final = 5
UNRESISTED: Final = 1e-12
"""Stiffness against a motion, as a fraction of the largest one, that is none."""


@dataclass(frozen=True, eq=False)
class Step:
    """A Newton step. local: (n, 6) of load and closed fraction; motion: (m,) of the freedoms."""

    local: Array
    motion: Array

    @property
    def finite(self) -> bool:
        """Whether the equations were regular."""
        return bool(np.isfinite(self.local).all() and np.isfinite(self.motion).all())


def newton_step(equation: Equation, blocks: Blocks) -> Step:
    """The step that solves the linearised equations; not finite if they are singular.

    Rows that say what one unknown of their own node is (open nodes, insulated potentials, closed fractions that do not
    graze) are eliminated beforehand: what remains is the size of the contact. Free motions are eliminated too, which
    leaves the stiffness of the contact against them; a motion that nothing resists stays where it is.
    """
    coupled = _coupled(blocks)
    step = np.where(coupled, 0.0, -blocks.residual / np.where(coupled, 1.0, _diagonal(blocks.a)))
    right = -blocks.residual
    if step.any():
        right = right - _product(equation, blocks, step)
    # first the step at rest, then the responses to each motion
    rights = np.concatenate([right[:, :, None], blocks.b @ equation.modes], axis=2)[coupled]
    responses = np.zeros((*coupled.shape, rights.shape[1]))
    responses[:, :, 0] = step
    if rights.size:
        responses[coupled] = _solve(equation, blocks, coupled, rights)
    amounts = _amounts(equation, blocks, responses)
    return Step(responses[:, :, 0] + responses[:, :, 1:] @ amounts, equation.units * amounts)


def _solve(equation: Equation, blocks: Blocks, coupled: Mask, rights: Array) -> Array:
    """Solutions (k, 1 + m) of the coupled rows (k of them)."""
    matrix = equation.problem.system.dense()
    if matrix is None:
        return _krylov(equation, blocks, coupled, rights)
    size = equation.problem.system.offset.size
    return _direct(equation, blocks, coupled, rights, matrix.reshape(size, size))


def _amounts(equation: Equation, blocks: Blocks, responses: Array) -> Array:
    """Motions (m,) in units of the equation that balance the step at rest and the responses (n, 6, 1 + m), or go there
    as far as they may."""
    if blocks.balance.size == 0 or not np.isfinite(responses).all():
        return np.full(blocks.balance.shape, np.nan)
    resultants = np.einsum("kni,nil->kl", equation.measures, responses[:, :N_FIELDS])
    right = -blocks.balance - resultants[:, 0]
    amounts = np.linalg.lstsq(resultants[:, 1:], right, rcond=UNRESISTED)[0]
    return np.asarray(amounts * blocks.farthest / np.abs(amounts).max(initial=blocks.farthest))


def _diagonal(a: Array) -> Array:
    return np.asarray(np.diagonal(a, axis1=1, axis2=2))


def _coupled(blocks: Blocks) -> Mask:
    """Rows (n, 6) that are more than a statement on their own unknown."""
    others = blocks.a.copy()
    others[:, np.arange(6), np.arange(6)] = 0.0
    return np.asarray(blocks.b.any(axis=2) | others.any(axis=2))


def _product(equation: Equation, blocks: Blocks, step: Array) -> Array:
    """(A + B C) step, (n, 6)."""
    moved = equation.problem.system.apply(step[:, :N_FIELDS])
    return np.asarray((blocks.a @ step[:, :, None] + blocks.b @ moved[:, :, None])[:, :, 0])


def _unit(equation: Equation, unknown: Indices) -> Array:
    """Characteristic magnitudes of unknowns by their number 0..5: with them the equations are without units."""
    return np.append(equation.scales.load, 1.0)[unknown]


def _direct(equation: Equation, blocks: Blocks, coupled: Mask, rights: Array, matrix: Array) -> Array:
    """Solutions by LU factorisation; matrix: (5n, 5n) compliance."""
    # loads before closed fractions, so that the compliance fills a block
    node, row = np.nonzero(coupled)
    order = np.argsort(row == CLOSED, kind="stable")
    node, row = node[order], row[order]
    number = np.full(coupled.shape, -1)
    number[node, row] = np.arange(len(node))
    columns = np.flatnonzero(coupled[:, :N_FIELDS])
    jacobian = np.zeros((len(node), len(node)))
    for field in range(N_FIELDS):
        factor = blocks.b[node, row, field]
        rows = np.flatnonzero(factor)
        response = matrix.take(node[rows] * N_FIELDS + field, axis=0).take(columns, axis=1)
        jacobian[rows, : len(columns)] += factor[rows, None] * response
    for unknown in range(CLOSED + 1):
        rows = np.flatnonzero(coupled[node, unknown])
        jacobian[rows, number[node[rows], unknown]] += blocks.a[node[rows], row[rows], unknown]
    unit = _unit(equation, row)
    solved = np.empty_like(rights)
    try:
        factors = lu_factor(jacobian * unit, overwrite_a=True, check_finite=False)
    except LinAlgError:
        return np.full_like(rights, np.nan)
    solved[order] = unit[:, None] * lu_solve(factors, rights[order], check_finite=False)
    return solved


def _krylov(equation: Equation, blocks: Blocks, coupled: Mask, rights: Array) -> Array:
    """Solutions by GMRES, preconditioned by the inverse of each node's own block."""
    unit = np.broadcast_to(_unit(equation, np.arange(6)), coupled.shape)
    both = coupled[:, :, None] & coupled[:, None, :]
    extended = np.zeros((len(coupled), N_FIELDS, CLOSED + 1))
    extended[:, :, :N_FIELDS] = equation.blocks
    own = np.where(both, (blocks.a + blocks.b @ extended) * unit[:, None, :], np.eye(6))
    # the own block of a grazing node says nothing on its closed fraction
    empty = _diagonal(own) == 0.0
    own[:, np.arange(6), np.arange(6)] += empty
    inverse = np.linalg.pinv(own)

    def full(values: Array) -> Array:
        vector = np.zeros(coupled.shape)
        vector[coupled] = values
        return vector

    def multiply(values: Array) -> Array:
        return np.asarray(_product(equation, blocks, unit * full(values))[coupled])

    def precondition(values: Array) -> Array:
        return np.asarray((inverse @ full(values)[:, :, None])[:, :, 0][coupled])

    shape = (len(rights), len(rights))
    operator = LinearOperator(shape, matvec=multiply, dtype=np.float64)
    preconditioner = LinearOperator(shape, matvec=precondition, dtype=np.float64)
    options = {"rtol": KRYLOV_TOLERANCE, "restart": RESTART, "maxiter": CYCLES, "M": preconditioner}
    solved = [gmres(operator, right, **options)[0] for right in rights.T]
    return np.asarray(unit[coupled][:, None] * np.column_stack(solved))
