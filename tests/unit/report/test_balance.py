"""Test the equilibrium of boundary fields of known stresses, for every element type."""

import dataclasses

import numpy as np
import pytest

from meeframe.elements import ELEMENTS
from meeframe.mesh import block_mesh, half_space_mesh
from meeframe.results.balance import unbalance, unbalance_warning
from meeframe.results.summary import summary
from meeframe.system.reduced import NodalFields

EXTENT = np.array([2.0, 2.0, 1.5])
"""Extent of the block along the axes [m]."""


def faces(name, flux):
    """Return fields on a block with separate nodes for each face; `flux` returns (n, 5) from points (n, 3) and the
    normal (3,)."""
    mesh = block_mesh(1.0, EXTENT[2], 0.5, 4, 2, 2, ELEMENTS[name])
    (block,) = mesh.blocks
    points, normals, cells = [], [], []
    for own in block.connectivity:
        corner = mesh.points[own]
        normal = np.cross(corner[1] - corner[0], corner[2] - corner[1])
        cells.append(np.arange(len(own)) + sum(map(len, points)))
        points.append(corner)
        normals.append(np.tile(normal / np.linalg.norm(normal), (len(own), 1)))
    points, normals = np.concatenate(points), np.concatenate(normals)
    return NodalFields(
        points, ((block.element.meshio_type, np.array(cells)),), np.ones((len(points), 5)), flux(points, normals)
    )


@pytest.mark.parametrize("name", sorted(ELEMENTS))
def test_divergence_free_stress_is_balanced(name):
    """Stresses and fluxes are constant, or linear as in bending."""
    stress = np.random.default_rng(1).normal(size=(5, 3))

    def flux(points, normals):
        bending = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]])
        # entry i, j grows along axis j + 1, so the divergence vanishes
        return normals @ stress.T + (normals * np.roll(points, -1, axis=1)) @ bending.T

    balance = unbalance(faces(name, flux))
    assert balance.relative == pytest.approx(0.0, abs=1e-12)
    assert not list(unbalance_warning(faces(name, flux)))


@pytest.mark.parametrize("name", sorted(ELEMENTS))
def test_body_force_is_the_imbalance(name):
    """The tension of a bar grows along x by its weight: t = g x n_x, with the resultant g times the volume."""
    weights = np.array([3.0, 0.0, 0.0, -2.0, 0.0])
    fields = faces(name, lambda points, normals: (points[:, 0] * normals[:, 0])[:, None] * weights)
    balance, volume = unbalance(fields), EXTENT.prod()
    assert balance.force == pytest.approx([3.0 * volume, 0.0, 0.0], abs=1e-12)
    assert balance.fluxes == pytest.approx([-2.0 * volume, 0.0])
    # tension at both ends, so half of the sum of moduli is half of the total
    assert balance.relative == pytest.approx([2.0, 2.0, 0.0])
    (message,) = unbalance_warning(fields)
    assert "200% of the force, 200% of the charge:" in message


def test_round_off_is_ignored():
    fields = faces("quad4", lambda points, normals: normals[:, [0, 1, 2, 0, 0]] * [1.0, 1.0, 1.0, 0.0, 0.0])
    noise = np.zeros(fields.values.shape)
    noise[:, 4] = 1e-20
    noisy = dataclasses.replace(fields, fluxes=fields.fluxes + noise, values=fields.values * [1, 1, 1, 1, 1e-20])
    assert unbalance(noisy).relative[2] == 0.0


def test_fluxes_between_grounds_are_relative_to_the_work_of_loads():
    """Tension along x does a thousand times the work of the flux, whose imbalance is complete."""

    def flux(points, normals):
        return np.column_stack([normals * [1e3, 0.0, 0.0], np.ones(len(points)), np.zeros(len(points))])

    fields = faces("quad4", flux)
    outside, face = float(2 * (EXTENT[0] * EXTENT[1] + 2 * EXTENT[0] * EXTENT[2])), EXTENT[1] * EXTENT[2]
    insulated, conducting = np.zeros((4, 2)), np.ones((4, 2))
    work_ratio = (1e3 * face * np.sqrt(3)) / (outside / 2)  # displacement of modulus sqrt(3), potential of one
    assert unbalance(fields).relative[1] == pytest.approx(2.0)
    assert unbalance(fields, conducting).relative[1] == pytest.approx(2.0)
    assert unbalance(fields, insulated).relative[1] == pytest.approx(2.0 / work_ratio)
    assert list(unbalance_warning(fields))
    assert not list(unbalance_warning(fields, contact_fluxes=insulated))


def test_open_boundaries_have_no_balance(synthetic):
    (block,) = half_space_mesh(1.0, 0.5, 4, 2, ELEMENTS["quad4"]).blocks
    points = half_space_mesh(1.0, 0.5, 4, 2, ELEMENTS["quad4"]).points
    nothing = np.zeros((len(points), 5))
    assert unbalance(NodalFields(points, (("quad", block.connectivity),), nothing, nothing)) is None
    assert unbalance(None) is None
    assert summary(synthetic.result(synthetic.step(1e-6)))["steps"][0]["unbalance"] is None
