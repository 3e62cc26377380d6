"""Dense boundary elements of layered bodies: exact fields on stacks, capacitors, meshes of regions, messages."""

from dataclasses import replace

import numpy as np
import pytest

from meeframe.common.errors import CaseError, MeshError
from meeframe.elements import Quad4, Quad8, Quad9, Tri6
from meeframe.fields import ELECTRIC, MEE
from meeframe.formulations.dense_bem import DenseBEM, formulation
from meeframe.formulations.dense_bem.regions import divide
from meeframe.material import library_material, rotation_about
from meeframe.material.layers import Interface, Layer, LayerStack, RigidBase
from meeframe.mesh import area, block_mesh, check_mesh, half_space_mesh, sphere_mesh, volume
from meeframe.mesh.body import Body, BoundaryCondition
from meeframe.mesh.surface import SurfaceMesh
from meeframe.results.interior import interior
from meeframe.testing import check_formulation
from meeframe.testing.manufactured import LinearField, PointSourceField, ThermalField, prescribe, with_heat

FILM, MIDDLE, SUBSTRATE = (library_material(name) for name in ("batio3", "pzt-4", "batio3-cofe2o4"))
HOT = FILM.with_heat(
    np.diag([3.0, 2.5, 4.0]), [1.2e-5, 2e-5, 0.8e-5], None, [2e-5, -1e-5, -7e-5], [1e-4, 2e-4, -3e-4], "strain"
)
TRICLINIC = library_material("orthotropic-mee").rotated(rotation_about((1.0, 2.0, 0.5), 0.8))
ROLLERS = {"side_x-": 0, "side_x+": 0, "side_y-": 1, "side_y+": 1, "base": 2}
SIDES = ("side_x-", "side_x+", "side_y-", "side_y+")
HEIGHT, THICKNESSES = 0.7, (0.1, 0.25)
COUPLED = [2, 3, 4]
LOAD = np.array([0.0, 0.0, -2e6, 3e-3, 5e-2])
SPRINGS = Interface(3e11, 2e11, {"electric": 2e-8, "magnetic": 5e-4})
MIXED = {
    "side_x-": "vvvvv",
    "side_x+": "vfffv",
    "side_y-": "fffvf",
    "side_y+": "fvvff",
    "base": "vvvvv",
    "top": "fffff",
}
"""Mechanical, electric and magnetic partitions that differ; values are prescribed on both sides of interfaces."""
INTERFACES = {
    "bonded": Interface(),
    "springs": SPRINGS,
    "normal spring": Interface(normal_stiffness=3e11),
    "grounded": Interface(electrode="grounded"),
    "floating": Interface(electrode="floating", tangential_stiffness=1e11),
}


def block(element, stack, grounded=(3, 4), material=SUBSTRATE):
    mesh = block_mesh((0.5, 0.4), HEIGHT, (0.4, 0.3), (2, 2), 1, 1, element)
    held = [BoundaryCondition(group, field, "value") for group, field in ROLLERS.items()]
    held += [BoundaryCondition("base", field, "value") for field in grounded]
    return Body(material.stiffness, mesh, tuple(held), "contact", layers=stack)


def gradients_of(material, electrode=False):
    """Return the derivatives by height of fields that depend on it alone, for zero field at an electrode."""
    matrix = material.stiffness[2][np.ix_(COUPLED, COUPLED)][..., 2]
    columns = [0, 2] if electrode else [0, 1, 2]
    slope = np.zeros(5)
    slope[np.array(COUPLED)[columns]] = np.linalg.solve(matrix[np.ix_(columns, columns)], LOAD[COUPLED][columns])
    return slope


def check_columns(points, values, slopes, bottoms, tolerance):
    """Check values inside three layers that are linear by height, with these slopes and values on their lower sides."""
    heights = -np.array([*THICKNESSES, HEIGHT - sum(THICKNESSES)]).cumsum()
    scale = np.abs(bottoms).max(axis=0) + np.abs(slopes).max(axis=0)
    scale[:2] = scale[2]
    number = np.searchsorted(-heights, -points[:, 2])
    exact = np.array(bottoms)[number] + (points[:, 2] - heights[number])[:, None] * np.array(slopes)[number]
    assert np.abs((values - exact) / scale).max() < tolerance


