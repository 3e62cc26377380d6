"""Direct solution of the sparse symmetric indefinite system: pardiso where it is installed, else SuperLU."""

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
"""The solution (u,) or (u, k) of right-hand sides (u,) or (u, k)."""

SINGULAR: Final = 1e-7
"""Relative residual of a probe above which the system counts as singular; sound ones leave 1e-13 to 1e-10."""
_BLOCK: Final = 64_000_000  # bytes of right-hand sides solved for at once

# numbers of oneMKL's interface to pardiso: matrix type, phase, order of elimination, size of perturbed pivots, error
_SYMMETRIC_INDEFINITE: Final = -2
_ANALYSE_AND_FACTORISE: Final = 12
_NESTED_DISSECTION: Final = 2
_PERTURBED_PIVOTS: Final = 8
_OUT_OF_MEMORY: Final = -2


def factorise(matrix: csr_array, solver: LinearSolver = "auto") -> Solve:
    """Factors of a symmetric matrix (u, u), as a function that solves.

    solver: 'auto' is pardiso if pypardiso is installed, else splu. The scaled matrix is quasi-definite (positive for
    displacements, negative for potentials; Vanderbei, SIAM J. Optim. 5 (1995) 100-113): it has factors for any order of
    elimination, so that neither needs to pivot for existence.
    Raises CaseError if pardiso is asked for and not there, or if the matrix is singular to working precision.
    """
    with _singular_is_an_error():
        solve = _pardiso(matrix) if uses_pardiso(solver) else _splu(matrix)
    probe = np.random.default_rng(0).normal(size=matrix.shape[0])
    residual = float(np.linalg.norm(matrix @ solve(probe) - probe) / np.linalg.norm(probe))
    if not residual < SINGULAR:
        raise CaseError(f"the finite element system is singular (relative residual {residual:.1e})")
    return solve


def condense(matrix: csr_array, unknowns: Indices, solver: LinearSolver = "auto") -> tuple[Solve, Array]:
    """Factors as of factorise, and the block (k, k) of the inverse that belongs to k of the unknowns.

    pardiso: inverse of the Schur complement of the unknowns, which costs one more factorisation; splu: solutions for
    unit right-hand sides, in blocks. Raises as factorise.
    """
    if uses_pardiso(solver):
        with _singular_is_an_error():
            inverse = np.linalg.inv(_schur_complement(matrix, unknowns))
        solve = factorise(matrix, solver)
    else:
        solve = factorise(matrix, solver)
        inverse = _columns(matrix.shape[0], unknowns, solve)
    return solve, (inverse + inverse.T) / 2  # symmetric but for round-off


def uses_pardiso(solver: LinearSolver) -> bool:
    """Whether a choice means pardiso here. Raises CaseError if it does and pypardiso is not installed."""
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
    # pypardiso has no public call for it: the complement comes back in place of the solution (oneMKL, iparm 36)
    solver.iparm[:36] = 0
    solver.iparm[[0, 1, 9, 35]] = 1, _NESTED_DISSECTION, _PERTURBED_PIVOTS, 1
    solver.perm = np.zeros(matrix.shape[0], np.int32)
    solver.perm[unknowns] = 1
    solver.set_phase(_ANALYSE_AND_FACTORISE)
    complement: Array = _call(solver, solver._call_pardiso, upper, np.zeros((len(unknowns), len(unknowns))))
    solver.free_memory(everything=True)
    place = np.argsort(np.argsort(unknowns))  # pardiso marks unknowns and hands them over in rising order
    return complement[np.ix_(place, place)]


def _pardiso_solver() -> Any:
    from pypardiso import PyPardisoSolver  # type: ignore[import-untyped]  # optional

    return PyPardisoSolver(mtype=_SYMMETRIC_INDEFINITE)


def _call(solver: Any, method: Callable[..., Any], *arguments: Any) -> Any:
    """The method's answer; memory is freed and a RuntimeError raised if pardiso fails."""
    from pypardiso.pardiso_wrapper import PyPardisoError  # type: ignore[import-untyped]

    try:
        return method(*arguments)
    except PyPardisoError as error:
        solver.free_memory(everything=True)
        if error.value == _OUT_OF_MEMORY:
            raise MemoryError("pardiso's factors") from None
        raise RuntimeError(str(error)) from None


def _upper(matrix: csr_array) -> csr_matrix:
    """The upper triangle, its columns in rising order, as pardiso wants it."""
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
    step = max(1, _BLOCK // (8 * size))
    for start in range(0, len(unknowns), step):
        loaded = unknowns[start : start + step]
        rhs = np.zeros((size, len(loaded)), order="F")
        rhs[loaded, np.arange(len(loaded))] = 1.0
        inverse[:, start : start + step] = solve(rhs)[unknowns]
    return inverse
