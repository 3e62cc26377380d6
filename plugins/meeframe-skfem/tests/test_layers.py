"""Layers: closed forms of uniform loads and capacitors, equal materials, fitted grids, messages."""

from dataclasses import replace

import meshio
import numpy as np
import pytest
from meeframe_skfem import FiniteElements
from meeframe_skfem.interior import FiniteElementInterior

from meeframe.common.errors import CaseError, MeshError
from meeframe.elements import Quad4, Quad9
from meeframe.fields import ELECTRIC, MEE
from meeframe.formulations.dense_bem import DenseBEM
from meeframe.material import library_material, rotation_about
from meeframe.material.layers import Interface, Layer, LayerStack
from meeframe.mesh import block_mesh
from meeframe.mesh.body import Body, BoundaryCondition

FILM, MIDDLE, SUBSTRATE = (library_material(name) for name in ("batio3", "pzt-4", "batio3-cofe2o4"))
ROLLERS = {"side_x-": 0, "side_x+": 0, "side_y-": 1, "side_y+": 1, "base": 2}
HEIGHT, THICKNESSES = 0.7, (0.1, 0.25)
COUPLED = [2, 3, 4]
LOAD = np.array([0.0, 0.0, -2e6, 3e-3, 5e-2])
SPRINGS = Interface(3e11, 2e11, {"electric": 2e-8, "magnetic": 5e-4})


def block(element, stack, rollers=ROLLERS, grounded=(3, 4), material=SUBSTRATE):
    mesh = block_mesh((0.5, 0.4), HEIGHT, (0.4, 0.3), (2, 2), 1, 1, element)
    held = [BoundaryCondition(group, field, "value") for group, field in rollers.items()]
    held += [BoundaryCondition("base", field, "value") for field in grounded]
    return Body(material.stiffness, mesh, tuple(held), "contact", layers=stack)


def uniform(body, load):
    """Return the body with the load on its top, beside the zone."""
    loads = tuple(BoundaryCondition("top", field, "flux", load[field]) for field in COUPLED)
    return replace(body, conditions=(*body.conditions, *loads))


def gradients_of(material, load, electrode=False):
    """Return the derivatives by height of fields that depend on it alone, for zero field at an electrode."""
    matrix = material.stiffness[2][np.ix_(COUPLED, COUPLED)][..., 2]
    slope = np.zeros(5)
    columns = [0, 2] if electrode else [0, 1, 2]
    slope[np.array(COUPLED)[columns]] = np.linalg.solve(matrix[np.ix_(columns, columns)], load[COUPLED][columns])
    return slope


INTERFACES = {
    "bonded": Interface(),
    "springs": SPRINGS,
    "normal spring": Interface(normal_stiffness=3e11),
    "grounded": Interface(electrode="grounded"),
    "floating": Interface(electrode="floating", tangential_stiffness=1e11),
}


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("lower", INTERFACES.values(), ids=INTERFACES)
def test_uniform_load_on_two_layers_is_exact(lower):
    """Values are linear in each layer, jump at springs, and vanish on an electrode; stress and fluxes are constant."""
    element = Quad9() if lower.electrode is None else Quad4()
    stack = LayerStack((Layer(FILM, THICKNESSES[0]), Layer(MIDDLE, THICKNESSES[1], lower)))
    solution = FiniteElements(growth=3.0).solve(uniform(block(element, stack), LOAD))
    slopes = [gradients_of(FILM, LOAD), gradients_of(MIDDLE, LOAD)]
    slopes.append(gradients_of(SUBSTRATE, LOAD, lower.electrode == "grounded"))
    check_values(solution, slopes, lower.compliance(MEE) * LOAD)
    check_fluxes(solution, slopes)


