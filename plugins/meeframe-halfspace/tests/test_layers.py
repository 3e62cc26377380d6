"""Layered half spaces: their response in space and on grids, against integrals over waves and other solutions."""

from dataclasses import replace

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace
from meeframe_halfspace.difference import point_difference
from meeframe_halfspace.directions import PlaneSymmetry
from meeframe_halfspace.layered_symbol import LayeredResponse, surface_symbol

import meeframe
from meeframe.common.errors import CaseError
from meeframe.elements import Quad4
from meeframe.fields import ELECTRIC, MAGNETIC, FieldScaling
from meeframe.material import Material, library_material, rotation_about
from meeframe.material.layers import Interface, Layer, LayerStack, RigidBase
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.model.solve import reduce
from meeframe.system.capabilities import InteriorFields, Multigrid, Restriction
from meeframe.testing.axisymmetric_layers import AxisymmetricLayers
from meeframe.testing.capabilities import check_capabilities

POTENTIALS = np.array([1.0, 1.0, 1.0, -1.0, -1.0])
UM = 1e-6


def rotated(name, angle):
    return library_material(name).rotated(rotation_about([1.0, 2.0, 3.0], angle))


SPRINGS = Interface(3e17, 1e17, {"electric": 0.5})
TRICLINIC = LayerStack((Layer(rotated("pzt-4", 0.7), UM, SPRINGS), Layer(rotated("batio3-cofe2o4", 1.9), 0.5 * UM)))
SUBSTRATE = rotated("orthotropic-mee", 0.3)
FILM = LayerStack((Layer(library_material("batio3"), UM, Interface(electrode="grounded")),))


def assert_close(computed, expected, tolerance):
    """Compare displacements field by field, relative to the largest one."""
    errors = np.abs(computed - expected).max(axis=0) / np.abs(expected).max(axis=0)
    assert errors.max() < tolerance, errors


def body(layers, substrate=SUBSTRATE, divisions=(24, 21), width=(4 * UM, 3.5 * UM)):
    mesh = half_space_mesh(4.0 * max(width), width, divisions, 1, Quad4())
    return Body(substrate.stiffness, mesh, (), "contact", layers=layers)


def random_load(system, layers):
    scale = 1.0 / FieldScaling.of(layers.layers[0].material.stiffness).factors
    return np.random.default_rng(1).normal(size=(len(system.points), 5)) * scale


