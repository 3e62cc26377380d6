"""Test fields.vtu as read by meshio."""

import dataclasses

import meshio
import numpy as np
import pytest

from meeframe.common.errors import ResultError
from meeframe.results.vtk import write_fields, zone_mesh
from meeframe.system.reduced import NodalFields


def test_last_step_is_written_with_units(tmp_path, synthetic):
    result = synthetic.result(synthetic.step(1e-6), synthetic.step(2e-6))
    write_fields(result, tmp_path)
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
    write_fields(dataclasses.replace(result, zone=dataclasses.replace(zone, frames=frames)), tmp_path)
    data = meshio.read(tmp_path / "fields.vtu").point_data
    np.testing.assert_array_equal(data["region"], [*step.region, 0, 0, 0, 0])
    expected = np.full((29, 3), np.nan)
    expected[:25] = np.column_stack([np.zeros(25), step.slip[:, 0], np.zeros(25)])  # e1 is along x2
    np.testing.assert_array_equal(data["slip [m]"], expected)
    np.testing.assert_array_equal(data["total slip [m]"], 2 * expected)


@pytest.mark.parametrize("member", ["fields.vtu", "fields.series/0001.vtu"])
def test_absent_phenomena_are_left_out(tmp_path, synthetic, member):
    """Neither slips of smooth surfaces, nor potentials, fluxes and wear that are zero are fields; then they are."""

    def names(**changes):
        steps = [synthetic.step(1e-6), synthetic.step(2e-6)]
        result = synthetic.result(*(dataclasses.replace(step, **(bare(step) | changes)) for step in steps))
        write_fields(result, tmp_path)
        zone = set(zone_mesh(result, result.steps[-1]).point_data)
        written = set(meshio.read(tmp_path / member).point_data)
        assert {name for name in zone if "stick" not in name} >= written - {"traction [N/m^2]"}
        return written

    def bare(step):
        none = np.zeros_like(step.potentials)
        boundary = NodalFields(
            step.boundary.points,
            step.boundary.cells,
            *(values * [1, 1, 1, 0, 0] for values in (step.boundary.values, step.boundary.fluxes)),
        )
        smooth = {"traction": step.traction * [0, 0, 1], "region": np.minimum(step.region, 1), "boundary": boundary}
        return smooth | {"potentials": none, "fluxes": none, "dissipation": np.zeros(25), "wear": np.zeros(25)}

    always = {"displacement [m]", "traction [Pa]", "region"}
    slips = {"slip [m]", "total slip [m]"}
    assert names() == always
    assert names(wear=np.full(25, 1e-9)) == always | slips | {"worn depth [m]"}
    assert names(region=np.full(25, 2)) == always | slips
    fluxes = np.zeros((25, 2))
    fluxes[3, 0] = 1.0
    assert names(fluxes=fluxes) == always | {"electric potential [V]", "electric flux [C/m^2]"}


def test_missing_fields_are_rejected(tmp_path, synthetic):
    with pytest.raises(ResultError, match="no fields on the whole boundary"):
        write_fields(synthetic.result(dataclasses.replace(synthetic.step(1e-6), boundary=None)), tmp_path)
