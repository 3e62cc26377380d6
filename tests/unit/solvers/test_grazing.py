"""Closed fractions of grazing nodes by secants, on nodes whose trial tractions are known functions of them."""

import numpy as np
import pytest

from meeframe.solvers.cg.biactive import BiactiveNodes


def test_nodes_go_where_their_trials_vanish() -> None:
    """Nearly linear and hardly coupled: four graze, the others touch or are open whatever they conduct."""
    n = 200
    random = np.random.default_rng(0)
    root, stiffness = np.where(np.arange(n) < 100, 3.0, -3.0), random.uniform(0.5, 2.0, n)
    root[[3, 30, 160, 190]] = 0.2, 0.7, 0.4, 0.05
    coupling = 0.02 * random.normal(size=(n, n)) / np.sqrt(n)
    contact_fraction, grazing = np.ones(n), BiactiveNodes.unknown(n)
    for _ in range(12):
        beyond = contact_fraction - root
        trial = stiffness * beyond * (1.0 + 0.2 * beyond) + coupling @ (contact_fraction - np.clip(root, 0.0, 1.0))
        grazing = grazing.next(contact_fraction, trial)
        contact_fraction = grazing.fractions(trial < 0.0)
    assert np.abs(contact_fraction - np.clip(root, 0.0, 1.0)).max() <= 1e-9


def test_rows_of_nodes_that_press_each_other_apart() -> None:
    """Slopes alone, of all together, are off by the coupling: what each look tells of it is used."""
    n, row = 200, np.arange(60, 100)
    stiffness = 0.5 ** np.abs(row[:, None] - row)
    root = np.random.default_rng(0).uniform(0.2, 0.8, len(row))
    contact_fraction, grazing = np.ones(n), BiactiveNodes.unknown(n)
    for _ in range(24):
        trial = np.full(n, -1.0)
        trial[row] = stiffness @ (contact_fraction[row] - root)
        grazing = grazing.next(contact_fraction, trial)
        contact_fraction = grazing.fractions(trial < 0.0)
    assert np.abs(contact_fraction[row] - root).max() <= 1e-4


def test_slopes_that_no_longer_hold_are_found_anew() -> None:
    """Two nodes of twenty become ten times stiffer: the trials grow, and from there the two slopes are others."""
    two = np.arange(20) < 2
    contact_fraction, grazing = np.ones(20), BiactiveNodes.unknown(20)
    for stiffness, root in ((1.0, 0.5), (1.0, 0.5), (1.0, 0.6), *[(10.0, 0.5)] * 4):
        trial = np.where(two, stiffness * (contact_fraction - root), -1.0)
        grazing = grazing.next(contact_fraction, trial)
        contact_fraction = grazing.fractions(trial < 0.0)
    assert (grazing.slope[:2] > 5.0).all()
    assert contact_fraction[:2] == pytest.approx(0.5, abs=1e-9)


def test_all_touching_nodes_may_be_biactive() -> None:
    root = np.linspace(0.2, 0.8, 20)
    contact_fraction, grazing = np.ones(20), BiactiveNodes.unknown(20)
    for _ in range(3):
        grazing = grazing.next(contact_fraction, contact_fraction - root)
        contact_fraction = grazing.fractions(contact_fraction < root)
    assert contact_fraction == pytest.approx(root, abs=1e-12)


def test_small_moves_give_no_slope_of_a_node() -> None:
    """Trials grow because of others while it hardly moves: its own slope would be a million, and it would stay."""
    first = BiactiveNodes.unknown(3).next(np.ones(3), np.full(3, 0.5)).next(np.zeros(3), np.full(3, -0.5))
    there = first.next(np.full(3, 0.5), np.full(3, 1e-3))
    astray = there.next(np.full(3, 0.5 + 1e-6), np.full(3, 1.0))
    assert astray.slope == pytest.approx(first.slope)


def test_moves_without_information_leave_no_derivatives() -> None:
    """Derivatives found from round-off hold a node where it is, and so would tell nothing for ever."""
    grazing = BiactiveNodes.unknown(3).next(np.ones(3), np.full(3, 0.5)).next(np.zeros(3), np.full(3, -0.5))
    grazing = grazing.next(np.full(3, 0.5), np.full(3, 0.1)).next(np.full(3, 0.5 + 1e-7), np.full(3, 0.2))
    held = grazing.fractions(np.ones(3, bool))
    assert np.abs(held - grazing.contact_fraction).max() < 1e-6
    again = grazing.next(grazing.contact_fraction + 1e-14, np.full(3, 0.2)).fractions(np.ones(3, bool))
    assert again == pytest.approx(0.3, abs=1e-3)


def test_slopes_that_others_spoiled_throw_no_node_to_and_fro() -> None:
    """All four that graze open at once at first: what that does to one of them hides how stiff it is itself."""
    n, root = 50, np.array([0.4, 0.5, 0.5, 0.5])
    contact_fraction, grazing = np.ones(n), BiactiveNodes.unknown(n)
    for _ in range(12):
        trial = np.full(n, -1.0)
        trial[:4] = contact_fraction[:4] - root
        trial[0] -= 0.9 * (contact_fraction[1:4].mean() - 0.5)
        grazing = grazing.next(contact_fraction, trial)
        contact_fraction = grazing.fractions(trial < 0.0)
    assert contact_fraction[:4] == pytest.approx(root, abs=1e-9)


def test_trials_that_are_no_numbers_are_forgotten() -> None:
    grazing = BiactiveNodes.unknown(6)
    for contact_fraction in (1.0, 0.0, 0.5):
        grazing = grazing.next(np.full(6, contact_fraction), np.full(6, contact_fraction - 0.3))
    touching = np.arange(6) < 3
    after = grazing.next(np.full(6, 0.2), np.array([0.1, np.nan, 0.0, np.inf, -0.1, 0.0]))
    assert np.array_equal(after.fractions(touching), touching.astype(float))
    again = after.next(np.full(6, 0.3), np.zeros(6)).fractions(touching)
    assert np.array_equal(again, touching.astype(float))
