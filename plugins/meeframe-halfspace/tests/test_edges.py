"""Test contact edges between the nodes: strips, discs, ellipses and squares in closed form, at any position and
angle."""

from dataclasses import replace

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace
from meeframe_halfspace.edges import MAX_EDGE_DISTANCE
from meeframe_halfspace.outline import distance_of, find_outline
from meeframe_halfspace.strip import edge_limits, edge_response, line_responses
from scipy.linalg import toeplitz
from scipy.special import ellipk

from meeframe.common.errors import CaseError
from meeframe.elements import Quad4
from meeframe.indenters import Placement, SampledHeights, find_indenter_edge, longest_side
from meeframe.indenters import shapes as rigid
from meeframe.laws import Signorini, StepConductivity
from meeframe.material import library_material
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.model.case import Case
from meeframe.model.history import at_rest
from meeframe.model.kinematics import IndenterKinematics
from meeframe.model.solve import reduce, solve_case
from meeframe.model.step import Step
from meeframe.results.resultants import resultants
from meeframe.solvers import Auto, Nesterov, ProjectedCG, SemismoothNewton, StoppingCriteria, solve, solve_to_edges
from meeframe.solvers.driver import resolve_edges
from meeframe.system.capabilities import EdgeResolution, Multigrid
from meeframe.system.dense import with_matrix
from meeframe.system.rotated import rotate_frames
from meeframe.system.two_body import combine_bodies
from meeframe.testing.closed_forms import Cone, FlatPunch, Sphere, indent
from meeframe.testing.half_space import indentation_problem

MATERIAL = library_material("batio3-cofe2o4")
XI = axisymmetric_compliance(MATERIAL.stiffness)
APPROACH = 5e-5
SQUARE = 0.3667877
"""Charge of a square of side 1 at potential 1 with the kernel 1/r (Read, J. Comput. Phys. 133 (1997) 1)."""


def half_space(spacing, divisions, edges="resolved"):
    """Return a half space; `divisions` applies to both axes, or gives one number for each."""
    width = tuple((np.array(spacing) * divisions).tolist())
    mesh = half_space_mesh(10.0 * max(width), width, divisions, 1, Quad4())
    return HalfSpace(matrix_up_to=0, edges=edges).reduce(Body(MATERIAL.stiffness, mesh, (), "contact"))


def totals(system, height, approach, potentials=(None, None), kappa=np.inf, offset=(0.0, 0.0)):
    """Return the resultants of -t.nu, q and s; `offset` is that of the indenter's axis [m]."""

    def above(points, _frames):
        return height(points[:, 0] + offset[0], points[:, 1] + offset[1]) - approach

    conductivity = tuple(0.0 if value is None else kappa for value in potentials)
    given = tuple(value or 0.0 for value in potentials)
    nodes = above(system.points, None) + approach
    problem = indentation_problem(system, nodes, approach, None, conductivity, given)
    solver = Auto() if any(conductivity) else ProjectedCG()
    reach = 2.0 * longest_side(system.points, system.cells)
    solution, _ = solve_to_edges(
        problem,
        solver,
        StoppingCriteria(tolerance=1e-10),
        indenter_edge=lambda: find_indenter_edge(above, system.points, system.frames, reach),
    )
    assert solution.status == "converged", solution.message
    return system.weights @ solution.state.load[:, 2:] * [-1.0, 1.0, 1.0]


INDENTERS = {
    "sphere": (Sphere(0.1), rigid.Sphere(0.1)),
    "cone": (Cone(0.02), rigid.Cone(0.02)),
    "punch": (FlatPunch(2e-3), rigid.FlatPunch(2e-3)),
}


def errors(name, potentials, cells, offset=(0.0, 0.0), edges="resolved"):
    """Return the relative errors of the totals that are not zero; `offset` is that of the axis from a node, in
    spacings."""
    shape, indenter = INDENTERS[name]
    exact = indent(XI, shape, APPROACH, *potentials)
    h = 2.0 * exact.contact_radius / cells
    system = half_space((h, h), 2 * round(0.6 * cells), edges)
    computed = totals(system, indenter.height, APPROACH, potentials, offset=(offset[0] * h, offset[1] * h))
    true = np.array([exact.force, exact.charge, exact.magnetic_flux])
    return computed[true != 0.0] / true[true != 0.0] - 1.0


# strips


