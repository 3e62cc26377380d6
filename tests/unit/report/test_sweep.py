"""Pictures of sweeps: quantities in units that can be read."""

import numpy as np
import pytest

from meeframe.core.sweep import SweepAxis, SweepResult
from meeframe.report.sweep import SweepPlot, sweep_figure


@pytest.fixture
def sweep():
    """Pressure and area over friction and two approaches; one point has no result."""
    quantities = {
        "max_pressure": np.array([[1e9, 2e9], [3e9, np.nan], [5e9, 6e9]]),
        "contact_area": np.array([[1e-6, 2e-6], [3e-6, np.nan], [5e-6, 6e-6]]),
    }
    texts = np.full((3, 2), "converged")
    mu = SweepAxis("contact.law.mu", ("0", "0.1", "0.3"), np.array([0.0, 0.1, 0.3]), "1")
    approach = SweepAxis("approach", ("10 um", "20 um"), np.array([1e-5, 2e-5]), "m")
    return SweepResult("", (mu, approach), quantities, {"max_pressure": "Pa", "contact_area": "m^2"}, *[texts] * 3)


def test_curves_have_prefixed_units(sweep):
    pressure, area = sweep_figure(sweep, [SweepPlot(("max_pressure", "contact_area"))]).axes
    assert (pressure.get_ylabel(), area.get_ylabel()) == ("[GPa]", "[m^2]")  # a prefix of m would be squared
    np.testing.assert_allclose(pressure.lines[0].get_ydata(), [1.0, 3.0, 5.0])
    np.testing.assert_allclose(area.lines[1].get_ydata(), [2e-6, np.nan, 6e-6])


def test_maps_have_units_too(sweep):
    axes, bar = sweep_figure(sweep, [SweepPlot(("max_pressure",), kind="map")]).axes
    assert bar.get_ylabel() == "[GPa]"
    np.testing.assert_allclose(axes.collections[0].get_array().compressed(), [1.0, 3.0, 5.0, 2.0, 6.0])


def test_quantities_without_any_number_are_drawn_empty(sweep):
    nothing = {"max_pressure": np.full((3, 2), np.nan)}
    empty = SweepResult("", sweep.axes, nothing, sweep.units, sweep.status, sweep.message, sweep.key)
    (axes,) = sweep_figure(empty, [SweepPlot(("max_pressure",))]).axes
    assert axes.get_ylabel() == "[Pa]"
