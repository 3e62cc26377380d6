"""Direct solution of the sparse symmetric indefinite system: pardiso where it is installed, else SuperLU."""

import weakref
from collections.abc import Callable
from importlib.util import find_spec
from typing import Final, Literal

import numpy as np
from scipy.sparse import csc_array, csr_array, csr_matrix, triu
from scipy.sparse.linalg import splu

from meeframe.core.errors import CaseError
from meeframe.core.fields import Array

LinearSolver = Literal["auto", "pardiso", "splu"]
Solve = Callable[[Array], Array]
"""The solution (u,) or (u, k) of right-hand sides (u,) or (u, k)."""

SINGULAR: Final = 1e-7
"""Relative residual of a probe above which the system counts as singular; sound ones leave 1e-13 to 1e-10."""
_SYMMETRIC_INDEFINITE: Final = -2


def factorise(matrix: csr_array, solver: LinearSolver = "auto") -> Solve:
    """Factors of a symmetric matrix (u, u), as a function that solves.

    solver: 'auto' is pardiso if pypardiso is installed, else splu. The scaled matrix is quasi-definite (positive for
    displacements, negative for potentials; Vanderbei, SIAM J. Optim. 5 (1995) 100-113): it has factors for any order of
    elimination, so that neither needs to pivot for existence.
    Raises CaseError if pardiso is asked for and not there, or if the matrix is singular to working precision.
    """
    if solver == "pardiso" and not has_pardiso():
        raise CaseError("linear_solver = 'pardiso': pypardiso is not installed; allowed: auto, splu")
    try:
        solve = _splu(matrix) if solver == "splu" or not has_pardiso() else _pardiso(matrix)
    except RuntimeError as error:
        raise CaseError(f"the finite element system is singular: {error}") from None
    probe = np.random.default_rng(0).normal(size=matrix.shape[0])
    residual = float(np.linalg.norm(matrix @ solve(probe) - probe) / np.linalg.norm(probe))
    if not residual < SINGULAR:
        raise CaseError(f"the finite element system is singular (relative residual {residual:.1e})")
    return solve


def has_pardiso() -> bool:
    """Whether pypardiso is installed."""
    return find_spec("pypardiso") is not None


def _pardiso(matrix: csr_array) -> Solve:
    from pypardiso import PyPardisoSolver  # type: ignore[import-untyped]  # optional
    from pypardiso.pardiso_wrapper import PyPardisoError  # type: ignore[import-untyped]

    upper = csr_matrix(triu(matrix, format="csr"))
    solver = PyPardisoSolver(mtype=_SYMMETRIC_INDEFINITE)
    try:
        solver.factorize(upper)
    except PyPardisoError as error:
        raise RuntimeError(str(error)) from None

    def solve(rhs: Array) -> Array:
        solution: Array = solver.solve(upper, rhs)
        return solution

    weakref.finalize(solve, solver.free_memory, everything=True)
    return solve


def _splu(matrix: csr_array) -> Solve:
    factors = splu(
        csc_array(matrix), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    return lambda rhs: np.asarray(factors.solve(rhs))
