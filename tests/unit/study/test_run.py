"""Test runs into a folder: written files, rejected folders, interruptions."""

import copy
import gc
import io
import json
import pickle
import time
from dataclasses import dataclass, replace
from functools import wraps
from itertools import groupby

import h5py
import meshio
import numpy as np
import pytest
from rich.console import Console

import meeframe
from meeframe.common.errors import CaseError, MaterialError, MeshError, ResultError
from meeframe.contact.problem import Status
from meeframe.laws import IsotropicCoulomb, Signorini
from meeframe.material import Material
from meeframe.model.case import Output
from meeframe.model.load import load_case
from meeframe.results.figures import write_figures
from meeframe.results.files import write_result
from meeframe.results.output import RESULT_FILE, SERIES, output_files
from meeframe.results.records import StepResult
from meeframe.results.summary import summary_table
from meeframe.study import run as run_module

TWO_STEPS = '\n[[steps]]\napproach = "20 um"\n'


@pytest.fixture
def case(write_case, registry):
    return load_case(write_case(more=TWO_STEPS), registry)


@pytest.fixture
def without_figures(case):
    """Return the case without figures, which take most of the time."""
    return replace(case, output=Output(figures=False, vtu=False))


def test_all_files_are_written_and_agree(case, tmp_path):
    out = tmp_path / "new" / "out"
    result = meeframe.run(case, out)
    absent = {"electric_potential.png", "magnetic_potential.png", "stick_slip.png", "wear.png"}  # no friction
    there = {*output_files(), SERIES} - absent
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


def test_figures_and_fields_are_optional(write_case, registry, tmp_path):
    case = load_case(write_case(more="\n[output]\nfigures = false\nvtu = false\n"), registry)
    meeframe.run(case, tmp_path / "out")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["result.h5", "summary.json"]


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("fields", [None, ()])
def test_increments_in_memory_or_not_give_the_same_files(case, tmp_path, fields):
    case = replace(case, output=replace(case.output, fields=fields))
    for name, held in (("memory", True), ("folder", False)):
        run_module.run(case, tmp_path / name, held=held)
    written = {path.relative_to(tmp_path / "memory") for path in (tmp_path / "memory").rglob("*") if path.is_file()}
    for path in written:
        texts = [(tmp_path / name / path).read_bytes() for name in ("memory", "folder")]
        if path.name == "summary.json":
            texts = [{**json.loads(text), "timings": {}, "peak_memory_mb": 0.0} for text in texts]
        if path.name != RESULT_FILE:
            assert texts[0] == texts[1], path
    assert len(written) == 9
    for name in ("memory", "folder"):
        with h5py.File(tmp_path / name / RESULT_FILE, "r") as file:
            assert ("boundary" in file) == (fields is None), "the fields on the boundary are stored only if chosen"
            assert ("boundary" in file["steps/0002"]) == (fields is None)


def test_files_of_a_series_hold_the_same_fields(write_case, registry, tmp_path):
    """Slips are fields from the beginning, if they may come, and fields that nothing acts on never are."""
    slides = '\n[[steps]]\ntranslation = ["1 um", 0]\n'
    case = replace(load_case(write_case(more=slides), registry), contact_law=IsotropicCoulomb(0.3))
    meeframe.run(replace(case, output=Output(figures=False)), tmp_path / "out")
    names = [set(meshio.read(path).point_data) for path in sorted((tmp_path / "out" / SERIES).iterdir())]
    assert names[0] == names[1] == set(meshio.read(tmp_path / "out" / "fields.vtu").point_data)
    assert {"slip [m]", "electric potential [V]"} <= names[0]
    assert "worn depth [m]" not in names[0]
    steel = Material.isotropic(2e11, 0.3)
    assert run_module.possible_phenomena(replace(case, material=steel, contact_law=Signorini())) == set()


