"""Friction agrees with closed forms on coarser grids than those of docs/validation/exact_friction.md."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).parents[3] / "validation" / "exact_friction"
EXACT, COUPLED = (0.0, True), (0.5, False)


def load(*names):
    """Return modules of the folder that import each other, and remove them from `sys.modules`: every validation has
    a study.py."""
    sys.path.insert(0, str(FOLDER))
    try:
        return [importlib.import_module(name) for name in names]
    finally:
        sys.path.remove(str(FOLDER))
        for name in names:
            sys.modules.pop(name, None)


study, elements = load("study", "elements")


@pytest.mark.parametrize(("body", "shares"), [(EXACT, (0.3, 0.9)), (COUPLED, (0.6,))])
def test_partial_slip_on_32_x_32_cells(body, shares):
    """Bounds chosen beforehand: stick radius within 2 %, traction within 3 % of its maximum except within one cell
    of the two radii, root mean square within 3 % everywhere, area of sticking cells within half a cell."""
    for row, _ in study.cattaneo(*body, 32, shares):
        assert abs(row.stick_moment) < 0.02
        assert abs(row.stick_radius) < study.ZONE / 32 / study.stick_share(row.share) / 2
        assert row.traction < 0.03
        assert row.traction_rms < 0.03
        assert abs(row.load) < 0.003


def test_margin_to_the_limit_gives_the_stick_radius():
    """Exact tractions on cells give the exact radius, and those of another force another radius."""
    exact = study.PartialSlip(study.HertzContact(study.YOUNG, 0.0, study.RADIUS, study.APPROACH), study.FRICTION)
    a, side = exact.hertz.contact_radius, study.ZONE / 64 * exact.hertz.contact_radius
    r = np.hypot(*np.meshgrid(*2 * [side * (np.arange(64) - 31.5)])).ravel()
    pressure = exact.traction(r, exact.limit_force) / study.FRICTION
    for share, expected in ((0.9, 0.0), (0.91, 0.9 ** (1 / 3) - 1), (0.6, 4 ** (1 / 3) - 1)):
        along = exact.traction(r, share * exact.limit_force)
        traction = np.column_stack([along, np.zeros_like(r), -pressure])
        stick = exact.stick_radius(0.9 * exact.limit_force)
        state = study.SlipState(r, traction, along, along, np.ones_like(r), side, a, stick, study.FRICTION)
        assert state.stick_moment_difference() == pytest.approx(expected, abs=0.005)


def test_full_reversal_and_dissipation():
    coarse, fine = (study.hysteresis(*EXACT, cells, 0.9, 8) for cells in (8, 24))
    assert fine.curve < 0.01
    assert abs(fine.dissipation - 1) < 0.02
    assert abs(fine.area - fine.dissipation) < 0.005
    assert fine.curve < coarse.curve / 2
    assert abs(fine.dissipation - 1) < abs(coarse.dissipation - 1) / 2
    assert fine.force[-1] == pytest.approx(fine.force[0], rel=1e-8), "the loop closes"
    np.testing.assert_allclose(fine.force[8], -fine.force[0], rtol=1e-8)


@pytest.mark.parametrize("poisson", [0.0, 0.2, 0.3, 0.4])
def test_bonded_flat_punch_carries_c_times_the_load(poisson):
    coarse, fine = (study.bonded_punch(poisson, cells) for cells in (8, 16))
    assert fine.factor > 1.009
    assert abs(fine.difference) < 0.05 * (fine.factor - 1) + 1e-4
    assert abs(fine.difference) < abs(coarse.difference)
    limit = 2 * fine.ratio - coarse.ratio
    assert abs(limit / fine.factor - 1) < 0.015 * (fine.factor - 1) + 1e-4


@pytest.mark.parametrize("power", [1, 2])
@pytest.mark.parametrize("poisson", [0.0, 0.3])
def test_contact_stiffness_under_full_stick(poisson, power):
    coarse, fine = (study.full_stick(power, poisson, cells, cells) for cells in (8, 16))
    assert abs(fine.stiffness_difference) < 0.01
    assert abs(fine.force_difference) < 0.01
    assert abs(fine.stiffness_difference) < abs(coarse.stiffness_difference)
    assert abs(fine.force_difference) < abs(coarse.force_difference)


def test_torsion_of_a_sphere():
    for row, _ in study.torsion(*COUPLED, 24, (0.8, 0.6)):
        assert abs(row.load) < 0.005
        assert abs(row.stick_radius) < 0.03
        assert row.traction < 0.03
    assert abs(study.twist_stiffness(*COUPLED, 24)) < 0.04


def test_partial_slip_on_boundary_elements():
    """A case file prescribes forces. Nodal tractions oscillate about the exact ones; their root mean square error is
    bounded and decreases with the element size."""
    coarse, _ = elements.drag_on_elements(8)
    drag, _ = elements.drag_on_elements(12)
    assert drag.row.traction_rms < 0.06
    assert drag.row.traction_rms < coarse.row.traction_rms
    assert abs(drag.approach) < 0.01
    assert abs(drag.row.load) < 0.01
    assert abs(drag.second_reversal) < 0.01
    assert abs(drag.row.stick_radius) < 0.03
    assert abs(drag.dissipation) < 0.03


def test_torsion_on_boundary_elements():
    row, _ = elements.torsion_on_elements(12)
    assert abs(row.load) < 0.01
    assert abs(row.stick_radius) < 0.03


def test_bonded_punch_on_boundary_elements():
    row = elements.punch_on_elements(12)
    assert abs(row.difference) < 0.1 * (row.factor - 1)
