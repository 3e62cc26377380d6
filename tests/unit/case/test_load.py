"""Test how case files are read, and the messages about everything that may be wrong with them."""

import math

import meshio
import numpy as np
import pytest

from meeframe.common.errors import CaseError
from meeframe.elements import Quad9
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.greens import LineIntegral
from meeframe.indenters import Heights, Sphere
from meeframe.laws import Insulating, IsotropicCoulomb, Signorini, StepConductivity
from meeframe.laws.base import ContactLaw
from meeframe.material import library_material
from meeframe.model.load import case_from_tables, load_case
from meeframe.plugin.validation import TableError
from meeframe.solvers import Auto


def test_defaults(write_case, registry):
    path = write_case(('[formulation]\nname = "winkler"\nstiffness = "1e14 Pa/m"\n', ""))
    case = load_case(path, registry)
    assert case.title == "tiny"
    assert case.text == path.read_text()
    assert case.indenter == Sphere(0.1)
    assert case.steps[0].approach == pytest.approx(1e-5)
    assert isinstance(case.contact_law, Signorini)
    assert isinstance(case.conductivity["electric"], Insulating)
    assert case.formulation == DenseBEM()
    assert case.mesh.n_elements == 16 + 2 * 16 + 16 + 16
    np.testing.assert_array_equal(case.material.stiffness, library_material("batio3-cofe2o4").stiffness)
    assert {(c.group, c.field, c.kind) for c in case.conditions} == {("base", i, "value") for i in range(5)}


def test_all_keys(write_case, registry):
    more = """
translation = ["1 um", 0]
magnetic_potential = "3 mA"

[contact]
law = {name = "isotropic-coulomb", mu = 0.3}

[conductivity.electric]
name = "step"
kappa = inf
[conductivity.magnetic]
name = "power-law"
reference_conductivity = "2 H/m^2"
reference_pressure = "1 MPa"

[solver]
name = "uzawa"
step_normal = "1e13 Pa/m"
tolerance = 1e-6
max_iterations = 77
criterion = "paper"

[output]
figures = false

[[boundary]]
group = "side_x+"
traction = ["free", "2 kPa", 0]
electric_flux = 1e-6
"""
    changes = [
        ('name = "winkler"\nstiffness = "1e14 Pa/m"', 'name = "dense-bem"\nfundamental_solution = "line-integral"'),
        ("layers = 1", 'layers = 1\nelement = "quad9"\nlayer_growth = 2'),
        ('radius = "100 mm"', 'radius = "100 mm"\nx = "1 mm"\ntilt_1 = "2 deg"\nelectric_potential = "-5 V"'),
    ]
    case = load_case(write_case(*changes, more=more), registry)
    assert case.contact_law == IsotropicCoulomb(0.3)
    assert case.conductivity["electric"] == StepConductivity(math.inf)
    assert case.conductivity["magnetic"].reference_pressure == pytest.approx(1e6)
    assert case.formulation == DenseBEM(LineIntegral())
    assert (case.placement.x, case.placement.tilt_1) == pytest.approx((1e-3, math.radians(2)))
    assert case.solver.step_normal == pytest.approx(1e13)
    assert (case.stopping.tolerance, case.stopping.max_iterations, case.stopping.criterion) == (1e-6, 77, "paper")
    assert (case.output.figures, case.output.vtu) == (False, True)
    assert case.mesh.blocks[0].element.name == Quad9().name
    (step,) = case.steps
    assert (step.translation, case.potentials["electric_potential"]) == ((pytest.approx(1e-6), 0.0), -5.0)
    assert step.scalars["magnetic_potential"] == pytest.approx(3e-3)
    side = {(c.field, c.kind): c.data for c in case.conditions if c.group == "side_x+"}
    assert side == {(1, "flux"): pytest.approx(2e3), (2, "flux"): 0.0, (3, "flux"): 1e-6}


def test_tables_without_a_name_use_the_default(write_case, registry):
    changes = ('name = "winkler"\nstiffness = "1e14 Pa/m"', "quadrature_tolerance = 1e-3")
    case = load_case(write_case(changes, more="\n[solver]\ntolerance = 1e-7\n"), registry)
    assert case.formulation == DenseBEM(quadrature_tolerance=1e-3)
    assert (case.solver, case.stopping.tolerance) == (Auto(), 1e-7)


