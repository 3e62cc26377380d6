"""Closed fractions of grazing nodes by secants, on nodes whose trial tractions are known functions of them."""

import numpy as np

from meeframe.solvers.grazing import Grazing


def test_nodes_go_where_their_trials_vanish() -> None:
    """Nearly linear and hardly coupled: four graze, the others touch or are open whatever they conduct."""
    n = 200
    random = np.random.default_rng(0)
    root, stiffness = np.where(np.arange(n) < 100, 3.0, -3.0), random.uniform(0.5, 2.0, n)
    root[[3, 30, 160, 190]] = 0.2, 0.7, 0.4, 0.05
    coupling = 0.02 * random.normal(size=(n, n)) / np.sqrt(n)
    closed, grazing = np.ones(n), Grazing.unknown(n)
    for _ in range(12):
        beyond = closed - root
        trial = stiffness * beyond * (1.0 + 0.2 * beyond) + coupling @ (closed - np.clip(root, 0.0, 1.0))
        grazing = grazing.next(closed, trial)
        found = grazing.fractions(trial < 0.0)
        assert found is not None
        closed = found
    assert np.abs(closed - np.clip(root, 0.0, 1.0)).max() <= 1e-9


def test_many_that_graze_are_left_to_others() -> None:
    root = np.full(20, 0.5)
    first = Grazing.unknown(20).next(np.ones(20), 1.0 - root)
    assert first.fractions(np.zeros(20, bool)) is not None
    second = first.next(np.zeros(20), -root)
    assert second.fractions(np.ones(20, bool)) is None