def test_fields_that_cannot_be_written_cost_nothing_else(case, tmp_path, monkeypatch):
    """All increments are solved, stored and drawn before the message, and no part of a series stays."""

    def fail(*_):
        raise ResultError("no space left")

    monkeypatch.setattr("meeframe.results.vtk.write_vtu", fail)
    more = replace(case, steps=(*case.steps, replace(case.steps[1], approach=3e-5)))
    with pytest.raises(ResultError, match="no space left"):
        meeframe.run(more, tmp_path / "out")
    assert len(meeframe.read_result(tmp_path / "out").steps) == 3
    assert (tmp_path / "out" / "pressure.png").exists()
    assert not (tmp_path / "out" / SERIES).exists()


@pytest.mark.full
@pytest.mark.parametrize(
    ("law", "draws"), [(Signorini(), True), (IsotropicCoulomb(0.3), False)], ids=["slips restored", "slips stored"]
)
def test_increments_do_not_stay_in_memory(write_case, registry, tmp_path, law, draws):
    steps = '\n[[steps]]\napproach = "20 um"\nincrements = 8\n'
    alive = set()

    def count(stage, _):
        if stage in {"writing", "figures"}:
            alive.add(sum(isinstance(each, StepResult) for each in gc.get_objects()))

    case = replace(
        load_case(write_case(more=steps), registry), contact_law=law, output=Output(figures=draws, vtu=False)
    )
    gc.collect()
    result = run_module.run(case, tmp_path / "out", progress=count, held=False)
    assert max(alive) - min(alive) <= 3, "that solved, that before, and that to start from"
    assert [step.increment for step in result.steps] == [1, *range(1, 9)]
    assert result.steps[-1].increment == result.steps[8].increment == 8
    assert [step.increment for step in result.steps[2:4]] == [2, 3]
    assert [step.increment for step in result.steps[:-3:-1]] == [8, 7]
    for number, step in enumerate(result.steps):
        np.testing.assert_array_equal(result.steps[number].slip_path, step.slip_path)
    assert meeframe.Result.of(result).select("2.5").increment == 5
    with pytest.raises(IndexError):
        result.steps[9]
    (tmp_path / "out" / RESULT_FILE).unlink()
    with pytest.raises(ResultError, match=r"result\.h5 does not exist"):
        result.steps[0]


def test_results_are_replaced_on_request_only(without_figures, tmp_path):
    out = tmp_path / "out"
    meeframe.run(without_figures, out)
    (out / "notes.txt").write_text("mine")
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    with pytest.raises(ResultError, match=r"is not empty.*--overwrite.*overwrite=True"):
        meeframe.run(without_figures, out)
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    meeframe.run(without_figures, out, overwrite=True)
    assert (out / "notes.txt").read_text() == "mine"
    assert (out / "result.h5").read_bytes() != before["result.h5"]


def test_output_is_checked_early(case, tmp_path):
    (tmp_path / "file").write_text("in the way")
    stages = []
    with pytest.raises(ResultError, match="cannot be written"):
        meeframe.run(case, tmp_path / "file" / "out", progress=lambda stage, _: stages.append(stage))
    assert stages == ["reading"]


def test_rejected_body_preserves_earlier_results(without_figures, tmp_path, monkeypatch):
    out = tmp_path / "out"
    meeframe.run(without_figures, out)
    before = {path.name: path.read_bytes() for path in out.iterdir()}

    def refuse(*_):
        raise MeshError("not with me")

    monkeypatch.setattr(type(without_figures.formulation), "reduce", refuse)
    with pytest.raises(MeshError):
        meeframe.run(without_figures, out, overwrite=True)
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


@pytest.mark.parametrize("interruption", [KeyboardInterrupt, MemoryError])
def test_interrupted_run_saves_finished_steps(without_figures, tmp_path, interruption):
    out = tmp_path / "out"
    finished = []

    def interrupt(stage, _fraction):
        finished.append(stage == "writing")
        if stage == "contact" and sum(finished):
            raise interruption

    with pytest.raises(interruption) as caught:
        meeframe.run(without_figures, out, progress=interrupt)
    assert caught.value.__notes__ == [f"1 of 2 increments are finished and in {out}"]
    result = meeframe.read_result(out)
    assert (str(result.status), len(result.steps), result.planned_steps) == ("unfinished", 1, 2)
    assert json.loads((out / "summary.json").read_text())["status"] == "unfinished"
    assert result.steps[0].traction.min() < 0