def test_byte_order_mark(write_case, registry):
    path = write_case()
    path.write_text(path.read_text(encoding="utf-8"), encoding="utf-8-sig")
    assert load_case(path, registry).title == "tiny"


def test_one_table_for_several_groups(write_case, registry):
    case = load_case(write_case(more='\n[[boundary]]\ngroup = ["side_x-", "top"]\nelectric_potential = 2\n'), registry)
    added = [(c.group, c.field, c.kind, c.data) for c in case.conditions if c.group != "base"]
    assert added == [("side_x-", 3, "value", 2.0), ("top", 3, "value", 2.0)]


BOX_POINTS = [[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)]
BOX_QUADS = {
    "base": [0, 2, 3, 1],
    "contact": [4, 5, 7, 6],
    "y-": [0, 1, 5, 4],
    "y+": [2, 6, 7, 3],
    "x-": [0, 4, 6, 2],
    "x+": [1, 3, 7, 5],
}


def write_box(path, quads):
    """Write a unit cube in millimetres as a gmsh file with named groups."""
    tags = np.arange(1, len(quads) + 1)
    mesh = meshio.Mesh(
        np.array(BOX_POINTS, float),
        [("quad", np.array(list(quads.values())))],
        cell_data={"gmsh:physical": [tags], "gmsh:geometrical": [tags]},
        field_data={name: np.array([tag, 2]) for name, tag in zip(quads, tags, strict=True)},
    )
    mesh.write(path, file_format="gmsh22", binary=False)


MESH = """[mesh]
half_width = "50 mm"
height = "120 mm"
contact_width = "5 mm"
divisions = 4
rings = 2
layers = 1
"""


def test_mesh_and_heights_from_files_beside_the_case(write_case, registry, tmp_path, monkeypatch):
    write_box(tmp_path / "box.msh", BOX_QUADS)
    np.save(tmp_path / "rough.npy", [[x, y, (x + y) * 1e-3] for x in (0.0, 1e-3) for y in (0.0, 1e-3)])
    path = write_case(
        (MESH, '[mesh]\nfile = "box.msh"\nunit = "mm"\n'),
        ('name = "sphere"\nradius = "100 mm"', 'name = "heights"\nfile = "rough.npy"'),
    )
    monkeypatch.chdir("/")
    case = load_case(path, registry)
    assert case.mesh.points.max() == pytest.approx(1e-3)
    assert set(case.mesh.group_names) == set(BOX_QUADS)
    assert case.indenter == Heights(tmp_path / "rough.npy")


def test_defaults_of_half_space_meshes(write_case, registry):
    """By default the mesh extends 16 widths of the zone to each side, in 6 rings."""
    potentials = "electric_potential = 0\nmagnetic_potential = 0\n"
    support = f'[[boundary]]\ngroup = "base"\ndisplacement = [0, 0, 0]\n{potentials}'
    bare = '[mesh]\ntype = "half-space"\ncontact_width = ["5 mm", "4 mm"]\ndivisions = 4\n'
    mesh = load_case(write_case((MESH, bare), (support, "")), registry).mesh
    np.testing.assert_allclose(mesh.points.max(axis=0), [0.08, 0.064, 0.0])
    assert mesh.n_elements == 16 + 6 * 16
    given = bare + 'half_width = "50 mm"\nrings = 1\n'
    mesh = load_case(write_case((MESH, given), (support, "")), registry).mesh
    np.testing.assert_allclose(mesh.points.max(axis=0), [0.05, 0.05, 0.0])
    assert mesh.n_elements == 16 + 16


def test_binary_file(tmp_path, registry):
    path = tmp_path / "result.h5"
    path.write_bytes(b"\x89HDF\r\n\x1a\n")
    with pytest.raises(CaseError, match=r"result\.h5: is not a TOML file: its text is not encoded in UTF-8$"):
        load_case(path, registry)


