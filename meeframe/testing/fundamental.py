"""Conformance of a fundamental solution with its contract (meeframe.core.fundamental)."""

from collections.abc import Callable

import numpy as np

from meeframe.core.fields import N_FIELDS, Array
from meeframe.core.fundamental import FundamentalSolution, Kernel
from meeframe.fundamental import LineIntegral
from meeframe.testing.requirements import explained


def check_fundamental_solution(
    solution: FundamentalSolution,
    stiffness: Array,
    displacement_tolerance: float = 1e-8,
    traction_tolerance: float = 1e-7,
    seed: int = 0,
) -> None:
    """All checks of this module for one scaled stiffness C'_iJKm (3, 5, 5, 3). Raises AssertionError.

    Tolerances are relative to the largest entry of U and of T at a point.
    """
    random = np.random.default_rng(seed)
    offset, normal = unit_vectors(random, 40) * random.uniform(0.5, 2.0, (40, 1)), unit_vectors(random, 40)
    with explained(solution):
        kernel = solution.bind(stiffness)
        check_form(kernel, offset, normal)
        check_symmetry(kernel, offset, normal)
        check_traction(kernel, stiffness, offset, normal)
        check_gradient(kernel, offset)
        check_equilibrium(kernel, stiffness, offset)
        check_unit_flux(kernel, 10.0 * traction_tolerance)
        reference = LineIntegral().bind(stiffness)
        check_agreement(kernel, reference, offset, normal, displacement_tolerance, traction_tolerance)


def unit_vectors(random: np.random.Generator, count: int) -> Array:
    """Random unit vectors, (count, 3)."""
    vectors = random.normal(size=(count, 3))
    unit: Array = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return unit


def relative_error(value: Array, reference: Array) -> float:
    """Largest difference over the largest entry, taken point by point; the first axis numbers the points."""
    axes = tuple(range(1, value.ndim))
    error = np.abs(value - reference).max(axis=axes) / np.abs(reference).max(axis=axes)
    return float(error.max())


def check_form(kernel: Kernel, offset: Array, normal: Array) -> None:
    """Shapes, memory order, finite values; no points are allowed, and each point is independent of the others."""
    n = len(offset)
    u, t = kernel.evaluate(offset, normal)
    gradient = kernel.gradient(offset)
    for name, array, shape in (("U", u, (n, 5, 5)), ("T", t, (n, 5, 5)), ("gradient", gradient, (n, 5, 5, 3))):
        assert array.shape == shape, f"{name} has shape {array.shape}, needs {shape}"
        assert array.flags.c_contiguous, f"{name} is not C-contiguous"
        assert np.isfinite(array).all(), f"{name} is not finite"
    empty = kernel.evaluate(offset[:0], normal[:0])
    assert empty[0].shape == empty[1].shape == (0, 5, 5), "no points must give no kernels"
    order = np.random.default_rng(0).permutation(n)
    u_shuffled, t_shuffled = kernel.evaluate(offset[order], normal[order])
    assert relative_error(u_shuffled, u[order]) < 1e-14, "U depends on the order of the points"
    assert relative_error(t_shuffled, t[order]) < 1e-13, "T depends on the order of the points"


def check_symmetry(kernel: Kernel, offset: Array, normal: Array) -> None:
    """U symmetric, even and homogeneous of degree -1; T and U,q odd and homogeneous of degree -2."""
    u, t = kernel.evaluate(offset, normal)
    gradient = kernel.gradient(offset)
    assert relative_error(u.transpose(0, 2, 1), u) < 1e-13, "U is not symmetric"
    u_opposite, t_opposite = kernel.evaluate(-offset, normal)
    assert relative_error(u_opposite, u) < 1e-12, "U is not even"
    assert relative_error(-t_opposite, t) < 1e-11, "T is not odd"
    assert relative_error(-kernel.gradient(-offset), gradient) < 1e-11, "U,q is not odd"
    for scale in (1e-9, 3.0, 1e6):
        u_scaled, t_scaled = kernel.evaluate(scale * offset, normal)
        assert relative_error(scale * u_scaled, u) < 1e-12, "U is not homogeneous of degree -1"
        assert relative_error(scale**2 * t_scaled, t) < 1e-11, "T is not homogeneous of degree -2"
        scaled = scale**2 * kernel.gradient(scale * offset)
        assert relative_error(scaled, gradient) < 1e-11, "U,q is not homogeneous of degree -2"


