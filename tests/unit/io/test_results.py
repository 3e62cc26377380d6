"""Test result files: round trip, self-description, interruptions while writing."""

import dataclasses

import h5py
import numpy as np
import pytest

from meeframe.common.errors import MeshError, ResultError
from meeframe.contact.problem import Status
from meeframe.mesh import read_mesh
from meeframe.results import files
from meeframe.results.output import INCREMENTS, RESULT_FILE, SERIES, check_output, clear_output, output_files, replacing
from meeframe.results.records import RunStatus, Zone


def write(folder, result, fields=None):
    writer = new_writer(folder, result, fields)
    for step in result.steps:
        writer.append(step)
    writer.finish(lambda: result)


def new_writer(folder, result, fields=None):
    """Return a writer of a result without increments."""
    return files.ResultWriter(folder, dataclasses.replace(result, steps=(), timings={}, peak_memory_mb=0.0), fields)


def assert_equal(first, second):
    """Assert that two records with arrays are bitwise identical."""
    if dataclasses.is_dataclass(first):
        assert type(first) is type(second)
        for field in dataclasses.fields(first):
            assert_equal(getattr(first, field.name), getattr(second, field.name))
    elif isinstance(first, dict):
        assert first.keys() == second.keys()
        for key in first:
            assert_equal(first[key], second[key])
    elif isinstance(first, tuple):
        assert len(first) == len(second)
        for one, other in zip(first, second, strict=True):
            assert_equal(one, other)
    elif isinstance(first, np.ndarray):
        np.testing.assert_array_equal(first, second)
    else:
        assert first == second


def test_round_trip(tmp_path, synthetic):
    result = synthetic.result(synthetic.step(1e-6), synthetic.step(2e-6, Status.CYCLING, 1, 2), planned=3)
    write(tmp_path, result)
    assert_equal(files.read_result(tmp_path), result)


def test_round_trip_of_optional_data(tmp_path, synthetic):
    area_fraction = np.linspace(0.0, 1.0, 25)
    write(
        tmp_path,
        synthetic.result(
            dataclasses.replace(synthetic.step(1e-6), area_fraction=area_fraction, contact_at_zone_boundary=True)
        ),
    )
    (step,) = files.read_result(str(tmp_path)).steps
    np.testing.assert_array_equal(step.area_fraction, area_fraction)
    assert step.contact_at_zone_boundary


def test_without_boundary_fields(tmp_path, synthetic):
    result = synthetic.result(dataclasses.replace(synthetic.step(1e-6), boundary=None))
    write(tmp_path, result)
    assert files.read_result(tmp_path).steps[0].boundary is None


def test_datasets_have_units_and_the_file_has_provenance(tmp_path, synthetic):
    write(tmp_path, synthetic.result(synthetic.step(1e-6)))
    with h5py.File(tmp_path / RESULT_FILE) as file:
        without = []
        file.visititems(
            lambda name, item: (
                without.append(name) if isinstance(item, h5py.Dataset) and "units" not in item.attrs else None
            )
        )
        assert without == []
        assert file.attrs["case"] == 'title = "a title"\n'
        assert file["steps/0001/resultants/force"].attrs["units"] == "N"
        force = file["steps/0001/resultants/force"][()]
        assert file["steps/0001/loading/prescribed/tangential_force"].attrs["units"] == "N"
        assert file["steps/0001/resultants/torque"].attrs["units"] == "N m"
    contact_zone = synthetic.zone()
    inside = np.linalg.norm(contact_zone.points[:, :2], axis=1) < 1.5e-3
    assert force == pytest.approx(
        [0.1 * 1e6 * contact_zone.weights[inside].sum(), 0.0, -1e6 * contact_zone.weights[inside].sum()]
    )


class Interrupts:
    """A message whose conversion to a string raises KeyboardInterrupt."""

    def __str__(self):
        raise KeyboardInterrupt


def test_interrupted_increment_preserves_finished_ones(tmp_path, synthetic):
    first = synthetic.step(1e-6)
    writer = new_writer(tmp_path, synthetic.result(first, planned=2))
    writer.append(first)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    with pytest.raises(KeyboardInterrupt):
        writer.append(dataclasses.replace(synthetic.step(2e-6), status=Interrupts()))
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before
    computed = files.read_result(tmp_path)
    assert computed.status is RunStatus.UNFINISHED
    assert_equal(computed.steps, (first,))


def test_unfinished_file_opens_without_meeframe(tmp_path, synthetic):
    writer = new_writer(tmp_path, synthetic.result(planned=3))
    writer.append(synthetic.step(1e-6))
    writer.append(synthetic.step(2e-6, increment=2))
    with h5py.File(tmp_path / RESULT_FILE) as file:
        assert file["steps/0002/increment"][()] == 2
        assert file.get("steps/0003") is None
        assert len(file["boundary/points"]) == 25