@pytest.mark.parametrize("stage", ["springs", "contact"])
def test_interruption_before_the_first_step_writes_nothing(without_figures, tmp_path, stage):
    def interrupt(current, _fraction):
        if current == stage:
            raise KeyboardInterrupt

    out = tmp_path / "deep" / "out"
    with pytest.raises(KeyboardInterrupt) as caught:
        meeframe.run(without_figures, out, progress=interrupt)
    assert caught.value.__notes__ == [f"no increment was finished; nothing was written to {out}"]
    assert not out.parent.exists()

    meeframe.run(without_figures, out)
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    with pytest.raises(KeyboardInterrupt) as caught:
        meeframe.run(without_figures, out, overwrite=True, progress=interrupt)
    assert caught.value.__notes__ == [f"no increment was finished; {out} holds the results of an earlier run as before"]
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


def test_files_of_a_failed_run_are_reported(without_figures, tmp_path, monkeypatch):
    out = tmp_path / "out"
    meeframe.run(without_figures, out)
    append = run_module.ResultWriter.append

    def fails(writer, step):
        if len(step.history) and writer.count == failing:
            raise ResultError("no space left")
        append(writer, step)

    monkeypatch.setattr(run_module.ResultWriter, "append", fails)
    for failing, message in enumerate(  # read by `fails`
        ("the results of an earlier run are gone from", "1 of 2 increments are finished and in")
    ):
        with pytest.raises(ResultError, match="no space left") as caught:
            meeframe.run(without_figures, out, overwrite=True)
        assert message in caught.value.__notes__[0]
        assert (out / RESULT_FILE).exists() == bool(failing)