def test_dissimilar_names_are_not_suggested(write_case, registry):
    path = write_case(('radius = "100 mm"', 'radius = "100 mm"\nfriction = 0.3'))
    with pytest.raises(CaseError, match=r"indenter\.friction = 0\.3: unknown key; allowed: radius"):
        load_case(path, registry)


WRONG = {
    "not TOML": ([('title = "tiny"', "title = tiny")], "case.toml: is not a TOML file"),
    "unknown table": ([("[indenter]", "[indentor]")], "indenter: missing key"),
    "unknown key": (
        [('title = "tiny"', "titel = 3")],
        "titel = 3: unknown key; did you mean 'title'? allowed: title, material, mesh",
    ),
    "unknown key in a table": (
        [("rings = 2", "rings = 2\nring = 3")],
        "mesh.ring = 3: unknown key; did you mean 'rings'? allowed: contact_width, divisions",
    ),
    "unknown key in a list": ([("displacement", "displacment")], "boundary[1].displacment = [0, 0, 0]: unknown key"),
    "missing key": ([('radius = "100 mm"\n', "")], "indenter.radius: missing key"),
    "missing table": ([('[material]\nname = "batio3-cofe2o4"\n', "")], "material: missing key"),
    "wrong unit": ([('"100 mm"', '"100 V"')], "indenter.radius = '100 V': has the wrong unit; expected a number in m"),
    "no quantity": ([('"10 um"', '"deep"')], "steps[1].approach = 'deep': cannot be read as one number and then units"),
    "NaN": ([('"10 um"', "nan")], "steps[1].approach = nan: is not a number (NaN)"),
    "infinite": ([('"10 um"', "inf")], "steps[1].approach = inf: must be >= -1e+60 and <= 1e+60"),
    "not positive": ([('radius = "100 mm"', "radius = -0.1")], "indenter.radius = -0.1: must be > 0"),
    "true is no number": ([('radius = "100 mm"', "radius = true")], "indenter.radius = true: expected a number"),
    "no whole number": ([("divisions = 4", "divisions = 4.5")], "mesh.divisions = 4.5: should be a whole number"),
    "a whole number in other words": (
        [("divisions = 4", "divisions = 4.0")],
        "mesh.divisions = 4.0: should be a whole",
    ),
    "too few": ([("layers = 1", "layers = 0")], "mesh.layers = 0: should be greater than or equal to 1"),
    "too many": (
        [("divisions = 4", "divisions = 400000")],
        "mesh.divisions = 400000: should be less than or equal to 1000",
    ),
    "unknown material": (
        [("batio3-cofe2o4", "unobtainium")],
        "material: unknown material 'unobtainium'; ",
    ),
    "a word of some names": ([('"sphere"', '"punch"')], "did you mean 'flat-punch' or 'rectangular-punch'? allowed: "),
    "unknown indenter": ([('"sphere"', '"spere"')], "indenter.name: unknown indenter 'spere'; did you mean 'sphere'?"),
    "unknown law": (
        [("[indenter]", '[contact]\nlaw = "shear-limited"\n\n[indenter]')],
        "; load a local plugin with --plugin FILE.py",
    ),
    "unknown mesh type": (
        [("half_width", 'type = "ball"\nhalf_width')],
        "mesh.type = 'ball': should be one of block, half-space, file",
    ),
    "unknown element": (
        [("layers = 1", 'layers = 1\nelement = "quad5"')],
        "mesh.element.name: unknown element 'quad5'",
    ),
    "no such group": (
        [('group = "base"', 'group = "bottom"')],
        "boundary[1].group = 'bottom': no face group 'bottom' in the mesh; it has contact",
    ),
    "zone larger than the block": ([('"5 mm"', '"500 mm"')], "mesh: contact_width = "),
    "free rigid motions": (
        [("[0, 0, 0]", '["free", "free", 0]')],
        "boundary: the boundary conditions leave 3 of the 6 rigid motions free",
    ),
    "free potential": (
        [("electric_potential = 0\n", "")],
        "boundary: no boundary condition prescribes electric_potential",
    ),
    "a formulation that does not take the material": (
        [('name = "winkler"\nstiffness = "1e14 Pa/m"', 'name = "dense-bem"\nfundamental_solution = "isotropic"')],
        "case.toml: formulation: ",
    ),
    "two components": ([("[0, 0, 0]", "[0, 0]")], "boundary[1].displacement[3]: missing entry"),
    "four components": (
        [("[0, 0, 0]", "[0, 0, 0, 0]")],
        "boundary[1].displacement = [0, 0, 0, 0]: should have 3 entries",
    ),
    "no list": ([("[0, 0, 0]", "0")], "boundary[1].displacement = 0: should be a list"),
    "wrong word": ([("[0, 0, 0]", '[0, 0, "fixed"]')], "boundary[1].displacement[3] = 'fixed': cannot be read"),
    "nothing above the zone": (
        [('name = "sphere"\nradius = "100 mm"', 'name = "flat-punch"\nradius = "1 mm"\nx = "10 mm"')],
        "indenter: no part of the indenter lies above the contact zone 'contact'",
    ),
    "text for a table": (
        [('[material]\nname = "batio3-cofe2o4"\n', ""), ("title", "material = 'x'\ntitle")],
        "material = 'x': should be a table",
    ),
    "table for a list": (
        [("[[steps]]", "[steps]")],
        "steps = {'approach': '10 um'}: should be a list of tables, each under a header [[steps]]",
    ),
    "table for a list in a table": (
        [("title", "second_body.boundary = {}\ntitle")],
        "second_body.boundary = {}: should be a list of tables, each under a header [[second_body.boundary]]",
    ),
    "table for a list of numbers": (
        [("[[steps]]", "[contact]\naxes = {direction = {x = 1}}\n[[steps]]")],
        "contact.axes.direction = {'x': 1}: should be a list",
    ),
    "no text": ([('title = "tiny"', "title = 3")], "title = 3: should be a text"),
    "no steps": (
        [('[[steps]]\napproach = "10 um"', ""), ("title", "steps = []\ntitle")],
        "steps = []: should not be empty",
    ),
}

