"""`meeframe verify` confirms agreement, detects an error of 2 %, and reports failed runs."""

import json
from dataclasses import dataclass, replace

import numpy as np
import pytest
from typer.testing import CliRunner

from meeframe.cli import app
from meeframe.common.errors import CaseError
from meeframe.fields.units import unit_registry
from meeframe.laws import Signorini
from meeframe.plugin.hookspecs import Record
from meeframe.plugin.registry import Entry, Kind, Provider
from meeframe.study import verify as study
from meeframe.study.reports.extrapolation import Basis
from meeframe.study.reports.verified import Verdict
from meeframe.study.reports.verify import unit_of, verification_figure, verification_json
from meeframe.study.verify import Meshes, verify

HALF_SPACE = """
title = "half space"
[material]
name = "batio3-cofe2o4"
[mesh]
type = "half-space"
half_width = "100 mm"
contact_width = "5 mm"
divisions = 12
rings = 6
[conductivity]
electric = { name = "step", kappa = inf }
[indenter]
name = "sphere"
radius = "100 mm"
[[steps]]
approach = "50 um"
"""

STIFFER = '''
"""A half space that is wrong: 2 % too stiff."""

from dataclasses import dataclass, replace

from meeframe.plugin import Formulation, Record, hookimpl, silent
from meeframe_halfspace import HalfSpace


@dataclass(frozen=True)
class Stiffer(Formulation):
    """Compliance of a half space over 1.02."""

    def check(self, body):
        HalfSpace().check(body)

    def reduce(self, body, progress=silent):
        system = HalfSpace().reduce(body, progress)
        return replace(system, matrix=system.matrix / 1.02)


@hookimpl
def meeframe_formulations():
    return [Record("stiffer", Stiffer, "half space, 2 % too stiff", "tests")]
'''


def invoke(*arguments):
    """Return exit status, standard output and standard error."""
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout, result.stderr


def numbers(folder):
    return json.loads((folder / "verify.json").read_text(encoding="utf-8"))


@pytest.fixture
def half_space(tmp_path):
    path = tmp_path / "half-space.toml"
    path.write_text(HALF_SPACE, encoding="utf-8")
    return path


@pytest.mark.full
def test_half_space_by_all_supporting_formulations(half_space, tmp_path):
    """Boundary elements and FFT agree, finite elements reject the case, and the limit is the closed form."""
    status, out, _ = invoke("verify", half_space, "--out", tmp_path / "out")
    assert status == 0
    assert "skfem refuses this case:  mesh: a semi-infinite body has no volume mesh" in out
    assert "result: agree" in out
    results = numbers(tmp_path / "out")
    assert results["verdict"] == "agree"
    assert results["case"] == HALF_SPACE
    assert list(results["refused"]) == ["skfem"]
    assert [(run["formulation"], round(1 / run["size"])) for run in results["runs"]] == [
        (name, divisions) for divisions in (5, 8, 12) for name in ("dense-bem", "half-space", "hmatrix-bem")
    ]
    pairs = {pair["quantity"]: pair for pair in results["agreements"]}
    assert {"force", "charge", "contact_area", "max_pressure", "max_magnetic_potential"} <= pairs.keys()
    assert not pairs.keys() & {"force_x", "torque", "magnetic_flux", "max_electric_potential"}, "zero, or nearly"
    for name in ("force", "charge"):
        assert abs(pairs[name]["difference"]) < 0.005 * pairs[name]["scale"]
        assert pairs[name]["verdict"] == "agree"
    exact = 21896.1  # docs/explanation/theory.md, Indentation in closed form
    for estimate in results["estimates"]:
        if estimate["quantity"] == "force":
            assert estimate["extrapolated"] == pytest.approx(exact, abs=estimate["error"])
            assert estimate["error"] < 0.01 * exact
    assert (tmp_path / "out" / "convergence.png").stat().st_size > 10_000


@pytest.mark.full
def test_formulation_2_percent_too_stiff_is_detected(half_space, tmp_path):
    plugin = tmp_path / "stiffer.py"
    plugin.write_text(STIFFER, encoding="utf-8")
    both = ["--formulation", "half-space", "--formulation", "stiffer", "--plugin", plugin]
    status, out, _ = invoke("verify", half_space, *both, "--out", tmp_path / "out")
    assert status == 1
    assert "result: disagree" in out
    pairs = {pair["quantity"]: pair for pair in numbers(tmp_path / "out")["agreements"]}
    assert pairs["force"]["verdict"] == "disagree"
    assert pairs["force"]["difference"] == pytest.approx(0.02 * pairs["force"]["scale"], rel=0.02)
    right = ["--formulation", "half-space", "--formulation", '{name = "half-space", matrix_up_to = 0}']
    assert invoke("verify", half_space, *right, "--out", tmp_path / "right")[0] == 0