def test_charge_of_a_strip():
    """The edges of a strip of 47 nodes are 0.2 spacings beyond the first node and 0.3 inside the last."""
    count, beyond = 47, np.array([0.2, -0.3])
    matrix = toeplitz(line_responses(count))
    matrix[[0, -1], [0, -1]] += edge_response(beyond)
    charge = np.linalg.solve(matrix, np.ones(count)).sum()
    width = count - 1 + beyond.sum()
    assert 1.0 / charge == pytest.approx(2.0 * np.log(2.0 / (width / 2.0)), rel=1e-4)


def test_nodal_compliance_grows_as_area_fraction_decreases():
    low, high = edge_limits()
    assert high - low == pytest.approx(1.0)
    assert edge_response(np.array([high, 2.0])) == pytest.approx(0.0, abs=1e-12)
    assert (np.diff(edge_response(np.linspace(low, high, 50))) <= 0.0).all()


# outlines


@pytest.mark.parametrize("direction", [0.0, 0.3, 0.6, np.pi / 4])
def test_outline_of_a_straight_edge(direction):
    """The fit recovers the edge from pressures as a grid computes them; uncorrected, it misses by less than 0.15
    spacings."""
    inward = np.array([[np.cos(direction), np.sin(direction)]])
    i, j = np.indices((41, 41)) - 20.0
    distance = inward[0, 0] * i + inward[0, 1] * j + 0.37
    values = np.linspace(0.0, 8.0, 20_001)
    on_grid = np.interp(distance, distance_of(values[None], -inward)[0], values, left=0.0)
    for pressure, much, askew in ((on_grid, 1e-3, 1e-4), (np.sqrt(np.maximum(distance, 0.0)), 0.15, 0.05)):
        outline = find_outline(pressure)
        inner = (np.abs(outline.nodes - 20) < 15).all(axis=1)
        assert inner.sum() > 30
        off = outline.distance - distance[tuple(outline.nodes.T)]
        assert np.abs(off[inner]).max() < much
        assert -outline.outward[inner] == pytest.approx(np.repeat(inward, inner.sum(), axis=0), abs=askew)


def test_a_stored_matrix_has_the_edges_of_its_system():
    system = half_space((1e-4, 1e-4), 7)
    stored, load = with_matrix(system), np.random.default_rng(1).normal(size=system.offset.shape)
    response = system.apply(load)
    np.testing.assert_allclose(stored.apply(load), response, rtol=0.0, atol=1e-12 * np.abs(response).max())
    pressure = np.where(np.linalg.norm(system.points, axis=1) < 2.5e-4, 1.0, 0.0)
    corrections = [each.capability(EdgeResolution).edge_correction(pressure) for each in (system, stored)]
    np.testing.assert_array_equal(*(correction.extra_compliance for correction in corrections))
    assert stored.capability(Multigrid) is None
    assert with_matrix(half_space((1e-4, 1e-4), 7, "nodes")).capability(EdgeResolution) is None


def test_outline_of_an_elliptic_contact():
    """The mean error is below 0.02 spacings and that of each node below 0.05, on an ellipse that was not used to
    calibrate NEARER."""
    h = 1.0 / 21.3
    system = half_space((h, h), 52)
    x, y = system.points[:, 0] + 0.3 * h, system.points[:, 1] + 0.4 * h
    problem = indentation_problem(system, x**2 / 2.0 + y**2 / 1.2, 0.5)
    solution, _ = solve_to_edges(problem, ProjectedCG(), StoppingCriteria(tolerance=1e-8))
    pressure = np.maximum(-solution.state.load[:, 2], 0.0)
    # p = p_o sqrt(1 - (x/a)^2 - (y/b)^2), fitted where the grid resolves it
    deep = pressure > 0.6 * pressure.max()
    p_o, a, b = np.linalg.lstsq(np.stack([np.ones(deep.sum()), -(x**2)[deep], -(y**2)[deep]], 1), pressure[deep] ** 2)[
        0
    ]
    outline = find_outline(pressure[system.grid.nodes])
    numbers = system.grid.nodes[tuple(outline.nodes.T)]
    value, slope = p_o - a * x**2 - b * y**2, np.hypot(2.0 * a * x, 2.0 * b * y)
    off = outline.distance - (value / slope / h)[numbers]
    near = np.abs(outline.distance) < 0.5
    assert abs(off[near].mean()) < 0.02
    assert np.abs(off[near]).max() < 0.05