def test_more_than_ten_thousand_increments_are_in_order(tmp_path, synthetic):
    """Names with four digits are sorted as texts only up to that number."""
    write(tmp_path, synthetic.result(synthetic.step(1e-6), synthetic.step(2e-6, increment=2)))
    with h5py.File(tmp_path / RESULT_FILE, "r+") as file:
        file["steps"].move("0001", "9999")
        file["steps"].move("0002", "10000")
    assert [step.increment for step in files.read_result(tmp_path).steps] == [1, 2]


def test_damaged_increment_does_not_end_the_series(tmp_path, synthetic):
    writer = new_writer(tmp_path, synthetic.result(planned=2))
    writer.append(synthetic.step(1e-6))
    next((tmp_path / INCREMENTS).glob("0001*")).write_bytes(b"nonsense")
    with pytest.raises(ResultError, match=r"result\.h5 is damaged"):
        files.read_result(tmp_path)


def test_zero_fields_are_not_stored(tmp_path, synthetic):
    step = synthetic.step(1e-6)
    bare = dataclasses.replace(
        step, fluxes=0.0 * step.fluxes, dissipation=0.0 * step.dissipation, region=0 * step.region
    )
    write(tmp_path, synthetic.result(bare))
    with h5py.File(tmp_path / RESULT_FILE) as file:
        assert not {"electric_flux", "magnetic_flux", "dissipation", "region"} & file["steps/0001"].keys()
        assert "traction" in file["steps/0001"]
    assert_equal(files.read_result(tmp_path).steps, (bare,))


def test_requested_fields_are_stored(tmp_path, synthetic):
    step = synthetic.step(1e-6)
    write(tmp_path, synthetic.result(step), fields={"pressure", "gap"})
    with h5py.File(tmp_path / RESULT_FILE) as file:
        np.testing.assert_array_equal(file["steps/0001/pressure"], -step.traction[:, 2])
        np.testing.assert_array_equal(file["steps/0001/gap"], step.gap)
        assert file["steps/0001/pressure"].attrs["units"] == "Pa"
        assert "slip" not in file["steps/0001"]
        assert "boundary" not in file["steps/0001"]
    assert files.read_result(tmp_path).steps[0].boundary is None


def test_large_arrays_are_compressed(tmp_path, synthetic):
    """The zone has 10,000 nodes, of which 25 are in contact."""
    step, contact_zone = synthetic.step(1e-6), synthetic.zone()
    wide = {
        name: np.concatenate([values, np.zeros((9_975, *values.shape[1:]), values.dtype)])
        for name, values in vars(step).items()
        if isinstance(values, np.ndarray) and len(values) == 25
    }
    points = np.concatenate([contact_zone.points, np.ones((9_975, 3))])
    zone = Zone(points, np.tile(np.eye(3), (10_000, 1, 1)), np.ones(10_000), contact_zone.cells)
    result = dataclasses.replace(synthetic.result(dataclasses.replace(step, **wide, boundary=None)), zone=zone)
    write(tmp_path, result)
    assert (tmp_path / RESULT_FILE).stat().st_size < 150_000
    assert_equal(files.read_result(tmp_path), result)


def test_missing_file(tmp_path):
    with pytest.raises(ResultError, match="does not exist"):
        files.read_result(tmp_path)
    (tmp_path / RESULT_FILE).write_text("no HDF5")
    with pytest.raises(ResultError, match="cannot be read as HDF5"):
        files.read_result(tmp_path)
    with h5py.File(tmp_path / RESULT_FILE, "w") as file:
        file.attrs["format"] = "something else"
    with pytest.raises(ResultError, match="'something else' is unknown"):
        files.read_result(tmp_path)
    with h5py.File(tmp_path / RESULT_FILE, "w") as file:
        file.attrs["format"] = "meeframe-result 5"
    with pytest.raises(ResultError, match="reaches_edge is now called contact_at_zone_boundary"):
        files.read_result(tmp_path)
    with h5py.File(tmp_path / RESULT_FILE, "w") as file:
        file.attrs.update({"format": "meeframe-result 4", "case": ""})  # not compressed
    with pytest.raises(
        ResultError, match="'meeframe-result 4' is unknown; this version reads 'meeframe-result 8': run"
    ):
        files.read_result(tmp_path)


def test_damaged_file(tmp_path, synthetic):
    write(tmp_path, synthetic.result(synthetic.step(1e-6)))
    with h5py.File(tmp_path / RESULT_FILE, "r+") as file:
        del file["steps/0001/traction"]
    with pytest.raises(ResultError, match=r"damaged.*traction"):
        files.read_result(tmp_path)


