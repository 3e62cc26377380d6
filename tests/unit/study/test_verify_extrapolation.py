"""Richardson extrapolation is correct for manufactured sequences."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meeframe.common.errors import CaseError
from meeframe.study.reports.extrapolation import Basis, of_order, richardson

SIZES = (0.4, 0.2, 0.1)


def sequence(limit, coefficient, order, sizes):
    return [limit + coefficient * h**order for h in sizes]


@settings(deadline=None, max_examples=60)
@given(
    st.floats(0.5, 4.0),
    st.floats(-3.0, 3.0).filter(lambda x: abs(x) > 0.1),
    st.floats(-3.0, 3.0).filter(lambda x: abs(x) > 0.1),
    st.floats(1.2, 3.0),
    st.floats(1.2, 3.0),
)
def test_order_and_limit_of_a_power(order, limit, coefficient, first, second):
    """The ratios of mesh sizes are not constant."""
    sizes = (first * second, second, 1.0)
    extrapolated = richardson(sizes, sequence(limit, coefficient, order, sizes), theoretical=order * 1.2)
    assert extrapolated.basis is Basis.OBSERVED
    assert extrapolated.order == pytest.approx(order, rel=1e-6)
    assert extrapolated.value == pytest.approx(limit, abs=1e-6 * abs(coefficient))
    assert extrapolated.error >= abs(limit - extrapolated.finest) * (1 - 1e-6)


@pytest.mark.parametrize(("order", "theoretical"), [(4.0, 2.0), (0.2, 2.0), (3.0, 1.0)])
def test_orders_out_of_bounds_are_replaced_by_theory(order, theoretical):
    extrapolated = richardson(SIZES, sequence(1.0, 0.5, order, SIZES), theoretical)
    assert (extrapolated.basis, extrapolated.order) == (Basis.THEORETICAL, None)
    fine, coarse = extrapolated.finest, 1.0 + 0.5 * SIZES[1] ** order
    assert extrapolated.value == pytest.approx(fine + (fine - coarse) / (2.0**theoretical - 1.0), rel=1e-12)
    assert extrapolated.error > 0.0
    if order > theoretical:
        assert abs(extrapolated.value - 1.0) <= extrapolated.error


def test_common_scatter_cancels_with_equal_orders():
    """Equal scatter cancels in the difference of the limits, and the remainder is extrapolated."""
    scatter = np.random.default_rng(5).normal(size=3)
    one, other = (np.array(sequence(limit, c, 3.0, SIZES)) + scatter for limit, c in ((2.0, 0.4), (2.5, -7.0)))
    assert of_order(SIZES, other, 3.0) - of_order(SIZES, one, 3.0) == pytest.approx(0.5, abs=1e-12)
    assert of_order(SIZES[1:], sequence(2.0, 0.4, 3.0, SIZES[1:]), 3.0) == pytest.approx(2.0, abs=1e-12)


def test_error_covers_a_second_term():
    """For values with a term of another order, the error of the limit is below its estimate."""
    for coefficient in (-1.0, -0.3, 0.3, 1.0):
        values = [2.0 + h**2 + coefficient * h**3 for h in SIZES]
        extrapolated = richardson(SIZES, values)
        assert 0.0 < abs(extrapolated.value - 2.0) <= extrapolated.error


def test_error_covers_noise():
    """With random noise of a quarter of the error of each mesh, as for spheres on grids, nine of ten limits are
    within the error."""
    rng = np.random.default_rng(3)
    within = []
    for _ in range(300):
        values = [1.0 + h**2 * (1.0 + 0.25 * rng.uniform(-1.0, 1.0)) for h in (0.225, 0.15, 0.1)]
        extrapolated = richardson((0.225, 0.15, 0.1), values)
        within.append(abs(extrapolated.value - 1.0) <= extrapolated.error)
    assert np.mean(within) > 0.9


def springs(divisions, approach):
    """Return the force of a paraboloid on springs at the nodes of a square, relative to that in the limit."""
    x = np.linspace(-2.5, 2.5, divisions + 1)
    overlap = np.maximum(approach - 0.5 * np.add.outer(x**2, x**2), 0.0)
    return overlap.sum() * (5.0 / divisions) ** 2 / (np.pi * approach**2)


def test_springs_under_a_paraboloid_are_within_the_error():
    """There is no smooth error: nodes are either in contact or not."""
    within = []
    for approach in np.linspace(0.7, 2.0, 9):
        for divisions in range(12, 40):
            counts = [round(divisions / 2.25), round(divisions / 1.5), divisions]
            extrapolated = richardson([1 / n for n in counts], [springs(n, approach) for n in counts])
            within.append(abs(extrapolated.value - 1.0) <= extrapolated.error)
    assert np.mean(within) > 0.85


def test_oscillating_values_are_not_extrapolated():
    extrapolated = richardson(SIZES, [1.0, 1.2, 1.1])
    assert (extrapolated.basis, extrapolated.value, extrapolated.order) == (Basis.FINEST, 1.1, None)
    assert extrapolated.error == pytest.approx(0.2)


def test_growing_differences_have_no_order():
    extrapolated = richardson(SIZES, [1.0, 1.1, 1.4])
    assert (extrapolated.basis, extrapolated.order) == (Basis.THEORETICAL, None)
    assert extrapolated.value == pytest.approx(1.5)
    assert extrapolated.error == pytest.approx(1.5 - (1.0 + 0.1 + 0.1 / 3.0))


def test_equal_values_have_no_error():
    extrapolated = richardson(SIZES, [3.0, 3.0, 3.0])
    assert (extrapolated.basis, extrapolated.value, extrapolated.error) == (Basis.CONSTANT, 3.0, 0.0)
    assert richardson(SIZES, [0.0, 0.0, 0.0]).value == 0.0


def test_values_that_stop_changing():
    extrapolated = richardson(SIZES, [1.0, 1.1, 1.1])
    assert (extrapolated.basis, extrapolated.value) == (Basis.FINEST, 1.1)
    assert extrapolated.error == pytest.approx(0.1)


def test_values_without_order_are_not_extrapolated():
    values = sequence(1.0, 1.0, 2.0, SIZES)
    for noise, error in ((0.01, 0.03), (0.05, 0.05)):
        extrapolated = richardson(SIZES, values, noise=noise)
        assert (extrapolated.basis, extrapolated.value) == (Basis.FINEST, values[-1])
        assert extrapolated.error == pytest.approx(error)


def test_last_three_meshes_are_used():
    sizes = (0.8, *SIZES)
    assert richardson(sizes, [77.0, *sequence(1.0, 0.5, 1.5, SIZES)]).value == pytest.approx(1.0)


@pytest.mark.parametrize("sizes", [(0.2, 0.1), (0.1, 0.2, 0.4), (0.2, 0.1, 0.1)])
def test_invalid_sizes_are_rejected(sizes):
    with pytest.raises(CaseError, match="needs 3 or more, decreasing"):
        richardson(sizes, [1.0] * len(sizes))
