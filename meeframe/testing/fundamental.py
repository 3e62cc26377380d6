"""Conformance of a fundamental solution with its abstract class (meeframe.greens.base)."""

from collections.abc import Callable

import numpy as np
from hypothesis import strategies as st

from meeframe.fields import N_FIELDS, Array
from meeframe.greens import LineIntegral
from meeframe.greens.base import FundamentalSolution, Kernel
from meeframe.testing.requirements import each, explained, require
from meeframe.testing.search import search_for

_SPECIAL = [(x, y, z) for x in (0.0, 1.0, -1.0) for y in (0.0, 1.0, -1.0) for z in (0.0, 1.0, -1.0) if x or y or z]
_COMPONENTS = st.sampled_from([0.0, 1.0, -1.0, 1e-3, -1e-6]) | st.floats(-1.0, 1.0, allow_subnormal=False)
_DIRECTIONS = (
    (st.sampled_from(_SPECIAL) | st.tuples(_COMPONENTS, _COMPONENTS, _COMPONENTS))
    .map(lambda components: np.array([components]))
    .filter(lambda direction: bool(np.linalg.norm(direction) > 0.1))
    .map(lambda direction: direction / np.linalg.norm(direction))
)
_POINTS = st.tuples(_DIRECTIONS, _DIRECTIONS)


def check_fundamental_solution(
    solution: FundamentalSolution,
    stiffness: Array,
    displacement_tolerance: float = 1e-8,
    traction_tolerance: float = 1e-7,
    seed: int = 0,
) -> None:
    """Check a fundamental solution by all tests of this module, in random directions and in simple ones.

    Parameters
    ----------
    solution : FundamentalSolution
        The fundamental solution.
    stiffness : Array
        Scaled stiffness C'_iJKm, (3, 5, 5, 3).
    displacement_tolerance, traction_tolerance : float, optional
        Tolerances relative to the largest entry of U and of T at a point.
    seed : int, optional
        Seed of the random directions.

    Raises
    ------
    AssertionError
        If a property fails; the message names the property, the offset and why it matters.
    """
    random = np.random.default_rng(seed)
    offset, normal = unit_vectors(random, 40) * random.uniform(0.5, 2.0, (40, 1)), unit_vectors(random, 40)
    reference = LineIntegral().bind(stiffness)
    with explained(solution):
        solution.check(stiffness)
        kernel = solution.bind(stiffness)

        def check_self(points: tuple[Array, Array]) -> None:
            check_form(kernel, *points)
            check_symmetry(kernel, *points)
            check_traction(kernel, stiffness, *points)

        def check_all(points: tuple[Array, Array]) -> None:
            check_self(points)
            check_agreement(kernel, reference, *points, displacement_tolerance, traction_tolerance)

        check_self((offset, normal))
        check_gradient(kernel, offset)
        check_equilibrium(kernel, stiffness, offset)
        check_unit_flux(kernel, 10.0 * traction_tolerance)
        check_all((offset, normal))
        search_for(_POINTS, check_all, examples=100)


def unit_vectors(random: np.random.Generator, count: int) -> Array:
    """Return random unit vectors, (count, 3)."""
    vectors = random.normal(size=(count, 3))
    unit: Array = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return unit


def relative_error(value: Array, reference: Array) -> float:
    """Return the largest difference relative to the largest entry of each point; the first axis numbers the points."""
    return float(_errors(value, reference).max())


def _errors(value: Array, reference: Array) -> Array:
    """Return the largest difference relative to the largest entry at each point, (n,)."""
    axes = tuple(range(1, value.ndim))
    errors: Array = np.abs(value - reference).max(axis=axes) / np.abs(reference).max(axis=axes)
    return errors


def _agree(value: Array, reference: Array, tolerance: float, message: str, offset: Array) -> None:
    """Require errors within a tolerance; the message shows the offset (n, 3) with the largest error."""
    errors = _errors(value, reference)
    worst = int(np.nan_to_num(errors, nan=np.inf).argmax())
    require(bool(errors[worst] <= tolerance), message, f"by {errors[worst]:.1e} at offset {offset[worst]}")


def check_form(kernel: Kernel, offset: Array, normal: Array) -> None:
    """Check shapes, memory order, finite values, empty input, and that each point is independent of the others."""
    n = len(offset)
    u, t = kernel.evaluate(offset, normal)
    gradient = kernel.gradient(offset)
    for name, array, shape in (("U", u, (n, 5, 5)), ("T", t, (n, 5, 5)), ("gradient", gradient, (n, 5, 5, 3))):
        require(array.shape == shape, f"{name} is not {shape}", array.shape)
        require(array.flags.c_contiguous, f"{name} is not C-contiguous", array.strides)
        each(np.isfinite(array).reshape(n, -1).all(axis=1), f"{name} is not finite", offset, array)
    empty = kernel.evaluate(offset[:0], normal[:0])
    require(empty[0].shape == empty[1].shape == (0, 5, 5), "no points must give no kernels", empty[0].shape)
    order = np.random.default_rng(0).permutation(n)
    u_shuffled, t_shuffled = kernel.evaluate(offset[order], normal[order])
    _agree(u_shuffled, u[order], 1e-14, "U depends on the order of the points", offset[order])
    _agree(t_shuffled, t[order], 1e-13, "T depends on the order of the points", offset[order])


