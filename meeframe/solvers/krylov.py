"""Krylov iteration for the linear equations of solvers without a matrix."""

from collections.abc import Callable
from typing import Final

import numpy as np
import scipy  # submodules are loaded on first use

from meeframe.fields import Array

Linear = Callable[[Array], Array]
"""Type of linear maps from (k,) to (k,)."""
RESTART: Final = 60
MAX_REDUCTION: Final = 0.9
"""Reduction factor of the residual above which a cycle is the last one."""
BREAKDOWN_FACTOR: Final = 50.0
"""Multiple of a product's round-off below which its part orthogonal to earlier directions counts as zero."""
MIN_REMAINDER: Final = 0.1
"""Remaining part of a product below which its orthogonalisation is repeated for the sake of round-off."""


def gmres(
    multiply: Linear, precondition: Linear, right: Array, tolerance: float, max_products: int = 400
) -> tuple[Array, float]:
    """Return an approximate solution of linear equations by flexible restarted GMRES.

    The preconditioner acts from the right: the norm is that of the residual itself. It need only be linear to single
    precision: preconditioned vectors in double precision are stored, those in single precision computed again.

    Parameters
    ----------
    multiply : callable
        Product of the matrix with a vector (k,), which must be a new vector.
    precondition : callable
        Approximate inverse of the matrix times a vector (k,).
    right : Array
        (k,), right-hand side.
    tolerance : float
        Allowed norm of the residual, relative to that of the right-hand side.
    max_products : int, optional
        Largest number of products.

    Returns
    -------
    solution : Array
        (k,); zero where the right-hand side is not finite.
    norm : float
        Norm of its residual in the iteration, exact up to round-off. It exceeds the allowed one if `max_products` are
        not enough or round-off prevents further reduction.

    References
    ----------
    Saad, SIAM J. Sci. Comput. 14 (1993) 461.
    """
    scale = float(np.abs(right).max(initial=0.0))
    if not 0.0 < scale < np.inf:
        return np.zeros_like(right), scale
    right = right / scale  # its squares then stay within the range of single precision
    solution, residual = np.zeros_like(right), right
    size = float(np.linalg.norm(residual))
    target = tolerance * size
    while size > target:
        change, remainder, products = _cycle(multiply, precondition, residual, target, min(RESTART, max_products))
        solution = solution + change
        max_products -= products + 1
        if max_products <= 0 or not target < remainder < MAX_REDUCTION * size:
            return scale * solution, scale * remainder
        residual = right - multiply(solution)
        previous_size, size = size, float(np.linalg.norm(residual))
        if not size < MAX_REDUCTION * previous_size:  # round-off: the reduction predicted by the cycle is not attained
            break
    return scale * solution, scale * size


def _cycle(
    multiply: Linear, precondition: Linear, residual: Array, target: float, max_products: int
) -> tuple[Array, float, int]:
    """Return the change (k,) that minimises the residual (k,) over up to `max_products` directions.

    Also returned are the norm of the remaining residual and the number of products.
    """
    size = float(np.linalg.norm(residual))
    # separate vectors: the memory of all together would be newly allocated by the operating system each time
    basis, directions = [residual / size], list[Array]()
    hessenberg = np.zeros((max_products + 1, max_products))
    weights, remainder, is_flexible = np.zeros(0), size, residual.dtype == np.float64
    (axpy,) = scipy.linalg.get_blas_funcs(["axpy"], [residual])
    for k in range(max_products):
        direction = precondition(basis[k])
        if is_flexible:
            directions.append(direction)
        product = multiply(direction)  # changed in place below
        del direction
        length = float(np.linalg.norm(product))
        previous, length_left = np.inf, length
        while length_left < MIN_REMAINDER * previous:
            for i, vector in enumerate(basis):
                component = float(vector @ product)
                hessenberg[i, k] += component
                product = axpy(vector, product, a=-component)
            previous, length_left = length_left, float(np.linalg.norm(product))
        hessenberg[k + 1, k] = length_left
        equations, right = hessenberg[: k + 2, : k + 1], size * np.eye(k + 2)[0]
        if not np.isfinite(equations).all():
            break
        weights = np.linalg.lstsq(equations, right, rcond=None)[0]
        remainder = float(np.linalg.norm(right - equations @ weights))
        if remainder <= target or length_left <= BREAKDOWN_FACTOR * np.finfo(product.dtype).eps * length:
            break
        basis.append(product / length_left)
    change = np.zeros_like(residual)
    for weight, vector in zip(weights.tolist(), directions if is_flexible else basis, strict=False):
        change += weight * vector
    return change if is_flexible else precondition(change), remainder, k + 1
