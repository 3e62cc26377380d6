"""`meeframe compare` runs all combinations on shared reduced systems and gives the results of single runs."""

import json
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner

import meeframe
from meeframe.cli import app
from meeframe.common.errors import CaseError, MaterialError, MeshError, PluginError
from meeframe.fields.units import Quantity
from meeframe.formulations.base import Formulation
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.laws import IsotropicCoulomb, Signorini
from meeframe.laws.base import ConductivityLaw
from meeframe.model.load import load_case
from meeframe.plugin.hookspecs import Record
from meeframe.plugin.registry import Entry, Kind, Provider
from meeframe.results.resultants import resultants
from meeframe.study.choices import Choice
from meeframe.study.compare import compare
from meeframe.study.reports.compare import Comparison, comparison_table
from meeframe.system.reduced import silent

NESTED = '{name = "dense-bem", fundamental_solution = "reside"}'
COULOMB = '{name = "isotropic-coulomb", mu = 0.2}'


def invoke(*arguments):
    """Return exit status, standard output and standard error."""
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout, result.stderr


@pytest.fixture
def dragged(case_file):
    """Return the tiny case with friction and conduction, dragged in its second step."""
    text = case_file.read_text(encoding="utf-8")
    text += 'translation = ["2 um", 0]\n[contact]\nlaw = {name = "isotropic-coulomb", mu = 0.1}\n'
    text += '[conductivity]\nelectric = {name = "step", kappa = 1e-3}\n'
    case_file.write_text(text, encoding="utf-8")
    return case_file


@pytest.fixture
def reductions(monkeypatch):
    """Return a list that counts reduced systems."""
    calls = []
    reduce = DenseBEM.reduce

    def counted(self, body, *rest):
        calls.append(self)
        return reduce(self, body, *rest)

    monkeypatch.setattr(DenseBEM, "reduce", counted)
    return calls


def numbers(folder):
    return json.loads((folder / "compare.json").read_text(encoding="utf-8"))["runs"]


@pytest.mark.full
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
    single = meeframe.solve_case(load_case(dragged))  # mu = 0.1 by uzawa with tolerance 1e-6, as in the file
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
    assert (
        runs[2]["differences"]["traction_x"] is None
    )  # the first run has no value to which the difference could be relative
    assert (tmp_path / "out" / "sections.png").stat().st_size > 10_000
    words = ("isotropic-coulomb", "mu=0.2", "newton", "difference in force", "iterations", "converged", "compilation")
    for word in words:
        assert word in out
    assert "meeframe verify" not in out, "one formulation"


@pytest.mark.full
def test_histories_are_compared_where_the_indenter_touches(write_case, laws, tmp_path):
    """Without --step, a history that ends without contact is compared at its peak load, any other one at its end."""
    loading = '\nincrements = 2\n[[steps]]\napproach = "5 um"\n'
    folder, solvers = tmp_path / "out", {"solver": ["newton", "uzawa"]}

    def shown(more, step=None):
        comparison = compare(write_case(more=loading + more), solvers, folder, True, registry=laws, step=step)
        first, _ = numbers(folder)
        return comparison.heading, max(first["fields"]["pressure"])

    away = '[[steps]]\napproach = "-1 um"\n'
    assert shown(away) == ("tiny, step 1, increment 2", pytest.approx(1e9))
    assert shown("") == ("tiny, step 2", pytest.approx(5e8))
    assert shown(away, "last") == ("tiny, step 3", 0.0)
    assert shown(away, "1.1") == ("tiny, step 1, increment 1", pytest.approx(5e8))
    with pytest.raises(CaseError, match=r"output.step = '4': is not an increment of the case"):
        shown(away, "4")


@pytest.mark.full
def test_one_system_for_each_formulation_and_fundamental_solution(dragged, tmp_path, reductions):
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


@pytest.mark.full
def test_conductivity_laws_of_both_fields_or_of_each(dragged, tmp_path):
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


