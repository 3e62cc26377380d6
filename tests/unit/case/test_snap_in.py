"""Attraction too steep for a mesh is reported exactly where single nodes have several states."""

import re
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from meeframe.laws import Signorini
from meeframe.laws.base import ContactLaw
from meeframe.model.diagnostics import snap_in, steepest_fall
from meeframe.model.step import Step

SNAP = "nodes snap into contact one by one"


@dataclass(frozen=True)
class Smooth(ContactLaw):
    """An attraction stress / (1 + exp((g - range) / width)), whose steepest slope is stress / (4 width)."""

    stress: float
    range: float
    width: float

    def project(self, trial):
        return Signorini().project(trial)

    def tangential_scaling(self):
        return Signorini().tangential_scaling()

    def adhesion(self, gap):
        beyond = np.where(np.isfinite(gap), (np.maximum(gap, 0.0) - self.range) / self.width, 700.0)
        return np.where(np.isfinite(gap), self.stress / (1.0 + np.exp(np.clip(beyond, -700.0, 700.0))), 0.0)


@pytest.mark.parametrize(("reach", "width"), [(1e-6, 1e-7), (1e-6, 1e-10), (3.3e-9, 1e-11), (1.0, 1e-4)])
def test_steepest_slope_is_computed(reach, width):
    assert steepest_fall(Smooth(1e6, reach, width)) == pytest.approx(1e6 / (4.0 * width), rel=1e-3)
    assert steepest_fall(Signorini()) == 0.0


def states(law, compliance, distance):
    """Return the number of open equilibrium states of a spring at this distance under the attraction."""
    gap = np.linspace(0.0, distance, 200_001)
    pull = compliance * law.adhesion(gap) - (distance - gap)
    return int((np.diff(np.sign(pull)) != 0.0).sum())


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("steepness", [0.9, 1.1])
def test_several_states_of_a_node_are_reported(bed, steepness):
    system = bed.half_space(8)
    compliance_of_node = float(system.diagonal_blocks()[0, 2, 2])
    law = Smooth(1e7, 1e-6, 1e7 * compliance_of_node / (4.0 * steepness))
    law = replace(law, range=10.0 * law.width)
    most = max(
        states(law, compliance_of_node, law.range + part * compliance_of_node * law.stress)
        for part in np.linspace(0.3, 0.7, 201)
    )
    assert most == (3 if steepness > 1.0 else 1)
    step = SimpleNamespace(gap=np.full(64, 0.0), traction=np.full((64, 3), -1e6))
    message = " ".join(snap_in(system, law, step))
    assert (SNAP in message) == (steepness > 1.0)
    assert not list(snap_in(system, Signorini(), step))
    far = SimpleNamespace(gap=np.full(64, np.inf), traction=step.traction)
    assert not list(snap_in(system, law, far)), "nothing is attracted"


def test_reported_element_size_suffices(bed):
    """For a slope twice too steep, elements of half the size suffice, and somewhat larger ones do not."""
    coarse = bed.half_space(8)
    law = Smooth(1e7, 1e-6, 1e7 * float(coarse.diagonal_blocks()[0, 2, 2]) / 8.0)
    step = SimpleNamespace(gap=np.zeros(1), traction=np.full((1, 3), -1e6))
    (message,) = snap_in(coarse, law, step)
    here = bed.side / 8
    assert re.search(r"elements of at most (\S+) m \(here (\S+) m\)", message).groups() == (
        f"{here / 2:.2g}",
        f"{here:.2g}",
    )
    assert SNAP in " ".join(snap_in(bed.half_space(15), law, step))
    assert not list(snap_in(bed.half_space(17), law, step))


def test_snap_in_is_reported_at_the_end_of_a_step(bed, frictional, system):
    compliance_of_node = float(system.diagonal_blocks()[0, 2, 2])
    for steepness, message in ((0.5, False), (1.5, True)):
        law = Smooth(1e7, 1e-6, 1e7 * compliance_of_node / (4.0 * steepness))
        path = bed.follow(frictional, system, Step(approach=2e-5, increments=2), contact_law=law)
        assert [SNAP in step.message for step in path.steps] == [False, message]
