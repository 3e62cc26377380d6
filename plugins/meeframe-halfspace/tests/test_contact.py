"""Test contact on half spaces by FFT: closed forms, boundary elements, two bodies, rough surfaces."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace, SelfAffine, indentation_modulus

from meeframe.common.errors import CaseError
from meeframe.common.toml import toml_text
from meeframe.elements import Quad4
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.indenters import shapes as rigid
from meeframe.laws import IsotropicCoulomb, StepConductivity
from meeframe.material import Material, library_material
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.mesh import FrictionAxes, half_space_mesh
from meeframe.mesh.body import Body
from meeframe.model.case import Case
from meeframe.model.load import load_case
from meeframe.model.second_body import SecondBody
from meeframe.model.solve import reduce, solve_case, solve_steps
from meeframe.model.step import Step
from meeframe.results.resultants import resultants
from meeframe.solvers import SemismoothNewton, StoppingCriteria, solve
from meeframe.testing.closed_forms import CONDITIONS, Cone, FlatPunch, Sphere, indent
from meeframe.testing.half_space import indentation_problem

STIFFNESS = library_material("batio3-cofe2o4").stiffness
XI = axisymmetric_compliance(STIFFNESS)
APPROACH = 5e-5
EXAMPLE = Path(__file__).parents[1] / "examples" / "rough.toml"


def indentation_errors(shape, potentials, cells, density="bilinear", divisions=None):
    """Return the relative errors of force, charge and flux that are not zero; `cells` counts cells across the
    contact."""
    exact = indent(XI, shape, APPROACH, *potentials)
    spacing, divisions = 2.0 * exact.contact_radius / cells, divisions or 2 * round(0.6 * cells)
    mesh = half_space_mesh(10.0 * divisions * spacing, divisions * spacing, divisions, 1, Quad4())
    system = HalfSpace(density).reduce(Body(STIFFNESS, mesh, (), "contact"))
    x, y, _ = system.points.T
    indenter = {
        Sphere: lambda: rigid.Sphere(shape.radius),
        Cone: lambda: rigid.Cone(shape.angle),
        FlatPunch: lambda: rigid.FlatPunch(shape.radius),
    }[type(shape)]()
    conductivity = tuple(0.0 if value is None else np.inf for value in potentials)
    given = tuple(value or 0.0 for value in potentials)
    problem = indentation_problem(system, indenter.height(x, y), APPROACH, None, conductivity, given)
    solution = solve(problem, SemismoothNewton(), StoppingCriteria(tolerance=1e-8))
    totals = system.weights @ solution.state.load
    expected = {2: -exact.force, 3: exact.charge, 4: exact.magnetic_flux}
    return np.array([totals[field] / value - 1.0 for field, value in expected.items() if value])


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("condition", CONDITIONS)
def test_sphere_64_cells_wide(condition):
    assert np.abs(indentation_errors(Sphere(0.1), CONDITIONS[condition], 64)).max() < 2e-4


@pytest.mark.parametrize("condition", ["EMII", "EMCI"])
def test_cone_64_cells_wide(condition):
    assert np.abs(indentation_errors(Cone(0.02), CONDITIONS[condition], 64)).max() < 2e-4


@pytest.mark.parametrize("condition", CONDITIONS)
def test_flat_punch_64_cells_wide(condition):
    """The contact edge is resolved to cells; the number of divisions is chosen so that the cells have the punch's
    area."""
    errors = indentation_errors(FlatPunch(2e-3), CONDITIONS[condition], 64, divisions=77)
    assert np.abs(errors).max() < 1e-3


def test_flat_punch_at_potentials():
    errors = indentation_errors(FlatPunch(2e-3), (-1.5e4, 30.0), 64, divisions=77)
    assert np.abs(errors).max() < 1e-3


def test_sphere_at_potentials():
    """Fluxes are singular at the contact edge, which is resolved to cells only. The contributions of pressure and
    potentials nearly cancel, so errors are relative to their magnitudes."""
    potentials = (-1.5e4, 30.0)
    exact, grounded = (indent(XI, Sphere(0.1), APPROACH, *given) for given in (potentials, (0.0, 0.0)))
    pairs = ((exact.force, 0.0), (exact.charge, grounded.charge), (exact.magnetic_flux, grounded.magnetic_flux))
    shares = np.array([abs(total) / (abs(part) + abs(total - part)) for total, part in pairs])
    errors = [shares * indentation_errors(Sphere(0.1), potentials, 64 + part) for part in (0.0, 0.25, 0.5, 0.75)]
    assert np.abs(np.mean(errors, axis=0)).max() < 1e-3
    assert np.abs(errors).max() < 2e-3


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("density", ["bilinear", "constant"])
def test_force_converges_with_second_order(density):
    """Errors are averaged over grids with different positions of the contact edge."""
    means = [
        np.mean([indentation_errors(Sphere(0.1), (None, None), cells + part, density)[0] for part in (0.0, 0.4, 0.8)])
        for cells in (12, 48)
    ]
    assert np.log(means[0] / means[1]) / np.log(4.0) == pytest.approx(2.0, abs=0.3)


@pytest.mark.full
def test_flat_punch_converges_with_first_order():
    """Errors are root mean squares over grids with different positions of the punch's edge."""
    errors = [
        [indentation_errors(FlatPunch(2e-3), (None, None), cells + part)[0] for part in np.arange(8) / 8]
        for cells in (10, 40)
    ]
    first, second = np.sqrt(np.mean(np.square(errors), axis=1))
    assert np.log(first / second) / np.log(4.0) > 0.9


