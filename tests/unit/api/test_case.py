"""Cases built in Python equal those of case files, convert to and from TOML, and report problems by argument."""

import dataclasses
import inspect
import re
import signal
from pathlib import Path

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace

import meeframe
from meeframe.api.tables import BUILT_IN
from meeframe.model.body_tables import BlockTable, BoundaryTable, FileTable, HalfSpaceTable, SecondBodyTable
from meeframe.model.layer_tables import BaseTable, InterfaceTable
from meeframe.model.schema import StepTable
from meeframe.plugin.registry import load

ROOT = Path(__file__).parents[3]
CASES = sorted(
    path
    for folder in ("validation", "plugins")
    for path in (ROOT / folder).rglob("*.toml")
    if {"[material]", "[mesh]"}
    <= {line.split("#")[0].strip() for line in path.read_text(encoding="utf-8").splitlines()}
)

STEPS = (meeframe.Step(approach="10 um", increments=2), meeframe.Step(translation=["1 um", 0], charge="0 C"))
CONDUCTING = {"electric": meeframe.StepConductivity("1e-3 F/m^2")}


def build(**changes) -> meeframe.Case:
    parts = {
        "material": "batio3-cofe2o4",
        "mesh": meeframe.mesh.block("50 mm", "120 mm", "5 mm", divisions=4, rings=2, layers=1),
        "boundary": [meeframe.Boundary("base", displacement=[0, 0, 0], electric_potential=0, magnetic_potential=0)],
        "indenter": meeframe.Sphere("100 mm"),
        "contact": meeframe.OrthotropicCoulomb(0.1, "30 %"),
        "conductivity": CONDUCTING,
        "steps": STEPS,
    }
    return meeframe.Case(**parts | changes)


TEXT = """
[material]
name = "batio3-cofe2o4"
[mesh]
half_width = 0.05
height = 0.12
contact_width = 0.005
divisions = 4
rings = 2
layers = 1
[[boundary]]
group = "base"
displacement = [0, 0, 0]
electric_potential = 0
magnetic_potential = 0
[contact]
law = {name = "orthotropic-coulomb", mu1 = 0.1, mu2 = 0.3}
[conductivity]
electric = {name = "step", kappa = 1e-3}
[indenter]
name = "sphere"
radius = 0.1
[[steps]]
approach = 1e-5
increments = 2
[[steps]]
translation = [1e-6, 0]
charge = 0
"""


def assert_same_model(one, other) -> None:
    """Assert that two checked cases are identical."""
    np.testing.assert_array_equal(one.material.stiffness, other.material.stiffness)
    np.testing.assert_array_equal(one.mesh.points, other.mesh.points)
    for name in ("steps", "placement", "potentials", "zone", "axes", "stopping", "title"):
        assert getattr(one, name) == getattr(other, name), name
    for name in ("indenter", "contact_law", "formulation", "solver", "output"):
        assert repr(getattr(one, name)) == repr(getattr(other, name)), name
    assert repr(dict(one.conductivity)) == repr(dict(other.conductivity))
    assert repr(one.conditions) == repr(other.conditions)
    assert (one.second_body is None) == (other.second_body is None)
    if one.second_body is not None:
        np.testing.assert_array_equal(one.second_body.material.stiffness, other.second_body.material.stiffness)
        np.testing.assert_array_equal(one.second_body.mesh.points, other.second_body.mesh.points)
        assert repr(one.second_body.conditions) == repr(other.second_body.conditions)
        assert one.second_body.formulation == other.second_body.formulation


