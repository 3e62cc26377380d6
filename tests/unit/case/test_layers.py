"""Layers in case files and in Python: tables, objects, messages, cache keys."""

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace
from meeframe_hmatrix import HierarchicalBEM

import meeframe
from meeframe.common.errors import CaseError
from meeframe.fields import MEE
from meeframe.material import library_material, rotation_about, write_material
from meeframe.material.layers import Interface, Layer, LayerStack, RigidBase
from meeframe.model.cache import system_key

MESH = meeframe.mesh.half_space("2 um", 4, rings=1)
TURN = {"axis": [1, 0, 0], "angle": "30 deg"}
PARTS = {
    "material": "silicon",
    "mesh": MESH,
    "indenter": meeframe.Sphere("10 um"),
    "steps": (meeframe.Step(approach="10 nm"),),
    "formulation": HalfSpace(periodic=True),
}
LAYERS = (
    meeframe.Layer("pzt-4", "1 um", TURN, meeframe.Interface(electrode="grounded", normal_stiffness="1e17 N/m^3")),
    meeframe.Layer({"name": "batio3"}, 2e-7, interface=meeframe.Interface(electric_conductance="2 F/m^2")),
    meeframe.Layer(library_material("cofe2o4"), 3e-7),
)
TEXT = """
[material]
name = "silicon"
[mesh]
type = "half-space"
contact_width = 2e-6
divisions = 4
[formulation]
name = "half-space"
[indenter]
name = "sphere"
radius = 1e-5
[[steps]]
approach = 1e-8
[[layers]]
material = "pzt-4"
thickness = "1 um"
"""


def assert_same_layers(one: LayerStack, other: LayerStack) -> None:
    assert len(one.layers) == len(other.layers)
    for layer, twin in zip(one.layers, other.layers, strict=True):
        np.testing.assert_array_equal(layer.material.stiffness, twin.material.stiffness)
        assert (layer.thickness, vars(layer.interface)) == (twin.thickness, vars(twin.interface))
    assert (one.base and vars(one.base)) == (other.base and vars(other.base))


def test_layers_of_a_case_are_objects_in_si_units():
    stack = meeframe.Case(**PARTS, layers=LAYERS, base=meeframe.Base("5 um", magnetic="insulating")).checked.layers
    assert [layer.thickness for layer in stack.layers] == [1e-6, 2e-7, 3e-7]
    assert stack.thickness == pytest.approx(1.5e-6)
    rotated = library_material("pzt-4").rotated(rotation_about([1, 0, 0], np.pi / 6))
    np.testing.assert_allclose(stack.layers[0].material.stiffness, rotated.stiffness, rtol=1e-14, atol=1e-20)
    assert vars(stack.layers[0].interface) == vars(Interface(1e17, electrode="grounded"))
    assert stack.layers[1].interface.conductances == {"electric": 2.0}
    assert stack.layers[2].interface.is_bonded
    assert not stack.layers[1].interface.is_bonded
    assert vars(stack.base) == vars(RigidBase(5e-6, ("magnetic",)))


def test_jumps_at_an_interface():
    interface = Interface(4.0, 2.0, {"magnetic": 5.0})
    np.testing.assert_array_equal(interface.compliance(MEE), [0.5, 0.5, 0.25, 0.0, -0.2])


def test_round_trip_of_both_bodies(tmp_path, monkeypatch):
    base = meeframe.Base("5 um", electric="insulating")
    second = meeframe.SecondBody("silicon", MESH, formulation=HalfSpace(periodic=True), layers=LAYERS[:2], base=base)
    case = meeframe.Case(**PARTS, layers=LAYERS, base=base, second_body=second)
    (tmp_path / "inner").mkdir()
    case.to_toml(tmp_path / "inner" / "case.toml")
    monkeypatch.chdir(tmp_path)
    again = meeframe.Case.from_toml("inner/case.toml")
    assert_same_layers(again.checked.layers, case.checked.layers)
    assert_same_layers(again.checked.second_body.layers, case.checked.second_body.layers)
    assert again.to_toml() == meeframe.Case.from_toml(again.to_toml()).to_toml()


def test_material_files_of_layers_are_relative_to_the_case_file(tmp_path, monkeypatch):

    write_material(library_material("pzt-4"), tmp_path / "film.toml")
    file = tmp_path / "case.toml"
    file.write_text(TEXT.replace('"pzt-4"', '{file = "film.toml"}'), encoding="utf-8")
    monkeypatch.chdir(tmp_path.parent)
    layer = meeframe.Case.from_toml(file).checked.layers.layers[0]
    np.testing.assert_array_equal(layer.material.stiffness, library_material("pzt-4").stiffness)


