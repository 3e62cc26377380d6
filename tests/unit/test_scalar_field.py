"""An additional scalar field, a decoupled potential that satisfies Laplace's equation, works in the whole framework.

Added to a magneto-electro-elastic body, it changes no other field and agrees with the same problem solved alone.
"""

import json
import re
from dataclasses import replace
from functools import cache
from io import StringIO
from pathlib import Path
from typing import Any

import h5py
import meshio
import numpy as np
import pytest
from meeframe_halfspace import HalfSpace
from meeframe_hmatrix import HierarchicalBEM
from meeframe_skfem import FiniteElements
from rich.console import Console

from meeframe import load_case, solve_case
from meeframe.common.errors import CaseError
from meeframe.contact.channels import flux_channels
from meeframe.contact.problem import ContactProblem, ContactState, Status
from meeframe.elements import Quad4
from meeframe.fields import MECHANICAL, MEE, POTENTIALS, THERMAL_FIELD, Array, FieldSet
from meeframe.formulations.base import Formulation
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.laws import IsotropicCoulomb, Signorini, StepConductivity
from meeframe.material import Material, library_material, rotation_about
from meeframe.mesh import block_mesh, half_space_mesh
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.plugin import registry as plugins
from meeframe.results.figures import figures
from meeframe.results.files import read_result, write_result
from meeframe.results.resultants import resultants
from meeframe.results.summary import summary, summary_table
from meeframe.results.sweep_files import dataset
from meeframe.results.vtk import write_fields
from meeframe.solvers import Auto, StoppingCriteria, solve
from meeframe.study.compare import compare
from meeframe.study.declare import load_study
from meeframe.study.reports.compare import comparison_figure, comparison_table
from meeframe.study.reports.sweep import sweep_figure, sweep_table
from meeframe.study.reports.verified import Verdict
from meeframe.study.reports.verify import verification_table
from meeframe.study.solve import solve_study
from meeframe.study.sweep.run import sweep
from meeframe.study.verify import verify
from meeframe.system.reduced import ReducedSystem
from meeframe.testing import check_formulation
from meeframe.testing.capabilities import check_capabilities, check_edge_resultants
from meeframe.testing.manufactured import LinearField, prescribe

HEAT = THERMAL_FIELD
CONDUCTIVITY = np.array([[3.0, 0.2, 0.0], [0.2, 2.5, 0.1], [0.0, 0.1, 3.5]])
LAWS = StepConductivity(1e-5), StepConductivity(0.4)
KAPPA = 700.0
POTENTIAL = 12.0
FORMULATIONS: dict[str, Formulation] = {
    "half-space": HalfSpace(matrix_up_to=0),
    "half-space with a matrix": HalfSpace(matrix_up_to=10_000),
    "dense-bem": DenseBEM(quadrature_tolerance=1e-8),
}
CRITERIA = StoppingCriteria(tolerance=1e-11)

CASE = """
title = "warm sphere"
formulation = "half-space"
[material]
name = "isotropic"
young_modulus = "200 GPa"
poisson_ratio = 0.3
thermal_conductivity = [[3.0, 0.2, 0.0], [0.2, "2.5 W/m/K", 0.1], [0.0, 0.1, 3.5]]
[mesh]
type = "half-space"
contact_width = "4 mm"
divisions = 15
[contact.law]
name = "isotropic-coulomb"
mu = 0.3
[conductivity]
thermal = {name = "step", kappa = 700}
[indenter]
name = "sphere"
radius = "100 mm"
temperature = "10 K"
[[steps]]
approach = "15 um"
[[steps]]
heat = "2 mW"
"""
SWEEP = """
[[points]]
label = "warm"
set = {"indenter.temperature" = 5.0}
[[points]]
label = "warmer"
set = {"indenter.temperature" = 10.0}
[[points]]
label = "without the field"
set = {"material" = {name = "batio3-cofe2o4"}, "conductivity" = {}, "indenter" = {name = "sphere", radius = "100 mm"}}
"""
CURVES = """
title = "temperatures"
case = "warm.toml"
kind = "curves"
quantities = {max_temperature = "reference", heat = 1.0}
[references]
reference = {}
[[panels]]
title = "contact"
axis = "conductance"
vary = "conductivity.thermal.kappa"
values = [350.0, 700.0]
"""


def reduced(formulation: Formulation, stiffness: Array, fields: FieldSet) -> ReducedSystem:
    cells = 6 if isinstance(formulation, DenseBEM) else 15
    mesh = half_space_mesh((0.1, 0.1), (0.005, 0.005), (cells, cells), 3, Quad4())
    return formulation.reduce(Body(stiffness, mesh, (), "contact", fields))