def test_rejected_solver_is_reported_and_others_run(dragged, tmp_path):
    solvers = ["--solver", "projected-cg", "--solver", "newton"]
    status, out, _ = invoke("compare", dragged, *solvers, "--out", tmp_path / "out")
    assert status == 1
    runs = numbers(tmp_path / "out")
    assert [run["status"] for run in runs] == ["refused", "converged"]
    assert [run["differences"]["force"] for run in runs] == [None, 0.0], "measured by the first that is not refused"
    assert "takes frictionless contact only" in runs[0]["message"]
    assert "projected-cg: solver: solver 'projected-cg' takes frictionless contact only" in out


def test_run_that_does_not_converge_gives_status_1(dragged, tmp_path):
    hasty = '{name = "uzawa", max_iterations = 1}'
    status, _, _ = invoke("compare", dragged, "--solver", "newton", "--solver", hasty, "--out", tmp_path / "out")
    assert status == 1
    assert [run["status"] for run in numbers(tmp_path / "out")] == ["converged", "iteration-limit"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "nothing to compare; give at least one of --formulation, "),
        (["--solver", "newtn"], "unknown solver 'newtn'; did you mean 'newton'?"),
        (["--solver", "newton", "--solver", "newton"], "--solver newton: is given twice"),
        (["--contact-law", "orthotropic-coulomb"], ": orthotropic-coulomb: contact.law.mu1: missing key"),
        (["--contact-law", '{name = "isotropic-coulomb" mu = 1}'], "is not an inline table of TOML: "),
        (["--contact-law", '{name = "isotropic-coulomb", mu = -1}'], "contact.law.mu = -1: must be >= 0"),
        (["--fundamental-solution", "isotropic"], "isotropic: formulation: fundamental solution isotropic: "),
        (["--solver", "newton", "--solver", '{name = "newtn"}'], ": newtn: solver.name: unknown solver 'newtn'"),
        (
            ["--formulation", "dense-bem", "--formulation", NESTED],
            "formulation.fundamental_solution.name: unknown fundamental solution 'reside'; did you mean 'residue'?",
        ),
        (["--solver", "newton", "--solver", "uzawa", "--contact-law", "tresca"], ": tresca, newton: contact.law.limit"),
    ],
)
def test_invalid_choices_are_reported_early(dragged, tmp_path, reductions, arguments, message):
    status, out, err = invoke("compare", dragged, *arguments, "--out", tmp_path / "out")
    assert (status, out) == (2, "")
    assert message in err
    assert not reductions
    assert not (tmp_path / "out").exists()


def test_results_are_not_overwritten_without_option(dragged, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "compare.json").write_text("mine")
    status, _, err = invoke("compare", dragged, "--solver", "newton", "--out", tmp_path / "out")
    assert status == 2
    assert "is not empty" in err
    assert invoke("compare", dragged, "--solver", "newton", "--out", tmp_path / "out", "--overwrite")[0] == 0
    assert len(numbers(tmp_path / "out")) == 1


def test_interrupted_comparison_saves_finished_runs(dragged, tmp_path, monkeypatch):
    def stop(_):
        raise KeyboardInterrupt

    monkeypatch.setattr("meeframe.study.compare.comparison_figure", stop)
    with pytest.raises(KeyboardInterrupt):
        compare(dragged, {"solver": ["newton", "uzawa"]}, tmp_path / "out")
    assert [run["status"] for run in numbers(tmp_path / "out")] == ["converged", "converged"]


def test_labels_of_choices():
    nested = '{electric = {name = "step", kappa = inf}}'
    assert Choice.read("conductivity-law", nested).label == "electric=(step kappa=inf)"
    assert Choice.read("contact-law", "signorini").label == "signorini"
    assert Choice.read("contact-law", COULOMB).label == "isotropic-coulomb mu=0.2"
    with pytest.raises(CaseError, match="is not an inline table"):
        Choice.read("contact-law", "{mu}")
    for mu in ("9" * 5000, "0x" + "f" * 4000, "[" * 5000 + "]" * 5000):
        with pytest.raises(CaseError, match="is not an inline table"):
            Choice.read("contact-law", f"{{mu = {mu}}}")