def check_traction(kernel: Kernel, stiffness: Array, offset: Array, normal: Array) -> None:
    """T_JK = C_iJMl U_MK,l nu_i (eq. 47)."""
    expected = np.einsum("ni,ijml,nmkl->njk", normal, stiffness, kernel.gradient(offset))
    assert relative_error(kernel.evaluate(offset, normal)[1], expected) < 1e-11, "T is not C : grad U . nu"


def check_gradient(kernel: Kernel, offset: Array) -> None:
    """Central differences of U approach U,q with second order."""
    errors = []
    for step in (0.02, 0.01):
        difference = _central_difference(lambda x: kernel.evaluate(x, x)[0], offset, step)
        errors.append(_root_mean_square(difference - kernel.gradient(offset)))
    _assert_order(errors, 2.0, "differences of U do not approach U,q")


def check_equilibrium(kernel: Kernel, stiffness: Array, offset: Array) -> None:
    """C_iJKm U_KL,mi = 0: central differences of U,m approach it with second order."""
    residuals = []
    for step in (0.04, 0.02):
        second = _central_difference(kernel.gradient, offset, step)
        residuals.append(_root_mean_square(np.einsum("ijkm,nklmi->njl", stiffness, second)))
    _assert_order(residuals, 2.0, "U does not satisfy its differential equation")


def check_unit_flux(kernel: Kernel, tolerance: float) -> None:
    """The integral of T over a sphere about the source is minus the identity."""
    heights, weights = np.polynomial.legendre.leggauss(64)
    angles = 2.0 * np.pi * np.arange(128) / 128
    radius = np.sqrt(1.0 - heights**2)[:, None]
    sphere = [radius * np.cos(angles), radius * np.sin(angles), np.broadcast_to(heights[:, None], (64, 128))]
    points = np.stack(sphere, axis=-1).reshape(-1, 3)
    traction = kernel.evaluate(points, points)[1].reshape(64, 128, 5, 5)
    flux = np.einsum("h,hajk->jk", weights, traction) * 2.0 * np.pi / 128
    error = np.abs(flux + np.eye(N_FIELDS)).max()
    assert error < tolerance, f"flux through a sphere differs from unity by {error:.1e}"


def check_agreement(
    kernel: Kernel, reference: Kernel, offset: Array, normal: Array, displacement: float, traction: float
) -> None:
    """U and T equal those of a reference within tolerances."""
    names = ("U", "T")
    tolerances = (displacement, traction)
    pairs = zip(kernel.evaluate(offset, normal), reference.evaluate(offset, normal), strict=True)
    for name, tolerance, (value, exact) in zip(names, tolerances, pairs, strict=True):
        error = relative_error(value, exact)
        assert error <= tolerance, f"{name} differs from the reference by {error:.1e}, allowed {tolerance:.1e}"


def _central_difference(function: Callable[[Array], Array], offset: Array, step: float) -> Array:
    """Derivatives along the three axes, appended as the last axis."""
    steps = step * np.eye(3)
    return np.stack([(function(offset + h) - function(offset - h)) / (2.0 * step) for h in steps], axis=-1)


def _root_mean_square(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _assert_order(errors: list[float], theoretical: float, message: str) -> None:
    observed = np.log2(errors[0] / errors[1])
    assert observed > theoretical - 0.2, f"{message}: errors {errors[0]:.2e}, {errors[1]:.2e}, order {observed:.2f}"