WRONG_MORE = {
    "negative kappa": (
        '[conductivity.electric]\nname = "step"\nkappa = -1',
        "conductivity.electric.kappa = -1: must be >= 0",
    ),
    "kappa of the other field": (
        '[conductivity.electric]\nname = "step"\nkappa = "2 H/m^2"',
        "conductivity.electric.kappa = '2 H/m^2': has the wrong unit; expected a number in F/m^2 or a text with such",
    ),
    "kappa of the other field in a plugin's law": (
        '[conductivity.magnetic]\nname = "power-law"\nreference_pressure = 1\nreference_conductivity = "2 uF/mm^2"',
        "conductivity.magnetic.reference_conductivity = '2 uF/mm^2': has the wrong unit; expected a number in H/m^2 or",
    ),
    "NaN kappa": ('[conductivity.magnetic]\nname = "step"\nkappa = nan', "conductivity.magnetic.kappa = nan: is not a"),
    "wrong table": ('[conductivity.thermal]\nname = "step"', "conductivity.thermal = {'name': 'step'}: unknown key"),
    "no such zone": ('[contact]\nzone = "top2"', "contact.zone = 'top2': no face group 'top2' in the mesh"),
    "condition on the zone": (
        '[contact]\nzone = "base"',
        "boundary[1].group = 'base': boundary condition on 'base': it is the contact zone",
    ),
    "negative friction": (
        '[contact.law]\nname = "isotropic-coulomb"\nmu = -0.1',
        "contact.law.mu = -0.1: must be >= 0",
    ),
    "angle of friction": (
        '[contact.law]\nname = "isotropic-coulomb"\nmu = "17 deg"',
        "contact.law.mu = '17 deg': has the wrong unit; expected a number without unit",
    ),
    "NaN angle": (
        '[contact.law]\nname = "isotropic-coulomb"\nmu = "nan deg"',
        "contact.law.mu = 'nan deg': cannot be read as one number and then units",
    ),
    "unknown criterion": ('[solver]\nname = "uzawa"\ncriterion = "luck"', "solver.criterion = 'luck': should be"),
    "axes without a key": ("[contact]\naxes = [1, 0, 0]", "contact.axes = [1, 0, 0]: should be a table"),
    "bad step size": ('[solver]\nname = "uzawa"\nstep_normal = -1', "solver.step_normal = -1: must be > 0"),
    "heat of a body without temperature": (
        '[conductivity.thermal]\nname = "step"\nkappa = inf',
        "unknown key; it needs a material with thermal_conductivity; otherwise allowed: electric, magnetic",
    ),
    "figures of no increment": (
        '[output]\nstep = "end"',
        "output.step = 'end': is not an increment; allowed: peak, last, a load",
    ),
    "figures of an absent step": (
        '[output]\nstep = "2"',
        "output.step = '2': is not an increment of the case; allowed: peak, last, and load step 1 (increment 1)",
    ),
    "figures of an absent increment": (
        '[output]\nstep = "1.2"',
        "output.step = '1.2': is not an increment of the case",
    ),
    "no flag": ('[output]\nvtu = "yes"', "output.vtu = 'yes': should be true or false"),
    "twice the same": (
        '[[boundary]]\ngroup = "base"\nelectric_flux = 0',
        "boundary[2]: boundary conditions on 'base' prescribe electric_potential or electric_flux twice",
    ),
}