@dataclass(frozen=True)
class Adhesive(Signorini):
    """Frictionless surfaces that attract each other."""

    strength: Annotated[float, Quantity("Pa", ge=0)] = 1e7

    def adhesion(self, gap):
        return self.strength / (1.0 + gap / 1e-5) ** 3


@dataclass(frozen=True)
class CompliantLayer(Signorini):
    """A layer on the surface whose compression is proportional to the pressure."""

    stiffness: Annotated[float, Quantity("Pa/m", gt=0)] = 1e14

    def resolve(self, trial, gap, r):
        normal = np.minimum(trial[:, 2], 0.0) / (1.0 + r[0] / self.stiffness)
        return np.column_stack([np.zeros((len(trial), 2)), normal])


@dataclass(frozen=True)
class Weakening(IsotropicCoulomb):
    """Coulomb friction with a coefficient that decreases with the mean slip path before the increment."""

    def for_increment(self, slip_path, duration):
        return replace(self, mu=self.mu / (1.0 + slip_path.mean() / 1e-6))


@dataclass(frozen=True)
class RateDependent(Signorini):
    """A law that requires the duration of a load step."""

    needs_duration: ClassVar[bool] = True


@dataclass(frozen=True)
class HalfSpaceOnly(Formulation):
    """A formulation that supports half spaces only."""

    def check(self, body):
        if not body.mesh.semi_infinite:
            raise MeshError("the mesh bounds a finite body")

    def reduce(self, body, progress=silent):
        raise AssertionError("nothing is computed of a body that was refused")


@dataclass(frozen=True)
class AirGap(ConductivityLaw):
    """A layer of air as thick as the gap, or a micrometre in contact."""

    across_gap: ClassVar[bool] = True
    permittivity: Annotated[float, Quantity("F/m", "H/m", gt=0)] = 8.9e-12

    def conductivity(self, normal_traction, gap, drop):
        return self.permittivity / (1e-6 + gap)


@pytest.fixture
def laws(registry):
    """Return the registry with installed plugins, springs, a law of each class, and a formulation that rejects
    finite bodies."""
    contact = {"sticky": Adhesive, "soft": CompliantLayer, "slowing": Weakening, "timed": RateDependent}
    new = [
        *((Kind.CONTACT_LAW, name, law) for name, law in contact.items()),
        (Kind.CONDUCTIVITY_LAW, "air", AirGap),
        (Kind.FORMULATION, "unbounded", HalfSpaceOnly),
    ]
    entries = [Entry(kind, Record(name, law, "for tests", "none"), Provider("tests", "0")) for kind, name, law in new]
    return replace(registry, entries=(*registry.entries, *entries))


def compare_runs(path, laws, out, **options):
    """Return the runs of a comparison from Python by label."""
    made = compare(path, {key.replace("_", "-"): value for key, value in options.items()}, out, registry=laws)
    return {run.label: run for run in made.runs}


def test_laws_of_different_classes_share_a_system(write_case, laws, tmp_path):
    """Each law has a closed form on springs; the table shows tension under attraction."""
    path = write_case(more='\n[[steps]]\ntranslation = ["9 um", 0]\nincrements = 2\n')
    table = '{name = "slowing", mu = 0.3}'
    runs = compare_runs(
        path, laws, tmp_path / "o", contact_law=["signorini", "sticky", "soft", table], solver=["auto", "uzawa"]
    )
    assert {run.status for run in runs.values()} == {"converged"}
    assert len({run.system_seconds for run in runs.values()}) == 1
    ends = {label: resultants(run.zone, run.steps[-1]) for label, run in runs.items()}
    hard = ends["signorini, auto"].normal_force
    assert ends["soft, auto"].normal_force == pytest.approx(hard / 2, rel=1e-8), "a layer as stiff as the springs"
    assert ends["sticky, auto"].normal_force < hard
    assert ends["sticky, auto"].max_tension > 0.0
    slowing = [resultants(run.zone, step) for run in [runs["slowing mu=0.3, auto"]] for step in run.steps]
    first, second = (total.tangential_force[0] / total.normal_force for total in slowing[1:])
    path_before = runs["slowing mu=0.3, auto"].steps[1].slip_path.mean()
    assert first == pytest.approx(0.3, rel=1e-8)
    assert second == pytest.approx(0.3 / (1.0 + path_before / 1e-6), rel=1e-8)
    for label in ("signorini", "sticky", "soft", "slowing mu=0.3"):
        one, other = ends[f"{label}, auto"], ends[f"{label}, uzawa"]
        assert one.normal_force == pytest.approx(other.normal_force, rel=1e-7)
    console = Console(width=300)
    with console.capture() as caught:
        console.print(comparison_table(Comparison("", "", {}, tuple(runs.values()))))
    rows = [line for line in caught.get().splitlines() if "largest tension" in line]
    assert [row.split().count("0") for row in rows] == [2, 4], "four runs side by side, the second two with tension"


