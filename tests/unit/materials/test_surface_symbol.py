"""Surface compliance of layers: closed forms, an independent solution, limits and symmetries."""

from dataclasses import replace

import numpy as np
import pytest

from meeframe.fields import MEE, FieldScaling
from meeframe.material import Material, library_material, rotation_about
from meeframe.material.layers import Interface, Layer, LayerStack, RigidBase
from meeframe.material.medium import exponential, exponentials
from meeframe.material.surface_symbol import SurfaceSymbol
from meeframe.testing.closed_forms_layers import collocated_compliance, isotropic_layer_compliance

FRAME = np.eye(3)
ANGLES = np.array([0.0, 0.4, 1.9, 2.7])
THICKNESS = 2e-6
KH = np.array([1e-4, 1e-2, 0.05, 0.19, 0.21, 0.7, 2.0, 6.0, 15.0, 40.0])
FLIP = np.diag([1.0, 1.0, 1.0, -1.0, -1.0])
ROTATION = rotation_about([1.0, 2.0, 3.0], 0.7)


def rotated(name: str, angle: float = 0.7) -> Material:
    return library_material(name).rotated(rotation_about([1.0, 2.0, 3.0], angle))


SPRINGS = Interface(1e17, 3e16, {"electric": 0.05, "magnetic": 20.0})
TRICLINIC = LayerStack(
    (Layer(rotated("pzt-4"), 1e-6, SPRINGS), Layer(rotated("batio3-cofe2o4", 1.9), 5e-7)), RigidBase(2e-6)
)
SUBSTRATE = rotated("orthotropic-mee", 0.3)
STACKS = {
    "film": LayerStack((Layer(library_material("batio3"), 1e-6),)),
    "electrode": LayerStack((Layer(library_material("pzt-4"), 1e-6, Interface(electrode="grounded")),)),
    "springs": LayerStack((Layer(rotated("pzt-4"), 1e-6, SPRINGS), Layer(rotated("linbo3", 2.0), 3e-7))),
    "base": LayerStack((), RigidBase(1e-6)),
    "insulating base": LayerStack((Layer(rotated("zno"), 1e-6),), RigidBase(4e-6, ("electric", "magnetic"))),
}


def symbol(layers: LayerStack, material: Material = SUBSTRATE, angles=ANGLES) -> SurfaceSymbol:
    return SurfaceSymbol.of(material.stiffness, layers, FRAME, np.asarray(angles))


def si(one: SurfaceSymbol, compliance: np.ndarray) -> np.ndarray:
    return compliance * np.outer(one.factors, one.factors)


def isotropic(shear: float, nu: float, permittivity: float = 1e-11) -> Material:
    return Material.isotropic(2.0 * shear * (1.0 + nu), nu, permittivity)


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.4, 0.499])
@pytest.mark.parametrize("substrate", [(8e10, 0.3), (8e8, 0.1), (4e12, 0.45), None])
def test_isotropic_layer(nu, substrate):
    film, shear = isotropic(8e10, nu), 8e10
    if substrate is None:
        one = symbol(LayerStack((), RigidBase(THICKNESS)), film, [0.0])
    else:
        one = symbol(LayerStack((Layer(film, THICKNESS),)), isotropic(*substrate, 4e-11), [0.0])
    computed = si(one, one.evaluate(KH / THICKNESS))[:, 0]
    expected = isotropic_layer_compliance(KH, (shear, nu), substrate)
    scale = np.abs(list(expected.values())).max(axis=0)
    for (row, column), values in expected.items():
        np.testing.assert_array_less(np.abs(computed[:, row, column] - values), 1e-12 * scale)
    permittivity = np.inf if substrate is None else 4.0  # of the substrate per that of the film
    t = np.tanh(KH)
    potential = t if substrate is None else (1.0 + t * permittivity) / (permittivity + t)
    np.testing.assert_allclose(computed[:, 3, 3], -potential / 1e-11, rtol=1e-12)
    assert np.abs(computed[:, [0, 1, 2], [1, 2, 1]]).max() < 1e-12 * scale.max()


@pytest.mark.full(except_for=3)
@pytest.mark.parametrize("electrode", [False, True])
@pytest.mark.parametrize(("kh", "nodes"), [(0.15, 10), (0.3, 14), (2.0, 24)])
def test_triclinic_stack_against_collocation(electrode, kh, nodes):
    """Both solve the same equations; collocation knows neither eigenvectors nor the compliance of half spaces."""
    first, second = TRICLINIC.layers
    if electrode:
        first = Layer(first.material, first.thickness, Interface(1e17, 3e16, {"magnetic": 20.0}, "grounded"))
    layers = LayerStack((first, second), TRICLINIC.base)
    one, k = symbol(layers, SUBSTRATE), kh / 1e-6
    materials = [first.material, second.material, SUBSTRATE]
    stiffnesses = [FieldScaling(one.factors).scale_stiffness(material.stiffness) for material in materials]
    jumps = [layer.interface.compliance(MEE) * k / one.factors**2 for layer in layers.layers]
    computed = one.evaluate(np.array([k]))[0]
    for angle, result in zip(ANGLES, computed, strict=True):
        m = np.array([np.cos(angle), np.sin(angle)])
        expected = collocated_compliance(stiffnesses, [kh, 0.5 * kh, 2 * kh], jumps, [electrode, False], m, nodes)
        # round-off of the collocation, which grows with the square of its nodes
        np.testing.assert_allclose(result, expected, rtol=0.0, atol=1e-10 * np.abs(expected).max())


