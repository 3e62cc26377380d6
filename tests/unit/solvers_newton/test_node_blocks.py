"""Block-diagonal matrices stored by entries agree with full matrices."""

import numpy as np
import pytest

from meeframe.system.node_blocks import NodeBlocks

RANDOM = np.random.default_rng(11)
NODES = 40


def to_blocks(matrices: np.ndarray) -> NodeBlocks:
    rows, columns, count = matrices.shape
    return NodeBlocks.of({position: matrices[position] for position in np.ndindex(rows, columns)}, (rows, count))


def to_matrix(blocks: NodeBlocks, columns: int) -> np.ndarray:
    return np.array([[blocks.entry(row, column) for column in range(columns)] for row in range(blocks.shape[0])])


def sparse(rows: int, columns: int) -> np.ndarray:
    """Return matrices (rows, columns, c) with half of the entries zero at all nodes."""
    matrices = RANDOM.normal(size=(rows, columns, NODES))
    return matrices * (RANDOM.random((rows, columns, 1)) < 0.5)


@pytest.mark.parametrize(("precision", "error"), [(np.float64, 1e-14), (np.float32, 1e-5)])
def test_products(precision: type, error: float) -> None:
    matrices, vectors = sparse(4, 5), RANDOM.normal(size=(5, NODES)).astype(precision)
    blocks = to_blocks(matrices).products(np.dtype(precision))
    assert len(blocks.entries) == matrices.any(axis=2).sum() < 20
    product = blocks.times(vectors)
    assert product.dtype == precision
    np.testing.assert_allclose(product, np.einsum("ijc,jc->ic", matrices, vectors), atol=error * 10.0)


def test_sums_and_products_of_blocks() -> None:
    first, second = sparse(4, 4), sparse(4, 4)
    np.testing.assert_array_equal(to_matrix(to_blocks(first).plus(to_blocks(second)), 4), first + second)
    expected = np.einsum("ijc,jkc->ikc", second, first)
    np.testing.assert_allclose(to_matrix(to_blocks(second).compose(to_blocks(first)), 4), expected, atol=1e-13)


def test_entry_of_a_single_node() -> None:
    for node in range(NODES):
        assert list(to_blocks(np.arange(NODES)[None, None] == node).entries) == [(0, 0)]


def test_row_exchange_at_selected_nodes() -> None:
    matrices, nodes = sparse(4, 3), np.array([3, 7, 30])
    blocks = to_blocks(matrices)
    expected = matrices.copy()
    expected[1][:, nodes], expected[3][:, nodes] = matrices[3][:, nodes], matrices[1][:, nodes]
    np.testing.assert_array_equal(to_matrix(blocks.swap_rows(1, 3, nodes), 3), expected)
    np.testing.assert_array_equal(to_matrix(blocks, 3), matrices)


def test_change_of_entries_at_selected_nodes() -> None:
    matrices, nodes = sparse(3, 3), np.array([0, 5])
    expected = matrices.copy()
    expected[2, 1, nodes] = 4.0
    np.testing.assert_array_equal(to_matrix(to_blocks(matrices).with_entries(2, 1, nodes, 4.0), 3), expected)


def test_rotated_axes_of_the_first_two_components() -> None:
    matrices, angle = sparse(4, 3), RANDOM.random(NODES) * 2.0 * np.pi
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = np.zeros((4, 4, NODES))
    turn[:2, :2] = [[cosine, sine], [-sine, cosine]]
    turn[2, 2] = turn[3, 3] = 1.0
    expected = np.einsum("ijc,jkc,lkc->ilc", turn, matrices, turn[:3, :3])
    np.testing.assert_allclose(to_matrix(to_blocks(matrices).rotate(cosine, sine), 3), expected, atol=1e-14)


@pytest.mark.parametrize("size", [1, 2, 3, 5])
def test_inverses_on_marked_rows_and_columns(size: int) -> None:
    """Each node has its set of rows; the other rows are unchanged and may be singular."""
    matrices = RANDOM.normal(size=(size, size, NODES)) + 4.0 * np.eye(size)[:, :, None]
    which = RANDOM.random((size, NODES)) < 0.6
    matrices *= which[:, None] & which
    computed = to_matrix(to_blocks(matrices).inverses(which), size)
    for node, marked in enumerate(which.T):
        expected = np.zeros((size, size))
        expected[np.ix_(marked, marked)] = np.linalg.inv(matrices[:, :, node][np.ix_(marked, marked)])
        np.testing.assert_allclose(computed[:, :, node], expected, atol=1e-12)


def test_inverses_of_diagonal_blocks() -> None:
    matrices = np.zeros((3, 3, NODES))
    matrices[0, 0], matrices[2, 2] = 2.0, 5.0
    computed = to_matrix(to_blocks(matrices).inverses(np.ones((3, NODES), bool)), 3)
    np.testing.assert_array_equal(computed[:, :, 7], np.diag([0.5, 0.0, 0.2]))


@pytest.mark.parametrize("size", [2, 3])
def test_singular_blocks_have_a_pseudo_inverse(size: int) -> None:
    matrices = RANDOM.normal(size=(size, size, NODES))
    matrices[0, :, ::2] = matrices[1, :, ::2]
    computed = to_matrix(to_blocks(matrices).inverses(np.ones((size, NODES), bool)), size)
    expected = np.linalg.pinv(matrices.transpose(2, 0, 1)).transpose(1, 2, 0)
    np.testing.assert_allclose(computed, expected, atol=1e-9 * np.abs(expected).max())
