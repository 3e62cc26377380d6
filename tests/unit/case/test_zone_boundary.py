"""Contact that the zone cuts off is distinguished from contact that ends with its indenter or body."""

from dataclasses import replace

import numpy as np
import pytest

import meeframe
from meeframe.contact.problem import Status
from meeframe.indenters import FlatPunch, RectangularPunch
from meeframe.laws import IsotropicCoulomb
from meeframe.model.diagnostics import boundary_sides, open_sides
from meeframe.model.load import load_case
from meeframe.model.step import Step
from meeframe.results.summary import summary
from meeframe.solvers import StoppingCriteria, Uzawa


@pytest.fixture
def case(write_case, registry):
    return load_case(write_case(), registry)


def test_sides_of_a_square(synthetic):
    zone = synthetic.zone()
    sides, away = boundary_sides(zone)
    middles = zone.points[sides].mean(axis=1)
    assert len(sides) == 16
    outward = np.where(np.abs(middles) == 2e-3, np.sign(middles), 0.0)
    np.testing.assert_allclose(away, 0.5e-3 * outward, atol=1e-15)


def test_sides_where_the_indenter_ends_are_not_open(synthetic):
    """The indenter ends on the border at one side, inside the zone at another, and extends beyond it at two."""
    zone = synthetic.zone()
    computed = open_sides(zone, lambda points, _: np.where((points[:, 0] < -1e-3) | (points[:, 1] > 2e-3), np.inf, 0.0))
    middles = zone.points[computed].mean(axis=1)
    assert len(computed) == 3 + 4
    assert set(np.flatnonzero(np.abs(middles) == 2e-3) % 3) == {0, 1}
    assert (middles[:, 0] > -1e-3).all()
    assert (middles[:, 1] < 2e-3).all()


@pytest.mark.parametrize("how", ["too small a zone", "tilted over it", "over the whole face", "ends with it"])
def test_contact_at_zone_boundary_is_flagged(case, how):
    punch = FlatPunch(radius=1.0)
    changes = {
        "too small a zone": {"steps": (Step(1e-6), Step(1e-3))},
        "tilted over it": {"indenter": punch, "steps": (Step(1e-6), Step(1e-4, tilt=(1e-4, 0.0)))},
        "over the whole face": {"indenter": punch, "steps": (Step(1e-6), Step(1e-3))},
        "ends with it": {
            "indenter": RectangularPunch(2.5e-3, 2.5e-3),
            "steps": (Step(1e-6), Step(1e-4, tilt=(1e-4, 0.0))),
        },
    }[how]
    result = meeframe.solve_case(replace(case, **changes))
    cut = how in ("too small a zone", "tilted over it")
    assert result.steps[-1].touching.all()
    assert [step.contact_at_zone_boundary for step in result.steps] == [False, cut]
    assert ("reaches the boundary" in result.steps[-1].message) == cut
    assert summary(result)["contact_at_zone_boundary"] == summary(result)["steps"][1]["contact_at_zone_boundary"] == cut


def test_unconverged_contact_is_not_flagged(case):
    """The overlap of the whole zone is reported nevertheless."""
    dragged, stopping = Step(1e-3, translation=(1e-5, 0.0)), StoppingCriteria(max_iterations=1)
    deep = replace(case, steps=(dragged,), contact_law=IsotropicCoulomb(0.3), solver=Uzawa(), stopping=stopping)
    (step,) = meeframe.solve_case(deep).steps
    assert step.status is not Status.CONVERGED
    assert step.touching.all()
    assert not step.contact_at_zone_boundary
    assert "reaches the boundary" not in step.message
    assert "overlaps the undeformed body on the whole contact zone" in step.message