@pytest.mark.full(except_for=6)
@pytest.mark.parametrize("file", CASES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_round_trip(file, tmp_path, monkeypatch):
    """A case file, its case, and another case file in another folder give the same model."""
    case = meeframe.Case.from_toml(file)
    assert_same_model(case.checked, meeframe.load_case(file))
    (tmp_path / "inner").mkdir()
    case.to_toml(tmp_path / "inner" / "case.toml")
    monkeypatch.chdir(tmp_path)
    again = meeframe.Case.from_toml("inner/case.toml")
    assert_same_model(again.checked, case.checked)
    assert again == case


def test_cases_are_equal_if_their_files_are():
    case = build(title="one")
    assert case == meeframe.Case.from_toml(case.to_toml())
    assert hash(case) == hash(meeframe.Case.from_toml(case.to_toml()))
    assert case != build(title="two")
    assert case != build(title="one", indenter=meeframe.Sphere("101 mm"))
    assert case != "one"


def test_names_stand_for_objects_without_parameters():
    named = build(contact="signorini", conductivity={"electric": "insulating"}, formulation="dense-bem")
    assert named == meeframe.Case.from_toml(named.to_toml())
    made = build(contact=meeframe.Signorini(), formulation=meeframe.formulation("dense-bem"))
    assert named.checked.formulation == made.checked.formulation
    assert named.checked.contact_law == made.checked.contact_law


@pytest.mark.parametrize("potential", ["5 V", 5, 5.0, "5 kV"])
def test_potentials_are_read_as_they_are_written(potential):
    case = build(potentials={"electric_potential": potential})
    again = meeframe.Case.from_toml(case.to_toml())
    assert again == case
    assert again.potentials == case.potentials


@pytest.mark.parametrize(
    ("create", "misspelt", "meant"),
    [
        (lambda: meeframe.Step(aproach="1 um"), "aproach", "approach"),
        (lambda: build(materal="pzt-4"), "materal", "material"),
        (lambda: meeframe.Sphere(radus="1 mm"), "radus", "radius"),
        (lambda: meeframe.IsotropicCoulomb(mue=0.1), "mue", "mu"),
        (lambda: meeframe.OrthotropicCoulomb(mu1=0.1, mu_2=0.3), "mu_2", "mu2"),
        (lambda: meeframe.Boundary("base", displacment=[0, 0, 0]), "displacment", "displacement"),
        (lambda: meeframe.StepConductivity(kapa=1.0), "kapa", "kappa"),
        (lambda: meeframe.Placement(tilt1=0.1), "tilt1", "tilt_1"),
        (lambda: meeframe.StoppingCriteria(tolerence=1e-8), "tolerence", "tolerance"),
        (lambda: meeframe.Uzawa(step_norml=0.5), "step_norml", "step_normal"),
        (lambda: meeframe.DenseBEM(quadrature_tol=1e-4), "quadrature_tol", "quadrature_tolerance"),
        (lambda: HalfSpace(densty="constant"), "densty", "density"),
        (lambda: meeframe.Output(figure=False), "figure", "figures"),
        (lambda: meeframe.Material(elastc=1.0), "elastc", "elastic"),
        (lambda: meeframe.Material.from_voigt("m", elastc=1.0), "elastc", "elastic"),
        (lambda: meeframe.FrictionAxes(arund=(0, 0, 1)), "arund", "around"),
        (lambda: meeframe.mesh.block(half_wdth="1 mm"), "half_wdth", "half_width"),
        (lambda: meeframe.mesh.half_space("5 mm", division=4), "division", "divisions"),
    ],
)
def test_misspelt_keywords_are_named(create, misspelt, meant):
    with pytest.raises(meeframe.CaseError, match=f"unknown keyword '{misspelt}'; did you mean '{meant}'. allowed: "):
        create()


def test_checked_arguments_leave_the_signature():
    assert list(inspect.signature(meeframe.Sphere).parameters) == ["radius", "profile"]
    with pytest.raises(TypeError, match="missing"):
        meeframe.Sphere()


def test_classes_without_parameters_take_no_keywords():
    with pytest.raises(meeframe.CaseError, match="Auto: unknown keyword 'tolerance'; allowed: none"):
        meeframe.Auto(tolerance=1e-8)


@pytest.mark.parametrize(
    ("argument", "value", "message"),
    [
        ("steps", STEPS[0], "should be a list of meeframe.Step"),
        ("boundary", [{"group": "base"}], "should be a list of meeframe.Boundary"),
        ("conductivity", meeframe.StepConductivity(1.0), "should be a dictionary of laws by field"),
        ("potentials", 5.0, "should be a dictionary"),
        ("placement", {"x": "1 mm"}, "should be a meeframe.Placement"),
        ("stopping", {"tolerance": 1e-6}, "should be meeframe.StoppingCriteria"),
        ("output", {"figures": False}, "should be a meeframe.Output"),
        ("mesh", "body.msh", "should be a mesh, from meeframe.mesh.block, half_space or file"),
        ("indenter", "sphere", "should be an indenter, such as meeframe.Sphere"),
        ("material", 5, "should be a name, a dictionary or a meeframe.Material"),
        ("second_body", {"material": "steel"}, "should be a meeframe.SecondBody"),
    ],
)
def test_arguments_of_other_types_are_named(argument, value, message):
    with pytest.raises(meeframe.CaseError, match=f"^Case: {argument} = .*: {re.escape(message)}"):
        build(**{argument: value})


def test_numpy_numbers_are_numbers():
    whole, real = np.int64, np.float32
    potentials = ("electric_potential", "magnetic_potential")
    theirs = build(
        mesh=meeframe.mesh.block(
            real(0.0625), real(0.125), np.array([0.0625, 0.0625]), whole(4), rings=whole(2), layers=whole(2)
        ),
        boundary=[meeframe.Boundary("base", displacement=np.zeros(3), **dict.fromkeys(potentials, whole(0)))],
        indenter=meeframe.Sphere(real(0.5)),
        contact=meeframe.Contact(
            meeframe.OrthotropicCoulomb(real(0.25), whole(1)), axes=meeframe.FrictionAxes(np.array([1, 0, 0]))
        ),
        placement=meeframe.Placement(axis=(whole(0), whole(0), real(1))),
        potentials={"electric_potential": whole(5)},
        formulation=meeframe.formulation("hmatrix-bem", leaf_size=whole(32)),
        stopping=meeframe.StoppingCriteria(real(0.125), whole(50), stall_window=whole(5)),
        steps=[
            meeframe.Step(normal_force=whole(8), increments=whole(2)),
            meeframe.Step(translation=np.array([0.125, 0]), twist=real(0.25)),
        ],
    )
    ours = build(
        mesh=meeframe.mesh.block(0.0625, 0.125, (0.0625, 0.0625), 4, rings=2, layers=2),
        boundary=[meeframe.Boundary("base", displacement=[0.0, 0.0, 0.0], **dict.fromkeys(potentials, 0))],
        indenter=meeframe.Sphere(0.5),
        contact=meeframe.Contact(meeframe.OrthotropicCoulomb(0.25, 1), axes=meeframe.FrictionAxes((1, 0, 0))),
        placement=meeframe.Placement(axis=(0, 0, 1.0)),
        potentials={"electric_potential": 5},
        formulation=meeframe.formulation("hmatrix-bem", leaf_size=32),
        stopping=meeframe.StoppingCriteria(0.125, 50, stall_window=5),
        steps=[
            meeframe.Step(normal_force=8, increments=2),
            meeframe.Step(translation=[0.125, 0.0], twist=0.25),
        ],
    )
    assert theirs == ours
    assert theirs.to_toml() == ours.to_toml()
    assert theirs.checked.n_increments == 3


def test_python_and_file_give_the_same_result():
    ours = build().solve()
    theirs = meeframe.Case.from_toml(TEXT).solve()
    assert ours.status == theirs.status == "converged"
    for one, other in zip(ours, theirs, strict=True):
        for name in ("traction", "displacement", "potentials", "fluxes", "total_slip"):
            scale = np.abs(getattr(other, name)).max()
            np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-12, atol=1e-12 * scale)