def check_values(solution, slopes, jump):
    """Check values at all nodes: linear by height with slopes in each layer, and a jump below the second layer."""
    heights = -np.array([THICKNESSES[0], sum(THICKNESSES), HEIGHT])
    second = slopes[2] * (heights[1] - heights[2]) + jump
    bottoms = [second + slopes[1] * (heights[0] - heights[1]), second, np.zeros(5)]
    scale = np.abs(bottoms).max(axis=0) + np.abs(slopes).max(axis=0)
    scale[:2] = scale[2]
    values, layered = solution.values(np.tile(LOAD, (len(solution.matched.zone_points), 1))), solution.matched.layered
    for region, (slope, bottom) in enumerate(zip(slopes, bottoms, strict=True)):
        nodes = np.unique(layered.mesh.cells[layered.regions == region])
        exact = bottom + np.outer(layered.mesh.points[nodes, 2] - heights[region], slope)
        np.testing.assert_allclose(values[nodes] / scale, exact / scale, atol=1e-11)


def check_fluxes(solution, slopes):
    """Check the fluxes through horizontal planes in the film and in the body."""
    frames = solution.matched.zone.frames
    load = np.column_stack([frames @ LOAD[:3], np.tile(LOAD[3:], (len(frames), 1))])
    points = np.array([[0.1, 0.05, -0.05], [0.1, 0.05, -0.5]])
    fluxes = FiniteElementInterior(solution).evaluate(load, points).fluxes[:, 2, 2:]
    below = SUBSTRATE.stiffness[2, 2:, :, 2] @ slopes[2]
    np.testing.assert_allclose(fluxes, [LOAD[2:], below], rtol=1e-9)
    interfaces = np.array([[0.1, 0.05, -depth] for depth in np.cumsum(THICKNESSES)])
    stress = FiniteElementInterior(solution).evaluate(load, interfaces).fluxes[:, :, :3]
    np.testing.assert_allclose(stress[:, 2, 2], LOAD[2], rtol=1e-9)
    np.testing.assert_array_equal(stress, stress.transpose(0, 2, 1))


@pytest.mark.full
def test_layers_of_one_material_are_homogeneous():
    """Interfaces are on planes of the homogeneous grid, so that round-off alone differs."""
    material = library_material("orthotropic-mee").rotated(rotation_about((1.0, 2.0, 0.5), 0.8))
    held = tuple(BoundaryCondition("base", field, "value") for field in range(5))
    plain = Body(material.stiffness, block_mesh(0.3, 0.4, 0.2, 2, 1, 1, Quad4()), held, "contact")
    layered = replace(plain, layers=LayerStack((Layer(material, 0.1), Layer(material, 0.1))))
    one, other = (FiniteElements(growth=1.0).reduce(body) for body in (plain, layered))
    scale = np.sqrt(np.abs(np.einsum("naa->a", one.diagonal_blocks())))
    first, second = (system.dense() / (scale[:, None, None] * scale) for system in (one, other))
    assert np.abs(first - second).max() < 1e-12 * np.abs(first).max()


def test_a_floating_electrode_is_the_plate_of_a_capacitor():
    """Whatever the distribution of the charge above, its potential is Q H / (eps A), unlike that above."""
    silicon = library_material("silicon")
    stack = LayerStack((Layer(FILM, 0.2, Interface(electrode="floating")),))
    solution = FiniteElements(growth=2.0).solve(block(Quad4(), stack, material=silicon))
    loads = np.zeros((len(solution.matched.zone_points), 5))
    loads[0, 3] = 1e-3
    charge = float((solution.mass @ loads[:, 3]).sum()) * solution.units.length**2
    potential = solution.values(loads)[:, ELECTRIC]
    layered = solution.matched.layered
    height = layered.mesh.points[:, 2]
    permittivity = -silicon.stiffness[2, ELECTRIC, ELECTRIC, 2]
    below = height < -0.2 + 1e-9
    expected = -charge * (height + HEIGHT) / (permittivity * 1.0 * 0.8)
    np.testing.assert_allclose(potential[below], expected[below], atol=1e-11 * np.abs(expected).max())
    assert np.ptp(potential[height > -1e-9]) > 0.01 * np.abs(expected).max()


