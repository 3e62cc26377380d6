"""Graded layers: closed forms of exponential and power-law grading, profiles, messages."""

from itertools import pairwise

import numpy as np
import pytest
import scipy

import meeframe
from meeframe.common.errors import CaseError
from meeframe.material import Material, library_material, rotation_about
from meeframe.material.grading import Grading
from meeframe.material.layers import Interface, LayerStack, RigidBase
from meeframe.material.medium import Medium
from meeframe.material.surface_symbol import SurfaceSymbol

PZT = library_material("pzt-4").rotated(rotation_about([1.0, 2.0, 3.0], 0.7))
H = 1e-6


def exponential_compliance(material: Material, ratio: float, kh: float, angle: float) -> np.ndarray:
    """Return Y of a layer with constants C ratio^(depth / h) on a rigid base: t = t~ e^(a z) has a constant matrix."""
    medium = Medium.of(material.stiffness, np.eye(3), np.array([angle]))
    state = medium.state[0].copy()
    state[5:, 5:] += np.log(ratio) / kh * np.eye(5)
    u, t = scipy.linalg.expm(kh * state)[:, 5:].reshape(2, 5, 5)
    return u @ np.linalg.inv(t)


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("ratio", [4.5, 0.3])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-3])
def test_exponential_grading(ratio, tolerance):
    layers = Grading("exponential", ratio=ratio, tolerance=tolerance).sublayers(PZT, H, Interface())
    assert sum(layer.thickness for layer in layers) == pytest.approx(H)
    stack = LayerStack(layers[:-1], RigidBase(layers[-1].thickness))
    symbol = SurfaceSymbol.of(layers[-1].material.stiffness, stack, np.eye(3), np.array([0.9]))
    for kh in (0.3, 1.0, 3.0):
        expected = exponential_compliance(PZT, ratio, kh, 0.9) * np.outer(PZT.scaling.factors, PZT.scaling.factors)
        expected = expected / np.outer(symbol.factors, symbol.factors)
        computed = symbol.evaluate(np.array([kh / H]))[0, 0]
        assert np.abs(computed - expected).max() < tolerance * np.abs(expected).max()


@pytest.mark.parametrize("exponent", [0.3, 0.6])
def test_power_law_grading(exponent):
    """A half space with constants ~ depth^n has no length of its own: Y is proportional to k^n.

    Source: Giannakopoulos and Suresh, Int. J. Solids Struct. 34 (1997) 2357; the force on a sphere then grows like the
    radius of the contact to the power 3 + n.
    """
    glass = library_material("glass")
    layers = Grading("power", exponent=exponent, tolerance=1e-2).sublayers(glass, H, Interface())
    symbol = SurfaceSymbol.of(glass.stiffness, LayerStack(layers), np.eye(3), np.zeros(1))
    normal = symbol.evaluate(np.array([3.0, 6.0]) / H)[:, 0, 2, 2].real
    assert np.log2(normal[1] / normal[0]) == pytest.approx(exponent, abs=0.03)


@pytest.mark.parametrize("exponent", [0.3, 0.8])
def test_power_laws_converge_with_the_square_of_the_number(exponent):
    """Sublayers on the body itself, where the constants are those of the layer without grading."""
    grading = Grading("power", exponent=exponent)
    y = []
    for count in (16, 32, 64):
        layers = LayerStack(grading._divided(PZT, H, Interface(), count))
        symbol = SurfaceSymbol.of(PZT.stiffness, layers, np.eye(3), np.array([0.9]))
        y.append(symbol.evaluate(np.array([0.3, 3.0]) / H) * np.outer(symbol.factors, symbol.factors))
    scale = np.outer(PZT.scaling.factors, PZT.scaling.factors)
    first, second = (np.abs((one - other) / scale).max() for one, other in pairwise(y))
    assert first > 3.5 * second
    assert second < 2e-3 * np.abs(y[-1] / scale).max()


