"""Contact laws may add an initial gap; the approach is measured from first contact with it."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

import meeframe
from meeframe.common.errors import CaseError
from meeframe.indenters import FlatPunch, Placement
from meeframe.laws import Signorini
from meeframe.model.kinematics import IndenterKinematics
from meeframe.model.load import load_case
from meeframe.model.solve import reduce
from meeframe.plugin.hookspecs import Record
from meeframe.plugin.registry import Entry, Kind, Provider

APPROACH, STIFFNESS, RADIUS = 1e-5, 1e14, 0.1


@dataclass(frozen=True)
class Wavy(Signorini):
    """Signorini's law with a wave along x of an amplitude [m] about a level [m]; `entries` is the number of values,
    to test errors."""

    size: float = 0.0
    level: float = 0.0
    entries: int | None = None

    def initial_gap(self, points):
        return (self.level + self.size * np.sin(3e3 * points[:, 0] + 0.4))[: self.entries]


@pytest.fixture
def case(write_case, registry):
    """Return the sphere on springs, without a wave."""
    return load_case(write_case(), registry)


def kinematics(case):
    return IndenterKinematics(case, reduce(case))


def test_force_follows_gap_from_first_contact(case):
    result = meeframe.solve_case(replace(case, contact_law=Wavy(2e-6, -1e-6)))
    x, y, _ = result.zone.points.T
    gap = (x**2 + y**2) / (2 * RADIUS) + Wavy(2e-6).initial_gap(result.zone.points)
    overlap = np.maximum(APPROACH - (gap - gap.min()), 0.0)
    assert 1 < (overlap > 0.0).sum() < len(overlap)
    force = STIFFNESS * result.zone.weights @ overlap
    assert meeframe.resultants(result.zone, result.steps[0]).normal_force == pytest.approx(force, rel=1e-10)


@pytest.mark.parametrize("level", [0.0, 3e-6, -3e-6])
def test_uniform_gap_has_no_effect(case, level):
    plain = kinematics(case).touching_gap
    np.testing.assert_allclose(kinematics(replace(case, contact_law=Wavy(0.0, level))).touching_gap, plain, atol=1e-19)


@pytest.mark.parametrize(
    "placement",
    [Placement(), Placement(x=4e-4, y=-7e-4), Placement(tilt_1=0.01), Placement(x=1e-3, axis=(0.02, -0.01, 1.0))],
    ids=["centred", "aside", "tilted", "from aside"],
)
def test_indenter_moves_along_its_axis_to_first_contact(case, placement):
    position = replace(case, placement=placement)
    plain, wavy = (kinematics(replace(position, contact_law=Wavy(size))) for size in (0.0, 2e-6))
    assert wavy.touching_gap.min() == pytest.approx(0.0, abs=1e-20)
    moved = (wavy.touching_gap - plain.touching_gap) - Wavy(2e-6).initial_gap(wavy.system.points)
    cosine = placement.base[2] @ np.array([0.0, 0.0, 1.0])
    assert np.ptp(moved) < 1e-18, "along the axis, flat zone"
    assert moved[0] / cosine == pytest.approx(
        -(plain.touching_gap + Wavy(2e-6).initial_gap(wavy.system.points)).min() / cosine
    )


def test_gap_beside_a_punch_remains_infinite(case):
    """Beside a punch there is no indenter, whatever the law adds."""
    punch = replace(case, indenter=FlatPunch(2e-3))
    plain, wavy = (kinematics(replace(punch, contact_law=Wavy(size))).touching_gap for size in (0.0, 2e-6))
    assert 0 < np.isinf(plain).sum() < len(plain)
    np.testing.assert_array_equal(np.isinf(wavy), np.isinf(plain))


@pytest.mark.parametrize(
    ("law", "text"),
    [
        (Wavy(entries=3), r"the initial gap of the contact law Wavy has shape \(3,\); allowed: \(25,\)"),
        (Wavy(level=np.inf), r"the initial gap of the contact law Wavy is inf at .*; allowed: finite numbers"),
        (Wavy(level=np.nan), "the initial gap of the contact law Wavy is nan"),
    ],
)
def test_invalid_gaps_are_rejected(case, law, text):
    with pytest.raises(CaseError, match=text):
        replace(case, contact_law=law)


def test_invalid_gaps_name_the_key_of_the_law(write_case, registry):
    entry = Entry(Kind.CONTACT_LAW, Record("wavy", Wavy, "for tests", "none"), Provider("tests", "0"))
    laws = replace(registry, entries=(*registry.entries, entry))
    with pytest.raises(CaseError, match=r"contact\.law: the initial gap of the contact law Wavy has shape \(2,\)"):
        load_case(write_case(more='\n[contact]\nlaw = {name = "wavy", entries = 2}\n'), laws)