def small_case(**changes):
    mesh = half_space_mesh(0.1, 5e-3, 12, 5, Quad4())
    return Case(
        material=library_material("orthotropic-mee"),
        mesh=mesh,
        conditions=(),
        indenter=rigid.Sphere(0.1),
        steps=(Step(approach=3e-5, translation=(1e-5, 0.5e-5)),),
        contact_law=IsotropicCoulomb(0.4),
        conductivity={"electric": StepConductivity(np.inf)},
        stopping=StoppingCriteria(tolerance=1e-8),
        formulation=HalfSpace(),
        **changes,
    )


def totals(case):
    result = solve_case(case)
    step = result.steps[-1]
    assert step.status == "converged"
    total = resultants(result.zone, step)
    return np.array([*total.force, total.charge]), step


@pytest.mark.full
def test_agrees_with_boundary_elements():
    """Only the formulation differs; the body is anisotropic, with friction and conduction."""
    case = small_case()
    (ours, step), (theirs, other) = totals(case), totals(replace(case, formulation=DenseBEM()))
    np.testing.assert_allclose(ours[:3], theirs[:3], atol=0.01 * abs(theirs[2]))
    assert ours[3] == pytest.approx(theirs[3], rel=0.02)
    difference = np.abs(step.traction - other.traction) / np.abs(other.traction).max()
    inside = -other.traction[:, 2] > 0.4 * np.abs(other.traction).max()
    assert inside.sum() > 20
    assert np.sqrt(np.mean(difference[inside] ** 2)) < 0.02
    assert difference[inside].max() < 0.06


def test_rotated_axes_do_not_affect_isotropic_friction():
    """The system in rotated frames is tested with and without a stored matrix."""
    plain, _ = totals(small_case())
    for limit in (0, 1200):
        axes = FrictionAxes(around=(0.0, 0.0, 1.0))
        case = replace(small_case(axes=axes), formulation=HalfSpace(matrix_up_to=limit))
        case = replace(case, steps=(Step(approach=3e-5, translation=(1e-5, 0.5e-5)),))
        rotated, _ = totals(case)
        np.testing.assert_allclose(rotated, plain, atol=1e-6 * np.abs(plain).max())


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("limit", [0, 1200])
def test_two_equal_isotropic_bodies_have_half_the_stiffness(limit):
    """Tangential displacements of equal bodies match by symmetry: P = 4/3 (E*/2) sqrt(R) g^1.5."""
    material = Material.isotropic(2e11, 0.3)
    mesh = half_space_mesh(0.1, 5e-3, 24, 1, Quad4())
    formulation = HalfSpace(matrix_up_to=limit)
    case = Case(
        material=material,
        mesh=mesh,
        conditions=(),
        indenter=rigid.Sphere(0.1),
        steps=(Step(approach=4e-5),),
        formulation=formulation,
        stopping=StoppingCriteria(tolerance=1e-8),
        second_body=SecondBody(material, mesh, formulation=formulation),
    )
    force, _ = totals(case)
    exact = 4.0 / 3.0 * (2e11 / 0.91 / 2.0) * np.sqrt(0.1) * 4e-5**1.5
    assert -force[2] == pytest.approx(exact, rel=2e-3)


@pytest.mark.parametrize("periodic", [True, False])
def test_periodic_and_free_surfaces_do_not_combine(tmp_path, periodic):
    """The period extends half a spacing beyond the zone of the free surface, so the surfaces do not match."""
    given = tomllib.loads(EXAMPLE.read_text(encoding="utf-8"))
    given["formulation"]["periodic"] = not periodic
    own = {"name": "half-space", "periodic": periodic}
    given["second_body"] = {"material": given["material"], "mesh": given["mesh"], "formulation": own}
    path = tmp_path / "case.toml"
    path.write_text(toml_text(given), encoding="utf-8")
    with pytest.raises(CaseError, match=r"second_body\.formulation.*periodic.*allowed: both or neither"):
        load_case(path)