def indentation(
    system: ReducedSystem, fields: FieldSet, laws: Any, potentials: Any, drag: float = 0.0
) -> ContactProblem:
    x, y = system.points[:, :2].T
    gap = (x**2 + y**2) / 0.2 - 2e-5
    law = IsotropicCoulomb(0.3) if drag else Signorini()
    slid = np.tile([drag, 0.0], (len(gap), 1))
    return ContactProblem(
        system, law, flux_channels(*laws, fields=fields), gap, slid, np.tile(potentials, (len(gap), 1))
    )


def solve_problem(problem: ContactProblem) -> ContactState:
    solution = solve(problem, Auto(), CRITERIA)
    assert solution.status is Status.CONVERGED, solution.message
    return solution.state


def equal(one: Array, other: Array, tolerance: float = 1e-7) -> None:
    np.testing.assert_allclose(one, other, rtol=0.0, atol=tolerance * np.abs(other).max(initial=1e-300))


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("drag", [0.0, 3e-6], ids=["frictionless", "friction"])
@pytest.mark.parametrize("name", FORMULATIONS)
def test_scalar_field_agrees_with_separate_problem(name: str, drag: float) -> None:
    """The scalar alone is the electric potential of an uncoupled body with the coefficient as permittivity.

    It is conducted across the contact of the coupled body, so the reference has the gap and the law of that contact.
    """
    material = library_material("batio3-cofe2o4")
    warm, formulation = material.with_field(HEAT, CONDUCTIVITY), FORMULATIONS[name]
    fields = warm.fields
    assert fields == FieldSet((*MEE.scalars, HEAT))
    given = 2e3, -3.0
    two = solve_problem(indentation(reduced(formulation, material.stiffness, MEE), MEE, LAWS, given, drag))
    system = reduced(formulation, warm.stiffness, fields)
    laws = (*LAWS, StepConductivity(KAPPA))
    three = solve_problem(indentation(system, fields, laws, (*given, POTENTIAL), drag))
    for column in range(MEE.size):
        equal(three.load[:, column], two.load[:, column])
        equal(three.displacement[:, column], two.displacement[:, column])
    equal(three.contact_fraction, two.contact_fraction, 1e-5)
    closed = three.load[:, 2] < 0.0
    assert 5 < closed.sum() < len(closed)

    other = replace(Material.isotropic(2e11, 0.3), permittivity=CONDUCTIVITY)
    alone = reduced(formulation, other.stiffness, MEE)
    flux = np.zeros((len(closed), MEE.size))
    flux[:, 3] = three.load[:, -1]
    equal(three.displacement[:, -1], alone.offset[:, 3] + alone.apply(flux)[:, 3], 1e-8)
    drop = -three.displacement[:, -1] - POTENTIAL
    equal(three.load[:, -1], np.where(closed, KAPPA * drop, 0.0))
    assert np.abs(three.load[:, -1]).max() > 0.1 * KAPPA * POTENTIAL


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("name", FORMULATIONS)
def test_field_set_with_a_single_scalar(name: str) -> None:
    """Heat conduction in elastic contact is the same if the scalar follows the two potentials of the default set,
    which vanish."""
    elastic = Material.isotropic(2e11, 0.3).with_field(HEAT, CONDUCTIVITY)
    columns = [0, 1, 2, 5]
    stiffness = np.ascontiguousarray(elastic.stiffness[:, columns][:, :, columns])
    fields, formulation = FieldSet((HEAT,)), FORMULATIONS[name]
    one = solve_problem(
        indentation(reduced(formulation, stiffness, fields), fields, [StepConductivity(KAPPA)], (POTENTIAL,))
    )
    system = reduced(formulation, elastic.stiffness, elastic.fields)
    laws = [StepConductivity(kappa) for kappa in (0.0, 0.0, KAPPA)]
    three = solve_problem(indentation(system, elastic.fields, laws, (0.0, 0.0, POTENTIAL)))
    equal(one.load, three.load[:, columns])
    equal(one.displacement[:, MECHANICAL], three.displacement[:, MECHANICAL])
    equal(one.displacement[:, POTENTIALS], three.displacement[:, 5:])
    assert one.load[:, 3].any()


