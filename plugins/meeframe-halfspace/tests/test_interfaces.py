"""Largest tension and shear on the interfaces of layered bodies, against closed forms."""

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace

import meeframe
from meeframe.common.errors import CaseError
from meeframe.results.interfaces import interfaces_table

STEEL = {"name": "isotropic", "young_modulus": "210 GPa", "poisson_ratio": 0.3}
UM = 1e-6
DEPTHS = np.array([0.4, 1.0]) * UM


def solve(divisions=16, **keys):
    """Return the result of a sphere that presses on layers and then slides."""
    parts = {
        "material": STEEL,
        "layers": (meeframe.Layer(STEEL, 0.4 * UM), meeframe.Layer(STEEL, 0.6 * UM)),
        "mesh": meeframe.mesh.half_space(1.4 * UM, divisions),
        "formulation": HalfSpace(matrix_up_to=0),
        "indenter": meeframe.Sphere(10 * UM),
        "contact": meeframe.IsotropicCoulomb(0.8),
        "steps": [meeframe.Step(approach=25e-9), meeframe.Step(translation=[60e-9, 30e-9])],
    }
    return meeframe.Case(**parts | keys).solve(progress=False)


def point_load_tractions(result, depth, positions):
    """Return tension and shear (2, m) on a plane at positions (m, 2) by Boussinesq's and Cerruti's point loads.

    The traction of a point force F on planes parallel to the surface is -3 z (F.R) R / (2 pi R^5) for any Poisson's
    ratio (Johnson, Contact Mechanics (1985), eqs. 3.19 and 3.76), with R from the force and z < 0.
    """
    loaded = result[-1].traction.any(axis=1)
    forces = result.zone.weights[loaded, None] * result[-1].traction[loaded]
    receivers = np.concatenate([positions, np.full((len(positions), 1), -depth)], axis=1)
    traction, h = np.zeros_like(receivers), np.sqrt(result.zone.weights.max())
    for i, j in np.ndindex(3, 3):  # nine forces with the second moments of a bilinear density
        shift = np.array([i - 1, j - 1, 0]) * h / np.sqrt(3.0)
        share = (2 - abs(i - 1)) * (2 - abs(j - 1)) / 16.0
        offsets = receivers[:, None] - result.zone.points[loaded] - shift
        factors = 3.0 * depth * np.einsum("mni,ni->mn", offsets, forces) / np.linalg.norm(offsets, axis=2) ** 5
        traction += share / (2.0 * np.pi) * np.einsum("mn,mni->mi", factors, offsets)
    return np.stack([traction[:, 2], np.hypot(traction[:, 0], traction[:, 1])])


@pytest.fixture(scope="module")
def sliding():
    return solve()


@pytest.fixture(scope="module")
def found(sliding):
    return meeframe.interfaces(sliding, step="last")


@pytest.mark.full
def test_layers_of_one_material(sliding, found):
    """Behind a slider the interface is in tension; point loads give the same values, and none that are larger."""
    x = np.linspace(-2.0 * UM, 2.0 * UM, 31)
    positions = np.stack(np.meshgrid(x, x, indexing="ij"), axis=-1).reshape(-1, 2)
    np.testing.assert_allclose([one.depth for one in found], DEPTHS)
    for one in found:
        largest = point_load_tractions(sliding, one.depth, positions).max(axis=1)
        for row, maximum in enumerate((one.tension, one.shear)):
            there = point_load_tractions(sliding, one.depth, maximum.position[None, :2])[row, 0]
            assert maximum.value == pytest.approx(there, rel=1e-3)
            assert maximum.value > (1.0 - 1e-3) * largest[row]
            assert maximum.position[2] == pytest.approx(-one.depth)
        assert one.tension.position[0] < -0.5 * UM


@pytest.mark.full
def test_table_of_interfaces(found):
    table = interfaces_table(found)
    layers, depths, names, *_ = [[str(cell) for cell in column.cells] for column in table.columns]
    assert layers == ["1", "1", "2", "2"]
    assert depths == ["4e-07", "4e-07", "1e-06", "1e-06"]
    assert names == ["tension", "shear", "tension", "shear"]


@pytest.mark.full
def test_two_bodies_have_the_same_tractions():
    """Each of two equal bodies deforms by half; the interfaces of the second one lie above the contact."""
    second = meeframe.SecondBody(
        STEEL,
        meeframe.mesh.half_space(1.4 * UM, 16),
        formulation=HalfSpace(matrix_up_to=0),
        layers=(meeframe.Layer(STEEL, 1.0 * UM),),
    )
    steps = [meeframe.Step(approach=50e-9)]
    two = solve(
        layers=(meeframe.Layer(STEEL, 1.0 * UM),), second_body=second, contact=meeframe.Signorini(), steps=steps
    )
    (first,), (second,) = (meeframe.interfaces(two, body=body) for body in ("first", "second"))
    assert second.shear.value == pytest.approx(first.shear.value, rel=1e-6)
    assert second.shear.position[2] == pytest.approx(1.0 * UM)
    assert first.tension.value < 1e-3 * first.shear.value


def test_homogeneous_bodies_have_no_interfaces():
    result = solve(divisions=8, layers=(), steps=[meeframe.Step(approach=25e-9)], contact=meeframe.Signorini())
    assert meeframe.interfaces(result) == []
    with pytest.raises(CaseError, match="there is no second body"):
        meeframe.interfaces(result, body="second")
    with pytest.raises(CaseError, match="body 'third': allowed: first, second"):
        meeframe.interfaces(result, body="third")
