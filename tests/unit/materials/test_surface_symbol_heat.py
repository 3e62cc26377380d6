"""Response of layers to heat through their surface: collocation, closed forms, limits and symmetries."""

from dataclasses import replace

import numpy as np
import pytest
import scipy

from meeframe.fields import Array, FieldScaling
from meeframe.material import Material, library_material, rotation_about
from meeframe.material.grading import Grading
from meeframe.material.layers import Interface, Layer, LayerStack, RigidBase
from meeframe.material.medium import Complex, Expansion, Medium
from meeframe.material.surface_symbol import SurfaceSymbol
from meeframe.material.thermal_half_space import thermal_response
from meeframe.testing.closed_forms_layers import collocated_compliance

ANGLES = np.array([0.0, 0.4, 1.9, 2.7])
KH = np.array([1e-4, 1e-2, 0.05, 0.19, 0.21, 0.7, 2.0, 6.0, 15.0, 40.0])
EXPANSION = np.array([[1.2e-5, 0.2e-5, -0.1e-5], [0.2e-5, 2e-5, 0.3e-5], [-0.1e-5, 0.3e-5, 0.8e-5]])
CONDUCTIVITY = np.array([[3.0, 0.4, -0.2], [0.4, 2.5, 0.5], [-0.2, 0.5, 4.0]])
HEAT = 5


def heated(name: str, factor: float, angle: float) -> Material:
    """Return a triclinic material whose thermal constants are turned with it."""
    pyroelectric, pyromagnetic = [2e-5, -1e-5, -7e-5 * factor], [1e-4, 2e-4, -3e-4]
    heat = factor * CONDUCTIVITY, EXPANSION / factor, None, pyroelectric, pyromagnetic, "strain"
    return library_material(name).with_heat(*heat).rotated(rotation_about([1.0, 2.0, 3.0], angle))


UPPER, LOWER = heated("pzt-4", 1.0, 0.7), heated("batio3-cofe2o4", 2.0, 1.9)
SUBSTRATE = heated("orthotropic-mee", 0.5, 0.3)
SPRINGS = Interface(1e17, 3e16, {"electric": 0.05, "magnetic": 20.0, "thermal": 1e6})
ELECTRODE = replace(SPRINGS, conductances={"thermal": 1e6}, electrode="grounded")
STACKS = {
    "springs": LayerStack((Layer(UPPER, 1e-6, SPRINGS), Layer(LOWER, 5e-7))),
    "electrode": LayerStack((Layer(UPPER, 1e-6, ELECTRODE),)),
    "base": LayerStack((Layer(UPPER, 1e-6, ELECTRODE), Layer(LOWER, 5e-7)), RigidBase(2e-6)),
    "insulating base": LayerStack((Layer(UPPER, 1e-6),), RigidBase(4e-6, ("electric", "thermal"))),
}


def symbol(layers: LayerStack, material: Material = SUBSTRATE, angles: Array = ANGLES) -> SurfaceSymbol:
    moduli = [*(layer.material.thermal_moduli for layer in layers.layers), material.thermal_moduli]
    return SurfaceSymbol.of(material.stiffness, layers, np.eye(3), angles, material.fields, moduli=moduli)


def heat_column(one: SurfaceSymbol, k: Array) -> Complex:
    """Return y_h (n, directions, 5) in SI units."""
    return np.asarray(one.evaluate(k)[..., :HEAT, HEAT] * one.factors[:HEAT] * one.factors[HEAT])


def assert_close(computed: Complex, expected: Complex, tolerance: float) -> None:
    """Compare field by field, relative to the largest one."""
    assert (np.abs(computed - expected) <= tolerance * np.abs(expected).max(axis=tuple(range(expected.ndim - 1)))).all()


def half_space(material: Material) -> Complex:
    directions = np.column_stack([np.cos(ANGLES), np.sin(ANGLES), np.zeros_like(ANGLES)])
    conductivity = material.decoupled[0][1]
    return thermal_response(
        material.stiffness[:, :HEAT, :HEAT], material.thermal_moduli, conductivity, (0, 0, 1), directions
    )[0]


@pytest.mark.parametrize("interface", [SPRINGS, ELECTRODE], ids=["springs", "electrode"])
@pytest.mark.parametrize(("kh", "nodes"), [(0.15, 10), (2.0, 24)])
def test_triclinic_stack_against_collocation(interface: Interface, kh: float, nodes: int) -> None:
    """Both solve the same equations; collocation knows neither eigenvectors nor the response of half spaces."""
    layers, k = LayerStack((Layer(UPPER, 1e-6, interface), Layer(LOWER, 5e-7)), RigidBase(2e-6)), kh / 1e-6
    one, materials = symbol(layers), (UPPER, LOWER, SUBSTRATE)
    scaling = FieldScaling(one.factors)
    stiffnesses = [scaling.scale_stiffness(material.stiffness) for material in materials]
    moduli = [material.thermal_moduli * one.factors[:HEAT] * one.factors[HEAT] for material in materials]
    jumps = [each.interface.compliance(SUBSTRATE.fields) * k / one.factors**2 for each in layers.layers]
    grounded = [interface.electrode is not None, False]
    for angle, computed in zip(ANGLES, one.evaluate(np.array([k]))[0], strict=True):
        m, depths = np.array([np.cos(angle), np.sin(angle)]), [kh, 0.5 * kh, 2.0 * kh]
        expected = collocated_compliance(stiffnesses, depths, jumps, grounded, m, nodes, moduli)
        np.testing.assert_allclose(computed, expected, rtol=0.0, atol=1e-10 * np.abs(expected).max())
        assert_close(computed[:HEAT, HEAT][None], expected[:HEAT, HEAT][None], 1e-9)