@pytest.mark.full
def test_uncoupled_fields_are_not_compared(tmp_path):
    """Noise in the magnetic field of a piezoelectric body must not count as disagreement."""
    case = tmp_path / "case.toml"
    case.write_text(HALF_SPACE.replace("batio3-cofe2o4", "pzt-4"), encoding="utf-8")
    both = ["--formulation", "half-space", "--formulation", "hmatrix-bem"]
    status, out, _ = invoke("verify", case, *both, "--out", tmp_path / "out")
    assert status == 0, out
    results = numbers(tmp_path / "out")
    pairs = {pair["quantity"] for pair in results["agreements"]}
    assert {"force", "charge"} <= pairs
    assert not pairs & {"magnetic_flux", "max_magnetic_potential"}
    for run in results["runs"]:
        assert run["steps"]["1"]["max_magnetic_potential"] == 0.0


SPRINGS = ("winkler", '{name = "winkler", stiffness = "1e14 Pa/m"}')
FINE = ("divisions = 4", "divisions = 16")


def verify_case(path, registry, out, formulations=SPRINGS, **options):
    return verify(path, out, formulations, registry=registry, **options)


def test_springs_match_closed_form(write_case, registry, tmp_path):
    """With pressure k w on the overlap of a paraboloid, P = pi k R g^2 and A = 2 pi R g."""
    stiffer = '{name = "winkler", stiffness = "1.05e14 Pa/m"}'
    verification = verify_case(write_case(FINE), registry, tmp_path / "o", ("winkler", stiffer))
    assert verification.verdict is Verdict.DISAGREE
    force = next(estimate for estimate in verification.estimates if estimate.quantity == "force")
    assert force.limit.value == pytest.approx(np.pi * 1e14 * 0.1 * 1e-5**2, abs=force.limit.error)
    area = next(estimate for estimate in verification.estimates if estimate.quantity == "contact_area")
    assert area.limit.value == pytest.approx(2 * np.pi * 0.1 * 1e-5, abs=area.limit.error)
    assert area.limit.basis is Basis.FINEST


@pytest.mark.full
def test_prescribed_quantities_are_not_compared(write_case, registry, tmp_path):
    """A force is prescribed and the approach is compared."""
    force = f'normal_force = "{np.pi * 1e14 * 0.1 * 1e-5**2} N"'
    verification = verify_case(write_case(FINE, ('approach = "10 um"', force)), registry, tmp_path / "o")
    names = {estimate.quantity for estimate in verification.estimates}
    assert "approach" in names
    assert "force" not in names
    approach = next(estimate for estimate in verification.estimates if estimate.quantity == "approach")
    assert approach.limit.value == pytest.approx(1e-5, abs=approach.limit.error)
    assert approach.limit.error < 5e-7


@pytest.mark.full
def test_last_step_or_every_step(write_case, registry, tmp_path):
    path = write_case(FINE, more='\n[[steps]]\napproach = "5 um"\nincrements = 2\n')
    last = verify_case(path, registry, tmp_path / "last")
    every = verify_case(path, registry, tmp_path / "every", every_step=True)
    assert {estimate.step for estimate in last.estimates} == {2}
    assert {estimate.step for estimate in every.estimates} == {1, 2}
    forces = {e.step: e.limit.value for e in every.estimates if (e.quantity, e.formulation) == ("force", "winkler")}
    assert forces[1] == pytest.approx(4 * forces[2], rel=0.02)


def test_more_levels_and_other_factors(write_case, registry, tmp_path):
    verification = verify_case(write_case(FINE), registry, tmp_path / "o", meshes=Meshes(levels=4, factor=2.0))
    assert [round(1 / size) for size in verification.estimates[0].sizes] == [2, 4, 8, 16]
    assert len(verification.runs) == 8


def test_runs_that_do_not_converge(write_case, registry, tmp_path):
    path = write_case(FINE, ("[[steps]]", '[solver]\nname = "uzawa"\nmax_iterations = 1\n\n[[steps]]'))
    verification = verify_case(path, registry, tmp_path / "o")
    assert verification.verdict is Verdict.NOT_CONVERGED
    assert {run.status for run in verification.runs} == {"iteration-limit"}
    assert verification.estimates == ()
    assert verification_figure(verification) is None
    assert json.loads(verification_json(verification))["verdict"] == "not-converged"


def test_solver_rejects_a_case_early(write_case, registry, tmp_path):
    path = write_case(
        FINE, ("[[steps]]", '[solver]\nname = "projected-cg"\n\n[[steps]]'),
        more='\n[contact]\nlaw = {name = "isotropic-coulomb", mu = 0.1}\n',
    )  # fmt: skip
    with pytest.raises(CaseError, match=r"case\.toml: solver: .* takes frictionless contact only"):
        verify_case(path, registry, tmp_path / "o")
    assert not (tmp_path / "o").exists()