@pytest.mark.parametrize(("own", "theirs"), [("resolved", "nodes"), ("nodes", "resolved")])
def test_edge_resolution_in_one_of_two_bodies_is_rejected(tmp_path, own, theirs):
    """Both bodies must resolve contact edges, or neither."""
    body = 'material = {name = "pzt-4"}\nmesh = {type = "half-space", contact_width = "5 mm", divisions = 8}\n'
    remainder = '[indenter]\nname = "flat-punch"\nradius = "1 mm"\n[[steps]]\napproach = "1 um"\n'
    path = tmp_path / "case.toml"

    def formulation(edges):
        return f'formulation = {{name = "half-space", density = "bilinear", edges = "{edges}"}}\n'

    def written(one, other):
        path.write_text(
            f"{body}{formulation(one)}[second_body]\n{body}{formulation(other)}{remainder}", encoding="utf-8"
        )
        return load_case(path)

    assert written(own, own).second_body.formulation == HalfSpace(edges=own)
    resolving, not_resolving = ("first", "second") if own == "resolved" else ("second", "first")
    match = rf"second_body\.formulation: .* {resolving} body resolves .* {not_resolving} body does not; .*edges"
    with pytest.raises(CaseError, match=match):
        written(own, theirs)


def rough_case(force, rms_height=1e-6, **changes):
    n, period = 32, 2e-3
    mesh = half_space_mesh(0.01, period * (n - 1) / n, n - 1, 1, Quad4())
    rough = SelfAffine(period, period / 6, 0.8, rms_height, seed=2, samples=n)
    given = {
        "material": library_material("batio3-cofe2o4"),
        "mesh": mesh,
        "conditions": (),
        "indenter": rough,
        "steps": (Step(normal_force=force),),
        "formulation": HalfSpace("trigonometric", periodic=True, matrix_up_to=0),
        "stopping": StoppingCriteria(tolerance=1e-9),
    }
    return Case(**(given | changes))


def test_full_contact_of_rough_surface():
    """The surface conforms to the indenter: a wave of wave number q and height h needs the pressure M q h / 2."""
    case = rough_case(4e3, 5e-7)
    force, step = totals(case)
    assert -force[2] == pytest.approx(4e3, rel=1e-8)
    system = reduce(case)
    heights, nodes = case.indenter.surface(), system.grid.nodes
    q = 2.0 * np.pi * np.fft.fftfreq(32, 2e-3 / 32)
    modulus = indentation_modulus(case.material.stiffness)
    waves = np.fft.ifft2(np.fft.fft2(-heights) * np.hypot(q[:, None], q) * modulus / 2.0).real
    pressure = -step.traction[nodes, 2]
    np.testing.assert_allclose(pressure, 4e3 / 4e-6 + waves, rtol=1e-6)


def test_frictional_rough_contact():
    """Partial contact satisfies the laws; a tangential force below the limit is carried by sticking and slipping
    spots."""
    steps = (Step(normal_force=60.0), Step(normal_force=60.0, tangential_force=(9.0, 0.0)))
    case = rough_case(
        60.0,
        4e-6,
        material=library_material("orthotropic-mee"),
        steps=steps,
        contact_law=IsotropicCoulomb(0.3),
        conductivity={"electric": StepConductivity(np.inf)},
        stopping=StoppingCriteria(tolerance=1e-8),
    )
    system = reduce(case)
    states = list(solve_steps(case, system, boundary=False))
    assert [step.status for step in states] == ["converged", "converged"]
    last = states[-1]
    pressure, drag = -last.traction[:, 2], np.hypot(last.traction[:, 0], last.traction[:, 1])
    touching = pressure > 0.0
    assert 0.02 < touching.mean() < 0.6
    assert (drag <= 0.3 * pressure * (1.0 + 1e-6)).all()
    slipping = drag > 0.3 * pressure * (1.0 - 1e-6)
    assert 0.0 < (touching & slipping).mean() < touching.mean()
    assert system.weights @ last.traction[:, 0] == pytest.approx(9.0, rel=1e-6)
    assert np.abs(last.potentials[touching, 0]).max() < 1e-6 * np.abs(last.potentials[:, 0]).max()


def test_example_case_loads():
    case = load_case(EXAMPLE)
    assert isinstance(case.indenter, SelfAffine)
    assert case.formulation == HalfSpace(periodic=True)


@pytest.mark.full
def test_no_warning_at_border_of_period():
    """The border of a period is no border of the zone, in full contact and where contact continues beyond it."""
    case = load_case(EXAMPLE)
    deep = replace(case, steps=(Step(approach=1e-3),))
    assert not deep.warnings
    assert "overlaps" in replace(deep, formulation=HalfSpace()).warnings[0]
    (step,) = solve_case(replace(case, steps=(Step(normal_force=30.0),))).steps
    assert step.message.startswith("residual")
    assert "zone" not in step.message