def test_half_space_against_collocation():
    one, k = symbol(STACKS["springs"]), 1e6
    layers = STACKS["springs"].layers
    materials = [*(layer.material for layer in layers), SUBSTRATE]
    stiffnesses = [FieldScaling(one.factors).scale_stiffness(material.stiffness) for material in materials]
    jumps = [layer.interface.compliance(MEE) * k / one.factors**2 for layer in layers]
    expected = collocated_compliance(
        stiffnesses, [1.0, 0.3, 28.0], jumps, [False, False], np.array([np.cos(0.4), np.sin(0.4)]), 64
    )
    np.testing.assert_allclose(one.evaluate(np.array([k]))[0, 1], expected, rtol=0.0, atol=1e-9)


def test_layers_of_the_substrate_change_nothing():
    for count in (1, 3):
        one = symbol(LayerStack((Layer(SUBSTRATE, 1e-6),) * count))
        assert np.abs(one.difference(KH / 1e-6)).max() < 1e-12 * np.abs(one.top).max()


@pytest.mark.parametrize("name", STACKS)
def test_splitting_a_layer_changes_nothing(name):
    layers = STACKS[name]
    k = KH / 1e-6
    if layers.layers:
        first, *others = layers.layers
        parts = (
            Layer(first.material, 0.3 * first.thickness),
            Layer(first.material, 0.7 * first.thickness, first.interface),
        )
        divided = LayerStack((*parts, *others), layers.base)
    else:
        divided = LayerStack((Layer(SUBSTRATE, 0.4e-6),), RigidBase(0.6e-6))
    one, other = symbol(layers), symbol(divided)
    np.testing.assert_allclose(one.evaluate(k), other.evaluate(k), rtol=0.0, atol=1e-12 * np.abs(one.top).max())


@pytest.mark.parametrize("name", STACKS)
def test_symmetries(name):
    one, opposite = symbol(STACKS[name]), symbol(STACKS[name], angles=ANGLES + np.pi)
    y = one.evaluate(KH / 1e-6)
    scale = np.abs(y).max(axis=(1, 2, 3), keepdims=True)
    assert (np.abs(y - y.conj().swapaxes(-1, -2)) <= 1e-14 * scale).all()
    assert (np.abs(opposite.evaluate(KH / 1e-6) - y.conj()) <= 1e-12 * scale).all()
    signed = FLIP @ y
    energy = np.linalg.eigvalsh(signed + signed.conj().swapaxes(-1, -2))
    assert energy.min() > 0.0


def test_evaluation_and_difference_agree_at_the_limit_of_the_series():
    """The two forms of the solution in a layer, for thin and for thick ones, are the same function."""
    for layers in STACKS.values():
        one = symbol(layers)
        k = np.array([0.2 * (1.0 - 1e-9), 0.2 * (1.0 + 1e-9)]) / 1e-6
        low, high = one.difference(k)
        np.testing.assert_allclose(low, high, rtol=0.0, atol=1e-8 * np.abs(one.top).max())
        np.testing.assert_allclose(
            one.evaluate(k), one.top + one.difference(k), rtol=0, atol=1e-13 * abs(one.top).max()
        )


def test_thick_and_thin_limits():
    film, layers = library_material("pzt-4"), STACKS["film"]
    one, substrate = symbol(layers), symbol(LayerStack())
    assert np.abs(one.difference(np.array([60.0 / 1e-6]))).max() < 1e-14
    thin = si(one, one.evaluate(np.array([1e-9 / 1e-6]))[0])
    ratio = (thin - si(substrate, substrate.top)) / np.outer(substrate.factors, substrate.factors)
    assert np.abs(ratio).max() < 1e-6
    base = symbol(LayerStack((), RigidBase(1e-6)), film)
    kh, t = 1e-7, np.linalg.inv(film.stiffness[2, :, :, 2])
    np.testing.assert_allclose(
        si(base, base.evaluate(np.array([kh / 1e-6])))[0, 0].diagonal() / kh, t.diagonal(), rtol=1e-6
    )


