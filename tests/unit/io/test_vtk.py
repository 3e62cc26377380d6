"""Test fields.vtu as read by meshio."""

import dataclasses

import meshio
import numpy as np
import pytest

from meeframe.common.errors import ResultError
from meeframe.results.vtk import write_fields
from meeframe.system.reduced import NodalFields


def test_last_step_is_written_with_units(tmp_path, synthetic):
    result = synthetic.result(synthetic.step(1e-6), synthetic.step(2e-6))
    write_fields(tmp_path, result)
    mesh = meshio.read(tmp_path / "fields.vtu")
    np.testing.assert_array_equal(mesh.points, result.zone.points)
    np.testing.assert_array_equal(mesh.cells_dict["quad"], result.zone.cells[0][1])
    assert mesh.point_data["displacement [m]"] == pytest.approx(np.full((25, 3), 2e-6))
    assert mesh.point_data["magnetic flux [Wb/m^2]"] == pytest.approx(np.full(25, 4e-6))


def test_region_and_slip_on_the_contact_zone_only(tmp_path, synthetic):
    """An element beside the zone, in the second block, has two corners at nodes of the zone."""
    zone, step = synthetic.zone(), synthetic.step(1e-6)
    frames = np.tile([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]], (25, 1, 1))
    beside = np.array([[2e-3, -2e-3, 0], [3e-3, -2e-3, 0], [3e-3, -1e-3, 0], [2e-3, -1e-3, 0]])
    points = np.concatenate([zone.points, beside])
    fields = np.zeros((29, 5))
    name, cells = zone.cells[0]
    begun_elsewhere = np.roll(cells, 1, axis=1)
    boundary = NodalFields(points, ((name, begun_elsewhere), ("quad", np.array([[25, 26, 27, 28]]))), fields, fields)
    result = synthetic.result(dataclasses.replace(step, boundary=boundary))
    write_fields(tmp_path, dataclasses.replace(result, zone=dataclasses.replace(zone, frames=frames)))
    data = meshio.read(tmp_path / "fields.vtu").point_data
    np.testing.assert_array_equal(data["region"], [*step.region, 0, 0, 0, 0])
    expected = np.full((29, 3), np.nan)
    expected[:25] = np.column_stack([np.zeros(25), step.slip[:, 0], np.zeros(25)])  # e1 is along x2
    np.testing.assert_array_equal(data["slip [m]"], expected)
    np.testing.assert_array_equal(data["total slip [m]"], 2 * expected)


def test_missing_fields_are_rejected(tmp_path, synthetic):
    with pytest.raises(ResultError, match="no fields on the whole boundary"):
        write_fields(tmp_path, synthetic.result(dataclasses.replace(synthetic.step(1e-6), boundary=None)))
