"""Test quantities of studies: signs, axes, divisors."""

from dataclasses import replace

import numpy as np
import pytest

from meeframe.results.resultants import resultants
from meeframe.study.quantities import largest, nodal, totals


@pytest.fixture
def rotated(synthetic):
    """Return the synthetic zone and step with e1 along global x2, so that the tangential traction is along x2."""
    zone = synthetic.zone()
    frames = np.tile([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]], (len(zone.points), 1, 1))
    return replace(zone, frames=frames), synthetic.step(1e-6)


def test_signs_of_totals(rotated):
    zone, step = rotated
    found = {name: total(resultants(zone, step)) for name, total in totals().items()}
    nodes = (np.linalg.norm(zone.points[:, :2], axis=1) < 1.5e-3).sum()
    assert found["force"] == pytest.approx(nodes * 1e-6 * 1e6)
    assert found["force_y"] == pytest.approx(0.1 * found["force"])
    assert found["force_x"] == pytest.approx(0.0, abs=1e-12)
    assert found["max_pressure"] == 1e6
    assert (found["max_electric_potential"], found["max_magnetic_potential"]) == (5.0, 7.0)
    assert found["charge"] == pytest.approx(2.0 * nodes * 1e-6)
    assert found["magnetic_flux"] == pytest.approx(-3.0 * nodes * 1e-6)


def test_fields_are_in_global_axes_and_normalised(rotated):
    zone, step = rotated
    assert nodal("traction_y", zone, step).max() == pytest.approx(1e5)
    np.testing.assert_array_equal(nodal("traction_x", zone, step), 0.0)
    np.testing.assert_array_equal(nodal("tangential_traction", zone, step)[:, 1], nodal("traction_y", zone, step))
    assert nodal("pressure", zone, step).max() == 1e6
    assert largest("traction_y", zone, step) == largest("pressure", zone, step) == 1e6
    assert largest("electric_potential", zone, step) == -5.0
    assert largest("magnetic_potential", zone, step) == 7.0
