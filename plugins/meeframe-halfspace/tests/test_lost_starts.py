"""An initial load at nodes that are no longer below the indenter is discarded."""

import numpy as np
import pytest

from meeframe import Case
from meeframe.results.resultants import resultants

CASE = """
[material]
name = "batio3-cofe2o4"

[mesh]
type = "half-space"
contact_width = "5 mm"
divisions = 15

[formulation]
name = "half-space"
edges = "resolved"

[indenter]
name = "{indenter}"

[solver]
name = "{solver}"

[[steps]]
{first}
increments = 2

[[steps]]
{second}
"""
PUNCH = 'flat-punch"\nradius = "1.5 mm'
TILTED = 'rectangular-punch"\nhalf_width_x = 1.1e-3\nhalf_width_y = 0.7e-3\ntilt_1 = "1e-3 rad'


def solve(indenter, solver, first='approach = "10 um"', second='approach = "4 um"'):
    return Case.from_toml(CASE.format(indenter=indenter, solver=solver, first=first, second=second)).solve()


def normal_force(result, number):
    return resultants(result.zone, result[number]).normal_force


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("solver", ["projected-cg", "auto", "uzawa-bb"])
@pytest.mark.parametrize("indenter", [PUNCH, TILTED], ids=["punch", "tilted"])
def test_all_increments_of_a_punch_with_resolved_edges_converge(indenter, solver):
    increments = solve(indenter, solver)
    assert [one.status for one in increments] == ["converged"] * 3
    # without friction the state depends on the approach only
    direct = solve(indenter, "newton", first='approach = "4 um"')
    assert normal_force(increments, 2) == pytest.approx(normal_force(direct, 1), rel=1e-7)


def test_force_of_a_punch_is_proportional_to_approach():
    result = solve(PUNCH, "auto")
    forces = np.array([normal_force(result, number) for number in range(3)])
    assert forces / forces[1] == pytest.approx([0.5, 1.0, 0.4], rel=1e-8)


def test_no_load_remains_behind_a_moving_indenter():
    increments = solve(PUNCH, "auto", second='approach = "10 um"\ntranslation = ["0.4 mm", 0]\nincrements = 2')
    assert [one.status for one in increments] == ["converged"] * 4
    for one in increments:
        assert not one.traction[np.isinf(one.initial_gap)].any()
