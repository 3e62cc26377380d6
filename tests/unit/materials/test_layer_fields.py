"""Fields of waves inside layers obey equilibrium and the conditions at the surface, at interfaces and on the base."""

import numpy as np
import pytest

from meeframe.fields import ELECTRIC, MEE
from meeframe.material import library_material, rotation_about
from meeframe.material.layer_fields import wave_amplitudes, wave_fields
from meeframe.material.layers import Interface, Layer, LayerStack, RigidBase, locate_depth
from meeframe.material.surface_symbol import SurfaceSymbol

ANGLES = np.array([0.3, 1.4, 3.0, 5.1])
K = np.array([0.02, 0.4, 1.5, 6.0]) / 1e-6
DIRECTIONS = np.stack([np.cos(ANGLES), np.sin(ANGLES), np.zeros(4)], axis=1)


def rotated(name, angle):
    return library_material(name).rotated(rotation_about([1.0, 2.0, 3.0], angle))


SUBSTRATE = rotated("orthotropic-mee", 0.3)
SPRINGS = Interface(1e17, 3e16, {"electric": 0.05, "magnetic": 20.0})
STACKS = {
    "springs": LayerStack((Layer(rotated("pzt-4", 0.7), 1e-6, SPRINGS), Layer(rotated("linbo3", 2.0), 3e-7))),
    "electrode": LayerStack((Layer(rotated("pzt-4", 0.7), 1e-6, Interface(electrode="grounded")),)),
    "base": LayerStack((Layer(rotated("pzt-4", 0.7), 1e-6),), RigidBase(5e-7)),
    "insulating base": LayerStack((Layer(rotated("zno", 0.7), 1e-6),), RigidBase(4e-7, ("electric", "magnetic"))),
}


def setup(name):
    symbol = SurfaceSymbol.of(SUBSTRATE.stiffness, STACKS[name], np.eye(3), ANGLES)
    random = np.random.default_rng(0)
    return symbol, random.normal(size=(4, 5)) + 1j * random.normal(size=(4, 5))


def waves_in_layers(symbol, loads, depth):
    """Return values and slopes (w, f) in the scaled fields of the surface; on an interface those above it."""
    number, *distances = locate_depth(symbol.bottoms, depth)
    values, slopes = wave_fields(symbol.media[number], K, wave_amplitudes(symbol, K, loads)[number], *distances)
    factors = symbol.media[number].factors / symbol.factors
    return values * factors, slopes * factors


def gradients(symbol, loads, depth):
    """Return values (w, f) and gradients (w, f, 3) in SI units."""
    values, slopes = waves_in_layers(symbol, loads, depth)
    along = 1j * K[:, None, None] * values[:, :, None] * DIRECTIONS[:, None, :]
    along[:, :, 2] = slopes
    return values * symbol.factors, along * symbol.factors[:, None]


def fluxes(stiffness, gradient):
    return np.einsum("iJKm,wKm->wiJ", stiffness, gradient)


@pytest.mark.parametrize("name", STACKS)
def test_surface(name):
    symbol, loads = setup(name)
    values, _ = waves_in_layers(symbol, loads, 0.0)
    expected = np.array([symbol.evaluate(K[i : i + 1])[0, i] @ loads[i] / K[i] for i in range(4)])
    np.testing.assert_allclose(values, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())
    _, gradient = gradients(symbol, loads, 0.0)
    traction = fluxes(STACKS[name].layers[0].material.stiffness, gradient)[:, 2] * symbol.factors
    np.testing.assert_allclose(traction, loads, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("name", STACKS)
@pytest.mark.parametrize("depth", [0.4e-6, 1.2e-6])
def test_equilibrium(name, depth):
    """The divergence of all fluxes vanishes; their derivative along the normal is that by differences."""
    symbol, loads = setup(name)
    layers, step = STACKS[name].layers, 1e-10
    material = layers[0].material if depth < 1e-6 else (*(layer.material for layer in layers[1:]), SUBSTRATE)[0]
    below, here, above = (
        fluxes(material.stiffness, gradients(symbol, loads, depth + offset)[1]) for offset in (step, 0.0, -step)
    )
    normal = (above - below)[:, 2] / (2.0 * step)
    along = 1j * K[:, None] * np.einsum("wi,wiJ->wJ", DIRECTIONS, here)
    scale = np.abs(along).max(axis=0)
    assert (np.abs(normal + along).max(axis=0) < 1e-6 * scale).all()


@pytest.mark.parametrize("name", STACKS)
def test_interface(name):
    symbol, loads = setup(name)
    layers = STACKS[name].layers
    interface, lower = layers[0].interface, (*(layer.material for layer in layers[1:]), SUBSTRATE)[0]
    u_above, gradient_above = gradients(symbol, loads, 1e-6)
    u_below, gradient_below = gradients(symbol, loads, 1e-6 * (1.0 + 2e-12))
    t_above = fluxes(layers[0].material.stiffness, gradient_above)[:, 2]
    t_below = fluxes(lower.stiffness, gradient_below)[:, 2]
    scale_u, scale_t = np.abs(u_above).max(axis=0), np.abs(t_above).max(axis=0)
    if interface.electrode:
        scale_u[ELECTRIC] = np.abs(gradients(symbol, loads, 0.0)[0]).max(axis=0)[ELECTRIC]
        assert (np.abs(u_above[:, ELECTRIC]) < 1e-10 * scale_u[ELECTRIC]).all()
        assert (np.abs(t_above - t_below)[:, ELECTRIC] > 1e-3 * scale_t[ELECTRIC]).any()
        t_below[:, ELECTRIC] = t_above[:, ELECTRIC]
    assert (np.abs(t_above - t_below).max(axis=0) < 1e-9 * scale_t).all()
    jump = interface.compliance(MEE) * t_above
    assert (np.abs(u_above - u_below - jump).max(axis=0) < 1e-9 * scale_u).all()


def test_base():
    for name, free in (("base", []), ("insulating base", [3, 4])):
        symbol, loads = setup(name)
        depth = sum(symbol.thicknesses)
        surface, _ = gradients(symbol, loads, 0.0)
        values, gradient = gradients(symbol, loads, depth)
        held = [field for field in range(5) if field not in free]
        assert (np.abs(values[:, held]).max(axis=0) < 1e-11 * np.abs(surface[:, held]).max(axis=0)).all()
        flux = fluxes(SUBSTRATE.stiffness, gradient)[:, 2] * symbol.factors
        assert np.abs(flux[:, free]).max(initial=0.0) < 1e-10