def test_cache_keys_include_layers():
    bodies = [
        meeframe.Case(**PARTS, layers=layers, base=base).checked.body
        for layers in ((), LAYERS, LAYERS[:2], (meeframe.Layer("pzt-4", "2 um"),), (meeframe.Layer("pzt-4", "1 um"),))
        for base in (None, meeframe.Base("5 um"))
    ]
    assert len({system_key(HalfSpace(), body) for body in bodies}) == len(bodies)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"1 um"', '"-1 um"', "layers[1].thickness = '-1 um': must be > 0 and finite"),
        ('"1 um"', '"1 um"\ninterface = "glued"', "layers[1].interface = 'glued': should be 'bonded' or a table"),
        ('"1 um"', '"1 um"\ninterface = {electrode = "live"}', "layers[1].interface.electrode = 'live': should be"),
        ('"1 um"', '"1 um"\ninterface = {stiffness = 1}', "layers[1].interface.stiffness = 1: unknown key"),
        ('"1 um"', '"1 um"\nrotation = {angle = 3}', "layers[1].rotation: rotation is {'angle': 3}, must be"),
        ('"pzt-4"', '"pzt-44"', "layers[1].material: unknown material 'pzt-44'"),
        ("[[layers]]", "[layers]", "layers = "),
        ('"1 um"', '"1 um"\n[base]\nthickness = 0', "base.thickness = 0: must be > 0 and finite"),
        ('"1 um"', '"1 um"\n[base]\nthickness = 1\nelectric = "live"', "base.electric = 'live': should be"),
        ('"1 um"', '"1 um"\n[base]\nthickness = 1\ngravity = "grounded"', "base.gravity = 'grounded': unknown key"),
        (
            '"1 um"',
            '"1 um"\ninterface = {electrode = "grounded", electric_conductance = 1}',
            "layers[1].interface: interface: electrode together with electric_conductance",
        ),
    ],
)
def test_messages(old, new, message, tmp_path):
    file = tmp_path / "case.toml"
    file.write_text(TEXT.replace(old, new), encoding="utf-8")
    with pytest.raises(CaseError) as caught:
        meeframe.load_case(file)
    assert f"{file}: {message}" in str(caught.value)


def test_formulations_refuse_layers_that_they_do_not_support(tmp_path):
    file = tmp_path / "case.toml"
    file.write_text(TEXT.replace('"half-space"\n[indenter]', '"hmatrix-bem"\n[indenter]'), encoding="utf-8")
    with pytest.raises(CaseError, match=r"layers.*: formulation HierarchicalBEM does not support layers.* for blocks"):
        meeframe.load_case(file)
    second = meeframe.SecondBody("silicon", MESH, base=meeframe.Base("5 um"), formulation=HierarchicalBEM())
    with pytest.raises(CaseError, match=r"second_body\.base.*: formulation HierarchicalBEM does not support layers"):
        meeframe.Case(**PARTS | {"formulation": meeframe.DenseBEM()}, second_body=second)


def test_boundary_elements_need_a_base_below_half_spaces(tmp_path):
    file = tmp_path / "case.toml"
    file.write_text(TEXT.replace('[formulation]\nname = "half-space"', ""), encoding="utf-8")
    with pytest.raises(
        CaseError, match=r"formulation: dense-bem: layers of a half space, no \[base\]; allowed: a rigid"
    ):
        meeframe.load_case(file)


def test_insulating_base_of_a_free_surface():
    with pytest.raises(
        CaseError, match=r"formulation: half-space: the base insulates magnetic: the potential of a layer"
    ):
        meeframe.Case(**PARTS | {"formulation": HalfSpace()}, base=meeframe.Base("5 um", magnetic="insulating"))


def test_only_half_spaces_have_a_rigid_base():
    block = meeframe.mesh.block("50 mm", "120 mm", "5 mm", divisions=4, rings=2, layers=1)
    with pytest.raises(CaseError, match="a rigid base is below a half space"):
        meeframe.Case(**PARTS | {"mesh": block}, base=meeframe.Base("5 um"))


@pytest.mark.parametrize("thickness", [0.0, -1.0, np.inf, np.nan])
def test_thickness_is_positive_and_finite(thickness):
    with pytest.raises(CaseError, match="thickness"):
        Layer(library_material("pzt-4"), thickness)
    with pytest.raises(CaseError, match="thickness"):
        RigidBase(thickness)


def test_stiffness_of_an_interface_is_positive():
    with pytest.raises(CaseError, match="normal_stiffness = 0"):
        Interface(normal_stiffness=0.0)
    with pytest.raises(CaseError, match="magnetic_conductance = -1"):
        Interface(conductances={"magnetic": -1.0})
