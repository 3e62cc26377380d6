"""Nodes that friction of a limit that jumps lifts, so that they have no admissible state."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from meeframe_laws.adhesive import DMT
from meeframe_laws.friction import CappedCoulomb, Tresca

from meeframe.contact.problem import Status
from meeframe.model.lifted_nodes import lifted_node
from meeframe.testing.half_space import half_space_system, indentation_problem

NODE = 12
LIMIT, SLIP = 1.0, -10.0
COUPLING = 0.5
"""Tangential displacement under unit pressure, by which friction at its limit lifts the node by LIMIT * COUPLING."""


def increment(law, overlap, slip, kappa=0.0, pull=0.0):
    """Return an increment in which a single node, with a spring of its own, overlaps the indenter and slips.

    kappa: conductivity in contact; pull: displacement of the surface towards the indenter by the flux at a drop of one
    that all of it passes.
    """
    system = half_space_system(-np.eye(3), 1.0, 5)
    matrix = np.zeros_like(system.matrix)
    for node in range(25):
        matrix[node, :, node, :] = np.eye(5)
        matrix[node, 2, node, 3] = pull
        matrix[node, 0, node, 2] = matrix[node, 2, node, 0] = COUPLING
    problem = indentation_problem(replace(system, matrix=matrix), np.zeros(25), 0.1, law, (kappa, 0.0), (-1.0, 0.0))
    gap, translation = np.full(25, np.inf), np.zeros((25, 2))
    gap[NODE], translation[NODE, 0] = -overlap, slip
    problem = replace(problem, gap=gap, translation=translation)
    return SimpleNamespace(problem=problem, base=np.zeros(8), free=[])


@pytest.mark.parametrize(
    ("law", "overlap", "slip", "is_lifted"),
    [
        (Tresca(LIMIT), 0.9 * LIMIT * COUPLING, SLIP, True),
        (Tresca(LIMIT), 1.1 * LIMIT * COUPLING, SLIP, False),  # it touches in spite of the friction
        (Tresca(LIMIT), 0.9 * LIMIT * COUPLING, -SLIP, False),  # friction presses it down
        (Tresca(LIMIT), -0.1, SLIP, False),  # it is open
        (DMT(0.05, 1.0, mu=np.inf), -0.05, SLIP, True),  # attraction alone closes it
        (DMT(0.05, 1.0, mu=np.inf), -0.05, -SLIP, False),
        (DMT(0.05, 1.0, mu=np.inf), -0.2, SLIP, False),
        (CappedCoulomb(10.0, LIMIT), 0.9 * LIMIT * COUPLING, SLIP, False),
    ],
)
@pytest.mark.parametrize("pressure", [0.0, 0.3])
def test_nodes_without_a_state_are_found(synthetic, law, overlap, slip, is_lifted, pressure):
    zero, traction = np.zeros((25, 2)), np.zeros((25, 3))
    traction[NODE, 2] = -pressure
    step = replace(synthetic.step(1e-6, Status.STALLED), traction=traction, fluxes=zero, potentials=zero)
    step = replace(step, loading=SimpleNamespace(motion=np.zeros(8)))
    assert lifted_node(increment(law, overlap, slip), step) == (NODE if is_lifted else None)


@pytest.mark.parametrize(
    ("overlap", "kappa", "pull", "is_lifted"),
    [
        (0.9, 1.0, 0.0, True),
        (0.9, 1.0, 0.4, False),  # half of the drop passes: the flux lets it touch in spite of the friction
        (0.9, np.inf, 0.25, False),
        (1.1, 1.0, -0.4, True),  # the flux lifts it further
        (1.1, np.inf, -0.25, True),
        (1.1, 1e-3, -0.4, False),
        (0.2, np.inf, -0.25, False),  # it lies between open and closed: a part of the flux lifts it
    ],
)
def test_fluxes_follow_the_state_of_the_node(synthetic, overlap, kappa, pull, is_lifted):
    zero = np.zeros((25, 2))
    step = replace(synthetic.step(1e-6, Status.STALLED), traction=np.zeros((25, 3)), fluxes=zero, potentials=zero)
    step = replace(step, loading=SimpleNamespace(motion=np.zeros(8)))
    planned = increment(Tresca(LIMIT), overlap * LIMIT * COUPLING, SLIP, kappa, pull)
    assert lifted_node(planned, step) == (NODE if is_lifted else None)