def replace_values(name, values):
    """Return a modification that replaces the values of a dataset or a group of the first step."""

    def change(file):
        del file["steps/0001"][name]
        file["steps/0001"][name] = values

    return change


def replace_attribute(name, value):
    """Return a modification of an attribute of the file."""
    return lambda file: file.attrs.create(name, value)


DAMAGES = {
    "prescribed is a number": replace_values("loading/prescribed", 1.0),
    "prescribed twice": replace_values("loading/prescribed/tangential_force", [1.0, 2.0, 3.0]),
    "motions": replace_values("loading/tilt", [0.0]),
    "complex motion": replace_values("loading/approach", 1.0 + 2.0j),
    "axes": replace_values("loading/axes", [1.0, 0.0, 0.0]),
    "infinite step": replace_values("step", np.inf),
    "step is a group": lambda file: [file["steps/0001"].pop("step"), file.create_group("steps/0001/step")],
    "few tractions": replace_values("traction", [1.0, 2.0]),
    "tractions in words": replace_values("traction", "none"),
    "one gap": replace_values("initial_gap", 1.0),
    "region in words": replace_values("region", "abc"),
    "region of fractions": lambda file: replace_values("region", file["steps/0001/region"][()] + 0.5)(file),
    "history": replace_values("history", [1.0]),
    "boundary": replace_values("boundary/values", [[1.0]]),
    "zone": lambda file: [file["zone"].pop("weights"), file["zone"].create_dataset("weights", data=[1.0])],
    "cells": lambda file: file["zone/cells/0"].write_direct(np.full(file["zone/cells/0"].shape, 10**6)),
    "infinitely many steps": replace_attribute("planned_steps", np.inf),
    "versions are a list": replace_attribute("versions", "[1]"),
    "versions are numbers": replace_attribute("versions", '{"numpy": 2}'),
    "timings are a number": replace_attribute("timings", "3"),
    "timings are texts": replace_attribute("timings", '{"solve": "long"}'),
    "resultant of a scalar field": lambda file: file["steps/0001"].attrs.create(
        "scalar_fields", file["steps/0001"].attrs["scalar_fields"].replace('"magnetic_flux"', '"oagnetic_flux"')
    ),
    "title is a number": replace_attribute("title", 3.0),
}


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_modifications_are_reported_as_damage(tmp_path, synthetic, damage):
    write(tmp_path, synthetic.result(synthetic.step(1e-6)))
    with h5py.File(tmp_path / RESULT_FILE, "r+") as file:
        damage(file)
    with pytest.raises(ResultError, match=r"result\.h5 is damaged: "):
        files.read_result(tmp_path)


def test_output_folder_is_created_rejected_or_accepted(tmp_path):
    check_output(tmp_path / "a" / "b", overwrite=False)
    assert list(tmp_path.iterdir()) == []
    clear_output(tmp_path / "a" / "b")
    check_output(tmp_path / "a" / "b", overwrite=False)
    assert list((tmp_path / "a" / "b").iterdir()) == []
    (tmp_path / "a" / "b" / "notes.txt").write_text("mine")
    with pytest.raises(ResultError, match=r"not empty \(notes.txt\).*--overwrite"):
        check_output(tmp_path / "a" / "b", overwrite=False)
    check_output(tmp_path / "a" / "b", overwrite=True)
    with pytest.raises(ResultError, match=r"notes.txt cannot be written|cannot be written"):
        check_output(tmp_path / "a" / "b" / "notes.txt", overwrite=True)
    with pytest.raises(ResultError, match="cannot be written"):
        check_output(tmp_path / "c" / ("x" * 300), overwrite=True)
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_clearing_removes_only_files_of_runs(tmp_path):
    for name in (*output_files(), ".result.123.h5", "notes.txt"):
        (tmp_path / name).write_text("x")
    for folder in (INCREMENTS, SERIES):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "0001").write_text("x")
    clear_output(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_failed_replacement_preserves_the_old_file(tmp_path):
    target = tmp_path / "summary.json"
    target.write_text("old")

    def write_half():
        with replacing(target) as path:
            path.write_text("half")
            raise OSError(28, "No space left on device")

    with pytest.raises(ResultError, match=r"summary.json cannot be written: No space"):
        write_half()
    assert target.read_text() == "old"
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize(
    ("touch", "error", "text"),
    [
        (lambda path: check_output(path, False), ResultError, "output folder .* cannot be written: Permission denied"),
        (files.read_result, ResultError, r"no result in .*result\.h5 cannot be read: Permission denied"),
        (lambda path: read_mesh(path, []), MeshError, "locked: cannot be read: Permission denied"),
    ],
)
def test_folders_without_permission(tmp_path, monkeypatch, touch, error, text):
    def refused(path):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr("pathlib.Path.is_file", refused)
    with pytest.raises(error, match=text):
        touch(tmp_path / "locked")