# contact


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    ("name", "solver"), [("sphere", SemismoothNewton), ("cone", SemismoothNewton), ("sphere", Nesterov)]
)
def test_attractive_conduction_converges_to_closed_forms(name, solver, monkeypatch):
    """With edges along nodes there are several solutions; the one with the largest contact is accurate to 2 %."""
    monkeypatch.setitem(globals(), "Auto", solver)
    assert np.abs(errors(name, (-1e5, 0.0), 48.3, edges="nodes")).max() < 5e-3


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("offset", [(0.0, 0.0), (0.5, 0.5)])
@pytest.mark.parametrize("cells", [64.0, 64.25])
@pytest.mark.parametrize("name", ["sphere", "cone"])
def test_charges_under_prescribed_potentials(name, cells, offset):
    """Charges are singular at the edge. Their contributions nearly cancel, which magnifies errors by a factor of 2 to
    3."""
    assert np.abs(errors(name, (-1.5e4, 30.0), cells, offset)).max() < 1e-3


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("cells", [64.0, 64.4])
def test_punch_between_cells(cells):
    assert np.abs(errors("punch", (-1.5e4, 30.0), cells)).max() < 3e-4


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("name", ["sphere", "cone"])
def test_regular_charges(name):
    assert np.abs(errors(name, (0.0, 0.0), 64.25, (0.1, 0.2))).max() < 1e-4


@pytest.mark.full
def test_order_of_the_punch():
    """The order exceeds 1, that of edges along nodes; root mean squares over positions of the edge
    on 12 to 48 cells."""
    grids = (12.0, 24.0, 48.0)
    sizes = [
        np.sqrt(np.mean([errors("punch", (None, None), cells + part)[0] ** 2 for part in (0.0, 0.25, 0.5, 0.75)]))
        for cells in grids
    ]
    assert -np.polyfit(np.log(grids), np.log(sizes), 1)[0] > 1.3
    assert sizes[-1] < 3e-4


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("bodies", [1, 2])
@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_elliptic_punch_on_oblong_cells(turn, bodies):
    """Two equal bodies are twice as compliant and have the same contact edge."""
    a, b, depth = 1.2e-3, 0.8e-3, 1e-6
    system = half_space((2.0 * a / 31.3, 2.0 * b / 30.2), 50)
    c, s = np.cos(turn), np.sin(turn)

    def height(x, y):
        return np.where(((c * x + s * y) / a) ** 2 + ((c * y - s * x) / b) ** 2 <= 1.0, 0.0, np.inf)

    exact = depth / XI[0, 0] * a / ellipk(1.0 - (b / a) ** 2)
    seen = system if bodies == 1 else combine_bodies(system, system)
    assert bodies * totals(seen, height, depth)[0] == pytest.approx(exact, rel=1e-3)


# complete cases


def half_space_case(indenter, approach, placement, width, divisions, edges="resolved", potential=None):
    """Return a case; `potential` is that of a conducting indenter, None of an insulating one."""
    return Case(
        material=MATERIAL,
        mesh=half_space_mesh(2e-2, width, divisions, 1, Quad4()),
        conditions=(),
        formulation=HalfSpace(edges=edges, matrix_up_to=0),
        indenter=indenter,
        placement=placement,
        contact_law=Signorini(),
        conductivity={"electric": StepConductivity(0.0 if potential is None else np.inf)},
        potentials={"electric_potential": potential or 0.0},
        steps=(Step(approach=approach),),
        stopping=StoppingCriteria(tolerance=1e-8),
    )


def force_of_case(*given):
    """Return the force on the body in `half_space_case`."""
    result = solve_case(half_space_case(*given))
    assert result.steps[-1].status == "converged"
    return -resultants(result.zone, result.steps[-1]).force[2]


def test_rotated_square_punch():
    """Corners and edges cross the grid lines."""
    side, depth = 1e-3, 1e-6
    punch = rigid.RectangularPunch(side / 2.0, side / 2.0)
    computed = force_of_case(punch, depth, Placement(rotation=0.3), 1.6e-3, 60)
    assert computed == pytest.approx(depth / XI[0, 0] * SQUARE * side, rel=1e-3)


def test_indenter_edge_on_elongated_cells():
    """The search range for the indenter edge scales with the length of the cells."""
    radius, length = 2e-3, 4e-4
    case = half_space_case(rigid.FlatPunch(radius), 1e-6, Placement(), (12 * length, 4.8e-3), (12, 192))
    kinematics = IndenterKinematics(case, reduce(case))
    exact = radius - np.hypot(*kinematics.system.points[:, :2].T)
    edge = kinematics.indenter_edge(kinematics.increment({}, at_rest(case.motions, case.potentials, len(exact))))
    near = np.abs(exact) < MAX_EDGE_DISTANCE * length
    assert edge.distance[near] == pytest.approx(exact[near], rel=2e-3, abs=1e-9)