def test_conductivities_across_the_gap_are_compared(write_case, laws, tmp_path):
    path = write_case(('"10 um"', '"10 um"\nelectric_potential = "1 kV"'))
    runs = compare_runs(path, laws, tmp_path / "o", conductivity_law=["insulating", "air"])
    charges = [resultants(run.zone, run.steps[-1]).charge for run in runs.values()]
    assert [run.status for run in runs.values()] == ["converged", "converged"]
    assert charges[0] == 0.0
    assert charges[1] < 0.0


HEATED = """
formulation = "half-space"
[material]
name = "isotropic"
young_modulus = "200 GPa"
poisson_ratio = 0.3
thermal_conductivity = 40
thermal_expansion = 1.2e-5
[mesh]
type = "half-space"
contact_width = "2.4 mm"
divisions = 7
[conductivity.thermal]
name = "step"
kappa = "2e4 W/m^2/K"
[indenter]
name = "sphere"
radius = "100 mm"
temperature = "100 K"
[[steps]]
normal_force = "1 kN"
"""
HARDENED = """
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from meeframe.plugin import ConductivityLaw, Quantity, Record, hookimpl


@dataclass(frozen=True)
class PlasticSpots(ConductivityLaw):
    conductance: Annotated[float, Quantity("W/m^2/K", ge=0)]
    hardness: Annotated[float, Quantity("Pa", gt=0)]

    def conductivity(self, normal_traction, gap, drop):
        return self.conductance * (np.maximum(-normal_traction, 0.0) / self.hardness) ** 0.95


@hookimpl
def meeframe_conductivity_laws():
    return [Record("plastic-spots", PlasticSpots, "Conductance of plastic asperities", "tests")]
"""


@pytest.mark.full
def test_laws_of_thermal_conductance_are_compared_with_one_of_a_file(tmp_path):
    """A law in one file conducts heat like a law that is installed; poor contact lets less heat through."""
    case, module = tmp_path / "heated.toml", tmp_path / "plastic_spots.py"
    case.write_text(HEATED, encoding="utf-8")
    module.write_text(HARDENED, encoding="utf-8")
    own = '{name = "plastic-spots", conductance = "5000 W/m^2/K", hardness = "100 MPa"}'
    laws = {
        "insulating": '"insulating"',
        "perfect": '{name = "step", kappa = inf}',
        "film": '{name = "step", kappa = "2e4 W/m^2/K"}',
        "rough": '{name = "power-law", reference_conductivity = "5000 W/m^2/K", reference_pressure = "100 MPa"}',
        "own": own,
        "gas": '{name = "across-gap", gap_constant = "0.026 W/m/K", residual_gap = "1 um", contact_conductivity = 2e4}',
    }
    options = [text for law in laws.values() for text in ("--conductivity-law", f"{{thermal = {law}}}")]
    status, out, err = invoke("compare", case, "--plugin", module, *options, "--out", tmp_path / "out")
    assert status == 0, err
    assert "heat out of the body" in out
    runs = dict(zip(laws, numbers(tmp_path / "out"), strict=True))
    heat = {name: -run["increments"][-1]["heat"] for name, run in runs.items()}
    assert heat["insulating"] == 0.0
    assert heat["own"] == pytest.approx(heat["rough"], rel=1e-9)
    assert 0.0 < heat["film"] < heat["gas"]
    assert heat["film"] < heat["perfect"]
    pressure = {name: run["increments"][-1]["max_pressure"] for name, run in runs.items()}
    assert pressure["insulating"] < pressure["film"] < pressure["perfect"], "the heated body bulges"
    assert runs["perfect"]["increments"][-1]["max_abs_temperature"] == pytest.approx(100.0)
    status, out, err = invoke("plugins", "check", module, "--with", own, "--pressure", "1e8")
    assert status == 0, out + err