def test_body_too_large_for_memory_is_invalid_input(case, tmp_path, monkeypatch):
    monkeypatch.setattr(type(case.formulation), "reduce", lambda *_: np.empty(1 << 59))
    with pytest.raises(CaseError, match="80 elements with 82 nodes need more memory than is available"):
        meeframe.run(case, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("held", [True, False])
def test_written_results_are_not_read_again(case, tmp_path, monkeypatch, held):
    """A run, its figures, its series of fields and its table read none of the increments that it has written."""

    def refuse(*_):
        raise AssertionError

    for name in ("read_result", "_read", "_get_step"):
        monkeypatch.setattr(f"meeframe.results.files.{name}", refuse)
    result = run_module.run(case, tmp_path / "out", held=held)
    Console(file=io.StringIO()).print(summary_table(result))
    monkeypatch.undo()
    assert {"pressure.png", "history.png", "fields.pvd"} <= {path.name for path in (tmp_path / "out").iterdir()}
    assert len(meeframe.read_result(tmp_path / "out").steps) == len(result.steps) == 2


def test_second_run_into_the_same_folder_is_rejected(without_figures, tmp_path):
    out, stages = tmp_path / "out", []

    def second(stage, _fraction):
        if stage == "contact" and not stages:
            with pytest.raises(ResultError, match=r"out is in use: another process writes there"):
                meeframe.run(without_figures, out, overwrite=True, progress=lambda stage, _: stages.append(stage))

    assert str(meeframe.run(without_figures, out, progress=second).status) == "converged"
    assert stages == ["reading"]
    assert len(meeframe.read_result(out).steps) == 2
    assert not (out / ".lock").exists()


def test_folder_of_a_killed_run_is_occupied(without_figures, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / ".lock").touch()
    meeframe.run(without_figures, out)
    (out / ".lock").touch()
    with pytest.raises(ResultError, match="is not empty"):
        meeframe.run(without_figures, out)
    meeframe.run(without_figures, out, overwrite=True)


@pytest.mark.parametrize(
    ("law", "more", "stored"),
    [
        ("", "", {"boundary"}),
        ('[contact.law]\nname = "isotropic-coulomb"\nmu = 0.3\n', "", {"boundary", "slip", "total_slip", "slip_path"}),
        ("", '[output]\nfields = ["gap", "pressure"]\n', {"gap", "pressure"}),
    ],
    ids=["frictionless", "friction", "asked for"],
)
def test_stored_fields(write_case, registry, tmp_path, law, more, stored):
    optional = {"boundary", "slip", "total_slip", "slip_path", "gap", "pressure"}
    case = load_case(write_case(more=f"translation = ['3 um', '0 um']\n{law}{more}"), registry)
    result = meeframe.run(replace(case, output=replace(case.output, vtu=False, figures=False)), tmp_path / "out")
    with h5py.File(tmp_path / "out" / RESULT_FILE) as file:
        assert file["steps/0001"].keys() & optional == stored
        assert not file["steps/0001"].keys() & {"electric_flux", "magnetic_flux"}
    (read,) = meeframe.read_result(tmp_path / "out").steps
    assert result.steps[0].total_slip.any()
    for name in ("slip", "total_slip", "slip_path"):
        scale = np.abs(result.steps[0].total_slip).max()
        np.testing.assert_allclose(getattr(read, name), getattr(result.steps[0], name), rtol=0.0, atol=1e-12 * scale)


def test_unknown_fields_are_rejected(write_case, registry):
    with pytest.raises(CaseError, match=r"output\.fields.*'slips'.*allowed: .*slip, total_slip"):
        load_case(write_case(more='[output]\nfields = ["slips"]\n'), registry)
    with pytest.raises(CaseError, match=r"fields: 'slips'.*allowed: .*boundary"):
        Output(fields=("slips",))


@pytest.mark.parametrize(
    ("old", "new"), [("closed", "contact_fraction"), ("covered", "area_fraction"), ("counter", "second_body")]
)
def test_renamed_fields_are_reported_by_their_new_names(write_case, registry, synthetic, old, new):
    for fails in (
        lambda: load_case(write_case(more=f'[output]\nfields = ["{old}"]\n'), registry),
        lambda: Output(fields=(old,)),
    ):
        with pytest.raises(
            CaseError, match=rf"'{old}'.*it is now called '{new}', which cannot be chosen here; allowed:"
        ):
            fails()
    with pytest.raises(AttributeError, match=rf"no attribute '{old}'; it is now called '{new}'$"):
        getattr(synthetic.step(1e-6), old)


def test_unknown_attributes_of_increments_are_named(synthetic):
    step = synthetic.step(1e-6)
    with pytest.raises(AttributeError, match=r"StepResult has no attribute 'pressures'$"):
        step.pressures  # noqa: B018
    assert copy.copy(step).step == pickle.loads(pickle.dumps(step)).step == 1


@pytest.mark.full
def test_figures_of_the_increment_chosen_in_output(write_case, registry, tmp_path):
    """The figures equal those drawn later for the same increment, and differ from those of other increments."""
    out = tmp_path / "out"
    result = meeframe.run(load_case(write_case(more='increments = 3\n[output]\nstep = "1.2"\n'), registry), out)
    same, other = (write_figures(result, tmp_path / which, which) for which in ("1.2", "last"))
    assert [path.read_bytes() == (out / path.name).read_bytes() for path in same] == [True] * len(same)
    assert (out / "pressure.png").read_bytes() != next(p for p in other if p.name == "pressure.png").read_bytes()


def test_figures_of_an_unfinished_run_show_the_peak_load(write_case, registry, tmp_path):
    case = replace(load_case(write_case(), registry), output=Output(step="4.7"))
    meeframe.run(case, tmp_path / "out")
    assert (tmp_path / "out" / "pressure.png").is_file()


def test_slips_are_restored_from_earlier_increments(write_case, registry, tmp_path):
    """Three increments follow back and forth after one that does not converge and does not count."""
    more = """
[[steps]]
translation = ["4 um", "1 um"]
increments = 2

[[steps]]
translation = ["-2 um", "0 um"]
twist = 0.001
"""
    case = load_case(write_case(more=more), registry)
    solved = meeframe.solve_case(case)
    failed = replace(solved.steps[1], status=Status.STALLED, total_slip=solved.steps[1].total_slip)
    steps = (solved.steps[0], *solved.steps[1:])
    write_result(tmp_path, replace(solved, steps=steps), {"boundary"})
    for read, whole in zip(meeframe.read_result(tmp_path).steps, steps, strict=True):
        for name in ("slip", "total_slip", "slip_path"):
            np.testing.assert_allclose(getattr(read, name), getattr(whole, name), rtol=0.0, atol=1e-18)
    write_result(tmp_path, replace(solved, steps=(solved.steps[0], failed, failed)), {"boundary"})
    read = meeframe.read_result(tmp_path).steps
    np.testing.assert_allclose(read[2].slip, read[1].slip, rtol=0.0, atol=0.0)


def test_restarted_run_stores_its_slips(write_case, registry, tmp_path):
    first, second = tmp_path / "first", tmp_path / "second"
    meeframe.run(load_case(write_case(more="translation = ['1 um', '0 um']\n"), registry), first)
    continued = write_case(more=f"translation = ['3 um', '0 um']\n[output]\nfields = []\n[restart]\nfrom = '{first}'\n")
    result = meeframe.run(replace(load_case(continued, registry), output=Output(False, False, ())), second)
    np.testing.assert_array_equal(meeframe.read_result(second).steps[0].slip_path, result.steps[0].slip_path)
    assert result.steps[0].slip_path.max() > np.abs(result.steps[0].slip).max()


def test_times_are_assigned_to_stages(case, tmp_path, monkeypatch):
    """Slow contact laws, recovery, writing and diagnostics count in their stages."""

    @dataclass(frozen=True)
    class Slow(Signorini):
        def for_increment(self, slip_path, duration):
            time.sleep(0.1)
            return self

    slow_writing = slowed(run_module.ResultWriter.append)
    monkeypatch.setattr(run_module.ResultWriter, "append", slow_writing)
    reduce = type(case.formulation).reduce

    def slow_recovery(formulation, body, progress):
        system = reduce(formulation, body, progress)
        return replace(system, recovery=slowed(system.recovery))

    monkeypatch.setattr(type(case.formulation), "reduce", slow_recovery)
    monkeypatch.setattr(type(case.formulation), "warnings", slowed(type(case.formulation).warnings))
    slow = replace(case, contact_law=Slow())
    stages = []
    timings = meeframe.run(slow, tmp_path / "out", progress=lambda stage, _: stages.append(stage)).timings
    least = {"contact": 0.2, "boundary fields": 0.2, "writing": 0.2, "diagnostics": 0.1}
    assert {stage: seconds for stage, seconds in least.items() if timings[stage] < seconds} == {}
    first = stages.index("contact")
    increment = ["contact", "diagnostics", "boundary fields", "diagnostics", "writing"]
    assert [stage for stage, _ in groupby(stages[first:])] == [
        *(*increment, "fields", *increment, "fields"),
        *("figures", "fields", "writing"),
    ]


def slowed(function):
    """Return the function with a delay of 0.1 s."""

    @wraps(function)
    def slow(*arguments, **named):
        time.sleep(0.1)
        return function(*arguments, **named)

    return slow


def test_errors_of_the_solution_name_the_case_file(tmp_path):
    """A material that loses too many digits is found when its half space is reduced."""
    path = tmp_path / "rubber.toml"
    path.write_text(
        """
        material = { name = "isotropic", young_modulus = "1 MPa", poisson_ratio = 0.49999999999 }
        mesh = { type = "half-space", contact_width = "5 mm", divisions = 4 }
        formulation = { name = "half-space" }
        indenter = { name = "sphere", radius = "100 mm" }
        steps = [{ approach = "1 um" }]
        """,
        encoding="utf-8",
    )
    message = rf"^{path}: the surface compliance has a round-off error"
    with pytest.raises(MaterialError, match=message) as raised:
        meeframe.run(path, tmp_path / "out")
    assert str(raised.value).count(str(path)) == 1
    assert not (tmp_path / "out").exists()