def test_indenter_edge_under_tilted_axis():
    """A tilted axis and a tilted indenter give the same surface, with different lowest points."""
    tilt, depth, width = 0.01, 2e-5, 1.6e-3
    punch = rigid.FlatPunch(5e-4)
    by_axis = force_of_case(punch, depth, Placement(axis=(tilt, 0.0, 1.0)), width, 40)
    tilted = Placement(tilt_2=float(np.arctan(tilt)))
    assert by_axis == pytest.approx(force_of_case(punch, depth - tilt * width / 2.0, tilted, width, 40), rel=1e-4)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("potential", [None, 1e3])
def test_pointwise_heights_have_no_indenter_edge(potential):
    """A punch given by nodal heights has an unknown border between the nodes."""
    width, depth = 1.6e-3, 1e-6
    grid = np.linspace(-width / 2.0, width / 2.0, 41)
    x, y = (side.ravel() for side in np.meshgrid(grid, grid))
    for shape in (rigid.Sphere(0.1), rigid.FlatPunch(5.1e-4)):
        height = shape.height(x, y)
        rows = np.stack([x, y, height], axis=1)[np.isfinite(height)]
        sampled = SampledHeights(rows, "nodes")
        edges = "resolved" if isinstance(shape, rigid.Sphere) and potential else "nodes"
        expected = force_of_case(shape, depth, Placement(), width, 40, edges, potential)
        computed = force_of_case(sampled, depth, Placement(), width, 40, "resolved", potential)
        assert computed == pytest.approx(expected, rel=1e-6)


def test_contact_edge_does_not_depend_on_round_off():
    """Nodes between open and closed have no pressure, whatever its sign in the last digit, nor have open ones."""
    h = 2.0 * np.sqrt(0.1 * APPROACH) / 24.3
    system = half_space((h, h), 40)
    gap = rigid.Sphere(0.1).height(system.points[:, 0], system.points[:, 1])
    problem = indentation_problem(system, gap, APPROACH, None, (np.inf, 0.0), (1.5e4, 0.0))
    state = solve(problem, SemismoothNewton()).state
    biactive = np.flatnonzero((state.contact_fraction > 0.0) & (state.contact_fraction < 1.0))
    assert len(biactive) > 0
    corrected = []
    for round_off in (0.0, -1e-16 * np.abs(state.load[:, 2]).max()):
        load = state.load.copy()
        load[biactive[::2], 2] = round_off
        corrected.append(resolve_edges(problem, replace(state, load=load)).area_fraction)
    np.testing.assert_array_equal(corrected[1], corrected[0])
    load = state.load.copy()
    load[load[:, 2] == 0.0, 2] = 1e-12 * load[:, 2].min()
    assert (state.contact_fraction[load[:, 2] != state.load[:, 2]] == 0.0).any()
    np.testing.assert_array_equal(resolve_edges(problem, replace(state, load=load)).area_fraction, corrected[0])


# indenters that end outside the contact


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("beyond", [0.3, 0.8, 1.5])
def test_indenter_edge_outside_the_contact(beyond):
    """A sphere that is cut off outside its contact gives the same charge as the complete sphere, and no correction
    without charge.

    Potentials of the other sign attract the surfaces, which leads to several solutions on a grid.
    """
    a = np.sqrt(0.1 * APPROACH)
    h = 2.0 * a / 24.3
    system = half_space((h, h), 40)

    def cut(radius):
        return lambda x, y: np.where(np.hypot(x, y) <= radius, rigid.Sphere(0.1).height(x, y), np.inf)

    potentials = (1.5e4, None)
    whole = totals(system, cut(np.inf), APPROACH, potentials)
    assert totals(system, cut(a + beyond * h), APPROACH, potentials) == pytest.approx(whole, rel=1e-6)

    def above(points, _frames):
        return cut(a + beyond * h)(points[:, 0], points[:, 1]) - APPROACH

    problem = indentation_problem(system, above(system.points, None) + APPROACH, APPROACH)
    end = find_indenter_edge(above, system.points, system.frames, 2.0 * h)
    assert end is not None
    _, same = solve_to_edges(problem, ProjectedCG(), StoppingCriteria(tolerance=1e-8), indenter_edge=lambda: end)
    assert same is problem