@pytest.mark.full
@pytest.mark.parametrize(
    ("lower", "element"),
    [
        *((lower, element) for element in (Quad4(), Tri6()) for lower in ("springs", "floating")),
        *((lower, Quad9()) for lower in INTERFACES),
    ],
    ids=lambda value: getattr(value, "name", value),
)
def test_uniform_load_on_two_layers_is_exact(lower, element):
    """Layers and interfaces are in series: linear values in each, jumps at springs, capacitors between electrodes.

    The error is that of the integrals.
    """
    lower = INTERFACES[lower]
    stack = LayerStack((Layer(FILM, THICKNESSES[0]), Layer(MIDDLE, THICKNESSES[1], lower)))
    body = block(element, stack)
    loads = tuple(BoundaryCondition("top", field, "flux", LOAD[field]) for field in COUPLED)
    system = DenseBEM().reduce(replace(body, conditions=(*body.conditions, *loads)))
    load = np.tile(LOAD, (len(system.points), 1))
    slopes = [gradients_of(FILM), gradients_of(MIDDLE), gradients_of(SUBSTRATE, lower.electrode == "grounded")]
    second = slopes[2] * (HEIGHT - sum(THICKNESSES)) + lower.compliance(MEE) * LOAD
    bottoms = [second + slopes[1] * THICKNESSES[1], second, np.zeros(5)]
    fields = system.recover(load)
    on_interface = (np.abs(fields.points[:, 2, None] + np.cumsum(THICKNESSES)) < 1e-9).any(axis=1)
    check_columns(fields.points[~on_interface], fields.values[~on_interface], slopes, bottoms, 1e-6)
    displacement = (system.offset + system.apply(load)) * np.array([1, 1, 1, -1, -1])
    check_columns(system.points, displacement, slopes, bottoms, 1e-6)
    points = np.array([[0.1, 0.05, -0.05], [-0.2, 0.1, -0.35], [0.1, 0.05, -0.6]])
    inside = interior(system, load, points)
    check_columns(points, np.concatenate([inside.displacement, inside.potentials], axis=1), slopes, bottoms, 1e-6)
    np.testing.assert_allclose(inside.stress[:, 2, 2], LOAD[2], rtol=1e-4)
    below = SUBSTRATE.stiffness[2, 3:, :, 2] @ slopes[2]
    np.testing.assert_allclose(inside.flux_densities[:, :, 2], [LOAD[3:], LOAD[3:], below], rtol=1e-4)


def with_exact_data(monkeypatch, materials, fields, kinds):
    """Give the regions of layered bodies materials and the boundary data of exact fields, one for each region."""

    def divided(body):
        regions = []
        for region, material, field in zip(divide(body), materials, fields, strict=True):
            mesh, zone = region.body.mesh, region.body.contact_group
            present = {group: kind for group, kind in kinds.items() if len(mesh.group_points(group))}
            exact = prescribe(mesh, field, material.stiffness, present)
            exact = with_heat(exact, material) if material.thermal_moduli is not None else exact
            regions.append(replace(region, body=replace(exact, contact_group=zone)))
        return tuple(regions)

    monkeypatch.setattr(formulation, "divide", divided)