def test_wear_laws_are_compared(write_case, laws, tmp_path):
    """Springs of the stiffness K wear by d (1 - 1 / (1 + k K s)); a name takes the coefficient of the case file."""
    press = ('approach = "10 um"', 'approach = "10 um"\nsliding = 0')
    wear = '\n[contact.wear]\nname = "archard"\ncoefficient = 1e-13\n[[steps]]\nsliding = "0.2 m"\n'
    table = '{name = "archard", coefficient = "3e-13 1/Pa"}'
    runs = compare_runs(write_case(press, more=wear), laws, tmp_path / "o", wear_law=["archard", table])
    for run, coefficient in zip(runs.values(), (1e-13, 3e-13), strict=True):
        expected = 10e-6 * (1.0 - 1.0 / (1.0 + coefficient * 1e14 * 0.2))
        assert run.steps[-1].wear.max() == pytest.approx(expected, rel=1e-9)
    first, second = numbers(tmp_path / "o")
    assert second["increments"][-1]["worn_volume"] > first["increments"][-1]["worn_volume"] > 0.0
    assert max(second["fields"]["wear"]) == pytest.approx(expected, rel=1e-9)
    with pytest.raises(PluginError, match=r"unknown wear law 'archer'; did you mean 'archard'\?"):
        compare(write_case(), {"wear-law": ["archer"]}, tmp_path / "p", registry=laws)


def test_formulations_of_both_bodies_or_of_each(write_case, laws, tmp_path, second_body):
    """Beds of springs in series have the stiffnesses 1e14 and 3e14 Pa/m in the case file."""
    both = '{name = "winkler", stiffness = "2e14 Pa/m"}'
    each = '{body = {name = "winkler", stiffness = "4e14 Pa/m"}, second_body = {name = "winkler", stiffness = 4e14}}'
    one = '{second_body = {name = "winkler", stiffness = "1e14 Pa/m"}}'
    made = compare(
        write_case(more=second_body), {"formulation": ["winkler", both, each, one]}, tmp_path / "o", registry=laws
    )
    forces = [resultants(run.zone, run.steps[-1]).normal_force for run in made.runs]
    np.testing.assert_allclose(np.array(forces) / forces[0], np.array([0.75, 1.0, 2.0, 0.5]) / 0.75, rtol=1e-9)


@pytest.mark.full
def test_formulation_without_a_name_is_the_default(write_case, laws, tmp_path):
    """The case file may begin with a byte order mark."""
    file = write_case()
    file.write_text(file.read_text(encoding="utf-8"), encoding="utf-8-sig")
    made = compare(file, {"formulation": ["{quadrature_tolerance = 1e-3}"]}, tmp_path / "o", registry=laws)
    named = {"formulation": ['{name = "dense-bem", quadrature_tolerance = 1e-3}']}
    same = compare(file, named, tmp_path / "p", registry=laws)
    np.testing.assert_array_equal(made.runs[0].steps[0].traction, same.runs[0].steps[0].traction)
    assert made.text == file.read_text(encoding="utf-8-sig")