def check_symmetry(kernel: Kernel, offset: Array, normal: Array) -> None:
    """Check that U is symmetric, even and homogeneous of degree -1; T and U,q odd and homogeneous of degree -2."""
    u, t = kernel.evaluate(offset, normal)
    gradient = kernel.gradient(offset)
    _agree(u.transpose(0, 2, 1), u, 1e-13, "U is not symmetric", offset)
    u_opposite, t_opposite = kernel.evaluate(-offset, normal)
    _agree(u_opposite, u, 1e-12, "U is not even", offset)
    _agree(-t_opposite, t, 1e-11, "T is not odd", offset)
    _agree(-kernel.gradient(-offset), gradient, 1e-11, "U,q is not odd", offset)
    for scale in (1e-9, 3.0, 1e6):
        u_scaled, t_scaled = kernel.evaluate(scale * offset, normal)
        _agree(scale * u_scaled, u, 1e-12, "U is not homogeneous of degree -1", offset)
        _agree(scale**2 * t_scaled, t, 1e-11, "T is not homogeneous of degree -2", offset)
        scaled = scale**2 * kernel.gradient(scale * offset)
        _agree(scaled, gradient, 1e-11, "U,q is not homogeneous of degree -2", offset)


def check_traction(kernel: Kernel, stiffness: Array, offset: Array, normal: Array) -> None:
    """Check T_JK = C_iJMl U_MK,l nu_i (eq. 47)."""
    expected = np.einsum("ni,ijml,nmkl->njk", normal, stiffness, kernel.gradient(offset))
    _agree(kernel.evaluate(offset, normal)[1], expected, 1e-11, "T is not C : grad U . nu", offset)


def check_gradient(kernel: Kernel, offset: Array) -> None:
    """Check that central differences of U approach U,q with second order."""
    exact = kernel.gradient(offset)
    errors = [_central_difference(lambda x: kernel.evaluate(x, x)[0], offset, step) - exact for step in (0.02, 0.01)]
    _require_order(errors, offset, "differences of U do not approach U,q")


def check_equilibrium(kernel: Kernel, stiffness: Array, offset: Array) -> None:
    """Check C_iJKm U_KL,mi = 0, which central differences of U,m approach with second order."""
    residuals = []
    for step in (0.04, 0.02):
        second = _central_difference(kernel.gradient, offset, step)
        residuals.append(np.einsum("ijkm,nklmi->njl", stiffness, second))
    _require_order(residuals, offset, "U does not satisfy its differential equation")


def check_unit_flux(kernel: Kernel, tolerance: float) -> None:
    """Check that the integral of T over a sphere about the source is minus the identity."""
    heights, weights = np.polynomial.legendre.leggauss(64)
    angles = 2.0 * np.pi * np.arange(128) / 128
    radius = np.sqrt(1.0 - heights**2)[:, None]
    sphere = [radius * np.cos(angles), radius * np.sin(angles), np.broadcast_to(heights[:, None], (64, 128))]
    points = np.stack(sphere, axis=-1).reshape(-1, 3)
    traction = kernel.evaluate(points, points)[1].reshape(64, 128, 5, 5)
    flux = np.einsum("h,hajk->jk", weights, traction) * 2.0 * np.pi / 128
    error = np.abs(flux + np.eye(N_FIELDS))
    worst = tuple(int(index) for index in np.unravel_index(error.argmax(), error.shape))
    message = f"flux through a sphere differs from unity, component {worst[0] + 1}, {worst[1] + 1}"
    require(bool(error[worst] < tolerance), message, f"by {error[worst]:.1e}")


def check_agreement(
    kernel: Kernel, reference: Kernel, offset: Array, normal: Array, displacement: float, traction: float
) -> None:
    """Check that U and T equal those of a reference within tolerances."""
    names = ("U", "T")
    tolerances = (displacement, traction)
    pairs = zip(kernel.evaluate(offset, normal), reference.evaluate(offset, normal), strict=True)
    for name, tolerance, (value, exact) in zip(names, tolerances, pairs, strict=True):
        _agree(value, exact, tolerance, f"{name} differs from the reference by more than {tolerance:.1e}", offset)


def _central_difference(function: Callable[[Array], Array], offset: Array, step: float) -> Array:
    """Return the derivatives along the three axes, appended as the last axis."""
    steps = step * np.eye(3)
    return np.stack([(function(offset + h) - function(offset - h)) / (2.0 * step) for h in steps], axis=-1)


def _require_order(errors: list[Array], offset: Array, message: str) -> None:
    """Require errors (n, ...) of two steps to decrease with second order; the message shows the worst offset."""
    sizes = [np.sqrt((error.reshape(len(error), -1) ** 2).mean(axis=1)) for error in errors]
    total = [float(np.sqrt((size**2).mean())) for size in sizes]
    observed = np.log2(total[0] / total[1])
    worst = offset[int(np.argmax(sizes[1]))]
    details = f"errors {total[0]:.2e}, {total[1]:.2e}, order {observed:.2f}, the largest at offset {worst}"
    require(bool(observed > 1.8), message, details)