@pytest.mark.parametrize("electrode", [None, "grounded", "floating"])
def test_uniform_load_is_the_limit_of_long_waves(electrode):
    """A floating electrode differs: its potential is free under a uniform load and zero under each wave."""
    interface = Interface(1e17, 3e16, {"magnetic": 20.0}, electrode)
    one = symbol(LayerStack((Layer(rotated("pzt-4"), 1e-6, interface),), RigidBase(2e-6)))
    uniform = one.uniform_compliances(1.0, np.squeeze)[0]
    k = np.array([1e-7 / 1e-6])
    without = replace(interface, electrode=None if electrode == "floating" else electrode)
    waves = replace(one, interfaces=(without,))
    np.testing.assert_allclose(waves.evaluate(k)[0, 0] / k, uniform, rtol=0.0, atol=1e-6 * np.abs(uniform).max())
    if electrode == "floating":
        assert np.abs(one.evaluate(k)[0, 0] / k - uniform).max() > 1e-2 * np.abs(uniform).max()


@pytest.mark.parametrize(
    ("interface", "film"),
    [
        (Interface(1e17, 3e16), isotropic(1.0, 0.2)),
        (Interface(conductances={"electric": 0.05}), None),
        (Interface(electrode="grounded"), None),
    ],
)
def test_interfaces_are_limits_of_thin_layers(interface, film):
    """Springs, capacitances and electrodes are soft, poorly and highly permittive layers of vanishing thickness."""
    errors = []
    for thickness in (4e-11, 2e-11):
        if film is not None:
            shear, normal = 3e16 * thickness, 1e17 * thickness  # normal: the modulus of uniaxial strain
            nu = (normal - 2.0 * shear) / (2.0 * normal - 2.0 * shear)
            soft = Material.isotropic(2.0 * shear * (1.0 + nu), nu, 1e-8, 5e-6)
        else:
            permittivity = 0.05 * thickness if interface.conductances else 1e3
            soft = Material.isotropic(2e11, 0.3, permittivity, 5e-6)
        top = library_material("pzt-4")
        thin = LayerStack((Layer(top, 1e-6), Layer(soft, thickness)))
        one, other = symbol(LayerStack((Layer(top, 1e-6, interface),))), symbol(thin)
        k = np.array([0.2, 1.0]) / 1e-6
        scale = np.abs(one.top).max()
        errors.append(np.abs(one.evaluate(k) - other.evaluate(k)).max() / scale)
    assert errors[1] < 1e-3
    assert errors[1] == pytest.approx(0.5 * errors[0], rel=0.1)


def test_nearly_degenerate_materials():
    """Perturbations of isotropic layers, whose eigenvalues coincide, change the compliance in proportion."""
    differences = []
    film, substrate = isotropic(8e10, 0.3), isotropic(2e10, 0.2)
    reference = symbol(LayerStack((Layer(film, 1e-6),)), substrate)
    for size in (1e-4, 1e-8):
        elastic = film.elastic.copy()
        elastic[2, 2, 2, 2] *= 1.0 + size
        parts = (elastic, film.piezoelectric, film.piezomagnetic, film.permittivity, film.magnetoelectric)
        perturbed = Material("perturbed", *parts, film.permeability)
        one = symbol(LayerStack((Layer(perturbed, 1e-6),)), substrate)
        differences.append(np.abs(one.evaluate(KH / 1e-6) - reference.evaluate(KH / 1e-6)).max() / size)
    assert differences[1] == pytest.approx(differences[0], rel=1e-3)


def test_exponential():
    generator = np.random.default_rng(3)
    vectors = generator.normal(size=(5, 5)) + 1j * generator.normal(size=(5, 5))
    values = np.array([-0.01, -1.0, -30.0 + 4.0j, -3.0, -200.0])
    for scale in (1e-3, 1.0):
        computed = exponential((vectors * (scale * values)) @ np.linalg.inv(vectors))
        expected = (vectors * np.exp(scale * values)) @ np.linalg.inv(vectors)
        np.testing.assert_allclose(computed, expected, rtol=0.0, atol=1e-12 * np.linalg.cond(vectors))


def test_exponentials_of_multiples():
    """Compare factors with ratios that are powers of two, and others, with one exponential each."""
    generator = np.random.default_rng(4)
    matrices = -np.eye(5) + 0.4 * (generator.normal(size=(3, 5, 5)) + 1j * generator.normal(size=(3, 5, 5)))
    factors = np.array([1e-3, 0.3, 0.6, 4.8, 0.25, 1.0, 0.7])
    expected = exponential(factors[:, None, None, None] * matrices)
    np.testing.assert_allclose(exponentials(matrices, factors), expected, rtol=0.0, atol=1e-13)


def test_rotated_frame():
    """Describe a stack in other axes: rows and columns of the compliance rotate with the frame."""
    one = symbol(STACKS["springs"])
    layers = LayerStack(
        tuple(
            Layer(layer.material.rotated(ROTATION), layer.thickness, layer.interface)
            for layer in STACKS["springs"].layers
        )
    )
    other = SurfaceSymbol.of(SUBSTRATE.rotated(ROTATION).stiffness, layers, ROTATION.T, ANGLES)
    k = KH / 1e-6
    np.testing.assert_allclose(si(one, one.evaluate(k)), si(other, other.evaluate(k)), rtol=1e-9, atol=1e-22)