@pytest.mark.parametrize("kind", WRONG)
def test_invalid_entries(kind, write_case, registry):
    changes, expected = WRONG[kind]
    expect(write_case(*changes), registry, expected)


@pytest.mark.parametrize("kind", WRONG_MORE)
def test_invalid_additions(kind, write_case, registry):
    more, expected = WRONG_MORE[kind]
    expect(write_case(more="\n" + more), registry, expected)


def expect(path, registry, text):
    with pytest.raises(CaseError) as caught:
        load_case(path, registry)
    message = str(caught.value)
    assert text in message
    assert all(line.startswith(str(path)) for line in message.splitlines())


def test_contradictory_conditions(write_case, registry):
    path = write_case(
        ('name = "winkler"\nstiffness = "1e14 Pa/m"', 'name = "dense-bem"'),
        more='\n[[boundary]]\ngroup = "side_x-"\nelectric_potential = 5\n',
    )
    expect(path, registry, "boundary[2]: electric_potential on 'side_x-' contradicts another face at 5 shared points")


def test_inadmissible_material(write_case, registry):
    material = '[material]\nname = "orthotropic-mee"\nmagnetoelectric_scale = "1e-7 s/m"'
    path = write_case(('[material]\nname = "batio3-cofe2o4"', material))
    expect(path, registry, "material: material 'orthotropic-mee' is not admissible: the block [[eps, lambda]")


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda quads: quads.pop("x+"), "not closed"),
        (lambda quads: quads.update({"x+": quads["x+"][::-1]}), "orient"),
        (lambda quads: [quad.reverse() for quad in quads.values()], "reorient = true flips those of a file"),
    ],
)
def test_invalid_mesh_files(write_case, registry, tmp_path, change, expected):
    quads = {name: list(quad) for name, quad in BOX_QUADS.items()}
    change(quads)
    write_box(tmp_path / "box.msh", quads)
    with pytest.raises(CaseError, match=r"case.toml: mesh: .*box.msh: ") as caught:
        load_case(write_case((MESH, '[mesh]\nfile = "box.msh"\nunit = "mm"\n')), registry)
    assert expected in str(caught.value)


def test_missing_files(write_case, registry, tmp_path):
    with pytest.raises(CaseError, match="cannot be read: No such file"):
        load_case(tmp_path / "absent.toml", registry)
    expect(write_case((MESH, '[mesh]\nfile = "absent.msh"\n')), registry, "absent.msh: no such file")
    expect(write_case((MESH, '[mesh]\nfile = "a.msh"\nunit = "kg"\n')), registry, "mesh.unit = 'kg': should be a unit")


def test_invalid_entry_is_reported_once(write_case, registry):
    with pytest.raises(CaseError) as caught:
        load_case(write_case(('"10 um"', '"10 V"')), registry)
    assert len(str(caught.value).splitlines()) == 1


def test_all_problems_are_reported_at_once(write_case, registry):
    path = write_case(('"100 mm"', '"100 V"'), ("rings = 2", "rings = 0"), ("batio3-cofe2o4", "unobtainium"))
    with pytest.raises(CaseError) as caught:
        load_case(path, registry)
    assert len(str(caught.value).splitlines()) == 3


