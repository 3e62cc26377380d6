"""Slip that merely undoes that of the same material before: nodes that an iteration should let stick."""

from types import SimpleNamespace

import numpy as np
import pytest

from meeframe.contact.undone_slip import MAX_BACKWARD, undone_slip
from meeframe.laws import IsotropicCoulomb

LIMIT = 0.5
"""Friction limit of the law at the pressure of all nodes, 1."""


def undone(tractions, slips, law=None, flows=True):
    """Return the positions, along a line of flow, of nodes that should stick; None if the function names none."""
    count = len(slips)
    lines = np.arange(count)[::-1, None]
    flow = SimpleNamespace(flow_lines=lines) if flows else None
    problem = SimpleNamespace(
        system=SimpleNamespace(capability=lambda _: flow), contact_law=law or IsotropicCoulomb(LIMIT)
    )
    load = np.zeros((count, 5))
    load[:, 2] = -1.0
    load[lines[:, 0], :2] = np.outer(tractions, [0.6, -0.8])
    trial = load[:, :3].copy()
    trial[lines[:, 0], :2] += np.outer(slips, [0.6, -0.8])
    mask = undone_slip(problem, load, trial)
    return None if mask is None else np.flatnonzero(mask[lines[:, 0]]).tolist()


def test_slip_counts_once_it_has_made_up_for_slip_back():
    tractions = [0.1, 0.3, LIMIT, LIMIT, LIMIT, LIMIT, LIMIT, LIMIT]
    assert undone(tractions, [0.0, 0.0, -3.0, 1.0, 1.0, 2.0, 1.0, 1.0]) == [3, 4]


def test_friction_below_the_limit_ends_the_sum():
    tractions = [LIMIT, LIMIT, LIMIT, 0.2, LIMIT, LIMIT]
    assert undone(tractions, [-9.0, 1.0, 1.0, 1.0, 1.0, 1.0]) == [1, 2]
    assert undone(tractions, [-9.0, 1.0, 1.0, -1.0, 1.0, 1.0]) == [1, 2]


def test_sums_begin_anew_after_forward_slip():
    assert undone([LIMIT] * 6, [5.0, -2.0, 1.0, 4.0, -1.0, 0.5]) == [2, 5]


def test_many_nodes_that_slip_back_are_no_end_of_a_line():
    back = [-1.0] * MAX_BACKWARD
    assert undone([LIMIT] * (MAX_BACKWARD + 2), [*back, 1.0, 1.0]) == [MAX_BACKWARD, MAX_BACKWARD + 1]
    assert undone([LIMIT] * (MAX_BACKWARD + 3), [-1.0, *back, 1.0, 1.0]) == []


@pytest.mark.parametrize(
    "arguments",
    [
        {"slips": [1.0, 2.0, 3.0]},
        {"slips": [-1.0, 2.0, 3.0], "flows": False},
        {"slips": [-1.0, 0.5, 3.0], "law": IsotropicCoulomb(2.0)},
    ],
    ids=["forward", "at rest", "stick"],
)
def test_no_slip_is_undone(arguments):
    assert undone([LIMIT] * 3, **arguments) is None
