"""Sums of matrix products by address agree with products of arrays."""

import numpy as np
import pytest
from meeframe_hmatrix.gemm import FULL, add_products, locate, subtract_products, table_of

PRECISIONS = pytest.mark.parametrize("dtype", [np.float32, np.float64])


def arrays(dtype):
    """Return matrices in row-major and column-major order, and slices of both."""
    random = np.random.default_rng(1).normal(size=(30, 40)).astype(dtype)
    return [
        random[:7, :4].copy(),
        np.asfortranarray(random[:7, :4]),
        random[::3, 2:6][:7],
        np.asfortranarray(random)[5:12, 3:7],
    ]


@PRECISIONS
@pytest.mark.parametrize("width", [1, 3])
def test_blocks_are_added(dtype, width):
    random = np.random.default_rng(2)
    for first in arrays(dtype):
        for left in arrays(dtype):
            right = arrays(dtype)[2].T
            rows = [
                (10, 7, 0, 4, FULL, *locate(first, dtype), 0, 0, 0),
                (10, 7, 4, 7, 4, *locate(left, dtype), *locate(right, dtype)),
            ]
            matrix = np.hstack([first, left @ right])
            for transposed, operator, starts in ((False, matrix, (10, 0)), (True, matrix.T, (0, 10))):
                x = random.normal(size=(operator.shape[1], width)).astype(dtype)
                for order in ("C", "F"):
                    ordered = np.array(x, order=order)
                    result = np.ones((len(operator), width), dtype)
                    assert add_products(
                        np.array(rows), transposed, (*locate(ordered, dtype), starts[1]), result, starts[0]
                    )
                    np.testing.assert_allclose(result, 1 + operator @ x, rtol=0, atol=100 * np.finfo(dtype).eps)


@PRECISIONS
@pytest.mark.parametrize("width", [1, 3])
def test_low_rank_without_columns_adds_nothing(dtype, width):
    left, nothing, x = np.ones((300, 200), dtype), np.ones((200, 0), dtype), np.ones((0, width), dtype)
    table = np.array([(0, 300, 0, 0, 200, *locate(left, dtype), *locate(nothing, dtype))])
    for _ in range(20):
        np.full(200 * width, np.nan, dtype)  # arbitrary content of fresh memory
        result = np.ones((300, width), dtype)
        assert add_products(table, False, (*locate(x, dtype), 0), result, 0)
        assert (result == 1).all()


@PRECISIONS
def test_products_are_subtracted_in_their_ranges(dtype):
    left, right = arrays(dtype)[3], arrays(dtype)[1].T
    target = np.random.default_rng(3).normal(size=(9, 11)).astype(dtype)
    expected = target.copy()
    expected[1:8, 2:9] -= left @ right
    expected[0:4, 3:4] -= right @ left[:, 1:2]
    entries = [(slice(21, 28), slice(32, 39), left, right), (slice(20, 24), slice(33, 34), right, left[:, 1:2])]
    assert subtract_products(table_of(entries, 20, 30, dtype), target)
    np.testing.assert_allclose(target, expected, rtol=0, atol=100 * np.finfo(dtype).eps)


def test_layouts_unsupported_by_blas_are_rejected():
    array = np.zeros((8, 8))
    for wrong in (array.astype(np.float32), array[::2, ::2], np.broadcast_to(array[0], (3, 8))):
        with pytest.raises(ValueError, match="allowed: "):
            locate(wrong, np.float64)