@dataclass(frozen=True)
class Failing(Signorini):
    """A law that cannot provide a law for slipped surfaces."""

    def for_increment(self, slip_path, duration):
        if slip_path.any():
            raise CaseError("the surface is worn off")
        return self


def test_error_of_a_law_is_reported(write_case, registry, tmp_path):
    entry = Entry(Kind.CONTACT_LAW, Record("wearing", Failing, "for tests", "none"), Provider("tests", "0"))
    path = write_case(
        FINE, ('approach = "10 um"', 'approach = "10 um"\ntranslation = ["1 um", 0]\nincrements = 2'),
        more='\n[contact]\nlaw = "wearing"\n',
    )  # fmt: skip
    verification = verify_case(path, replace(registry, entries=(*registry.entries, entry)), tmp_path / "o")
    assert verification.verdict is Verdict.NOT_CONVERGED
    assert {(run.status, run.message) for run in verification.runs} == {("refused", "the surface is worn off")}


def test_a_case_that_ends_without_contact_has_nothing_to_compare(write_case, registry, tmp_path):
    path = write_case(FINE, more='\n[[steps]]\napproach = "-1 um"\n')
    verification = verify_case(path, registry, tmp_path / "o")
    assert verification.verdict is Verdict.UNRESOLVED
    assert not verification.agreements


def test_interrupted_verification_saves_its_results(write_case, registry, tmp_path, monkeypatch):
    solve, count = study.solve_steps, iter(range(10))

    def stopping(*arguments, **options):
        if next(count) == 3:
            raise KeyboardInterrupt
        return solve(*arguments, **options)

    monkeypatch.setattr(study, "solve_steps", stopping)
    with pytest.raises(KeyboardInterrupt) as stopped:
        verify_case(write_case(FINE), registry, tmp_path / "o")
    assert stopped.value.__notes__ == [f"results so far are in {tmp_path / 'o' / 'verify.json'}"]
    results = numbers(tmp_path / "o")
    assert results["verdict"] == "unfinished"
    assert [run["status"] for run in results["runs"]] == ["converged"] * 3
    assert results["agreements"] == []


@pytest.mark.full
def test_reduced_systems_are_reused(write_case, registry, tmp_path):
    path = write_case(FINE)
    one, other = (verify_case(path, registry, tmp_path / name, cache=tmp_path / "cache") for name in "ab")
    assert len(list((tmp_path / "cache").iterdir())) == 3
    assert one.estimates == other.estimates


@pytest.mark.parametrize(
    ("changes", "options", "message"),
    [
        ([], {}, "mesh.divisions = 4: 3 meshes that differ by a factor of 1.1 would have 3, 4, 4"),
        ([FINE], {"formulations": ["winkler"]}, "needs at least two formulations that accept the case"),
        ([FINE], {"formulations": ["winkler", "half-space"]}, "--formulation half-space: .*mesh bounds a finite body"),
        ([FINE, ("rings = 2", "rings = 0")], {}, "mesh.rings = 0"),
    ],
)  # fmt: skip
def test_invalid_input_is_reported_early(write_case, registry, tmp_path, changes, options, message):
    meshes = Meshes(factor=1.1) if not changes else None
    with pytest.raises(CaseError, match=message):
        verify_case(write_case(*changes), registry, tmp_path / "o", meshes=meshes, **options)
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--levels", "2"], "levels = 2: allowed: 3 to 20"),
        (["--levels", "9" * 30], f"levels = {'9' * 30}: allowed: 3 to 20"),
        (["--formulation", "{name = 5}"], "unknown formulation 5; allowed: dense-bem"),
        (["--factor", "1"], "factor = 1: allowed: above 1"),
        (["--order", "9"], "order = 9: allowed: 0.5 to 4"),
    ],
)
def test_invalid_options_give_status_2(half_space, tmp_path, arguments, message):
    status, _, err = invoke("verify", half_space, *arguments, "--out", tmp_path / "o")
    assert status == 2
    assert message in err


def test_results_are_not_overwritten_without_option(half_space, tmp_path):
    (tmp_path / "o").mkdir()
    (tmp_path / "o" / "mine").write_text("mine")
    status, _, err = invoke("verify", half_space, "--out", tmp_path / "o")
    assert status == 2
    assert "is not empty" in err


@pytest.mark.full
def test_units_in_output(write_case, registry, tmp_path):
    verification = verify_case(write_case(FINE), registry, tmp_path / "o")
    for estimate in verification.estimates:
        unit_registry().Unit(unit_of(estimate.quantity))
        assert unit_of(estimate.quantity)
    assert replace(verification, runs=()).verdict is Verdict.UNFINISHED
