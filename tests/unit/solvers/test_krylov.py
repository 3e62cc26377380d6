"""The Krylov iteration agrees with direct solution."""

import numpy as np
import pytest

from meeframe.solvers.krylov import RESTART, gmres


def system(size: int = 120) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(5)
    matrix = np.diag(np.linspace(1.0, 50.0, size)) + random.normal(size=(size, size)) / np.sqrt(size)
    return matrix, random.normal(size=size)


def count_products(matrix: np.ndarray):
    products: list[None] = []

    def multiply(x: np.ndarray) -> np.ndarray:
        products.append(None)
        return matrix @ x

    return multiply, products


def identity(x: np.ndarray) -> np.ndarray:
    return x


def test_restarted_iteration_solves() -> None:
    matrix, right = system()
    multiply, products = count_products(matrix)
    computed, _ = gmres(multiply, identity, right, 1e-12)
    assert len(products) > RESTART
    np.testing.assert_allclose(computed, np.linalg.solve(matrix, right), atol=1e-11 * np.abs(computed).max())


def test_single_precision_preconditioner_does_not_limit_accuracy() -> None:
    matrix, right = system()
    inverse = np.linalg.inv(np.diag(np.diag(matrix))).astype(np.float32)
    multiply, products = count_products(matrix)
    computed, _ = gmres(multiply, lambda x: (inverse @ x.astype(np.float32)).astype(float), right, 1e-13)
    assert np.linalg.norm(right - matrix @ computed) <= 1.1e-13 * np.linalg.norm(right)
    assert len(products) < RESTART


@pytest.mark.parametrize("restarts", [False, True])
def test_preconditioner_of_a_system_in_single_precision(restarts: bool) -> None:
    """Vectors to which the preconditioner was applied are computed again, also in several cycles."""
    matrix, right = (array.astype(np.float32) for array in system())
    weights = (1.0 / np.diag(matrix) if not restarts else np.geomspace(1.0, 30.0, len(right))).astype(np.float32)
    multiply, products = count_products(matrix)
    computed, left = gmres(multiply, lambda x: weights * x, right, 1e-4)
    assert (len(products) > RESTART) == restarts
    remainder = np.linalg.norm(right - matrix.astype(float) @ computed)
    assert remainder <= 1.01e-4 * np.linalg.norm(right)
    assert left == pytest.approx(remainder, rel=1e-2)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-6])
def test_tolerance_bounds_the_residual(tolerance) -> None:
    matrix, right = system()
    computed, _ = gmres(lambda x: matrix @ x, identity, right, tolerance)
    left = np.linalg.norm(right - matrix @ computed) / np.linalg.norm(right)
    assert 1e-2 * tolerance < left <= tolerance * (1.0 + 1e-9)


@pytest.mark.parametrize("most", [7, 15, 400])
def test_residual_is_returned(most: int) -> None:
    """The returned residual is correct whether or not the tolerance is met."""
    matrix, right = system()
    computed, left = gmres(lambda x: matrix @ x, identity, right, 1e-9, most)
    assert (left <= 1e-9 * np.linalg.norm(right)) == (most == 400)
    assert left == pytest.approx(np.linalg.norm(right - matrix @ computed), rel=1e-4)


def test_number_of_products() -> None:
    matrix, right = system()
    multiply, products = count_products(matrix)
    gmres(multiply, identity, right, 1e-12, max_products=7)
    assert len(products) == 7
    assert not gmres(multiply, identity, np.zeros_like(right), 1e-12)[0].any()
    assert len(products) == 7


def test_exact_after_as_many_products_as_eigenvalues() -> None:
    """The iteration ends by itself."""
    multiply, products = count_products(np.diag([1.0, 2.0, 2.0, 5.0]))
    np.testing.assert_allclose(gmres(multiply, identity, np.ones(4), 1e-15)[0], [1.0, 0.5, 0.5, 0.2], rtol=1e-14)
    assert len(products) <= 4


def test_single_precision_ends_at_its_round_off() -> None:
    """With four eigenvalues, only round-off remains after four products, however small the tolerance."""
    random = np.random.default_rng(0)
    rotated = np.linalg.qr(random.normal(size=(400, 400)))[0]
    matrix = ((rotated * np.repeat([1.0, 2.0, 5.0, 7.0], 100)) @ rotated.T).astype(np.float32)
    right = random.normal(size=400).astype(np.float32)
    multiply, products = count_products(matrix)
    computed, _ = gmres(multiply, identity, right, 1e-15)
    assert computed.dtype == np.float32
    assert np.linalg.norm(right - matrix.astype(float) @ computed) <= 1e-6 * np.linalg.norm(right)
    assert len(products) <= 20


@pytest.mark.parametrize("size", [1e-35, 1e-24, 1.0, 1e25])
def test_single_precision_with_overflowing_squares(size: float) -> None:
    matrix, right = system()
    matrix, right = matrix.astype(np.float32), (size * right).astype(np.float32)
    computed, left = gmres(lambda x: matrix @ x, identity, right, 1e-4)
    assert computed.dtype == np.float32
    remainder = right - matrix.astype(float) @ computed.astype(float)
    norm = float(np.linalg.norm(right.astype(float)))
    assert float(np.linalg.norm(remainder)) <= 1.1e-4 * norm
    assert 0.0 < left <= 1e-4 * norm


@pytest.mark.parametrize("one", [np.inf, np.nan])
def test_nonfinite_right_hand_side(one: float) -> None:
    """The returned residual is not finite, either."""
    matrix, right = system()
    computed, left = gmres(lambda x: matrix @ x, identity, np.where(np.arange(120) == 7, one, right), 1e-4)
    assert not computed.any()
    assert not np.isfinite(left)