def test_repr_of_a_case():
    elements = build().checked.mesh.n_elements
    assert repr(build(title="a title")) == (
        f"Case('a title': batio3-cofe2o4, {elements} elements, 2 load steps, 3 increments)"
    )


def test_result_contains_the_case():
    case = build()
    assert meeframe.Case.from_toml(case.solve().provenance.case_text).to_toml() == case.to_toml()


@pytest.mark.parametrize(
    ("part", "table"),
    [
        (meeframe.Step, StepTable.of(BUILT_IN)),
        (meeframe.Boundary, BoundaryTable.of(BUILT_IN)),
        (meeframe.Interface, InterfaceTable.of(BUILT_IN)),
        (meeframe.Base, BaseTable.of(BUILT_IN)),
        (meeframe.SecondBody, SecondBodyTable),
    ],
)
def test_classes_have_the_keys_of_case_files(part, table):
    names = {field.name for field in dataclasses.fields(part)} - {"scalars"}
    assert names == set(table.model_fields)


@pytest.mark.parametrize(
    ("recipe", "table"),
    [
        (meeframe.mesh.block, BlockTable),
        (meeframe.mesh.half_space, HalfSpaceTable),
        (meeframe.mesh.file, FileTable),
    ],
)
def test_meshes_have_the_keys_and_defaults_of_case_files(recipe, table):
    parameters = {name.replace("path", "file"): entry for name, entry in inspect.signature(recipe).parameters.items()}
    assert set(parameters) == set(table.model_fields) - {"type"}
    for name, parameter in parameters.items():
        field = table.model_fields[name]
        assert field.is_required() == (parameter.default is inspect.Parameter.empty)
        assert field.is_required() or field.default == parameter.default


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: meeframe.Step(approach="5 s"), "Step: approach = '5 s': has the wrong unit; expected a number in m"),
        (lambda: meeframe.Step(approach=1e-5, normal_force=1), "approach and normal_force are both given"),
        (lambda: meeframe.Boundary("base", displacement=[0, 0]), r"Boundary: displacement\[2\]: missing entry"),
        (lambda: meeframe.Sphere("-1 mm"), "Sphere: radius = '-1 mm': must be > 0"),
        (lambda: meeframe.law("dmmt"), "contact law 'dmmt'.*did you mean 'dmt'"),
        (lambda: meeframe.law("isotropic-coulomb", mue=0.3), "mue = 0.3: unknown key; did you mean 'mu'"),
        (lambda: meeframe.solver("newton", steps=2), "solver 'newton': steps = 2: unknown key"),
        (lambda: build(mesh=meeframe.mesh.half_space("5 s", 8)), "Case: mesh.contact_width = '5 s': has the wrong"),
        (lambda: build(contact=meeframe.Contact(zone="lid")), "Case: contact.zone = 'lid': no face group 'lid'"),
        (lambda: build(boundary=[meeframe.Boundary("lid", traction=[0, 0, 0])]), r"Case: boundary\[0\].group = 'lid'"),
        (lambda: build(potentials={"electric": 1}), "Case: potentials.electric = 1: unknown key"),
        (lambda: build(steps=[meeframe.Step(tilt=[0, 0])]), r"Case: steps\[0\]: the first load step gives neither"),
        (lambda: meeframe.Step(temperature="5 W"), "Step: temperature = '5 W': has the wrong unit"),
        (lambda: meeframe.Boundary("base", heat_flux="5 W"), "Boundary: heat_flux = '5 W': has the wrong unit"),
        (lambda: build(steps=[meeframe.Step(approach=1e-5, heat=0)]), r"Case: steps\[0\].heat = 0: unknown key"),
        (lambda: build(material="pzt-44"), "Case: material: unknown material 'pzt-44'; did you mean 'pzt-4'"),
        (lambda: build(restart="nowhere"), "Case: restart = 'nowhere': no result in nowhere"),
        (lambda: meeframe.Case.from_toml("a = 1\nb ="), "the text is not a case file"),
    ],
)  # fmt: skip
def test_messages_name_argument_value_and_allowed_values(make, message):
    with pytest.raises(meeframe.MeeframeError, match=message):
        make()


