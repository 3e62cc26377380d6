"""Resultants agree with known areas on every element type, and with the work of forces and moments."""

import dataclasses

import numpy as np
import pytest

from meeframe.elements import ELEMENTS
from meeframe.indenters.base import RESULTANTS, motion_modes
from meeframe.mesh import find_contact_zone, half_space_mesh
from meeframe.results.records import Region, Zone
from meeframe.results.resultants import resultants

EVERY = pytest.mark.parametrize("name", sorted(ELEMENTS))
DIVISIONS = 20
WIDTH = 0.02


def flat_zone(name):
    contact_zone = find_contact_zone(half_space_mesh(0.05, WIDTH, DIVISIONS, 2, ELEMENTS[name]), "contact")
    return Zone(contact_zone.points, contact_zone.frames, contact_zone.weights, contact_zone.cells)


def contact_area(zone, compressed, template):
    n = len(zone.points)
    traction = np.column_stack([np.zeros((n, 2)), np.where(compressed, -1e6, 0.0)])
    pairs = dict.fromkeys(("potentials", "fluxes", "slip", "total_slip"), np.zeros((n, 2)))
    pairs |= {"displacement": np.zeros((n, 3)), "dissipation": np.zeros(n), "wear": np.zeros(n)}
    step = dataclasses.replace(template, traction=traction, region=np.where(compressed, Region.STICK, 0), **pairs)
    return resultants(zone, step).contact_area


@EVERY
def test_area_of_a_circle(name, synthetic):
    """An element that intersects the circle is in error by its area at most."""
    zone, radius = flat_zone(name), 0.35 * WIDTH
    size = WIDTH / DIVISIONS
    computed = contact_area(zone, np.linalg.norm(zone.points[:, :2], axis=1) < radius, synthetic.step(1e-6))
    assert computed == pytest.approx(np.pi * radius**2, abs=0.5 * size * 2 * np.pi * radius)


def test_area_fractions_of_nodes(synthetic):
    """Nodes count by their area fraction; open ones that an edge covers in part are shared by stick and slip."""
    zone, whole = synthetic.zone(), synthetic.step(1e-6)
    full = resultants(zone, dataclasses.replace(whole, area_fraction=np.ones(25)))
    assert full.contact_area == pytest.approx(resultants(zone, whole).contact_area) == pytest.approx(9e-6)
    covered = np.where(whole.touching, 0.5, 0.0)
    half = resultants(zone, dataclasses.replace(whole, area_fraction=covered))
    assert (half.stick_area, half.slip_area, half.contact_area) == pytest.approx((0.5e-6, 4e-6, 4.5e-6))
    covered[np.flatnonzero(~whole.touching)[:6]] = 0.36  # of 2.5 cells
    more = resultants(zone, dataclasses.replace(whole, area_fraction=covered))
    assert (more.stick_area, more.slip_area, more.contact_area) == pytest.approx((0.6e-6, 4.8e-6, 5.4e-6))


@pytest.mark.full(except_for=1)
@EVERY
def test_full_partial_and_no_contact(name, synthetic):
    zone, step = flat_zone(name), synthetic.step(1e-6)
    n = len(zone.points)
    assert contact_area(zone, np.ones(n, bool), step) == pytest.approx(WIDTH**2)
    assert str(contact_area(zone, np.zeros(n, bool), step)) == "0.0"
    alone = [contact_area(zone, np.arange(n) == node, step) for node in range(n)]
    assert min(alone) > 0
    assert sum(alone) == pytest.approx(WIDTH**2)


def test_resultants_are_conjugate_to_the_motions(synthetic):
    """The indenter has any position, and frames vary from node to node."""
    rng = np.random.default_rng(3)
    rotated = [np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(26)]
    zone = dataclasses.replace(synthetic.zone(), frames=np.array(rotated[1:]))
    whole = synthetic.step(1e-6)
    loading = dataclasses.replace(whole.loading, axes=rotated[0], reference=1e-3 * rng.normal(size=3))
    step = dataclasses.replace(
        whole, loading=loading, traction=rng.normal(size=(25, 3)), fluxes=rng.normal(size=(25, 2))
    )
    modes = motion_modes(zone.points, zone.frames, loading.axes, loading.reference)
    leaving = np.column_stack([step.traction, -step.fluxes])  # a unit potential is a motion of -1
    works = np.einsum("kni,n,ni->k", modes, zone.weights, leaving)
    computed = resultants(zone, step)
    for key, columns in RESULTANTS.items():
        np.testing.assert_allclose(np.atleast_1d(getattr(computed, key)), works[columns], rtol=1e-12, atol=1e-18)


def test_resultants_do_not_depend_on_memory_layout(synthetic):
    """A step read from a file gives bitwise identical resultants, so redrawn studies have the same values."""
    rng = np.random.default_rng(4)
    load = rng.normal(size=(25, 5))
    step = dataclasses.replace(synthetic.step(1e-6), traction=load[:, :3], fluxes=load[:, [3, 4]])
    other = dataclasses.replace(step, traction=step.traction.copy(), fluxes=step.fluxes.copy(order="C"))
    computed, again = (vars(resultants(synthetic.zone(), one)) for one in (step, other))
    for name, value in computed.items():
        np.testing.assert_array_equal(again[name], value, err_msg=name)
