"""Krylov iteration against direct solution."""

import numpy as np
import pytest

from meeframe.solvers.krylov import RESTART, gmres


def system(size: int = 120) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(5)
    matrix = np.diag(np.linspace(1.0, 50.0, size)) + random.normal(size=(size, size)) / np.sqrt(size)
    return matrix, random.normal(size=size)


def counted(matrix: np.ndarray):
    products: list[None] = []

    def multiply(x: np.ndarray) -> np.ndarray:
        products.append(None)
        return matrix @ x

    return multiply, products


def unchanged(x: np.ndarray) -> np.ndarray:
    return x


def test_restarted_iteration_solves() -> None:
    matrix, right = system()
    multiply, products = counted(matrix)
    found, _ = gmres(multiply, unchanged, right, 1e-12)
    assert len(products) > RESTART
    np.testing.assert_allclose(found, np.linalg.solve(matrix, right), atol=1e-11 * np.abs(found).max())


def test_single_precision_of_the_preconditioner_does_not_show() -> None:
    matrix, right = system()
    inverse = np.linalg.inv(np.diag(np.diag(matrix))).astype(np.float32)
    multiply, products = counted(matrix)
    found, _ = gmres(multiply, lambda x: (inverse @ x.astype(np.float32)).astype(float), right, 1e-13)
    assert np.linalg.norm(right - matrix @ found) <= 1.1e-13 * np.linalg.norm(right)
    assert len(products) < RESTART


@pytest.mark.parametrize("tolerance", [1e-2, 1e-6])
def test_tolerance_is_that_of_the_residual(tolerance) -> None:
    matrix, right = system()
    found, _ = gmres(lambda x: matrix @ x, unchanged, right, tolerance)
    left = np.linalg.norm(right - matrix @ found) / np.linalg.norm(right)
    assert 1e-2 * tolerance < left <= tolerance * (1.0 + 1e-9)


@pytest.mark.parametrize("most", [7, 15, 400])
def test_what_is_left_is_said(most: int) -> None:
    """Whether it is as little as was asked for or not."""
    matrix, right = system()
    found, left = gmres(lambda x: matrix @ x, unchanged, right, 1e-9, most)
    assert (left <= 1e-9 * np.linalg.norm(right)) == (most == 400)
    assert left == pytest.approx(np.linalg.norm(right - matrix @ found), rel=1e-4)


def test_no_more_products_than_allowed_and_none_for_nothing() -> None:
    matrix, right = system()
    multiply, products = counted(matrix)
    gmres(multiply, unchanged, right, 1e-12, max_products=7)
    assert len(products) == 7
    assert not gmres(multiply, unchanged, np.zeros_like(right), 1e-12)[0].any()
    assert len(products) == 7


def test_exact_after_as_many_products_as_eigenvalues() -> None:
    """The iteration ends by itself."""
    multiply, products = counted(np.diag([1.0, 2.0, 2.0, 5.0]))
    np.testing.assert_allclose(gmres(multiply, unchanged, np.ones(4), 1e-15)[0], [1.0, 0.5, 0.5, 0.2], rtol=1e-14)
    assert len(products) <= 4


def test_single_precision_ends_at_its_round_off() -> None:
    """However little is asked to be left: four eigenvalues are found at once, and what remains is round-off."""
    random = np.random.default_rng(0)
    turned = np.linalg.qr(random.normal(size=(400, 400)))[0]
    matrix = ((turned * np.repeat([1.0, 2.0, 5.0, 7.0], 100)) @ turned.T).astype(np.float32)
    right = random.normal(size=400).astype(np.float32)
    multiply, products = counted(matrix)
    found, _ = gmres(multiply, unchanged, right, 1e-15)
    assert found.dtype == np.float32
    assert np.linalg.norm(right - matrix.astype(float) @ found) <= 1e-6 * np.linalg.norm(right)
    assert len(products) <= 20


@pytest.mark.parametrize("size", [1e-35, 1e-24, 1.0, 1e25])
def test_single_precision_whose_squares_are_no_numbers_of_it(size: float) -> None:
    matrix, right = system()
    matrix, right = matrix.astype(np.float32), (size * right).astype(np.float32)
    found, left = gmres(lambda x: matrix @ x, unchanged, right, 1e-4)
    assert found.dtype == np.float32
    rest = right - matrix.astype(float) @ found.astype(float)
    norm = float(np.linalg.norm(right.astype(float)))
    assert float(np.linalg.norm(rest)) <= 1.1e-4 * norm
    assert 0.0 < left <= 1e-4 * norm


@pytest.mark.parametrize("one", [np.inf, np.nan])
def test_nothing_is_found_for_what_is_no_number(one: float) -> None:
    """And what is left is no number either."""
    matrix, right = system()
    found, left = gmres(lambda x: matrix @ x, unchanged, np.where(np.arange(120) == 7, one, right), 1e-4)
    assert not found.any()
    assert not np.isfinite(left)