def test_layers_of_the_substrate_change_nothing() -> None:
    one = symbol(LayerStack((Layer(SUBSTRATE, 1e-6),) * 2))
    assert np.abs(one.difference(KH / 1e-6)).max() < 1e-12 * np.abs(one.top).max()
    computed = heat_column(one, KH / 1e-6)
    assert_close(computed, np.broadcast_to(half_space(SUBSTRATE), computed.shape), 1e-10)


@pytest.mark.parametrize("name", STACKS)
def test_splitting_and_opposite_waves(name: str) -> None:
    """Splitting a layer changes nothing; the responses to opposite waves are conjugate; heat has no reaction."""
    layers = STACKS[name]
    first, *others = layers.layers
    parts = Layer(first.material, 3e-7), Layer(first.material, 7e-7, first.interface)
    one, divided = symbol(layers), symbol(LayerStack((*parts, *others), layers.base))
    opposite = symbol(layers, angles=ANGLES + np.pi)
    k = KH / 1e-6
    y = one.evaluate(k)
    scale = np.abs(y).max(axis=(1, 2, 3), keepdims=True)
    assert (np.abs(divided.evaluate(k) - y) <= 1e-11 * scale).all()
    assert (np.abs(opposite.evaluate(k) - y.conj()) <= 1e-11 * scale).all()
    assert (np.abs(one.top + one.difference(k) - y) <= 1e-11 * scale).all()
    assert not y[..., HEAT, :HEAT].any()


def test_short_and_long_waves() -> None:
    """Short waves see the top material alone, long ones the substrate, whatever is between."""
    one = symbol(STACKS["springs"])
    assert_close(heat_column(one, np.array([40.0 / 1e-6]))[0], half_space(UPPER), 1e-10)
    assert_close(heat_column(one, np.array([1e-9 / 1e-6]))[0], half_space(SUBSTRATE), 1e-6)
    # an electrode on the substrate takes the effect on the potential away
    grounded = heat_column(symbol(STACKS["electrode"]), np.array([1e-9 / 1e-6]))[0]
    assert np.abs(grounded[:, 3]).max() < 1e-6 * np.abs(half_space(SUBSTRATE)[:, 3]).max()


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.45])
def test_heated_layer_on_a_rigid_base(poisson: float) -> None:
    """A uniform flux through an isotropic layer: constrained expansion (1 + nu) / (1 - nu) alpha times mean theta.

    Long waves have the same limit, and so have the potentials of a stack with an electrode.
    """
    steel, thickness = Material.isotropic(2e11, poisson).with_heat(40.0, 1.2e-5), 3e-3
    one = symbol(LayerStack((), RigidBase(thickness)), steel)
    uniform = one.uniform_heat_response() * one.factors * one.factors[HEAT]
    growth = -1.2e-5 * (1.0 + poisson) / (1.0 - poisson) * thickness**2 / (2.0 * 40.0)
    np.testing.assert_allclose(uniform, [0.0, 0.0, growth, 0.0, 0.0, 0.0], rtol=1e-12)
    stack = symbol(STACKS["base"])
    k = np.array([1e-5 / 1e-6])
    expected = stack.uniform_heat_response()[:HEAT] * stack.factors[:HEAT] * stack.factors[HEAT]
    long_waves = heat_column(stack, k)[0].real / k**2
    assert_close(long_waves, np.broadcast_to(expected, long_waves.shape), 1e-6)


@pytest.mark.parametrize("change", [1e-3, 1e-6, 1e-9])
def test_nearly_degenerate_materials(change: float) -> None:
    """Layers near the isotropic one, whose eigenvalues coincide with that of heat, approach it linearly."""

    def response(detuned: float) -> Complex:
        film = Material.isotropic(2e11 * (1.0 + detuned), 0.3).with_heat([40.0, 40.0, 40.0 * (1 + detuned)], 1.2e-5)
        base = Material.isotropic(7e10, 0.34).with_heat(200.0, 2.3e-5)
        return heat_column(symbol(LayerStack((Layer(film, 1e-6),)), base), KH / 1e-6)

    exact = response(0.0)
    assert_close(response(change)[..., :3], exact[..., :3], 3.0 * change + 1e-12)


@pytest.mark.full
def test_exponential_grading() -> None:
    """With all constants as exp(a z), t and h are so as well, and the matrix of the depth is constant but for a."""
    thickness, ratio, tolerance, angle = 1e-6, 4.5, 1e-3, 0.9
    layers = Grading("exponential", ratio=ratio, tolerance=tolerance).sublayers(UPPER, thickness, Interface())
    lowest, base = layers[-1].material, RigidBase(layers[-1].thickness)
    one = symbol(LayerStack(layers[:-1], base), lowest, np.array([angle]))
    medium = Medium.of(UPPER.stiffness, np.eye(3), np.array([angle]), expansion=Expansion(UPPER.thermal_moduli, HEAT))
    for kh in (0.3, 1.0, 3.0):
        state = medium.state[0].copy()
        state[6:, 6:] += np.log(ratio) / kh * np.eye(6)
        u, t = scipy.linalg.expm(kh * state)[:, 6:].reshape(2, 6, 6)
        exact = (u @ np.linalg.inv(t))[:HEAT, HEAT] * medium.factors[:HEAT] * medium.factors[HEAT]
        computed = heat_column(one, np.array([kh / thickness]))[0, 0]
        assert (np.abs(computed - exact) / one.factors[:HEAT]).max() < tolerance * (
            np.abs(exact) / one.factors[:HEAT]
        ).max()
