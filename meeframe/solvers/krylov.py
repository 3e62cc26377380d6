"""Krylov iteration for the linear equations that solvers meet without a matrix."""

from collections.abc import Callable
from typing import Final

import numpy as np
import scipy  # its parts load where they are used

from meeframe.fields import Array

Linear = Callable[[Array], Array]
"""A linear map from (k,) to (k,)."""
RESTART: Final = 60
LEAST_FALL: Final = 0.9
"""A cycle that leaves more of the residual is the last one."""
BREAKDOWN: Final = 50.0
"""What is left of a product beside the directions before it is none below so many times the round-off of it."""

CANCELLED: Final = 0.1
"""A product of which less is left beside the directions before it is made orthogonal to them once more: what is left is
then not so to the last digit."""


def gmres(
    multiply: Linear, precondition: Linear, right: Array, tolerance: float, most: int = 400
) -> tuple[Array, float]:
    """x, (k,), with |right - multiply(x)| <= tolerance |right| (k,), or as near to it as so many products come; and
    that norm, as the iteration has it: round-off apart. Zero where the right-hand side is not finite.

    Flexible restarted GMRES, preconditioned from the right: the norm is that of the residual itself, and the
    preconditioner need not be linear to the last digit, so that it may be of single precision.
    Source: Saad, SIAM J. Sci. Comput. 14 (1993) 461.
    """
    unit = float(np.abs(right).max(initial=0.0))
    if not 0.0 < unit < np.inf:
        return np.zeros_like(right), unit
    right = right / unit  # whose squares are numbers in single precision too
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
        if not size < LEAST_FALL * before:  # round-off: what was left by the equations of the cycle is not there
            break
    return unit * solution, unit * size


def _cycle(multiply: Linear, precondition: Linear, residual: Array, goal: float, most: int) -> tuple[Array, float, int]:
    """Change (k,) that leaves least of the residual (k,) over at most so many directions; what it leaves; products."""
    size = float(np.linalg.norm(residual))
    # vectors by themselves: memory of all at once would be the operating system's each time, and fresh
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
