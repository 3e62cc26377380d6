"""Direct solution of the sparse symmetric indefinite system: pardiso where it is installed, else SuperLU."""

import os
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any, Final, Literal

import numpy as np
from scipy.sparse import csc_array, csr_array, csr_matrix, triu
from scipy.sparse.linalg import splu

from meeframe.plugin import Array, CaseError, Indices

LinearSolver = Literal["auto", "pardiso", "splu"]
Solve = Callable[[Array], Array]
"""Function that returns the solution of right-hand sides, both (u,) or (u, k)."""

MAX_RESIDUAL: Final = 1e-7
"""Relative residual of a test above which the system is singular; regular systems have 1e-13 to 1e-10."""
_BATCH_BYTES: Final = 64_000_000  # bytes of right-hand sides of one batch

# numbers of the pardiso interface of oneMKL: matrix type, phase, order of elimination, size of perturbed pivots, error
_SYMMETRIC_INDEFINITE: Final = -2
_ANALYSE_AND_FACTORISE: Final = 12
_NESTED_DISSECTION: Final = 2
_PERTURBED_PIVOTS: Final = 8
_OUT_OF_MEMORY: Final = -2


def factorise(matrix: csr_array, solver: LinearSolver = "auto") -> Solve:
    """Factorise a symmetric matrix.

    Parameters
    ----------
    matrix : csr_array
        Matrix, (u, u).
    solver : {'auto', 'pardiso', 'splu'}
        'auto' is pardiso if pypardiso is installed, else splu.

    Returns
    -------
    callable
        Function that solves systems with the matrix.

    Raises
    ------
    CaseError
        If pardiso is required but not installed, or if the matrix is singular to working precision.

    Notes
    -----
    The scaled matrix is quasi-definite, positive for displacements and negative for potentials. It has factors for any
    order of elimination, so that no pivoting is needed for their existence.

    References
    ----------
    Vanderbei, SIAM J. Optim. 5 (1995) 100-113.
    """
    with _singular_is_an_error():
        solve = _pardiso(matrix) if uses_pardiso(solver) else _splu(matrix)
    test_vector = np.random.default_rng(0).normal(size=matrix.shape[0])
    residual = float(np.linalg.norm(matrix @ solve(test_vector) - test_vector) / np.linalg.norm(test_vector))
    if not residual < MAX_RESIDUAL:
        raise CaseError(f"the finite element system is singular (relative residual {residual:.1e})")
    return solve


def condense(matrix: csr_array, unknowns: Indices, solver: LinearSolver = "auto") -> tuple[Solve, Array]:
    """Factorise a symmetric matrix and compute a block of its inverse.

    Parameters
    ----------
    matrix : csr_array
        Matrix, (u, u).
    unknowns : Indices
        Unknowns of the block, (k,).
    solver : {'auto', 'pardiso', 'splu'}
        As for `factorise`.

    Returns
    -------
    callable
        Function that solves systems with the matrix.
    Array
        Block of the inverse, (k, k).

    Raises
    ------
    CaseError
        As for `factorise`.

    Notes
    -----
    With pardiso, the block is the inverse of the Schur complement of the unknowns, which takes another factorisation.
    With splu, it consists of solutions for unit right-hand sides.
    """
    if uses_pardiso(solver):
        with _singular_is_an_error():
            inverse = np.linalg.inv(_schur_complement(matrix, unknowns))
        solve = factorise(matrix, solver)
    else:
        solve = factorise(matrix, solver)
        inverse = _columns(matrix.shape[0], unknowns, solve)
    return solve, (inverse + inverse.T) / 2  # symmetric to round-off


def uses_pardiso(solver: LinearSolver) -> bool:
    """Return whether a choice of solver selects pardiso.

    Raises
    ------
    CaseError
        If pardiso is required but not installed.
    """
    installed = find_spec("pypardiso") is not None
    if solver == "pardiso" and not installed:
        raise CaseError("linear_solver = 'pardiso': pypardiso is not installed; allowed: auto, splu")
    return installed and solver != "splu"


@contextmanager
def _singular_is_an_error() -> Iterator[None]:
    try:
        yield
    except (RuntimeError, np.linalg.LinAlgError) as error:
        raise CaseError(f"the finite element system is singular: {error}") from None


def _pardiso(matrix: csr_array) -> Solve:
    upper = _upper(matrix)
    solver = _pardiso_solver()
    _call(solver, solver.factorize, upper)

    def solve(rhs: Array) -> Array:
        solution: Array = _call(solver, solver.solve, upper, rhs)
        return solution

    weakref.finalize(solve, solver.free_memory, everything=True).atexit = False
    return solve


def _schur_complement(matrix: csr_array, unknowns: Indices) -> Array:
    upper = _upper(matrix)
    solver = _pardiso_solver()
    # pypardiso has no public call for this; the complement replaces the solution (oneMKL, iparm 36)
    solver.iparm[:36] = 0
    solver.iparm[[0, 1, 9, 35]] = 1, _NESTED_DISSECTION, _PERTURBED_PIVOTS, 1
    solver.perm = np.zeros(matrix.shape[0], np.int32)
    solver.perm[unknowns] = 1
    solver.set_phase(_ANALYSE_AND_FACTORISE)
    complement: Array = _call(solver, solver._call_pardiso, upper, np.zeros((len(unknowns), len(unknowns))))
    solver.free_memory(everything=True)
    rank = np.argsort(np.argsort(unknowns))  # pardiso returns the marked unknowns in rising order
    return complement[np.ix_(rank, rank)]


def _pardiso_solver() -> Any:
    from pypardiso import PyPardisoSolver, ps  # type: ignore[import-untyped]  # optional

    # without the path that `ps` found, each solver searches all installed packages for the library
    os.environ.setdefault("PYPARDISO_MKL_RT", ps.libmkl._name)
    return PyPardisoSolver(mtype=_SYMMETRIC_INDEFINITE)


def _call(solver: Any, method: Callable[..., Any], *arguments: Any) -> Any:
    """Call a method of pardiso; free its memory and raise RuntimeError if it fails."""
    from pypardiso.pardiso_wrapper import PyPardisoError  # type: ignore[import-untyped]

    try:
        return method(*arguments)
    except PyPardisoError as error:
        solver.free_memory(everything=True)
        if error.value == _OUT_OF_MEMORY:
            raise MemoryError("pardiso's factors") from None
        raise RuntimeError(str(error)) from None


def _upper(matrix: csr_array) -> csr_matrix:
    """Return the upper triangle with columns in rising order, as pardiso requires."""
    upper = csr_matrix(triu(matrix, format="csr"))
    upper.sort_indices()
    return upper


def _splu(matrix: csr_array) -> Solve:
    factors = splu(
        csc_array(matrix), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    return lambda rhs: np.asarray(factors.solve(rhs))


def _columns(size: int, unknowns: Indices, solve: Solve) -> Array:
    inverse = np.empty((len(unknowns), len(unknowns)))
    step = max(1, _BATCH_BYTES // (8 * size))
    for start in range(0, len(unknowns), step):
        batch = unknowns[start : start + step]
        rhs = np.zeros((size, len(batch)), order="F")
        rhs[batch, np.arange(len(batch))] = 1.0
        inverse[:, start : start + step] = solve(rhs)[unknowns]
    return inverse
