"""Layers on a rigid base: the same case file by finite elements, boundary elements and the half space."""

from dataclasses import replace

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace
from meeframe_skfem import FiniteElements

import meeframe
from meeframe.common.errors import CaseError, MeshError
from meeframe.elements import Quad4
from meeframe.laws import StepConductivity
from meeframe.material import library_material
from meeframe.material.layers import Layer, LayerStack, RigidBase
from meeframe.mesh import block_mesh, half_space_mesh
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.study.reports.verified import Verdict
from meeframe.study.verify import verify

LOWER = library_material("cofe2o4")
FILM = (Layer(library_material("batio3"), 0.2),)
PLANE = half_space_mesh(0.5, 0.4, 2, 1, Quad4())
SIDES = ("side_x-", "side_x+", "side_y-", "side_y+")


def half_space(layers=(), base=None):
    return Body(LOWER.stiffness, PLANE, (), "contact", layers=LayerStack(layers, base))


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    ("formulation", "body"),
    [
        (FiniteElements(), half_space(FILM, RigidBase(0.3))),
        (FiniteElements(), half_space((), RigidBase(0.5))),
        (FiniteElements(depth=0.5), half_space(FILM)),
    ],
    ids=["layer on base", "base", "depth"],
)
def test_half_spaces_are_boxes_with_zero_values_far_away(formulation, body):
    """The box is the block of the same depth whose sides and base are held and grounded."""
    held = tuple(BoundaryCondition(group, field, "value") for group in (*SIDES, "base") for field in range(5))
    mesh = block_mesh(0.5, 0.5, 0.4, 2, 1, 1, Quad4())
    block = replace(body, mesh=mesh, conditions=held, layers=LayerStack(body.layers.layers))
    one, other = formulation.reduce(body), FiniteElements().reduce(block)
    scale = np.sqrt(np.abs(np.einsum("naa->a", one.diagonal_blocks())))
    difference = (one.dense() - other.dense()) / (scale[:, None, None] * scale)
    assert np.abs(difference).max() < 1e-12
    assert one.recover(np.ones((len(one.points), 5))).points.shape[1] == 3


@pytest.mark.parametrize(
    ("formulation", "body", "error", "message"),
    [
        (FiniteElements(), half_space(FILM), MeshError, r"no volume mesh without \[base\] or `depth`"),
        (FiniteElements(depth=0.2), half_space(FILM), MeshError, r"layers are 0\.2 m thick, the body is 0\.2 m deep"),
        (FiniteElements(depth=1.0), half_space(FILM, RigidBase(0.3)), CaseError, "depth = 1 m: the depth of a block"),
        (FiniteElements(), half_space(FILM, RigidBase(0.3, ("electric",))), CaseError, "the base insulates electric"),
    ],
    ids=["no depth", "shallow", "two depths", "insulating"],
)
def test_messages(formulation, body, error, message):
    with pytest.raises(error, match=message):
        formulation.check(body)


CASE = """
[material]
name = "{lower}"

[mesh]
type = "half-space"
contact_width = "4 um"
half_width = "10 um"
divisions = {divisions}
rings = {rings}
element = "{element}"

[[layers]]
material = "{film}"
thickness = "1 um"
interface = {interface}

[base]
thickness = "3 um"

[conductivity]
electric = {{name = "step", kappa = inf}}

[indenter]
name = "sphere"
radius = "10 um"

[formulation]
{formulation}

[[steps]]
approach = "120 nm"
"""


def totals(folder, rings=2, text=CASE, **values):
    """Return normal force [N] and charge [C] under the sphere."""
    path = folder / "case.toml"
    path.write_text(text.format(rings=rings, **values), encoding="utf-8")
    result = meeframe.solve_case(meeframe.load_case(path))
    (last,) = result.steps
    assert last.status == "converged"
    return result.zone.weights @ np.column_stack([last.traction[:, 2], last.fluxes[:, 0]])


COATED = {"film": "batio3", "lower": "cofe2o4", "interface": '{electrode = "grounded"}', "element": "quad9"}
ROTATION = '\nrotation = {axis = [1, 2, 3], angle = "40 deg"}'
BOUNDARY_ELEMENTS = 'name = "dense-bem"\nquadrature_tolerance = 1e-3'
"""Quadrature as accurate as 1e-5 changes the totals by less than 1e-4."""
SPRINGS = "{normal_stiffness = 3e17, tangential_stiffness = 1e17, electric_conductance = 0.5}"