@pytest.mark.parametrize(("divisions", "too_large"), [(23, 1.155), (31, 1.145), (47, 1.116)])
def test_resolved_area_of_the_punch(divisions, too_large):
    """The area is pi R^2: nodes outside the indenter edge do not count, and nodes near it count in part.

    `too_large` is the relative area of all nodes with pressure.
    """
    mesh = half_space_mesh(1.6e-2, 4e-3, divisions, 1, Quad4())
    material = library_material("isotropic", young_modulus=210e9, poisson_ratio=0.3)
    punch, step = rigid.FlatPunch(1e-3), Step(approach=1e-6)
    result = solve_case(Case(material, mesh, (), punch, (step,), formulation=HalfSpace(edges="resolved")))
    totals = resultants(result.zone, result.steps[-1])
    assert totals.contact_area == totals.slip_area == pytest.approx(np.pi * 1e-6, rel=2e-3)
    whole = resultants(result.zone, replace(result.steps[-1], area_fraction=None))
    assert whole.contact_area == pytest.approx(too_large * np.pi * 1e-6, rel=2e-3)


def test_weak_conduction_is_proportional_to_area():
    """Q = kappa phi_o area, because the potential of the surface hardly changes; with edges along nodes, the area is
    off by several cells."""
    exact = indent(XI, Sphere(0.1), APPROACH)
    h = 2.0 * exact.contact_radius / 32.3
    kappa = 1e-7 / (abs(XI[1, 1]) * exact.contact_radius)
    system = half_space((h, h), 42)
    potentials = [1e4, -1e4]
    # the contribution of the pressure does not depend on the potential
    computed = [totals(system, rigid.Sphere(0.1).height, APPROACH, (phi, None), kappa)[1] for phi in potentials]
    area = np.pi * exact.contact_radius**2
    assert (computed[1] - computed[0]) / (kappa * 2e4) == pytest.approx(area, rel=1e-3)


# composed systems


def test_resolved_edges_in_rotated_frames_and_two_bodies():
    """Rotated frames give the same totals up to the directions in which the edge is sought; two equal bodies share
    the approach."""
    shape, indenter = INDENTERS["punch"]
    h = 2.0 * shape.radius / 24.4
    alone = half_space((h, h), 30)
    direct = totals(alone, indenter.height, APPROACH, (-1e4, None))
    askew = rotate_frames(alone, np.tile([np.cos(0.4), np.sin(0.4), 0.0], (len(alone.points), 1)))
    assert askew.capability(EdgeResolution) is not None
    assert totals(askew, indenter.height, APPROACH, (-1e4, None)) == pytest.approx(direct, rel=3e-5)
    sphere = rigid.Sphere(0.1)
    h = 2.0 * np.sqrt(0.1 * APPROACH) / 24.4
    alone = half_space((h, h), 30)
    grounded = totals(alone, sphere.height, APPROACH, (0.0, None))
    both = totals(combine_bodies(alone, alone), sphere.height, APPROACH, (None, None))
    single = totals(alone, sphere.height, APPROACH, (None, None))
    assert both[0] == pytest.approx(single[0] / 2.0, rel=1e-6)
    assert grounded[0] < single[0]


def test_edge_correction_is_symmetric_positive_and_bilinear_only():
    system = half_space((1e-4, 1e-4), 20)
    r = np.hypot(*system.points[:, :2].T)
    edges = system.edge_correction(np.sqrt(np.maximum(1.0 - (r / 7.3e-4) ** 2, 0.0)))
    flipped = edges.extra_compliance * np.array([1.0, 1.0, 1.0, -1.0, -1.0])[:, None]
    assert flipped == pytest.approx(flipped.transpose(0, 2, 1), rel=1e-9)
    scale = np.sqrt(np.abs(np.einsum("nii->i", edges.extra_compliance)))
    symmetric = (edges.extra_compliance + edges.extra_compliance.transpose(0, 2, 1)) / np.outer(scale, scale)
    assert np.linalg.eigvalsh(symmetric).min() > -1e-12
    assert ((edges.area_fraction > 0.0) & (edges.area_fraction < 1.0)).sum() > 30
    assert half_space((1e-4, 1e-4), 20, "nodes").capability(EdgeResolution) is None
    with pytest.raises(CaseError, match="edges = 'resolved' with density = 'constant'"):
        HalfSpace("constant", edges="resolved")


def test_no_edge_correction_without_singular_load():
    system = half_space((1e-4, 1e-4), 20)
    problem = indentation_problem(system, rigid.Sphere(0.1).height(*system.points[:, :2].T), 2e-6)
    problem = problem.with_laws(electric=StepConductivity(0.0))
    _, same = solve_to_edges(problem, ProjectedCG(), StoppingCriteria(tolerance=1e-8))
    assert same is problem