def test_tables_from_python(registry):
    with pytest.raises(TableError, match="indenter: missing key"):
        case_from_tables({"title": "nothing else"}, registry)


def test_case_file_never_runs_code(write_case, registry, tmp_path):
    expect(
        write_case(('"100 mm"', '''"__import__('os').mkdir('oops') m"''')),
        registry,
        "cannot be read as one number and then units",
    )
    assert not (tmp_path / "oops").exists()
    assert not issubclass(ContactLaw, dict)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (('"10 um"', "9" * 400), "approach = 9999.*: is too large; expected a number in m"),
        (('"50 mm"', "9" * 400), "mesh.half_width = 9999.*: is too large; expected a number in m"),
        (
            ("divisions = 4", f"divisions = {'9' * 400}"),
            r"mesh.divisions = 9999.*\.\.\.: should be less than or equal to",
        ),
        (
            ('"tiny"', "9" * 5000),
            r"is not a TOML file: an integer of 5000 digits \(at line 2\); allowed: at most 10000 bin",
        ),
        (
            ('"tiny"', "0x" + "f" * 4000),
            "is not a TOML file: title: an integer of 16000 binary digits; allowed: at most 10000",
        ),
        (('"tiny"', f"[{{a = [0x{'f' * 4000}]}}]"), r"file: title\[1\].a\[1\]: an integer of 16000 binary digits"),
        (('"tiny"', "[" * 5000 + "]" * 5000), "is not a TOML file: maximum recursion depth"),
        (('"tiny"', r'"a\u0000b"'), r"title = 'a\\x00b': holds the character NUL; allowed: any other in a title"),
        (('"tiny"', "1979-05-27"), r"title = 1979-05-27: should be a text"),
    ],
)
def test_extreme_numbers_and_texts(write_case, registry, change, text):
    with pytest.raises(CaseError, match=text):
        load_case(write_case(change), registry)


@pytest.mark.filterwarnings("ignore:overflow encountered")
@pytest.mark.parametrize("formulation", ["dense-bem", "hmatrix-bem"])
def test_nearly_incompressible_materials_are_rejected_early(write_case, registry, formulation):
    """The closed form of the fundamental solution supports them; quadrature does not."""
    chosen = f'name = "{formulation}"\nfundamental_solution = "isotropic"'
    material = 'name = "isotropic"\nyoung_modulus = "1 GPa"\npoisson_ratio = 0.4999999'
    change = ('name = "batio3-cofe2o4"', material), ('name = "winkler"\nstiffness = "1e14 Pa/m"', chosen)
    with pytest.raises(CaseError, match=r"formulation: a Stroh eigenvalue .* real .* a smaller poisson_ratio"):
        load_case(write_case(*change), registry)


def test_unnamed_materials_are_rejected(write_case, registry):
    change = ('name = "batio3-cofe2o4"', 'symmetry = "isotropic"\ncomponents = { c_11 = 1e9, c_12 = 2e9 }')
    with pytest.raises(CaseError, match="material: the material is not admissible: the elastic stiffness c must be"):
        load_case(write_case(change), registry)


@pytest.mark.parametrize(
    ("tables", "text"),
    [
        ({"title": 10**5000}, "title: an integer of 16610 binary digits; allowed: at most 10000"),
        ({"material": {"name": [1, 10**5000]}}, r"material.name\[2\]: an integer of 16610 binary digits"),
        ({"mesh": ({}, {"divisions": -(10**5000)})}, r"mesh\[2\].divisions: an integer of 16610 binary digits"),
        ({10**5000: 1}, "4300 digits"),
    ],
)
def test_integers_too_long_to_print(registry, tables, text):
    with pytest.raises(CaseError, match=text):
        case_from_tables(tables, registry)


def test_extreme_meshes(write_case, registry):
    change = ('"50 mm"', "1e60"), ('name = "winkler"\nstiffness = "1e14 Pa/m"', 'name = "dense-bem"')
    with np.errstate(all="ignore"), pytest.raises(CaseError, match=r"case.toml: mesh: .* points that coincide"):
        load_case(write_case(*change), registry)
