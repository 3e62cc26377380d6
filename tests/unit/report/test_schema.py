"""A quantity added to the schema of results appears everywhere."""

import dataclasses
import io
import json

import h5py
import meshio
import numpy as np
import pytest
from rich.console import Console

from meeframe.results import schema
from meeframe.results.figures import figures
from meeframe.results.files import read_result, write_result
from meeframe.results.output import output_files
from meeframe.results.records import StepResult
from meeframe.results.resultants import resultants
from meeframe.results.schema import NodalField, StorageCondition, Total
from meeframe.results.summary import summary, summary_table
from meeframe.results.vtk import write_fields
from meeframe.study.reports.compare import ComparedRun, Comparison, comparison_json, comparison_table
from meeframe.study.sweep.numbers import field_units, numbers_of, units


@pytest.fixture
def extended(monkeypatch):
    """Extend the schema by a nodal field and a total."""
    work = NodalField(
        "normal_work",
        "J/m^2",
        "work of the pressure",
        lambda _, step: step.traction[:, 2] * step.displacement[:, 2],
        stored=StorageCondition.ALWAYS,
    )
    total = Total(
        "work",
        "J",
        "work of the contact",
        value=lambda zone, step: float(zone.weights @ (step.traction[:, 2] * step.displacement[:, 2])),
    )
    monkeypatch.setattr(schema, "NODAL_FIELDS", (*schema.NODAL_FIELDS, work))
    monkeypatch.setattr(schema, "TOTALS", (*schema.TOTALS, total))
    return work, total


def test_added_field_appears_everywhere(extended, synthetic, tmp_path):
    step = synthetic.step(1e-6)
    result = synthetic.result(step)
    work = 1e6 * 1e-6 * (step.region > 0)
    energy = float(synthetic.zone().weights @ work)

    write_result(tmp_path, result)
    with h5py.File(tmp_path / "result.h5") as file:
        np.testing.assert_allclose(file["steps/0001/normal_work"], work)
        assert file["steps/0001/normal_work"].attrs["units"] == "J/m^2"
        assert file["steps/0001/resultants/work"][()] == pytest.approx(energy)
        assert file["steps/0001/resultants/work"].attrs["units"] == "J"
    assert len(read_result(tmp_path).steps) == 1

    write_fields(result, tmp_path)
    np.testing.assert_allclose(meshio.read(tmp_path / "fields.vtu").point_data["work of the pressure [J/m^2]"], work)

    assert summary(result)["steps"][0]["work"] == pytest.approx(energy)
    assert "work of the contact" in text(summary_table(result))

    drawn = figures(result)
    assert drawn["normal_work"].axes[0].get_title().endswith("work of the pressure")
    assert "work of the pressure" in " ".join(axes.get_ylabel() for axes in drawn["sections"].axes)
    assert "normal_work.png" in output_files()

    assert numbers_of(synthetic.zone(), step)["work"] == pytest.approx(energy)
    assert (units()["work"], field_units()["normal_work"]) == ("J", "J/m^2")
    assert schema.label_of("work") == "work of the contact"

    runs = tuple(ComparedRun({"solver": name}, synthetic.zone(), 1, (step,)) for name in "ab")
    comparison = Comparison("", "", {}, runs)
    assert "difference in work of the pressure" in text(comparison_table(comparison))
    numbers = json.loads(comparison_json(comparison))["runs"][0]
    assert numbers["increments"][0]["work"] == pytest.approx(energy)
    np.testing.assert_allclose(numbers["fields"]["normal_work"], work)


def text(table):
    file = io.StringIO()
    Console(file=file, width=200).print(table)
    return file.getvalue()


def test_schema_is_complete(synthetic):
    """Every array of an increment can be restored from its fields, and every resultant is a total."""
    held = {row.attribute for row in schema.nodal_fields() if row.attribute}
    arrays = {name for name, value in vars(synthetic.step(1e-6)).items() if isinstance(value, np.ndarray)}
    assert held == arrays - {"history"}
    summed = resultants(synthetic.zone(), synthetic.step(1e-6))
    assert {total.name for total in schema.total_rows()} == (vars(summed).keys() - {"scalars"}) | summed.scalars.keys()
    assert held <= {field.name for field in dataclasses.fields(StepResult)}


@pytest.mark.parametrize("row", schema.nodal_fields(), ids=lambda row: row.name)
def test_fields_have_the_shapes_of_the_schema(synthetic, row):
    values = row.values(synthetic.zone(), synthetic.step(1e-6))
    assert values.shape == (25, *row.shape)
    assert (values.dtype.kind in "iu") == row.integer