def columns_of(points, interfaces, fields):
    """Return exact values at points, and which points are on no interface, for regions between these heights."""
    number = np.searchsorted(-np.array(interfaces), -points[:, 2])
    values = np.array([field.values(points) for field in fields])[number, np.arange(len(points))]
    return values, (np.abs(points[:, 2, None] - interfaces) > 1e-9).all(axis=1)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    ("element", "interface"),
    [(Quad4(), SPRINGS), (Quad9(), SPRINGS), (Tri6(), SPRINGS), (Quad9(), Interface())],
    ids=["quad4-springs", "quad9-springs", "tri6-springs", "quad9-bonded"],
)
def test_linear_fields_of_one_triclinic_material_are_exact(element, interface, monkeypatch):
    """Prescribed values and fluxes meet on the border of the interfaces; fields jump at springs."""
    field = LinearField.random(TRICLINIC.stiffness, seed=3)
    stress = field.fluxes(np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]))
    lower = replace(field, constant=field.constant - interface.compliance(MEE) * stress[0])
    with_exact_data(monkeypatch, [TRICLINIC] * 3, [field, lower, lower], MIXED)
    stack = LayerStack((Layer(TRICLINIC, 0.2, interface), Layer(TRICLINIC, 0.3)))
    system = DenseBEM(quadrature_tolerance=1e-7).reduce(block(element, stack, material=TRICLINIC))
    fields = system.recover(np.tile(stress, (len(system.points), 1)))
    exact, unique = columns_of(fields.points, [-0.2, -0.5], [field, lower, lower])
    assert np.abs((fields.values - exact) / np.abs(exact).max(axis=0))[unique].max() < 2e-6
    load = np.column_stack(
        [np.einsum("nai,i->na", system.frames, stress[0, :3]), np.tile(stress[0, 3:], (len(system.points), 1))]
    )
    points = np.array([[0.1, 0.05, -0.1], [-0.3, 0.2, -0.2], [0.5, 0.1, -0.2], [0.1, 0.3, -0.5], [0.0, 0.0, -0.2001]])
    inside = interior(system, load, points)
    assert (
        np.abs(inside.stress / np.einsum("ijkm,km->ij", TRICLINIC.stiffness, field.gradient)[:, :3] - 1.0).max() < 1e-4
    )
    displacement = columns_of(points, [-0.2, -0.5], [field, lower, lower])[0][:, :3]
    np.testing.assert_allclose(inside.displacement, displacement, rtol=1e-5)


@pytest.mark.full
@pytest.mark.parametrize(("element", "slope"), [(Quad4(), 0.0), (Quad9(), 40.0)], ids=["uniform", "linear"])
def test_heat_in_layers(element, slope, monkeypatch):
    """A temperature that is linear by height, with the quadratic fields of thermal expansion, in layers of one
    material."""
    field = ThermalField(HOT, 20.0, np.array([0.0, 0.0, slope]))
    kinds = {**dict.fromkeys(SIDES, "fffffv"), "base": "vvvvvv", "top": "ffffff"}
    with_exact_data(monkeypatch, [HOT] * 2, [field] * 2, kinds)
    body = block(element, LayerStack((Layer(HOT, 0.2),)), material=HOT)
    body = replace(body, fields=HOT.fields, thermal_moduli=HOT.thermal_moduli)
    body = replace(body, conditions=tuple(BoundaryCondition("base", number, "value") for number in range(6)))
    system = DenseBEM(quadrature_tolerance=1e-7).reduce(body)
    load = field.fluxes(system.points, np.tile([0.0, 0.0, 1.0], (len(system.points), 1)))
    fields = system.recover(load)
    exact, unique = columns_of(fields.points, [-0.2], [field] * 2)
    assert np.abs((fields.values - exact) / np.abs(exact).max(axis=0))[unique].max() < 2e-6


@pytest.mark.full
def test_layers_of_one_material_are_as_accurate_as_one_body(monkeypatch):
    """The field of a point source above: values and tractions on interfaces are interpolated as on the surface."""
    kinds = {**dict.fromkeys((*SIDES, "top"), "fffff"), "base": "vvvvv"}
    field = PointSourceField(TRICLINIC.stiffness, np.array([0.1, 0.05, 0.5]), np.array([1.0, 2.0, -1.0, 1.0, 2.0]))
    errors = []
    for divisions, rings in ((2, 1), (4, 2)):
        mesh = block_mesh((0.5, 0.4), HEIGHT, (0.4, 0.3), divisions, rings, rings + 1, Quad4())
        plain = replace(prescribe(mesh, field, TRICLINIC.stiffness, kinds), contact_group="contact")
        errors.append(error_of(DenseBEM().reduce(plain), field))
        with monkeypatch.context() as patch:
            with_exact_data(patch, [TRICLINIC] * 3, [field] * 3, kinds)
            stack = LayerStack((Layer(TRICLINIC, 0.2), Layer(TRICLINIC, 0.2)))
            held = tuple(BoundaryCondition("base", number, "value") for number in range(5))
            errors.append(error_of(DenseBEM().reduce(replace(plain, conditions=held, layers=stack)), field))
    coarse, coarse_layers, fine, fine_layers = errors
    assert coarse_layers < 1.2 * coarse
    assert fine_layers < 1.2 * fine < 0.6 * coarse