def test_a_grounded_electrode_needs_no_other_ground():
    stack = LayerStack((Layer(FILM, 0.2, Interface(electrode="grounded")),))
    body = block(Quad4(), stack, grounded=(4,))
    solution = FiniteElements().solve(body)
    loads = np.zeros((len(solution.matched.zone_points), 5))
    loads[0, 3] = 1e-3
    potential = solution.values(loads)[:, ELECTRIC]
    height = solution.matched.layered.mesh.points[:, 2]
    assert not potential[np.abs(height + 0.2) < 1e-9].any()
    with pytest.raises(CaseError, match="no boundary condition prescribes electric_potential"):
        FiniteElements().check(replace(body, layers=LayerStack((Layer(FILM, 0.2),))))


def test_the_grid_is_fitted_to_layers():
    """Interfaces are planes of the grid; widths grow by at most `growth`, save below thin layers."""
    stack = LayerStack((Layer(FILM, 0.37), Layer(MIDDLE, 0.01)))
    solution = FiniteElements(growth=1.4).solve(block(Quad4(), stack))
    depths = np.unique(np.round(-solution.matched.volume.points[:, 2], 12))
    assert {0.37, 0.38} <= set(depths.tolist())
    widths = np.diff(depths)
    first = np.searchsorted(depths, 0.37)
    assert (widths[1:first] / widths[: first - 1] < 1.4 * (1 + 1e-9)).all()
    assert widths[first] == pytest.approx(0.01)
    assert widths[0] <= 0.175 * (1 + 1e-9)


TWO = LayerStack((Layer(FILM, 0.1), Layer(MIDDLE, 0.25)))


@pytest.mark.parametrize(
    ("formulation", "stack", "error", "message"),
    [
        (
            FiniteElements(),
            LayerStack((Layer(FILM, 0.7),)),
            MeshError,
            r"layers are 0\.7 m thick, the body is 0\.7 m deep",
        ),
        (FiniteElements(layers=3), TWO, CaseError, "skfem: layers: the grid is not fitted"),
        (FiniteElements(grid="shells"), TWO, CaseError, 'grid = "shells": the grid is not fitted'),
        (FiniteElements(depth=1.0), TWO, CaseError, r"depth = 1 m: the depth of a block.*allowed: half spaces"),
    ],
)
def test_messages(formulation, stack, error, message):
    with pytest.raises(error, match=message):
        formulation.check(block(Quad4(), stack))


@pytest.mark.parametrize(("electrode", "data"), [("grounded", 2.0), ("floating", (0.0, 2.0))])
def test_electrodes_have_one_potential(electrode, data):
    body = block(Quad4(), LayerStack((Layer(FILM, 0.1, Interface(electrode=electrode)),)))
    first, last = np.broadcast_to(data, 2)
    sides = [BoundaryCondition(f"side_{name}", 3, "value", value) for name, value in (("x-", first), ("x+", last))]
    body = replace(body, conditions=(*body.conditions, *sides))
    body = replace(body, conditions=tuple(c for c in body.conditions if (c.group, c.field) != ("base", 3)))
    with pytest.raises(CaseError, match=r"electrode of a layer.*another electric potential.*allowed: zero beside"):
        FiniteElements().check(body)


def test_a_floating_electrode_takes_the_potential_of_a_side():
    body = block(Quad4(), LayerStack((Layer(FILM, 0.1, Interface(electrode="floating")),)), grounded=(4,))
    body = replace(body, conditions=(*body.conditions, BoundaryCondition("side_x-", 3, "value", 2.0)))
    solution = FiniteElements().solve(body)
    height = solution.matched.layered.mesh.points[:, 2]
    potential = solution.units.values_si(solution.constant)[:, 3]
    np.testing.assert_allclose(potential[np.abs(height + 0.1) < 1e-9], 2.0)


def cube_with(stack, mesh):
    held = tuple(BoundaryCondition("z-", field, "value") for field in range(5))
    return Body(SUBSTRATE.stiffness, mesh, held, "z+", layers=stack)