@pytest.mark.full
def test_sphere_on_a_film_by_three_methods(tmp_path):
    """On the same nodes, the differences decrease with the elements, and end below 1 % and 2 %.

    The lower material is triclinic, the film is attached by springs.
    """
    case = {"film": "pzt-4", "lower": "batio3-cofe2o4", "interface": SPRINGS + ROTATION, "element": "quad9"}
    coarse, fine = (differences(tmp_path, divisions, **case) for divisions in (4, 6))
    assert (fine < coarse).all()
    assert (fine < [[0.01], [0.02]]).all()


def differences(folder, divisions, **values):
    """Return the differences of the totals by finite and boundary elements, relative to those by the half space."""
    formulations = 'name = "half-space"', 'name = "skfem"\ngrowth = 3.0', BOUNDARY_ELEMENTS
    by_waves, *by_elements = (totals(folder, divisions=divisions, formulation=text, **values) for text in formulations)
    return np.abs(np.array(by_elements) / by_waves - 1.0)


SECOND = """
[second_body.material]
name = "batio3-cofe2o4"

[second_body.mesh]
type = "half-space"
contact_width = "4 um"
half_width = "10 um"
divisions = {divisions}
rings = {rings}
element = "quad9"

[second_body.formulation]
{formulation}

[[second_body.layers]]
material = "pzt-4"
thickness = "1.5 um"
interface = {{normal_stiffness = 3e17, tangential_stiffness = 1e17}}

[second_body.base]
thickness = "2.5 um"
"""


@pytest.mark.full
def test_two_coated_bodies_by_three_methods(tmp_path):
    """Force and charge by elements approach those by the half space on the same nodes, to 0.4 % and 1 %."""
    coarse, fine = (
        differences(tmp_path, divisions, rings=rings, text=CASE + SECOND, **COATED)
        for divisions, rings in ((4, 2), (6, 3))
    )
    assert (fine < coarse).all()
    assert (fine < [0.004, 0.01]).all()


@pytest.mark.full
def test_verify_takes_the_same_case_file(tmp_path):
    """Linear elements: force and pressure of both methods have the same limits within resolved errors."""
    both = ("half-space", '{name = "skfem", growth = 1.6}')
    verification = verify(film_on_electrode(tmp_path, divisions=18, rings=2), tmp_path / "out", both)
    assert verification.verdict is Verdict.AGREE
    pairs = {pair.first.quantity: pair for pair in verification.agreements}
    for name in ("force", "charge", "max_pressure"):
        assert pairs[name].verdict is Verdict.AGREE
    assert abs(pairs["force"].difference) < 0.01 * pairs["force"].scale


def film_on_electrode(folder, **mesh):
    """Write a case of linear elements and return its file."""
    path = folder / "case.toml"
    values = COATED | {"element": "quad4"}
    path.write_text(CASE.format(formulation='name = "half-space"', **mesh, **values), encoding="utf-8")
    return path


@pytest.mark.full
def test_hot_sphere_on_a_film_by_finite_elements_and_half_space():
    """A grounded pyroelectric film: force, charge and heat, and the changes of force and charge by heating."""
    by_waves, by_elements = (heated_totals(formulation) for formulation in (HalfSpace(), FiniteElements(growth=3.0)))
    assert by_waves[1, 0] == pytest.approx(1.0125 * by_waves[0, 0], rel=3e-3)  # heat matters
    np.testing.assert_allclose(by_elements[1], by_waves[1], rtol=0.02)
    np.testing.assert_allclose(np.diff(by_elements, axis=0), np.diff(by_waves, axis=0), rtol=0.04)


def heated_totals(formulation):
    """Return normal force [N], charge [C] and heat [W] under a cold and a hot sphere, (2, 3)."""
    case = meeframe.Case(
        material=library_material("cofe2o4", thermal=True),
        layers=[
            meeframe.Layer(
                library_material("batio3", thermal=True), 1e-6, interface=meeframe.Interface(electrode="grounded")
            )
        ],
        base=meeframe.Base(3e-6),
        mesh=meeframe.mesh.half_space(4e-6, divisions=6, half_width=1e-5, rings=2, element="quad9"),
        formulation=formulation,
        indenter=meeframe.Sphere(1e-5),
        conductivity={"electric": StepConductivity(np.inf), "thermal": StepConductivity(2e7)},
        steps=[meeframe.Step(approach=1.2e-7), meeframe.Step(temperature=60.0)],
    )
    table = case.solve(progress=False).to_dataframe()
    assert (table["status"] == "converged").all()
    return table[["normal_force", "charge", "heat"]].to_numpy()
