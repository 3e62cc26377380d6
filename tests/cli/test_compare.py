"""`meeframe compare`: all combinations on shared reduced systems, with the numbers that single runs have."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

import meeframe
from meeframe.case.load import load_case
from meeframe.cli import app
from meeframe.core.errors import CaseError
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.study.compare import Choice, compare

COULOMB = '{name = "isotropic-coulomb", mu = 0.2}'


def invoke(*arguments):
    """Exit status, standard output, standard error."""
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout, result.stderr


@pytest.fixture
def dragged(case_file):
    """The tiny case, dragged in its second step, with friction and a conducting contact."""
    text = case_file.read_text(encoding="utf-8")
    text += 'translation = ["2 um", 0]\n[contact]\nlaw = {name = "isotropic-coulomb", mu = 0.1}\n'
    text += '[conductivity]\nelectric = {name = "step", kappa = 1e-3}\n'
    case_file.write_text(text, encoding="utf-8")
    return case_file


@pytest.fixture
def reductions(monkeypatch):
    """Counts reduced systems."""
    seen = []
    reduce = DenseBEM.reduce

    def counted(self, body, *rest):
        seen.append(self)
        return reduce(self, body, *rest)

    monkeypatch.setattr(DenseBEM, "reduce", counted)
    return seen


def numbers(folder):
    return json.loads((folder / "compare.json").read_text(encoding="utf-8"))["runs"]


def test_combinations_have_the_numbers_of_single_runs(dragged, tmp_path, reductions):
    laws = ["--contact-law", "signorini", "--contact-law", "isotropic-coulomb", "--contact-law", COULOMB]
    solvers = ["--solver", "uzawa", "--solver", "newton"]
    status, out, _ = invoke("compare", dragged, *laws, *solvers, "--out", tmp_path / "out")
    assert status == 0
    assert len(reductions) == 1
    made = json.loads((tmp_path / "out" / "compare.json").read_text(encoding="utf-8"))
    assert (made["title"], made["case"]) == ("tiny", dragged.read_text(encoding="utf-8"))
    assert made["versions"]["meeframe"] == meeframe.__version__
    runs = made["runs"]
    assert [tuple(run["choices"].values()) for run in runs] == [
        (law, solver)
        for law in ("signorini", "isotropic-coulomb", "isotropic-coulomb mu=0.2")
        for solver in ("uzawa", "newton")
    ]
    single = meeframe.solve_case(load_case(dragged))  # mu = 0.1 by uzawa, tolerance 1e-6, as the file says
    for increment, step in zip(runs[2]["increments"], single.steps, strict=True):
        totals = meeframe.resultants(single.zone, step)
        assert increment["iterations"] == step.iterations
        np.testing.assert_allclose(increment["force"], totals.force, rtol=1e-12)
        np.testing.assert_allclose(increment["charge"], totals.charge, rtol=1e-12)
    np.testing.assert_allclose(runs[2]["fields"]["pressure"], -single.steps[-1].traction[:, 2], rtol=1e-12)
    drag = [run["increments"][-1]["force"][0] / -run["increments"][-1]["force"][2] for run in runs]
    assert drag[0] == drag[1] == 0
    assert 0 < drag[2] == pytest.approx(drag[3], rel=1e-4)
    assert drag[2] <= 0.1 + 1e-6
    assert drag[2] < drag[4] <= 0.2 + 1e-6
    assert set(runs[0]["differences"].values()) == {0.0}
    force = np.array([run["increments"][-1]["force"] for run in runs])
    expected = np.linalg.norm(force - force[0], axis=1) / np.linalg.norm(force[0])
    np.testing.assert_allclose([run["differences"]["force"] for run in runs], expected, rtol=1e-9)
    assert runs[2]["differences"]["traction_x"] is None  # nothing to measure it by in the first run
    assert (tmp_path / "out" / "sections.png").stat().st_size > 10_000
    for word in ("isotropic-coulomb", "mu=0.2", "newton", "difference in force", "iterations", "converged"):
        assert word in out


def test_formulations_and_fundamental_solutions_have_a_system_each(dragged, tmp_path, reductions):
    kernels = ["--fundamental-solution", "tabulated", "--fundamental-solution", '{name = "line-integral", points = 24}']
    status, _, _ = invoke(
        "compare", dragged, *kernels, "--solver", "newton", "--solver", "auto", "--out", tmp_path / "o"
    )
    assert status == 0
    assert [type(formulation.fundamental_solution).__name__ for formulation in reductions] == [
        "Tabulated",
        "LineIntegral",
    ]
    assert [formulation.quadrature_tolerance for formulation in reductions] == [1e-3, 1e-3]
    runs = numbers(tmp_path / "o")
    assert len(runs) == 4
    for run in runs:
        assert run["differences"]["force"] < 1e-6
        assert run["differences"]["electric_potential"] < 1e-6


def test_conductivity_laws_are_those_of_both_fields_or_of_each(dragged, tmp_path):
    each = '{magnetic = {name = "step", kappa = inf}}'
    laws = [
        "--conductivity-law",
        "insulating",
        "--conductivity-law",
        '{name = "step", kappa = inf}',
        "--conductivity-law",
    ]
    assert invoke("compare", dragged, *laws, each, "--out", tmp_path / "o")[0] == 0
    ends = [run["increments"][-1] for run in numbers(tmp_path / "o")]
    assert [(end["charge"] != 0, end["magnetic_flux"] != 0) for end in ends] == [
        (False, False), (True, True), (False, True)
    ]  # fmt: skip


def test_what_a_solver_refuses_is_told_and_the_others_go_on(dragged, tmp_path):
    solvers = ["--solver", "projected-cg", "--solver", "newton"]
    status, out, _ = invoke("compare", dragged, *solvers, "--out", tmp_path / "out")
    assert status == 1
    runs = numbers(tmp_path / "out")
    assert [run["status"] for run in runs] == ["refused", "converged"]
    assert "takes frictionless contact only" in runs[0]["message"]
    assert "projected-cg: solver 'projected-cg' takes frictionless contact only" in out


def test_a_run_that_does_not_converge_is_status_1(dragged, tmp_path):
    hasty = '{name = "uzawa", max_iterations = 1}'
    status, _, _ = invoke("compare", dragged, "--solver", "newton", "--solver", hasty, "--out", tmp_path / "out")
    assert status == 1
    assert [run["status"] for run in numbers(tmp_path / "out")] == ["converged", "iteration-limit"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "nothing to compare; give at least one of --formulation, "),
        (["--solver", "newtn"], "unknown solver 'newtn'; did you mean 'newton'?"),
        (["--solver", "newton", "--solver", "newton"], "--solver newton: given twice"),
        (["--contact-law", "orthotropic-coulomb"], ": orthotropic-coulomb: contact.law.mu1: missing key"),
        (["--contact-law", '{name = "isotropic-coulomb" mu = 1}'], "is no inline table of TOML: "),
        (["--contact-law", '{name = "isotropic-coulomb", mu = -1}'], "contact.law.mu = -1: must be >= 0"),
        (["--fundamental-solution", "isotropic"], "isotropic: formulation: fundamental solution isotropic: "),
    ],
)
def test_bad_choices_are_told_before_anything_is_computed(dragged, tmp_path, reductions, arguments, message):
    status, out, err = invoke("compare", dragged, *arguments, "--out", tmp_path / "out")
    assert (status, out) == (2, "")
    assert message in err
    assert not reductions
    assert not (tmp_path / "out").exists()


def test_results_are_not_overwritten_by_accident(dragged, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "compare.json").write_text("mine")
    status, _, err = invoke("compare", dragged, "--solver", "newton", "--out", tmp_path / "out")
    assert status == 2
    assert "is not empty" in err
    assert invoke("compare", dragged, "--solver", "newton", "--out", tmp_path / "out", "--overwrite")[0] == 0
    assert len(numbers(tmp_path / "out")) == 1


def test_what_is_finished_is_kept_if_the_run_is_stopped(dragged, tmp_path, monkeypatch):
    def stop(_):
        raise KeyboardInterrupt

    monkeypatch.setattr("meeframe.study.compare.comparison_figure", stop)
    with pytest.raises(KeyboardInterrupt):
        compare(dragged, {"solver": ["newton", "uzawa"]}, tmp_path / "out")
    assert [run["status"] for run in numbers(tmp_path / "out")] == ["converged", "converged"]


def test_labels_of_choices():
    assert Choice.read("contact-law", "signorini").label == "signorini"
    assert Choice.read("contact-law", COULOMB).label == "isotropic-coulomb mu=0.2"
    with pytest.raises(CaseError, match="is no inline table"):
        Choice.read("contact-law", "{mu}")