def error_of(system, field):
    """Return the error of values in the zone under the fluxes of an exact field, relative to the largest ones."""
    load = field.fluxes(system.points, np.tile([0.0, 0.0, 1.0], (len(system.points), 1)))
    exact = field.values(system.points) * np.array([1, 1, 1, -1, -1])
    return np.sqrt(np.mean(((system.offset + system.apply(load) - exact) / np.abs(exact).max(axis=0)) ** 2))


def test_a_floating_electrode_has_the_charge_zero():
    """It is the plate of a capacitor, whatever the distribution of the charge above."""
    silicon = library_material("silicon")
    stack = LayerStack((Layer(FILM, 0.2, Interface(electrode="floating")),))
    system = DenseBEM().reduce(block(Quad4(), stack, material=silicon))
    load = np.zeros((len(system.points), 5))
    load[0, ELECTRIC] = 1e-3
    fields = system.recover(load)
    on_electrode = np.abs(fields.points[:, 2] + 0.2) < 1e-9
    assert np.ptp(fields.values[on_electrode, ELECTRIC]) < 1e-12 * np.abs(fields.values[:, ELECTRIC]).max()
    below = (fields.points[:, 2] < -0.2 - 1e-9) & (fields.points[:, 2] > -HEIGHT + 1e-9)
    height = fields.points[below, 2] + HEIGHT
    field = fields.values[on_electrode, ELECTRIC][0] / (HEIGHT - 0.2)
    np.testing.assert_allclose(fields.values[below, ELECTRIC], field * height, rtol=1e-5)
    permittivity = -silicon.stiffness[2, ELECTRIC, ELECTRIC, 2]
    charge = system.weights @ load[:, ELECTRIC]
    assert -field * permittivity * 0.8 == pytest.approx(charge, rel=0.05)


@pytest.mark.full
def test_conformance():
    """A field that depends on the height alone has uniform data on each face."""
    field = LinearField.random(TRICLINIC.stiffness, seed=3)
    field = replace(field, gradient=field.gradient * np.array([0.0, 0.0, 1.0]))
    mesh = block_mesh((0.5, 0.4), HEIGHT, (0.4, 0.3), 4, 2, 2, Quad4())
    kinds = {**dict.fromkeys((*SIDES, "top"), "fffff"), "base": "vvvvv"}
    body = prescribe(mesh, field, TRICLINIC.stiffness, kinds)
    conditions = tuple(replace(condition, data=float(np.mean(condition.data))) for condition in body.conditions)
    stack = LayerStack((Layer(TRICLINIC, 0.2), Layer(TRICLINIC, 0.1)))
    check_formulation(DenseBEM(), replace(body, conditions=conditions, contact_group="contact", layers=stack), field)


@pytest.mark.parametrize("element", [Quad8(), Tri6()], ids=lambda e: e.name)
def test_meshes_of_regions(element):
    """They are closed, fill the body with its face groups, and share the nodes of interfaces."""
    stack = LayerStack((Layer(FILM, 0.1), Layer(MIDDLE, 0.25)))
    body = block(element, stack)
    meshes = [region.body.mesh for region in divide(body)]
    for mesh in meshes:
        check_mesh(mesh)
    assert sum(volume(mesh) for mesh in meshes) == pytest.approx(volume(body.mesh))
    for name in body.mesh.group_names:
        assert sum(area(mesh, name) for mesh in meshes) == pytest.approx(area(body.mesh, name))
    for upper, lower, depth in zip(meshes, meshes[1:], (0.1, 0.35), strict=False):
        (name,) = set(upper.group_names) & set(lower.group_names) - set(body.mesh.group_names)
        nodes = upper.points[upper.group_points(name)]
        np.testing.assert_array_equal(nodes, lower.points[lower.group_points(name)])
        np.testing.assert_allclose(nodes[:, 2], -depth)


@pytest.mark.full
def test_layers_of_a_half_space_are_a_box_on_the_base():
    """Values vanish at its sides and base, as in finite elements."""
    layers = (Layer(FILM, 0.2),)
    plane = half_space_mesh(0.5, 0.4, 2, 1, Quad4())
    one = Body(SUBSTRATE.stiffness, plane, (), "contact", layers=LayerStack(layers, RigidBase(0.3)))
    held = [BoundaryCondition(group, field, "value") for group in ("base", *SIDES) for field in range(5)]
    mesh = block_mesh(0.5, 0.5, 0.4, 2, 1, 1, Quad4())
    other = Body(SUBSTRATE.stiffness, mesh, tuple(held), "contact", layers=LayerStack(layers))
    first, second = (DenseBEM().reduce(body).dense() for body in (one, other))
    assert (np.abs(first - second) <= 1e-9 * np.abs(first).max(axis=(0, 2), keepdims=True)).all()