def test_cells_of_a_file_must_not_cross_interfaces(cube_file):
    mesh, file = cube_file("tet10", 4)
    formulation = FiniteElements(volume=file, unit=1e-3)
    formulation.check(cube_with(LayerStack((Layer(FILM, 0.25),)), mesh))
    with pytest.raises(MeshError, match=r"\d+ of \d+ cells lie on both sides of the interface below layer 1, 0\.3 m"):
        formulation.check(cube_with(LayerStack((Layer(FILM, 0.3),)), mesh))
    with pytest.raises(MeshError, match="layer 1 has no cells"):
        formulation.check(cube_with(LayerStack((Layer(FILM, 1e-8),)), mesh))


def rotated(body, file, turn):
    """Return a body and the file of its volume mesh after a rotation."""
    volume = meshio.read(file)
    path = file.with_name("rotated.vtu")
    meshio.write(path, meshio.Mesh(volume.points @ turn.T, volume.cells))
    layers = tuple(replace(layer, material=layer.material.rotated(turn)) for layer in body.layers.layers)
    mesh = replace(body.mesh, points=body.mesh.points @ turn.T)
    return replace(body, stiffness=SUBSTRATE.rotated(turn).stiffness, mesh=mesh, layers=LayerStack(layers)), path


@pytest.mark.full
def test_oblique_interfaces_with_springs(cube_file):
    """The response of a rotated body is the same in its local frames."""
    mesh, file = cube_file("hex8", 2)
    body = cube_with(LayerStack((Layer(FILM, 0.5, SPRINGS),)), mesh)
    turn = rotation_about((1.0, 2.0, 0.5), 0.8)
    other, path = rotated(body, file, turn)
    one, two = (FiniteElements(volume=f, unit=1e-3).reduce(b).dense() for f, b in ((file, body), (path, other)))
    straight = (
        FiniteElements(volume=file, unit=1e-3).reduce(replace(body, layers=LayerStack((Layer(FILM, 0.5),)))).dense()
    )
    normal = np.s_[:, 2:, :, 2:]
    scale = np.abs(one).max(axis=(0, 2), keepdims=True)[normal]
    assert np.abs((two[normal] - one[normal]) / scale).max() < 1e-10
    assert np.abs((straight[normal] - one[normal]) / scale).max() > 0.01
    alone = LayerStack((Layer(FILM, 0.5, Interface(normal_stiffness=3e11)),))
    with pytest.raises(CaseError, match=r"interface below layer 1: only one of.*oblique.*allowed: both of them"):
        FiniteElements(volume=path, unit=1e-3).check(replace(other, layers=alone))


@pytest.mark.full
def test_boundary_elements_of_layers_agree():
    """Works of bumps of all fields on each other, on two layers with a floating electrode and springs."""
    rotated_film = FILM.rotated(rotation_about((1.0, 2.0, 3.0), 0.7))
    upper, lower = Layer(rotated_film, 0.1, Interface(electrode="floating")), Layer(MIDDLE, 0.25, SPRINGS)
    held = tuple(BoundaryCondition("base", field, "value") for field in range(5))
    differences = []
    for divisions, rings in ((2, 1), (4, 2)):
        mesh = block_mesh((0.5, 0.4), HEIGHT, (0.4, 0.3), divisions, rings, 1, Quad9())
        body = Body(SUBSTRATE.stiffness, mesh, held, "contact", layers=LayerStack((upper, lower)))
        formulations = DenseBEM(quadrature_tolerance=1e-3), FiniteElements(growth=2.5)
        one, other = (works(formulation.reduce(body)) for formulation in formulations)
        scale = np.sqrt(np.abs(np.diag(other)))
        differences.append(np.abs((one - other) / np.outer(scale, scale)).max())
    coarse, fine = differences
    assert fine < min(0.3 * coarse, 0.005)


def works(system):
    """Return the works (5, 5) of bumps of one field on the displacements by bumps of another one."""
    bump = np.exp(-(system.points[:, :2] ** 2).sum(axis=1) / (2 * 0.08**2))
    loads = bump[:, None] * np.eye(5)[:, None, :]
    responses = np.array([system.apply(load) for load in loads])
    return np.einsum("n,inf,jnf->ij", system.weights, loads, responses)