@pytest.mark.full
def test_table_and_mixture():
    """A mixture of a material with itself changes nothing; a straight profile is that of the power one."""
    barium, cobalt = library_material("batio3"), library_material("cofe2o4")
    same = Grading("power", exponent=2.0, material=barium).sublayers(barium, H, Interface())
    for layer in same:
        np.testing.assert_allclose(layer.material.stiffness, barium.stiffness, rtol=1e-14)
    table = Grading("table", depths=(0.0, 1.0), factors=(0.0, 1.0), material=cobalt)
    depths = np.linspace(0.0, 1.0, 7)
    np.testing.assert_allclose(table.values(depths), Grading("power", exponent=1.0).values(depths))
    layers = table.sublayers(barium, H, Interface(electrode="grounded"))
    assert layers[-1].interface.electrode == "grounded"
    assert all(layer.interface.is_bonded for layer in layers[:-1])
    np.testing.assert_allclose(LayerStack(layers).interface_depths, [H])
    np.testing.assert_allclose(LayerStack(layers, RigidBase(H)).interface_depths, [H, 2 * H])
    for material, layer in ((barium, layers[0]), (cobalt, layers[-1])):
        elastic = layer.material.elastic[2, 2, 2, 2]
        assert elastic == pytest.approx(material.elastic[2, 2, 2, 2], rel=0.1)


def test_graded_case():
    """A graded layer of a case consists of sublayers, and the case is the same after a round trip."""
    grading = {"law": "exponential", "ratio": 3.0, "tolerance": 0.01}
    case = meeframe.Case(
        material="glass",
        mesh=meeframe.mesh.half_space("2 um", 8),
        indenter=meeframe.Sphere("10 um"),
        steps=[meeframe.Step(approach="10 nm")],
        formulation=meeframe.formulation("half-space"),
        layers=[meeframe.Layer("pzt-4", H, grading=grading), meeframe.Layer("steel", H)],
    )
    layers = case.checked.layers.layers
    assert len(layers) > 4
    assert case.checked.layers.thickness == pytest.approx(2 * H)
    again = meeframe.Case.from_toml(case.to_toml()).checked.layers.layers
    for one, other in zip(layers, again, strict=True):
        np.testing.assert_array_equal(one.material.stiffness, other.material.stiffness)
    with pytest.raises(CaseError, match=r"layers\[1\]\.grading.*: grading: law 'power' takes the keys exponent"):
        meeframe.Case.from_toml(case.to_toml().replace('"exponential"', '"power"'))


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"law": "cubic"}, "law = 'cubic'"),
        ({"law": "exponential"}, "takes the keys ratio"),
        ({"law": "exponential", "ratio": -1.0}, "ratio = -1.0"),
        ({"law": "table", "depths": (0.0, 0.5), "factors": (1.0, 2.0)}, "depths must increase from 0"),
        ({"law": "table", "depths": (0.0, 1.0), "factors": (1.0,)}, "2 depths with 1 factors"),
        ({"law": "table", "depths": (0.0, 1.0), "factors": (0.0, 1.0)}, "positive numbers"),
        ({"law": "table", "depths": (0.0, 1.0), "factors": (0.0, 2.0), "material": PZT}, "fractions from 0 to 1"),
    ],
)
def test_messages(keys, message):
    with pytest.raises(CaseError, match=message):
        Grading(**keys)


def test_infinite_compliance():
    with pytest.raises(CaseError, match="exponent = 1: the compliance of the upper side is infinite"):
        Grading("power", exponent=1.0).sublayers(PZT, H, Interface())


@pytest.mark.full
def test_too_many_sublayers():
    with pytest.raises(CaseError, match="more than 256 sublayers"):
        Grading("exponential", ratio=1e3, tolerance=1e-9).sublayers(PZT, H, Interface())


def test_homogeneous_grading_is_no_grading():
    layers = Grading("exponential", ratio=1.0).sublayers(PZT, H, Interface())
    one = SurfaceSymbol.of(PZT.stiffness, LayerStack(layers), np.eye(3), np.array([0.3]))
    assert np.abs(one.difference(np.array([1.0]) / H)).max() < 1e-12