def test_unknown_bodies_are_rejected(write_case, laws, tmp_path):
    with pytest.raises(CaseError, match="no body 'second_body'; allowed: a name, or body"):
        compare(write_case(), {"formulation": ['{second_body = "winkler"}']}, tmp_path / "o", registry=laws)
    expected_message = (
        "formulation boddy=winkler: unknown key 'boddy'; did you mean 'body'[?] allowed: name, body, .*tolerance"
    )
    with pytest.raises(CaseError, match=expected_message):
        compare(write_case(), {"formulation": ['{boddy = "winkler"}']}, tmp_path / "o", registry=laws)


@pytest.mark.full
def test_fundamental_solutions_apply_where_supported(write_case, laws, tmp_path):
    """Springs take no fundamental solution and therefore run once."""
    coarse = '{name = "dense-bem", quadrature_tolerance = 1e-2}'
    options = {"formulation": ["winkler", coarse], "fundamental-solution": ["tabulated", "residue"]}
    made = compare(write_case(), options, tmp_path / "both", registry=laws)
    label = Choice.read("formulation", coarse).label
    assert [run.label for run in made.runs] == ["winkler, -", f"{label}, tabulated", f"{label}, residue"]
    assert [run.status for run in made.runs] == ["converged"] * 3
    with pytest.raises(CaseError, match="--fundamental-solution: the formulation takes no fundamental solution"):
        compare(write_case(), {"fundamental-solution": ["residue"]}, tmp_path / "none", registry=laws)


@pytest.mark.full(except_for=3)
@pytest.mark.parametrize(
    ("option", "values", "refusal"),
    [
        (
            "contact-law",
            ["timed", "signorini"],
            "load step 1 has no duration, which the contact law RateDependent needs",
        ),
        ("formulation", ["winkler", "unbounded"], "mesh: the mesh bounds a finite body"),
        ("contact-law", ["signorini", "orthotropic-coulomb"], "contact.law.mu1: missing key"),
        ("contact-law", ["signorini", COULOMB.replace("0.2", "-1")], "contact.law.mu = -1: must be >= 0"),
    ],
)
def test_unsuitable_choices_are_reported_and_others_run(write_case, laws, tmp_path, option, values, refusal):
    made = compare(write_case(), {option: values, "solver": ["newton", "uzawa"]}, tmp_path / "o", registry=laws)
    refused = {"refused": 2, "converged": 2}
    assert {status: [run.status for run in made.runs].count(status) for status in refused} == refused
    for run, number in zip(made.runs, numbers(tmp_path / "o"), strict=True):
        assert (run.status, run.choices) == (number["status"], number["choices"])
        assert run.status == "converged" or refusal in run.refusal == number["message"]
        assert len(number["points"]) == 25
    single = meeframe.solve_case(load_case(write_case(), laws))
    for run in made.runs:
        for step in run.steps:
            np.testing.assert_allclose(step.traction[:, 2], single.steps[0].traction[:, 2], rtol=1e-7, atol=1e-3)


def test_rejected_formulation_is_reported_and_others_run(write_case, laws, tmp_path, monkeypatch):
    def refuse(*_):
        raise MaterialError("not this material")

    monkeypatch.setattr(DenseBEM, "reduce", refuse)
    made = compare(write_case(), {"formulation": ["dense-bem", "winkler"]}, tmp_path / "o", registry=laws)
    assert [(run.status, run.refusal) for run in made.runs] == [("refused", "not this material"), ("converged", "")]
    assert [run["status"] for run in numbers(tmp_path / "o")] == ["refused", "converged"]


def test_interruption_names_the_folder_of_finished_increments(case_file, tmp_path, monkeypatch):
    def stopped(*arguments, **options):
        yield next(meeframe.model.solve.solve_steps(*arguments, **options))
        raise KeyboardInterrupt

    monkeypatch.setattr("meeframe.study.compare.solve_steps", stopped)
    status, _, err = invoke("compare", case_file, "--solver", "newton", "--out", tmp_path / "o")
    assert status == 130
    assert err.splitlines()[-1] == f"interrupted; results so far are in {tmp_path / 'o' / 'compare.json'}"
    (run,) = json.loads((tmp_path / "o" / "compare.json").read_text())["runs"]
    assert run["status"] == "unfinished"