def test_scalar_field_in_case_files_results_and_reports(tmp_path: Path) -> None:
    """Coefficient, law, potential and resultant are keys of a case file, and all output names the field."""
    registry = plugins.load()
    (tmp_path / "warm.toml").write_text(CASE, encoding="utf-8")
    case = load_case(tmp_path / "warm.toml", registry)
    assert case.fields == FieldSet((*MEE.scalars, HEAT))
    assert case.conductivity["thermal"] == StepConductivity(700.0)
    assert (case.potentials["temperature"], case.steps[1].scalars) == (10.0, {"heat": 2e-3})
    (tmp_path / "wrong.toml").write_text(CASE.replace("heat =", "heet ="), encoding="utf-8")
    with pytest.raises(CaseError, match=r"steps\[2\].heet = '2 mW': unknown key; did you mean 'heat'\?"):
        load_case(tmp_path / "wrong.toml", registry)
    with pytest.raises(CaseError, match="unknown key 'thermal_conductivity' in material 'isotropic'"):
        load_case(tmp_path / "warm.toml", replace(registry, scalar_fields=()))

    result = solve_case(case)
    first, last = result.steps
    assert (first.status, last.status) == (Status.CONVERGED, Status.CONVERGED)
    assert first.loading.temperature == 10.0
    assert resultants(result.zone, last).heat == pytest.approx(2e-3, rel=1e-8)
    assert -resultants(result.zone, first).heat / first.loading.temperature > 0.0
    drop = last.potentials[:, 2] - last.loading.temperature
    equal(last.fluxes[:, 2], np.where(last.touching, 700.0 * drop, 0.0))

    write_result(tmp_path, result)
    read = read_result(tmp_path)
    assert read.steps[1].fields == case.fields
    np.testing.assert_array_equal(read.steps[1].fluxes, last.fluxes)
    assert read.steps[1].loading.motion.tolist() == last.loading.motion.tolist()
    with h5py.File(tmp_path / "result.h5") as file:
        assert file["steps/0002/temperature"].attrs["units"] == "K"
        assert file["steps/0002/heat_flux"].attrs["units"] == "W/m^2"
        assert file["steps/0002/resultants/heat"][()] == pytest.approx(2e-3, rel=1e-8)
    write_fields(read, tmp_path)
    names = meshio.read(tmp_path / "fields.vtu").point_data
    assert {"temperature [K]", "heat flux [W/m^2]"} <= set(names)
    entry = summary(read)["steps"][1]
    assert (entry["heat"], entry["prescribed"]) == (pytest.approx(2e-3, rel=1e-8), {"heat": [2e-3]})
    assert {"temperature", "max_abs_temperature"} <= set(entry)
    console = Console(width=160, record=True, file=StringIO())
    console.print(summary_table(read))
    table = console.export_text()
    assert re.search(r"heat out of the body +│ W ", table)
    assert re.search(r"temperature of the indenter +│ K ", table)
    assert "temperature" in figures(read)


@cache
def dense_solution() -> tuple[Body, ReducedSystem, ContactState]:
    """Return a warm half space, its dense system, and the state of frictional contact with three channels."""
    warm = library_material("batio3-cofe2o4").with_field(HEAT, CONDUCTIVITY)
    mesh = half_space_mesh((0.1, 0.1), (0.005, 0.005), (10, 10), 3, Quad4())
    body = Body(warm.stiffness, mesh, (), "contact", warm.fields)
    system = DenseBEM(quadrature_tolerance=1e-8).reduce(body)
    return body, system, press_and_conduct(system, body)


def press_and_conduct(system: ReducedSystem, body: Body) -> ContactState:
    laws = (*LAWS, StepConductivity(KAPPA))
    return solve_problem(indentation(system, body.fields, laws, (2e3, -3.0, POTENTIAL), 3e-6))


@pytest.mark.full
def test_hierarchical_matrices_match_dense_matrices() -> None:
    """Frictional contact with three channels; small leaves give low-rank blocks."""
    tolerance = 1e-5
    body, dense, expected = dense_solution()
    hierarchical = HierarchicalBEM(tolerance=tolerance, leaf_size=10).reduce(body)
    assert hierarchical.dense() is None
    state = press_and_conduct(hierarchical, body)
    assert (np.abs(expected.load).max(axis=0) > 0.0).all()
    for column in range(body.fields.size):
        equal(state.load[:, column], expected.load[:, column], tolerance)
        equal(state.displacement[:, column], expected.displacement[:, column], tolerance)
    values, fluxes = (
        [getattr(system.recover(expected.load), name) for system in (hierarchical, dense)]
        for name in ("values", "fluxes")
    )
    equal(values[0][:, -1], values[1][:, -1], tolerance)
    equal(fluxes[0][:, -1], fluxes[1][:, -1], tolerance)
    alone = np.where(np.arange(body.fields.size) == 5, expected.load, 0.0)
    assert not hierarchical.apply(alone)[:, :5].any()


