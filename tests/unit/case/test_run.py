"""Runs into a folder: what is written, when it is refused, and what an interruption leaves."""

import json

import numpy as np
import pytest

import meeframe
from meeframe.common.errors import CaseError, MeshError, ResultError
from meeframe.model import run as run_module
from meeframe.model.load import load_case
from meeframe.results.output import OUTPUT_FILES

TWO_STEPS = '\n[[steps]]\napproach = "20 um"\n'


@pytest.fixture
def case(write_case, registry):
    return load_case(write_case(more=TWO_STEPS), registry)


def test_all_files_are_written_and_agree(case, tmp_path):
    out = tmp_path / "new" / "out"
    result = meeframe.run(case, out)
    there = set(OUTPUT_FILES) - {"electric_potential.png", "magnetic_potential.png"}  # springs have no potentials
    assert {path.name for path in out.iterdir()} == there
    read = meeframe.read_result(out)
    assert read.provenance.case_text == case.text
    np.testing.assert_array_equal(read.steps[1].traction, result.steps[1].traction)
    assert read.provenance.versions.keys() >= {"meeframe", "meeframe-laws", "numpy", "numba", "python"}
    summary = json.loads((out / "summary.json").read_text())
    assert summary["status"] == "converged"
    assert summary["timings"].keys() >= {"reading", "springs", "contact", "writing", "figures", "fields", "total"}
    assert summary["timings"]["total"] == pytest.approx(
        sum(seconds for stage, seconds in summary["timings"].items() if stage != "total"), rel=1e-3
    )
    assert summary["steps"][1]["force"] == pytest.approx(meeframe.resultants(result.zone, result.steps[1]).force)


def test_figures_and_fields_can_be_left_out(write_case, registry, tmp_path):
    case = load_case(write_case(more="\n[output]\nfigures = false\nvtu = false\n"), registry)
    meeframe.run(case, tmp_path / "out")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["result.h5", "summary.json"]


def test_results_are_replaced_only_when_asked(case, tmp_path):
    out = tmp_path / "out"
    meeframe.run(case, out)
    (out / "notes.txt").write_text("mine")
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    with pytest.raises(ResultError, match=r"is not empty.*--overwrite.*overwrite=True"):
        meeframe.run(case, out)
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    meeframe.run(case, out, overwrite=True)
    assert (out / "notes.txt").read_text() == "mine"
    assert (out / "result.h5").read_bytes() != before["result.h5"]


def test_output_is_tried_before_anything_is_computed(case, tmp_path):
    (tmp_path / "file").write_text("in the way")
    stages = []
    with pytest.raises(ResultError, match="cannot be written"):
        meeframe.run(case, tmp_path / "file" / "out", progress=lambda stage, _: stages.append(stage))
    assert stages == ["reading"]


def test_a_refused_body_leaves_earlier_results_alone(case, tmp_path, monkeypatch):
    out = tmp_path / "out"
    meeframe.run(case, out)
    before = {path.name: path.read_bytes() for path in out.iterdir()}

    def refuse(*_):
        raise MeshError("not with me")

    monkeypatch.setattr(type(case.formulation), "reduce", refuse)
    with pytest.raises(MeshError):
        meeframe.run(case, out, overwrite=True)
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


@pytest.mark.parametrize("interruption", [KeyboardInterrupt, MemoryError])
def test_an_interrupted_run_keeps_its_finished_steps(case, tmp_path, interruption):
    out = tmp_path / "out"
    finished = []

    def interrupt(stage, _fraction):
        finished.append(stage == "writing")
        if stage == "contact" and sum(finished):
            raise interruption

    with pytest.raises(interruption) as caught:
        meeframe.run(case, out, progress=interrupt)
    assert caught.value.__notes__ == [f"1 of 2 increments are finished and in {out}"]
    result = meeframe.read_result(out)
    assert (str(result.status), len(result.steps), result.planned_steps) == ("unfinished", 1, 2)
    assert json.loads((out / "summary.json").read_text())["status"] == "unfinished"
    assert result.steps[0].traction.min() < 0


@pytest.mark.parametrize("stage", ["springs", "contact"])
def test_interrupted_before_the_first_step_nothing_is_written(case, tmp_path, stage):
    def interrupt(current, _fraction):
        if current == stage:
            raise KeyboardInterrupt

    out = tmp_path / "deep" / "out"
    with pytest.raises(KeyboardInterrupt) as caught:
        meeframe.run(case, out, progress=interrupt)
    assert caught.value.__notes__ == [f"no step was finished; nothing was written to {out}"]
    assert not out.parent.exists()

    meeframe.run(case, out)
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    with pytest.raises(KeyboardInterrupt) as caught:
        meeframe.run(case, out, overwrite=True, progress=interrupt)
    assert caught.value.__notes__ == [f"no step was finished; {out} holds the results of an earlier run as before"]
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


def test_what_a_run_that_failed_leaves_behind_is_told(case, tmp_path, monkeypatch):
    """Earlier results that are gone, and results that cannot be read; neither hides the error itself."""
    out = tmp_path / "out"
    meeframe.run(case, out)

    def fails(folder, *_):
        raise ResultError("no space left")

    def spoils(folder, *_):
        (folder / "result.h5").write_bytes(b"nonsense")
        raise ResultError("no space left")

    for name, fault, told in (
        ("create_result", fails, "of an earlier run are gone"),
        ("append_step", spoils, "result.h5"),
    ):
        monkeypatch.setattr(run_module, name, fault)
        monkeypatch.setattr(run_module, "finish_result", lambda *_: None)
        monkeypatch.setattr(run_module, "_write_summary", lambda *_: None)
        with pytest.raises(ResultError, match="no space left") as caught:
            meeframe.run(case, out, overwrite=True)
        assert told in caught.value.__notes__[0]
        monkeypatch.undo()


def test_a_body_too_large_for_the_memory_is_bad_input(case, tmp_path, monkeypatch):
    monkeypatch.setattr(type(case.formulation), "reduce", lambda *_: np.empty(1 << 59))
    with pytest.raises(CaseError, match="80 elements with 82 nodes need more memory than there is"):
        meeframe.run(case, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_reports_see_the_result_file_only(case, tmp_path, monkeypatch):
    seen = []
    monkeypatch.setattr(run_module, "figures", lambda result: seen.append(result) or {})
    result = meeframe.run(case, tmp_path / "out")
    assert len(seen) == 1
    assert seen[0] is not result