TWO = LayerStack((Layer(FILM, 0.1), Layer(MIDDLE, 0.25)))
FLOATING = LayerStack((Layer(FILM, 0.1, Interface(electrode="floating")),))


def prescribing(*conditions, stack=TWO):
    """Return a block with further values on face groups: group, field, value."""
    body = block(Quad4(), stack)
    return replace(
        body, conditions=(*body.conditions, *(BoundaryCondition(g, f, "value", v) for g, f, v in conditions))
    )


def with_group(name, chosen, **prescribed):
    """Return a block of which the elements with chosen middles have a group of their own."""
    mesh = block_mesh((0.5, 0.4), HEIGHT, (0.4, 0.3), (2, 2), 2, 2, Quad4())
    (block_of,) = mesh.blocks
    middles = mesh.points[block_of.connectivity].mean(axis=1)
    groups = np.where(chosen(middles), len(mesh.group_names), block_of.groups)
    renamed = SurfaceMesh(mesh.points, (replace(block_of, groups=groups),), (*mesh.group_names, name))
    return replace(block(Quad4(), TWO), mesh=renamed, **prescribed)


def held_above():
    """Return a block that is held on the border of its upper face alone."""
    rim = tuple(BoundaryCondition("rim", field, "value") for field in range(5))
    return with_group(
        "rim", lambda x: (x[:, 2] == 0.0) & (np.abs(x / [0.5, 0.4, 1.0]).max(axis=1) > 0.7), conditions=rim
    )


FOOT = with_group("foot", lambda x: (x[:, 2] < -0.4) & (x[:, 0] > 0.45))
SPHERE = Body(SUBSTRATE.stiffness, sphere_mesh(1.0, 2, Quad4()), (), "surface", layers=TWO)


@pytest.mark.parametrize(
    ("body", "error", "message"),
    [
        (
            block(Quad4(), LayerStack((Layer(FILM, 0.7),))),
            MeshError,
            r"layers are 0\.7 m thick, the body is 0\.7 m deep",
        ),
        (held_above(), CaseError, "below layer 2: .*potential.*allowed: .*skfem"),
        (prescribing(("side_x-", 3, 1.0), ("side_x+", 3, 2.0), stack=FLOATING), CaseError, "allowed: zero beside a gr"),
        (prescribing(("side_x-", 4, np.zeros(6))), CaseError, "'side_x-' has data at points; allowed: one number"),
        (FOOT, MeshError, "face group 'side_x[+]' has an area of .* allowed: groups that reach"),
        (SPHERE, MeshError, "'surface'"),
        (replace(block(Quad4(), TWO), contact_group=None), CaseError, "parallel to a contact zone"),
    ],
    ids=["thick", "no supports below", "two potentials", "varying data", "divided side", "sphere", "no zone"],
)
def test_messages(body, error, message):
    with pytest.raises(error, match=message):
        DenseBEM().check(body)


def test_only_prisms_have_layers():
    mesh = block_mesh((0.5, 0.4), HEIGHT, (0.4, 0.3), (2, 2), 1, 1, Quad4())
    tapered = replace(mesh, points=mesh.points * np.array([1.0, 1.0, 1.0]) * (1.0 + 0.1 * mesh.points[:, 2:]))
    with pytest.raises(MeshError, match="the body is not a prism below the plane face of the contact zone 'contact'"):
        DenseBEM().check(replace(block(Quad4(), TWO), mesh=tapered))


def test_a_floating_electrode_takes_the_potential_of_a_side():
    stack = LayerStack((Layer(FILM, 0.1, Interface(electrode="floating")),))
    body = block(Quad4(), stack, grounded=(4,))
    body = replace(body, conditions=(*body.conditions, BoundaryCondition("side_x-", ELECTRIC, "value", 2.0)))
    system = DenseBEM().reduce(body)
    fields = system.recover(np.zeros_like(system.offset))
    on_electrode = np.abs(fields.points[:, 2] + 0.1) < 1e-9
    np.testing.assert_allclose(fields.values[on_electrode, ELECTRIC], 2.0)
