"""Test sweeps of cases built in Python."""

from dataclasses import replace

import numpy as np
import pytest
import xarray

import meeframe

CASE = meeframe.Case(
    material="pzt-4",
    mesh=meeframe.mesh.half_space("1.4 mm", divisions=10),
    formulation=meeframe.formulation("half-space"),
    indenter=meeframe.Sphere("100 mm"),
    contact=meeframe.IsotropicCoulomb(0.3),
    steps=[meeframe.Step(approach="2 um"), meeframe.Step(translation=["0.5 um", 0], increments=2)],
)


@pytest.mark.full
def test_points_match_separate_cases():
    axes = {"mu": {"contact.law.mu": [0.1, 0.3]}, "indenter.radius": ["100 mm", "50 mm"]}
    sweep = meeframe.sweep(CASE, axes, fields=["pressure"], every_increment=True)
    changed = replace(CASE, contact=meeframe.IsotropicCoulomb(0.1), indenter=meeframe.Sphere(0.05)).solve()
    point = sweep.sel({"mu": 0.1, "indenter.radius": 0.05}, method="nearest")
    curve = changed.to_dataframe()
    for name in ("normal_force", "tangential_force_1", "translation_1"):
        np.testing.assert_allclose(point[name], curve[name], rtol=1e-8)
    pressure = changed.to_xarray()["pressure"].isel(increment=-1).transpose("y", "x")
    np.testing.assert_allclose(point["zone_pressure"], pressure, rtol=1e-6, atol=1.0)
    assert sweep["normal_force"].attrs["units"] == "N"
    assert {"charge", "max_abs_electric_potential"} <= set(sweep), "piezoelectric"
    assert not [name for name in sweep.variables if "magnetic" in name or "conductance" in name]


@pytest.mark.full
def test_points_are_stored_in_a_folder(tmp_path):
    axes = {"contact.law.mu": [0.1]}
    first = meeframe.sweep(CASE, axes, tmp_path / "out")
    (point,) = (tmp_path / "out" / "points").iterdir()
    assert meeframe.Result.load(point)[-1].loading.translation[0] == pytest.approx(0.5e-6)
    written = (point / "result.h5").stat().st_mtime_ns
    again = meeframe.sweep(CASE, axes, tmp_path / "out")
    assert again.equals(first)
    assert (point / "result.h5").stat().st_mtime_ns == written


@pytest.mark.full
@pytest.mark.parametrize("keep", [True, False])
def test_interruption_returns_the_finished_points(tmp_path, keep):
    """The dataset of the finished points is in the error and in the folder, from which the sweep continues."""
    axes, out = {"contact.law.mu": [0.1, 0.3]}, tmp_path / "out" if keep else None

    def interrupt(stage, fraction):
        if stage == "points" and fraction == 0.5:
            raise KeyboardInterrupt

    with pytest.raises(meeframe.Interrupted) as caught:
        meeframe.sweep(CASE, axes, out, progress=interrupt)
    partial = caught.value.result
    assert partial["status"].values.tolist() == ["converged", "unfinished"]
    assert np.isnan(partial["normal_force"]).values.tolist() == [False, True]
    (note,) = caught.value.__notes__
    assert ("attribute `result`" in note) is not keep
    if out is not None:
        assert "1 of 2 points are finished" in note
        assert xarray.load_dataset(out / "sweep.h5", engine="h5netcdf").equals(partial)
        whole = meeframe.sweep(CASE, axes, out)
        assert (whole["status"] == "converged").all()
        assert whole["normal_force"][0] == partial["normal_force"][0]


def test_messages_name_the_axis():
    with pytest.raises(meeframe.CaseError, match=r"^Sweep: contact\.law\.muu = 1: ") as error:
        meeframe.sweep(CASE, {"contact.law.muu": [1]})
    assert ".toml" not in str(error.value)


def test_unregistered_objects_are_rejected():
    class Law(meeframe.IsotropicCoulomb):
        pass

    with pytest.raises(meeframe.CaseError, match="no name in case files"):
        meeframe.sweep(replace(CASE, contact=Law(0.3)), {"indenter.radius": [0.1]})