def test_objects_of_every_registered_name():
    """Objects without keys can be created by name and equal those of case files."""
    registry = load()
    for maker, kind in (
        (meeframe.law, "contact law"),
        (meeframe.conductivity, "conductivity law"),
        (meeframe.solver, "solver"),
    ):
        for entry in registry.entries:
            required = (
                [
                    field
                    for field in dataclasses.fields(entry.record.factory)
                    if field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
                ]
                if entry.kind == kind
                else [None]
            )
            if not required:
                assert type(maker(entry.record.name)) is entry.record.factory


def test_heat_has_the_keys_of_case_files():
    tables = {
        "material": {"name": "batio3", "thermal": True},
        "formulation": meeframe.formulation("skfem"),
        "conductivity": CONDUCTING | {"thermal": meeframe.StepConductivity("1e6 W/m^2/K")},
        "potentials": {"temperature": "10 K"},
        "steps": [meeframe.Step(approach="10 um", temperature="20 K"), meeframe.Step(heat="-1 mW")],
    }
    grounded = {"displacement": [0, 0, 0], "electric_potential": 0, "magnetic_potential": 0}
    case = build(**tables, boundary=[meeframe.Boundary("base", **grounded, temperature=0)])
    assert [dict(step.scalars) for step in case.checked.steps] == [{"temperature": 20.0}, {"heat": -1e-3}]
    again = meeframe.Case.from_toml(case.to_toml())
    assert [step.temperature for step in again.steps] == ["20 K", None]
    assert again.boundary[0].temperature == 0
    assert_same_model(again.checked, case.checked)


