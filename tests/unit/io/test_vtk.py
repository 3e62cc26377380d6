"""fields.vtu as ParaView sees it: read back by meshio."""

import dataclasses

import meshio
import numpy as np
import pytest

from meeframe.core.errors import ResultError
from meeframe.io.vtk import write_fields


def test_last_step_is_written_with_units(tmp_path, synthetic):
    result = synthetic.result(synthetic.step(1e-6), synthetic.step(2e-6))
    write_fields(tmp_path, result)
    mesh = meshio.read(tmp_path / "fields.vtu")
    np.testing.assert_array_equal(mesh.points, result.zone.points)
    np.testing.assert_array_equal(mesh.cells_dict["quad"], result.zone.cells[0][1])
    assert mesh.point_data["displacement [m]"] == pytest.approx(np.full((25, 3), 2e-6))
    assert mesh.point_data["magnetic flux [Wb/m^2]"] == pytest.approx(np.full(25, 4e-6))


def test_refused_without_fields(tmp_path, synthetic):
    with pytest.raises(ResultError, match="no fields on the boundary"):
        write_fields(tmp_path, synthetic.result(dataclasses.replace(synthetic.step(1e-6), boundary=None)))
