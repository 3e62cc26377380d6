"""Krylov iteration for the linear equations of solvers without a matrix."""

from collections.abc import Callable
from typing import Final

import numpy as np
import scipy  # its submodules are imported where they are used

from meeframe.fields import Array

Linear = Callable[[Array], Array]
"""Type of linear maps from (k,) to (k,)."""
RESTART: Final = 60
LEAST_FALL: Final = 0.9
"""Reduction factor of the residual above which a cycle is the last one."""
BREAKDOWN: Final = 50.0
"""Multiple of a product's round-off below which its part orthogonal to earlier directions counts as zero."""

CANCELLED: Final = 0.1
"""Remaining part of a product below which its orthogonalisation is repeated for the sake of round-off."""


def gmres(
    multiply: Linear, precondition: Linear, right: Array, tolerance: float, most: int = 400
) -> tuple[Array, float]:
    """Return an approximate solution x (k,) of multiply(x) = right, and the norm of its residual.

    The solution satisfies |right - multiply(x)| <= tolerance |right|, or comes as near to it as `most` products allow;
    the norm is that of the iteration, exact up to round-off. The solution is zero where the right-hand side is not
    finite.

    Flexible restarted GMRES, preconditioned from the right: the norm is that of the residual itself, and the
    preconditioner need only be approximately linear, so that it may use single precision.
    Source: Saad, SIAM J. Sci. Comput. 14 (1993) 461.
    """
    unit = float(np.abs(right).max(initial=0.0))
    if not 0.0 < unit < np.inf:
        return np.zeros_like(right), unit
    right = right / unit  # its squares then stay within the range of single precision
    solution, residual = np.zeros_like(right), right
    size = float(np.linalg.norm(residual))
    goal = tolerance * size
    while size > goal:
        change, left, products = _cycle(multiply, precondition, residual, goal, min(RESTART, most))
        solution = solution + change
        most -= products + 1
        if most <= 0 or not goal < left < LEAST_FALL * size:
            return unit * solution, unit * left
        residual = right - multiply(solution)
        before, size = size, float(np.linalg.norm(residual))
        if not size < LEAST_FALL * before:  # round-off: the reduction predicted by the cycle is not attained
            break
    return unit * solution, unit * size


def _cycle(multiply: Linear, precondition: Linear, residual: Array, goal: float, most: int) -> tuple[Array, float, int]:
    """Return the change (k,) that minimises the residual (k,) over up to `most` directions.

    Also returned are the norm of the remaining residual and the number of products.
    """
    size = float(np.linalg.norm(residual))
    # separate vectors: the memory of all together would be newly allocated by the operating system each time
    basis, directions = [residual / size], list[Array]()
    hessenberg = np.zeros((most + 1, most))
    weights, left = np.zeros(0), size
    (axpy,) = scipy.linalg.get_blas_funcs(["axpy"], [residual])
    for k in range(most):
        directions.append(precondition(basis[k]))
        product = multiply(directions[k]).copy()  # changed in place below
        length = float(np.linalg.norm(product))
        before, rest = np.inf, length
        while rest < CANCELLED * before:
            for i, vector in enumerate(basis):
                part = float(vector @ product)
                hessenberg[i, k] += part
                product = axpy(vector, product, a=-part)
            before, rest = rest, float(np.linalg.norm(product))
        hessenberg[k + 1, k] = rest
        equations, first = hessenberg[: k + 2, : k + 1], size * np.eye(k + 2)[0]
        if not np.isfinite(equations).all():
            break
        weights = np.linalg.lstsq(equations, first, rcond=None)[0]
        left = float(np.linalg.norm(first - equations @ weights))
        if left <= goal or rest <= BREAKDOWN * np.finfo(product.dtype).eps * length:
            break
        basis.append(product / rest)
    change = np.zeros_like(residual)
    for weight, direction in zip(weights.tolist(), directions, strict=False):
        change += weight * direction
    return change, left, len(directions)