@pytest.mark.full
@pytest.mark.parametrize(
    "formulation", [FiniteElements(), DenseBEM(quadrature_tolerance=1e-8)], ids=["fem", "dense-bem"]
)
def test_finite_body_with_uncoupled_fields(formulation: Formulation) -> None:
    """The compliance consists of that of the coupled fields and that of the scalar."""
    material, other = library_material("pzt-4"), replace(Material.isotropic(2e11, 0.3), permittivity=CONDUCTIVITY)
    mesh = block_mesh((0.01, 0.01), 0.01, (0.005, 0.005), (3, 3), 1, 2, Quad4())

    def compliance(body_material: Material) -> Array:
        fields = body_material.fields
        grounded = tuple(BoundaryCondition("base", field, "value") for field in range(fields.size))
        body = Body(body_material.stiffness, mesh, grounded, "contact", fields)
        matrix = formulation.reduce(body).dense()
        assert matrix is not None
        return matrix

    both, scalar = compliance(material.with_field(HEAT, CONDUCTIVITY)), compliance(other)[:, 3, :, 3]
    coupled = compliance(material)
    for field in np.ndindex(5, 5):
        equal(both[:, field[0], :, field[1]], coupled[:, field[0], :, field[1]], 1e-6)
    equal(both[:, 5, :, 5], scalar, 1e-6)
    assert not both[:, 5, :, :5].any()
    assert not both[:, :5, :, 5].any()


@pytest.mark.full
@pytest.mark.parametrize(
    "formulation",
    [DenseBEM(), FiniteElements(), HierarchicalBEM(tolerance=1e-5, leaf_size=10)],
    ids=["dense-bem", "skfem", "hmatrix-bem"],
)
def test_formulations_conform_with_scalar_field(formulation: Formulation) -> None:
    """The conformance kit derives the number of fields from the body."""
    rotation = rotation_about((1.0, 2.0, 0.5), 0.8)
    material = library_material("orthotropic-mee").rotated(rotation).with_field(HEAT, CONDUCTIVITY)
    field = LinearField.random(material.stiffness, seed=5)
    sides = dict.fromkeys(("top", "side_x-", "side_x+", "side_y-", "side_y+"), 6 * "f")
    mesh = block_mesh(0.5, 0.8, 0.5, 3, 1, 2, Quad4())
    body = prescribe(mesh, field, material.stiffness, {"base": 6 * "v", **sides})
    check_formulation(formulation, replace(body, contact_group="contact", fields=material.fields), field)


@pytest.mark.full
@pytest.mark.parametrize("formulation", [HalfSpace(edges="resolved"), HalfSpace(matrix_up_to=0)])
def test_capabilities_of_half_spaces_include_scalar_field(formulation: HalfSpace) -> None:
    material = library_material("orthotropic-mee").with_field(HEAT, CONDUCTIVITY)
    mesh = half_space_mesh(2.0, (1.0, 0.8), (24, 21), 1, Quad4())
    system = formulation.reduce(Body(material.stiffness, mesh, (), "contact", material.fields))
    check_capabilities(system)
    check_edge_resultants(system, material.stiffness)


@pytest.fixture
def warm(tmp_path: Path) -> tuple[Path, plugins.Registry]:
    """Return a case file with one increment of the additional field, and the registry that contains the field."""
    path = tmp_path / "warm.toml"
    path.write_text(CASE.removesuffix('[[steps]]\nheat = "2 mW"\n'), encoding="utf-8")
    return path, plugins.load()


@pytest.mark.full
def test_verification_compares_scalar_field(warm: tuple[Path, plugins.Registry], tmp_path: Path) -> None:
    path, registry = warm
    path.write_text(CASE, encoding="utf-8")
    densities = "half-space", '{name = "half-space", density = "constant"}'
    made = verify(path, tmp_path / "verified", densities, every_step=True, registry=registry)
    assert made.verdict is not Verdict.DISAGREE
    finest = {run.formulation: run for run in made.runs}["half-space"]
    result = solve_case(load_case(path, registry))
    for number, name in ((1, "heat"), (1, "max_temperature"), (2, "max_temperature")):
        step = result.steps[number - 1]
        expected = resultants(result.zone, step)
        value = expected.heat if name == "heat" else expected.max_abs_temperature
        assert finest.steps[number][name].value == pytest.approx(value, rel=1e-6)
    assert "heat" not in finest.steps[2]  # prescribed, so that the temperature of the indenter is compared
    found = finest.steps[2]["indenter_temperature"].value
    assert found == pytest.approx(result.steps[1].loading.temperature, rel=1e-6)
    compared = {(agreement.first.step, agreement.first.quantity) for agreement in made.agreements}
    assert {(1, "heat"), (1, "max_temperature"), (2, "indenter_temperature")} <= compared
    console = Console(width=160, record=True, file=StringIO())
    console.print(verification_table(made))
    assert re.search(r"indenter temperature +│ K +│", console.export_text())