def polar_rule(k_max, n_k, n_angles, finest=0.01 / UM):
    """Gauss points in k, closer towards zero, and equal angles over half a circle."""
    edges = np.concatenate([[0.0], np.geomspace(finest, k_max, max(2, n_k // 24))])
    x, w = np.polynomial.legendre.leggauss(24)
    half = 0.5 * np.diff(edges)
    k = (edges[:-1, None] + half[:, None] * (1.0 + x)).ravel()
    return k, (half[:, None] * w).ravel(), np.pi * np.arange(n_angles) / n_angles


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("layers", [TRICLINIC, FILM, LayerStack(FILM.layers, RigidBase(2 * UM))])
def test_difference_in_space_is_the_double_integral_over_waves(layers):
    one = body(layers)
    response = LayeredResponse.of(one, np.eye(3))
    computed = point_difference(response.difference, UM, 20 * UM)
    k, weights, angles = polar_rule(20.0 / UM, 320, 64)
    symbol = surface_symbol(one, np.eye(3), angles)
    difference = symbol.difference(k)
    largest = np.abs(computed.coefficients).max()
    for r, theta in ((0.0, 0.0), (0.3 * UM, 1.1), (1.7 * UM, 4.0), (6.0 * UM, -0.4)):
        phase = np.exp(1j * r * np.outer(k, np.cos(angles - theta)))
        # the other half of the waves is conjugate
        expected = np.einsum("k,kp,kpJK->JK", weights, phase, difference).real / (2 * np.pi * len(angles))
        terms, values = computed.terms, np.zeros(25)
        of_terms = computed.coefficients_at(np.array([r]))[0]
        turns = np.where(terms.sines == 1, np.sin(terms.harmonics * theta), np.cos(terms.harmonics * theta))
        np.add.at(values, terms.entries, of_terms * turns)
        np.testing.assert_allclose(response.layout.matrix(values), expected, rtol=0.0, atol=3e-9 * largest)
    assert computed.error < 1e-7 * largest


@pytest.mark.parametrize("is_between", [False, True])
@pytest.mark.parametrize(
    ("film", "counts"),
    [("pzt-4", (1, 1)), ("silicon", (3, 2)), ("orthotropic-mee", (5, 4)), ("triclinic", (8, 8))],
    ids=["axisymmetric", "cubic", "orthotropic", "triclinic"],
)
def test_symmetric_directions_stand_for_all(film, counts, is_between):
    """Compare the compliance in all directions with that transformed from those that symmetries leave."""
    material = rotated("pzt-4", 0.7) if film == "triclinic" else library_material(film)
    one = body(LayerStack((Layer(material, UM),)), library_material("batio3"))
    directions, k = PlaneSymmetry.of(one, np.eye(3)).directions(8, is_between), np.array([0.3, 2.0]) / UM
    assert len(directions.angles) == counts[is_between]
    expected = surface_symbol(one, np.eye(3), np.pi * (np.arange(8) + 0.5 * is_between) / 8).evaluate(k)
    computed = directions.expand(surface_symbol(one, np.eye(3), directions.angles).evaluate(k))
    np.testing.assert_allclose(computed, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("periodic", [False, True])
def test_layers_of_the_substrate_change_nothing(periodic):
    layers = LayerStack((Layer(SUBSTRATE, UM), Layer(SUBSTRATE, 0.1 * UM)))
    formulation = HalfSpace(periodic=periodic, matrix_up_to=0)
    system, homogeneous = formulation.reduce(body(layers)), formulation.reduce(body(LayerStack()))
    load = random_load(system, layers)
    expected = homogeneous.apply(load)
    assert_close(system.apply(load), expected, 1e-11)


@pytest.mark.parametrize("insulating", [("electric",), ("electric", "magnetic")])
def test_periodic_surface_above_a_base_that_insulates(insulating):
    """Compare with one compliance for each wave; potentials grow with the length of waves."""
    layers = LayerStack((Layer(rotated("pzt-4", 0.7), UM),), RigidBase(0.5 * UM, insulating))
    one, size = body(layers, library_material("batio3"), (14, 12), (42 * UM, 36 * UM)), (15, 13)
    system = HalfSpace(periodic=True, density="trigonometric", matrix_up_to=0).reduce(one)
    order = np.lexsort(system.points[:, 1::-1].T)
    load = random_load(system, layers)
    load -= load.mean(axis=0)
    qx, qy = (2 * np.pi * np.fft.fftfreq(n, 3 * UM) for n in size)
    k, angles = np.hypot(qx[:, None], qy).ravel(), np.arctan2(qy, qx[:, None]).ravel()
    symbol = surface_symbol(one, np.eye(3), angles[1:])
    y = symbol.compliance_at(k[None, 1:], 0) / k[1:, None, None] * np.outer(symbol.factors, symbol.factors)
    waves = np.fft.fft2(load[order].reshape(*size, 5), axes=(0, 1)).reshape(-1, 5)
    answers = np.concatenate([np.zeros((1, 5)), np.einsum("wab,wb->wa", y, waves[1:])])
    expected = np.fft.ifft2(answers.reshape(*size, 5), axes=(0, 1)).real.reshape(-1, 5)
    assert_close(system.apply(load)[order] * POTENTIALS, expected, 1e-8)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("periodic", [False, True])
def test_splitting_a_layer_changes_nothing(periodic):
    first, second = TRICLINIC.layers
    divided = LayerStack((Layer(first.material, 0.2 * UM), replace(first, thickness=0.8 * UM), second))
    formulation = HalfSpace(periodic=periodic, matrix_up_to=0)
    one, other = formulation.reduce(body(TRICLINIC)), formulation.reduce(body(divided))
    load = random_load(one, TRICLINIC)
    expected = one.apply(load)
    assert_close(other.apply(load), expected, 1e-9)


class GaussianOnLayers:
    """Displacement under a Gaussian load on layers, by integration over waves, without any series or table."""

    def __init__(self, one, amplitude, width, k_max=None):
        k, weights, angles = polar_rule(k_max or 8.0 / width, 240, 40)
        symbol = surface_symbol(one, np.eye(3), angles)
        spectrum = 2 * np.pi * width**2 * np.exp(-0.5 * (k * width) ** 2) * weights / (2 * np.pi * len(angles))
        compliance = symbol.evaluate(k) * np.outer(symbol.factors, symbol.factors)
        self.amplitude, self.width = amplitude, width
        self.waves = (k[:, None, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)).reshape(-1, 2)
        self.answers = (compliance @ amplitude * spectrum[:, None, None]).reshape(-1, 5)

    def load(self, points):
        return np.exp(-0.5 * (points[:, :2] ** 2).sum(axis=1) / self.width**2)[:, None] * self.amplitude

    def values(self, points):
        return (np.exp(1j * points[:, :2] @ self.waves.T) @ self.answers).real


@pytest.mark.full
@pytest.mark.parametrize("density", ["bilinear", "constant"])
def test_all_fields_converge_with_second_order(density):
    """All 25 entries take part: a load of all fields on a triclinic stack with springs."""
    amplitude = np.array([1.0, -0.7, 1.3, 0.8, -0.6]) / FieldScaling.of(TRICLINIC.layers[0].material.stiffness).factors
    field, errors = GaussianOnLayers(body(TRICLINIC), amplitude, 0.4 * UM), []
    for n in (32, 64):
        system = HalfSpace(density, matrix_up_to=0).reduce(body(TRICLINIC, divisions=(n, n)))
        computed = system.apply(field.load(system.points)) * POTENTIALS
        chosen = np.random.default_rng(0).choice(len(system.points), 60, replace=False)
        exact = field.values(system.points[chosen])
        errors.append(np.abs(computed[chosen] - exact).max(axis=0) / np.abs(exact).max(axis=0))
    orders = np.log2(errors[0] / errors[1])
    assert (orders > 1.8).all()
    assert (errors[1] < 4e-3).all()


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("thickness", [0.02 * UM, 0.1 * UM, 0.5 * UM])
def test_layers_thinner_than_the_cells(thickness):
    """Grids as coarse as ten thicknesses converge to the same waves: the difference is integrated over each cell."""
    layers = LayerStack((Layer(library_material("batio3"), thickness),), RigidBase(0.5 * UM))
    amplitude = np.array([1.0, -0.7, 1.3, 0.8, -0.6]) / FieldScaling.of(layers.layers[0].material.stiffness).factors
    one, errors = body(layers, library_material("pzt-4")), []
    field = GaussianOnLayers(one, amplitude, 0.4 * UM)
    for n in (32, 64):
        system = HalfSpace(matrix_up_to=0).reduce(body(layers, library_material("pzt-4"), divisions=(n, n)))
        computed = system.apply(field.load(system.points)) * POTENTIALS
        chosen = np.random.default_rng(0).choice(len(system.points), 60, replace=False)
        exact = field.values(system.points[chosen])
        errors.append(np.abs(computed[chosen] - exact).max(axis=0) / np.abs(exact).max(axis=0))
    orders = np.log2(np.array(errors[0]) / errors[1])
    assert (orders > 1.7).all()


def test_periodic_waves_have_their_compliance():
    layers = LayerStack(TRICLINIC.layers, RigidBase(3 * UM))
    system = HalfSpace("trigonometric", periodic=True, matrix_up_to=0).reduce(body(layers))
    points = system.points[:, :2] - system.points[:, :2].min(axis=0)
    period = np.array([25 / 24 * 4 * UM, 22 / 21 * 3.5 * UM])
    amplitude = np.array([1.0, -0.7, 1.3, 0.8, -0.6]) / FieldScaling.of(layers.layers[0].material.stiffness).factors
    for numbers in ((1, 0), (2, -3), (0, 7)):
        q = 2.0 * np.pi * np.array(numbers) / period
        k, angle = np.hypot(*q), np.arctan2(q[1], q[0])
        symbol = surface_symbol(body(layers), np.eye(3), np.array([angle]))
        y = symbol.evaluate(np.array([k]))[0, 0] * np.outer(symbol.factors, symbol.factors)
        phase = np.exp(1j * points @ q)
        expected = (phase[:, None] * (y @ amplitude / k)).real * POTENTIALS
        computed = system.apply(phase.real[:, None] * amplitude)
        assert_close(computed, expected, 1e-9)  # of the series in k
    surface = symbol.uniform_compliances(1.0 / UM, np.squeeze)[0]
    uniform = surface * np.outer(symbol.factors, symbol.factors) @ amplitude * POTENTIALS
    computed = system.apply(np.tile(amplitude, (len(points), 1)))
    np.testing.assert_allclose(computed, np.tile(uniform, (len(points), 1)), rtol=1e-10)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(("layers", "periodic"), [(TRICLINIC, True), (TRICLINIC, False), (FILM, True)])
def test_capabilities(layers, periodic):
    """Coarser grids, subgrids, fields of the product, the approximate inverse and fields inside agree with the product.

    The depths at which fields are evaluated, up to 0.3 widths, are in the first layer.
    """
    one = body(layers, divisions=(55, 51), width=(2 * UM, 1.8 * UM))
    system = HalfSpace(periodic=periodic, matrix_up_to=0).reduce(one)
    check_capabilities(system)
    assert (system.capability(Multigrid) is None) == (periodic and any(n % 2 for n in system.grid.size))
    assert (system.capability(Restriction) is None) == periodic


def test_interpolation_far_from_the_source():
    """On wide grids, the difference far from the source is interpolated; on a part of 170 nodes it is not."""
    system = HalfSpace(matrix_up_to=0).reduce(body(TRICLINIC, divisions=(250, 5), width=(50 * UM, UM)))
    part = system.capability(Restriction).restrict(
        np.flatnonzero(system.points[:, 0] < system.points[:, 0].min() + 34 * UM)
    )
    load = np.zeros((len(system.points), 5))
    load[part.nodes] = random_load(part.system, TRICLINIC)
    assert len(part.nodes) < 0.75 * len(load)
    assert_close(part.system.apply(load[part.nodes]), system.apply(load)[part.nodes], 1e-10)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("periodic", [False, True])
def test_floating_electrodes(periodic):
    """A floating electrode differs from a grounded one in the response to the mean of a periodic load alone."""
    values = []
    for electrode in ("grounded", "floating"):
        film = replace(FILM.layers[0], interface=Interface(electrode=electrode))
        layers = LayerStack((film,), RigidBase(2 * UM))
        system = HalfSpace(periodic=periodic, matrix_up_to=0).reduce(body(layers))
        load = random_load(system, layers)
        values.append(system.apply(load + load.max(axis=0)))
    difference = (values[1] - values[0]) / np.abs(values[0]).max(axis=0)
    if periodic:
        assert np.ptp(difference, axis=0).max() < 1e-10
        assert np.abs(difference[0, ELECTRIC]) > 0.01
    else:
        assert np.abs(difference).max() < 1e-10


@pytest.mark.full
def test_matrix_matches_fft():
    small = body(TRICLINIC, divisions=(13, 11))
    one, other = (HalfSpace(matrix_up_to=limit).reduce(small) for limit in (10_000, 0))
    load = random_load(one, TRICLINIC)
    assert_close(other.apply(load), one.apply(load), 1e-12)
    matrix = one.dense().reshape(len(load) * 5, -1)
    inside = np.abs(one.weights / one.weights.max() - 1.0) < 1e-9
    square = one.dense()[inside][:, :, inside].reshape(inside.sum() * 5, -1)
    scale = np.tile(FieldScaling.of(TRICLINIC.layers[0].material.stiffness).factors, inside.sum())
    scaled = square / np.outer(scale, scale)
    assert len(matrix) == len(load) * 5
    assert np.linalg.eigvalsh(scaled + scaled.T).min() > 0.0


def sphere(layers, material="cofe2o4", divisions=64, width=1.63 * UM, **keys):
    parts = {
        "material": material,
        "mesh": meeframe.mesh.half_space(width, divisions, rings=1, half_width=width),
        "indenter": meeframe.Sphere(10 * UM),
        "steps": [meeframe.Step(approach=40e-9)],
        "formulation": HalfSpace(matrix_up_to=0),
        "layers": layers,
    }
    return meeframe.Case(**parts | keys).solve()


def force_of(result):
    return -meeframe.resultants(result.zone, result[-1]).force[2]


CONDUCTING = {name: meeframe.StepConductivity(float("inf")) for name in ("electric", "magnetic")}
GLASS_FILM = (meeframe.Layer("pzt-4", UM, interface=meeframe.Interface(electrode="grounded")),)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    ("layers", "stack", "substrate", "conducting"),
    [
        ((meeframe.Layer("batio3", UM),), LayerStack((Layer(library_material("batio3"), UM),)), "cofe2o4", False),
        (
            GLASS_FILM,
            LayerStack((Layer(library_material("pzt-4"), UM, Interface(electrode="grounded")),)),
            "glass",
            True,
        ),
        ((meeframe.Layer("batio3", UM),), LayerStack((Layer(library_material("batio3"), UM),)), "cofe2o4", True),
        (
            GLASS_FILM,
            LayerStack((Layer(library_material("pzt-4"), UM, Interface(electrode="grounded")),)),
            "glass",
            False,
        ),
    ],
)
def test_sphere_against_integral_equations(layers, stack, substrate, conducting):
    potentials = {ELECTRIC: 0.0, MAGNETIC: 0.0} if conducting else {}
    reference = AxisymmetricLayers(library_material(substrate).stiffness, stack, potentials)
    exact = reference.press_sphere_by(10 * UM, 40e-9)
    result = sphere(layers, substrate, conductivity=CONDUCTING if conducting else {})
    assert result.status == "converged"
    assert force_of(result) == pytest.approx(exact.force, rel=4e-4)
    contact = result.zone.weights[result[-1].traction[:, 2] < 0.0].sum()
    assert np.sqrt(contact / np.pi) == pytest.approx(exact.radius, rel=1e-2)
    if conducting:
        charge = result.zone.weights @ result[-1].fluxes[:, 0]
        assert charge == pytest.approx(exact.fluxes[ELECTRIC], rel=1e-2)
    else:
        centre = np.hypot(*result.zone.points[:, :2].T).argmin()
        assert result[-1].potentials[centre, 0] == pytest.approx(exact.centre[1], rel=2e-4)


def test_two_equal_coated_bodies_share_the_approach():
    """Each of two equal bodies deforms like one under a sphere of twice the radius at half the approach."""
    layers = (meeframe.Layer("batio3", UM),)
    second = meeframe.SecondBody(
        "cofe2o4",
        meeframe.mesh.half_space(1.63 * UM, 24, rings=1, half_width=1.63 * UM),
        formulation=HalfSpace(matrix_up_to=0),
        layers=layers,
    )
    two = sphere(layers, divisions=24, second_body=second)
    one = sphere(layers, divisions=24, indenter=meeframe.Sphere(20 * UM), steps=[meeframe.Step(approach=20e-9)])
    pressure = one[-1].traction[:, 2]
    np.testing.assert_allclose(two[-1].traction[:, 2], pressure, rtol=0.0, atol=1e-8 * np.abs(pressure).max())


@pytest.mark.full
def test_differently_coated_bodies_exchanged():
    """Two coated bodies that take each other's place carry the same load, which is not that of equal bodies.

    Seen from the other body, everything is rotated by 180 degrees about x1, and loads are reversed: tangential
    tractions along x1 and fluxes change their sign, and so do the motion and the potential of the upper body.
    """
    films = (meeframe.Layer("batio3", UM),), (meeframe.Layer("steel", 0.3 * UM), meeframe.Layer("zno", 0.5 * UM))
    mesh = meeframe.mesh.half_space(1.63 * UM, 24, rings=1, half_width=1.63 * UM)

    def load(upper, lower, sign=1.0):
        (name, layers), (other, lower_layers) = upper, lower
        second = meeframe.SecondBody(name, mesh, formulation=HalfSpace(matrix_up_to=0), layers=layers)
        steps = [meeframe.Step(approach=40e-9), meeframe.Step(translation=[sign * 7e-9, 0], electric_potential=sign)]
        keys = {"contact": meeframe.IsotropicCoulomb(0.3), "conductivity": CONDUCTING, "steps": steps}
        step = sphere(lower_layers, other, 24, second_body=second, **keys)[-1]
        return np.column_stack([step.traction[:, [0, 2]] * [sign, 1.0], sign * step.fluxes])

    one, two = ("cofe2o4", films[0]), ("silicon", films[1])
    expected, equal = load(one, two), load(one, one)
    scale = np.abs(expected).max(axis=0)
    assert (scale > 0.0).all()
    assert (np.abs(load(two, one, -1.0) - expected) <= 1e-7 * scale).all()
    assert np.abs(equal - expected)[:, 1].max() > 0.02 * scale[1]


@pytest.mark.full
def test_force_control_and_friction_histories():
    """A force gives back the approach it belongs to, and a history with friction converges."""
    film = (meeframe.Layer("pzt-4", UM, {"axis": [1, 0, 0], "angle": "20 deg"}),)
    law, steps = meeframe.IsotropicCoulomb(0.3), [meeframe.Step(approach=40e-9, increments=2)]
    by_motion = sphere(film, "silicon", 24, contact=law, steps=[*steps, meeframe.Step(translation=[5e-9, 0.0])])
    assert by_motion.status == "converged"
    assert len(set(by_motion[-1].region.tolist())) == 3  # open, slip and stick
    force = force_of(by_motion)
    without_friction = sphere(film, "silicon", 24)
    steps = [meeframe.Step(normal_force=force_of(without_friction))]
    by_force = sphere(film, "silicon", 24, steps=steps)
    assert by_force[-1].loading.approach == pytest.approx(40e-9, rel=1e-7)
    assert force == pytest.approx(force_of(without_friction), rel=0.05)


@pytest.mark.full
def test_resolved_edges():
    """The charge of a grounded sphere, singular at the contact edge on layers, is accurate on coarse grids."""
    film = LayerStack((Layer(library_material("batio3"), UM),))
    reference = AxisymmetricLayers(library_material("cofe2o4").stiffness, film, {ELECTRIC: 0.0, MAGNETIC: 0.0})
    exact, errors = reference.press_sphere_by(10 * UM, 40e-9).fluxes[ELECTRIC], {}
    for edges in ("nodes", "resolved"):
        formulation = HalfSpace(matrix_up_to=0, edges=edges)
        layers = (meeframe.Layer("batio3", UM),)
        result = sphere(layers, divisions=16, conductivity=CONDUCTING, formulation=formulation)
        errors[edges] = abs(result.zone.weights @ result[-1].fluxes[:, 0] / exact - 1.0)
    assert errors["resolved"] < 4e-3
    assert errors["resolved"] < 0.3 * errors["nodes"]
    with pytest.raises(CaseError, match="thicknesses of 4 spacings"):
        HalfSpace(edges="resolved").check(body(LayerStack((Layer(library_material("batio3"), 0.5 * UM),))))


@pytest.mark.full
def test_interior_of_layers_of_the_substrate():
    """Layers of the substrate's material leave the fields inside as they are."""
    layers = LayerStack((Layer(SUBSTRATE, 0.4 * UM), Layer(SUBSTRATE, 0.3 * UM)))
    points = np.array([[x, 0.2 * UM, -depth * UM] for depth in (0.55, 1.3) for x in (-UM, 0.0, 0.4 * UM)])
    fields = []
    for one in (layers, LayerStack()):
        system = HalfSpace(matrix_up_to=0).reduce(body(one, divisions=(12, 11)))
        load = random_load(system, layers) * (np.hypot(*system.points[:, :2].T) < 1.2 * UM)[:, None]
        fields.append(system.capability(InteriorFields).evaluate(load, points))
    for name in ("values", "gradients", "fluxes"):
        computed, expected = getattr(fields[0], name), getattr(fields[1], name)
        assert_close(computed.reshape(len(points), -1), expected.reshape(len(points), -1), 1e-6)


@pytest.mark.full
def test_interior_fields_balance_the_load():
    """The normal stress on both sides of the interface adds up to the force on the surface."""
    result = sphere((meeframe.Layer("batio3", UM),), divisions=16)
    interior = reduce(meeframe.Case.from_toml(result.provenance.case_text).checked).capability(InteriorFields)
    x = np.linspace(-6 * UM, 6 * UM, 41)
    load = np.concatenate([result[-1].traction, result[-1].fluxes], axis=1)
    stresses = []
    for depth in (UM * (1.0 - 1e-6), UM * (1.0 + 1e-6)):
        points = np.stack([*np.meshgrid(x, x, indexing="ij"), np.full((41, 41), -depth)], axis=-1).reshape(-1, 3)
        stresses.append(interior.evaluate(load, points).fluxes[:, 2])
        inside = -stresses[-1][:, 2].sum() * (x[1] - x[0]) ** 2
        # of a point force z^3 / (z^2 + r^2)^1.5 = 0.4 % is outside
        assert inside == pytest.approx(force_of(result), rel=6e-3)
    assert_close(stresses[1][:, :3], stresses[0][:, :3], 1e-5)


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(
    "layers",
    [TRICLINIC, LayerStack(TRICLINIC.layers, RigidBase(UM)), FILM, LayerStack(FILM.layers, RigidBase(UM))],
    ids=["half space", "base", "electrode", "electrode above base"],
)
def test_interior_of_periodic_layers(layers):
    """Surface values are those of the compliance; the mean traction crosses all planes, and electrodes are at zero."""
    system = HalfSpace("trigonometric", periodic=True, matrix_up_to=0).reduce(body(layers, divisions=(10, 9)))
    interior, load = system.capability(InteriorFields), random_load(system, layers)
    load += 0.3 * np.abs(load).max(axis=0)
    surface = interior.evaluate(load, system.points)
    assert_close(surface.values, system.recover(load).values, 1e-9)
    assert_close(surface.fluxes[:, 2], load, 1e-9)
    for depth in (0.7 * UM, UM, UM * (1.0 + 1e-6), 1.6 * UM):
        below = interior.evaluate(load, system.points - [0.0, 0.0, depth])
        np.testing.assert_allclose(below.fluxes[:, 2, :3].mean(axis=0), load[:, :3].mean(axis=0), rtol=1e-9)
        if layers.layers == FILM.layers and depth == UM:
            assert np.abs(below.values[:, ELECTRIC]).max() < 1e-9 * np.abs(surface.values[:, ELECTRIC]).max()
            assert np.abs(below.fluxes[:, 2, ELECTRIC].mean() / load[:, ELECTRIC].mean() - 1.0) < 1e-9


def test_interior_of_periodic_layers_of_the_substrate():
    """Layers of the substrate's material leave the fields below them as they are, also under the mean load."""
    layers, fields = LayerStack((Layer(SUBSTRATE, 0.4 * UM), Layer(SUBSTRATE, 0.3 * UM))), []
    points = np.array([[x, 0.2 * UM, -depth * UM] for depth in (0.0, 0.4, 0.55, 1.3) for x in (-UM, 0.0, 0.4 * UM)])
    for one in (layers, LayerStack()):
        system = HalfSpace(periodic=True, matrix_up_to=0).reduce(body(one, divisions=(12, 11)))
        load = random_load(system, layers)
        fields.append(system.capability(InteriorFields).evaluate(load + load.max(axis=0), points))
    for name in ("values", "gradients", "fluxes"):
        computed, expected = (getattr(one, name).reshape(len(points), -1) for one in fields)
        assert_close(computed, expected, 1e-9)


def airy(nu, shear, functions):
    """Return f, f' / k and the displacements along and across the surface, for derivatives (4, n) of n functions.

    Airy's function f(z) cos kx has the stresses -k^2 f cos kx and k f' sin kx on planes z; displacements are for k = 1.
    """
    f0, f1, f2, f3 = functions
    along = ((1.0 - nu) * f2 + nu * f0) / (2.0 * shear)
    return np.array([f0, f1, along, ((1.0 - nu) * f3 + nu * f1) / (2.0 * shear) - f1 / shear])


def in_film(a):
    cosh, sinh = np.cosh(a), np.sinh(a)
    even, odd = np.array([cosh, sinh, cosh, sinh]), np.array([sinh, cosh, sinh, cosh])
    n = np.arange(4.0)
    # derivatives of cosh, a cosh, sinh, a sinh
    return np.stack([even, a * even + n * odd, odd, a * odd + n * even], axis=1)


def in_substrate(a):
    return np.exp(a) * np.stack([np.ones(4), a + np.arange(4.0)], axis=1)


@pytest.mark.parametrize("substrate", [None, (5e9, 0.1), (150e9, 0.4)], ids=["base", "soft", "stiff"])
def test_sinusoidal_pressure_on_an_isotropic_film(substrate):
    """Stresses in a film on a rigid base or on another half space, by Airy's functions (Burmister 1945)."""
    nu, shear, h = 0.3, 30e9, 0.9 * UM
    film = Material.isotropic(2.0 * shear * (1.0 + nu), nu)
    lower = film if substrate is None else Material.isotropic(2.0 * substrate[0] * (1.0 + substrate[1]), substrate[1])
    base = None if substrate else RigidBase(0.5 * UM)
    layers = LayerStack((Layer(film, h if substrate else 0.4 * UM),), base)
    system = HalfSpace("trigonometric", periodic=True, matrix_up_to=0).reduce(body(layers, lower, (12, 9)))
    x = system.points[:, 0] - system.points[:, 0].min()
    k = 2.0 * 2.0 * np.pi / (13 / 12 * 4 * UM)
    load = np.zeros((len(x), 5))
    load[:, 2] = -np.cos(k * x)

    surface, interface = (airy(nu, shear, in_film(k * z)) for z in (h, 0.0))
    if substrate is None:
        matrix = np.concatenate([surface[:2], interface[2:]])
    else:
        matrix = np.zeros((6, 6))
        matrix[:2, :4], matrix[2:, :4] = surface[:2], interface
        matrix[2:, 4:] = -airy(substrate[1], substrate[0], in_substrate(0.0))
    constants = np.linalg.solve(matrix, np.eye(len(matrix))[0])
    heights = [0.0, 0.5 * UM, 0.7 * UM] + ([-0.3 * UM] if substrate else [])
    for z in heights:
        normal, along = (in_film(k * z) @ constants[:4] if z >= 0.0 else in_substrate(k * z) @ constants[4:])[:2]
        stress = system.capability(InteriorFields).evaluate(load, system.points - [0.0, 0.0, h - z]).fluxes[:, 2]
        np.testing.assert_allclose(stress[:, 2], -normal * np.cos(k * x), atol=1e-9)
        np.testing.assert_allclose(stress[:, 0], along * np.sin(k * x), atol=1e-9)


def test_refusals():
    with pytest.raises(CaseError, match="insulates electric"):
        HalfSpace().check(body(LayerStack((), RigidBase(UM, ("electric",)))))