def test_arguments_as_objects(tmp_path):
    from meeframe.material import library_material

    case = build(material=library_material("pzt-4"), placement=meeframe.Placement(x="1 mm"), title="objects")
    case.to_toml(tmp_path / "case.toml")
    assert_same_model(meeframe.load_case(tmp_path / "case.toml"), case.checked)


def test_mesh_object_cannot_be_written():
    case = build(mesh=build().checked.mesh)
    assert_same_model(case.checked, build().checked)
    with pytest.raises(meeframe.CaseError, match=r"mesh: case files do not hold points; allowed: meeframe.mesh.block"):
        case.to_toml()
    with pytest.raises(meeframe.CaseError, match="Case: mesh = 5: should be a mesh, from "):
        build(mesh=5)


def test_unregistered_law_cannot_be_written():
    @dataclasses.dataclass(frozen=True)
    class Mine(type(meeframe.Signorini()).__mro__[1]):
        def project(self, trial):
            return meeframe.Signorini().project(trial)

        def tangential_scaling(self):
            return np.zeros((2, 2))

    case = build(contact=Mine(), steps=STEPS[:1])
    with pytest.raises(meeframe.CaseError, match="has no name in case files"):
        case.to_toml()
    assert case == case
    assert case != build(contact=Mine(), steps=STEPS[:1])
    np.testing.assert_allclose(
        case.solve()[-1].traction,
        build(contact=meeframe.Signorini(), steps=STEPS[:1]).solve()[-1].traction,
        rtol=1e-6,
        atol=1,
    )


def interrupt_after(after: int):
    """Return a progress callback that sends SIGINT to this process after a number of increments."""
    state = {"sent": False}

    def report(stage: str, fraction: float) -> None:
        if stage == "contact" and fraction > after / 3 + 1e-9 and not state["sent"]:
            state["sent"] = True
            signal.raise_signal(signal.SIGINT)

    return report


@pytest.fixture
def default_sigint():
    """Handle SIGINT by default; asyncio or Dask may have replaced the handler in this process."""
    previous = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, previous if previous is not None else signal.default_int_handler)


@pytest.mark.usefixtures("default_sigint")
def test_interruption_returns_finished_increments(tmp_path):
    case = build()
    whole = case.solve()
    with pytest.raises(KeyboardInterrupt) as caught:
        case.solve(progress=interrupt_after(2))
    assert isinstance(caught.value, meeframe.Interrupted)
    assert len(caught.value.result) == 2
    assert caught.value.result.status == "unfinished"
    with pytest.raises(meeframe.Interrupted) as caught:
        case.solve(tmp_path / "out", progress=interrupt_after(2))
    assert "2 of 3 increments are finished" in caught.value.__notes__[0]
    for result in (caught.value.result, meeframe.Result.load(tmp_path / "out")):
        assert len(result) == 2
        for one, other in zip(result, whole[:2], strict=True):
            np.testing.assert_allclose(one.traction, other.traction, atol=1e-9 * np.abs(other.traction).max())


def test_import_is_light():
    """`import meeframe` imports neither numpy nor pydantic; completion still offers all names."""
    import subprocess
    import sys

    code = (
        "import sys, meeframe; print(*sorted({'numpy', 'pydantic', 'numba', 'matplotlib'} & set(sys.modules)), end='')"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == ""
    assert {"Case", "Sphere", "mesh", "law", "Result"} <= set(dir(meeframe))


def test_progress_bars_in_terminals_and_notebooks(capsys):
    case = build(steps=STEPS[:1])
    case.solve()
    case.solve(progress=False)
    assert capsys.readouterr().err == "", "neither a terminal nor a notebook"
    case.solve(progress=True)
    assert "contact" in capsys.readouterr().err
    stages = []
    case.solve(progress=lambda stage, fraction: stages.append(stage))
    assert "contact" in stages