def test_comparison_shows_scalar_field(warm: tuple[Path, plugins.Registry], tmp_path: Path) -> None:
    """A conductivity law for all fields applies to it, too."""
    path, registry = warm
    laws = ['{name = "step", kappa = 700}', '{name = "step", kappa = 350}']
    made = compare(path, {"conductivity-law": laws}, tmp_path / "compared", registry=registry)
    runs = json.loads((tmp_path / "compared" / "compare.json").read_text())["runs"]
    heat = [run["increments"][-1]["heat"] for run in runs]
    assert 1.0 < heat[0] / heat[1] < 2.0
    assert runs[1]["differences"]["heat"] == pytest.approx(1.0 - heat[1] / heat[0])
    assert 0.0 < runs[1]["differences"]["temperature"] < 1.0
    assert len(runs[0]["fields"]["temperature"]) == len(runs[0]["points"])
    console = Console(width=160, record=True, file=StringIO())
    console.print(comparison_table(made))
    assert "difference in temperature" in console.export_text()
    figure = comparison_figure(made)
    assert figure is not None
    assert any("temperature" in axes.get_ylabel() for axes in figure.axes)


@pytest.mark.full
def test_sweeps_collect_scalar_field(warm: tuple[Path, plugins.Registry], tmp_path: Path) -> None:
    """The heat is proportional to the temperature of the indenter; a point without the field has none."""
    path, registry = warm
    study = tmp_path / "study.toml"
    study.write_text(f'case = "{path.name}"\nfields = ["temperature"]\n' + SWEEP, encoding="utf-8")
    result = sweep(study, tmp_path / "swept", registry=registry)
    assert set(result.status) == {"converged"}, result.message
    heat, potential = result.last("heat"), result.last("max_abs_temperature")
    np.testing.assert_allclose(heat[:2] / heat[0], [1.0, 2.0], rtol=1e-6)
    np.testing.assert_allclose(potential[:2] / potential[0], [1.0, 2.0], rtol=1e-6)
    assert np.isnan(heat[2])
    assert not np.isnan(result.last("charge")).any()
    np.testing.assert_allclose(result.fields["zone_temperature"][1], 2.0 * result.fields["zone_temperature"][0])
    assert np.isnan(result.fields["zone_temperature"][2]).all()
    data = dataset(result)
    assert (data["heat"].attrs["units"], data["temperature"].attrs["units"]) == ("W", "K")
    conductance = result.last("thermal_conductance")
    np.testing.assert_allclose(conductance[:2], -heat[:2] / result.last("temperature")[:2], rtol=1e-12)
    assert data["thermal_conductance"].attrs["units"] == "W/K"
    assert data["zone_temperature"].attrs["units"] == "K"
    console = Console(width=200, record=True, file=StringIO())
    console.print(sweep_table(result))
    assert "temperature" in console.export_text()
    assert any("temperature" in axes.get_ylabel() for axes in sweep_figure(result).axes)
    study.write_text(study.read_text() + '[[plots]]\nquantities = ["heet"]\n', encoding="utf-8")
    with pytest.raises(CaseError, match="unknown quantity 'heet'; did you mean 'heat'"):
        sweep(study, tmp_path / "again", registry=registry)


def test_studies_show_scalar_field(tmp_path: Path) -> None:
    study = tmp_path / "study.toml"
    (tmp_path / "warm.toml").write_text(CASE, encoding="utf-8")
    registry = plugins.load()
    study.write_text(CURVES, encoding="utf-8")
    panel = solve_study(study, tmp_path / "cache", registry=registry).panels[0]
    np.testing.assert_allclose(panel.quantities["heat"], 2e-3, rtol=1e-8)  # prescribed
    poor, reference = panel.quantities["max_temperature"]
    assert 1.0 < poor < 1.1
    assert reference == 1.0
    with pytest.raises(CaseError, match="unknown quantity 'max_temperature'"):
        load_study(study)
