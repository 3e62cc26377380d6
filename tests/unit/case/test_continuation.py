"""Continuation of an increment that does not converge, through states under parts of its load."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from meeframe.contact.problem import Status
from meeframe.model.continuation import solve_by_continuation


class Increments:
    """Increments that are solved from a guess within some distance of their load, up to some load."""

    def __init__(self, step, radius: float, most: float) -> None:
        self._step, self._radius, self._most = step, radius, most
        self.fractions: list[float] = []

    def solve(self, fraction: float, start: float | None):
        self.fractions.append(fraction)
        solved = fraction - (start or 0.0) <= self._radius and fraction <= self._most
        result = replace(self._step, status=Status.CONVERGED if solved else Status.STALLED, iterations=7)
        return fraction, SimpleNamespace(state=fraction), result


@pytest.mark.parametrize(
    ("radius", "fractions"),
    [
        (0.5, [0.5, 1.0]),
        (0.4, [0.5, 0.25, 0.5, 0.75, 1.0]),
        (0.07, [0.5, 0.25, 0.125, 0.0625]),
    ],
)
def test_load_is_raised_in_parts(synthetic, radius, fractions):
    increments = Increments(synthetic.step(1e-6), radius, 1.0)
    failed = increments.solve(1.0, None)
    increments.fractions.clear()
    planned, end, result = solve_by_continuation(increments.solve, failed)
    assert increments.fractions[: len(fractions)] == fractions
    assert increments.fractions[-1] == planned == end.state == 1.0
    assert result.status is Status.CONVERGED
    assert result.iterations == 7 * (1 + len(increments.fractions))  # those of the failed increment count, too


@pytest.mark.parametrize("most", [0.0, 0.3, 0.99])
def test_a_failed_increment_is_returned_as_it_was(synthetic, most):
    increments = Increments(synthetic.step(1e-6), 1.0, most)
    failed = increments.solve(1.0, None)
    assert solve_by_continuation(increments.solve, failed) is failed
    assert len(increments.fractions) < 20
