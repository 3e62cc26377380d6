"""Test laws that depend on time and slip path: arguments, storage, restart."""

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np
import pytest
from rich.console import Console

import meeframe
from meeframe.common.errors import CaseError
from meeframe.fields.units import Quantity
from meeframe.laws import IsotropicCoulomb
from meeframe.laws.base import ContactLaw
from meeframe.model.load import load_case
from meeframe.model.step import Step
from meeframe.plugin.hookspecs import Record
from meeframe.plugin.registry import Entry, Kind, Provider
from meeframe.results.records import Region
from meeframe.results.summary import summary, summary_table

MU, RATE, WEAK = 0.3, 0.5, 5e-6


@dataclass(frozen=True)
class TimeDependent(ContactLaw):
    """Coulomb friction whose coefficient grows with the duration of an increment."""

    mu: Annotated[float, Quantity("", ge=0)] = MU
    needs_duration: ClassVar[bool] = True

    def project(self, trial):
        return IsotropicCoulomb(self.mu).project(trial)

    def tangential_scaling(self):
        return IsotropicCoulomb(self.mu).tangential_scaling()

    def for_increment(self, slip_path, duration):
        return replace(self, mu=self.mu * (1.0 + RATE * duration))


@dataclass(frozen=True)
class PathDependent(ContactLaw):
    """Coulomb friction with the coefficient mu / (1 + s / WEAK), where s is the slip path before the increment."""

    slip_path: object = None

    @property
    def mu(self):
        return MU if self.slip_path is None else MU / (1.0 + self.slip_path / WEAK)

    def project(self, trial):
        limit = self.mu * np.maximum(-trial[:, 2], 0.0)
        size = np.linalg.norm(trial[:, :2], axis=1)
        share = np.minimum(1.0, limit / np.where(size > 0.0, size, 1.0))
        return np.column_stack([share[:, None] * trial[:, :2], np.minimum(trial[:, 2], 0.0)])

    def tangential_scaling(self):
        return np.eye(2)

    def for_increment(self, slip_path, duration):
        return PathDependent(slip_path)


@pytest.fixture
def laws(registry):
    """Return the registry with installed plugins, the springs, and the laws of this module."""
    records = [
        Record(name, factory, "for tests", "none")
        for name, factory in (("hurried", TimeDependent), ("pol", PathDependent))
    ]
    entries = [Entry(Kind.CONTACT_LAW, record, Provider("tests", "0")) for record in records]
    return replace(registry, entries=(*registry.entries, *entries))


HURRIED = '\n[contact]\nlaw = "hurried"\n'
TIMED = 'duration = "4 s"\nincrements = 2\n'
SLIDE = '[[steps]]\ntranslation = ["9 um", 0]\n'


def table_text(result):
    console = Console(width=200)
    with console.capture() as caught:
        console.print(summary_table(result))
    return caught.get()


def test_law_receives_the_duration_of_each_increment(write_case, laws):
    case = load_case(write_case(more=f'{TIMED}{HURRIED}{SLIDE}duration = "0.6 s"\nincrements = 3\n'), laws)
    result = meeframe.solve_case(case)
    assert [step.loading.duration for step in result.steps] == [2.0, 2.0, *[pytest.approx(0.2)] * 3]
    end = meeframe.resultants(result.zone, result.steps[-1])
    factor = 1.0 + RATE * 0.2
    assert end.tangential_force[0] == pytest.approx(factor * MU * end.normal_force, rel=1e-9), "all of it slips"
    assert [step["duration"] for step in summary(result)["steps"]] == [2.0, 2.0, *[pytest.approx(0.2)] * 3]
    (row,) = [line for line in table_text(result).splitlines() if "duration" in line]
    assert [word for word in row.split() if word[0].isdigit()] == ["4", "0.6"]


def test_missing_duration_is_rejected_if_required(write_case, laws):
    path = write_case(more=TIMED + HURRIED + SLIDE)
    text = r"steps\[2\]: load step 2 has no duration, which the contact law TimeDependent needs; "
    text += r"allowed: a duration > 0 \[s\]"
    with pytest.raises(CaseError, match=text):
        load_case(path, laws)
    timed = load_case(write_case(more=TIMED + HURRIED), laws)
    with pytest.raises(CaseError, match="load step 1 has no duration"):
        replace(timed, steps=(Step(approach=1e-5), Step(twist=0.0, duration=1.0)))


def test_results_without_durations(write_case, laws):
    result = meeframe.solve_case(load_case(write_case(), laws))
    assert summary(result)["steps"][0]["duration"] is None
    assert "duration" not in table_text(result)


def test_duration_is_stored(write_case, laws, tmp_path):
    meeframe.run(load_case(write_case(more=f"{TIMED}{HURRIED}{SLIDE}duration = 3\n"), laws), tmp_path / "out")
    assert [step.loading.duration for step in meeframe.read_result(tmp_path / "out").steps] == [2.0, 2.0, 3.0]


BACK = [Step(approach=1e-5), Step(translation=(8e-6, 0.0), increments=4), Step(translation=(0.0, 0.0), increments=2)]


def test_slip_path_accumulates_in_contact(bed, frictional, system):
    """Under a reversal the total slip decreases, but the path does not; open nodes keep their path."""
    path = bed.follow(frictional, system, *BACK)
    path_lengths = np.array([np.linalg.norm(step.slip, axis=1) * (step.region != Region.OPEN) for step in path.steps])
    for step, way in zip(path.steps, np.cumsum(path_lengths, axis=0), strict=True):
        np.testing.assert_array_equal(step.slip_path, way)
    last = path.steps[-1]
    touched = last.region != Region.OPEN
    assert touched.any()
    assert (last.slip_path[~touched & (path_lengths.max(axis=0) == 0.0)] == 0.0).all()
    assert np.linalg.norm(last.total_slip[touched], axis=1).sum() < 0.5 * last.slip_path[touched].sum()


def test_law_receives_the_path_of_earlier_increments(write_case, laws):
    """All springs slip, forth and back, so the friction of each increment is known."""
    text = '\n[contact]\nlaw = "pol"\n[[steps]]\ntranslation = ["40 um", 0]\nincrements = 4\n'
    text += '[[steps]]\ntranslation = ["-20 um", 0]\nincrements = 3\n'
    first, *slid = meeframe.solve_case(load_case(write_case(more=text), laws)).steps
    assert first.slip_path.max() == 0.0
    before = first
    for step in slid:
        pressed = step.region == Region.SLIP
        ratio = np.linalg.norm(step.traction[pressed, :2], axis=1) / -step.traction[pressed, 2]
        np.testing.assert_allclose(ratio, MU / (1.0 + before.slip_path[pressed] / WEAK), rtol=1e-9)
        before = step
    assert ratio.max() < 0.2 * MU


def test_two_bodies_match_one_body_of_combined_compliance(write_case, laws, second_body):
    """Springs in series with three quarters of the stiffness have the same memory as one such bed."""
    text = '\n[contact]\nlaw = "pol"\n[[steps]]\ntranslation = ["20 um", "8 um"]\nincrements = 4\n'
    pair = meeframe.solve_case(load_case(write_case(more=text + second_body), laws))
    one = meeframe.solve_case(load_case(write_case(('"1e14 Pa/m"', '"0.75e14 Pa/m"'), more=text), laws))
    assert one.steps[-1].slip_path.max() > 1e-5
    for ours, theirs in zip(pair.steps, one.steps, strict=True):
        np.testing.assert_allclose(ours.slip_path, theirs.slip_path, rtol=1e-8, atol=1e-18)
        np.testing.assert_allclose(ours.traction, theirs.traction, rtol=1e-8, atol=1e-3)


@pytest.mark.full
def test_restart_is_bitwise_identical(write_case, laws, tmp_path):
    first = '\n[contact]\nlaw = "pol"\n[[steps]]\ntranslation = ["20 um", "3 um"]\nincrements = 3\n'
    second = '\n[[steps]]\ntranslation = ["4 um", 0]\nincrements = 3\n'
    whole = meeframe.solve_case(load_case(write_case(more=first + second), laws))
    meeframe.run(load_case(write_case(more=first), laws), tmp_path / "first")
    text = '\n[contact]\nlaw = "pol"\n[restart]\nfrom = "first"\n' + second
    rest = meeframe.run(load_case(write_case(('[[steps]]\napproach = "10 um"\n', ""), more=text), laws), tmp_path / "b")
    assert len(rest.steps) == 3
    for ours, theirs in zip(meeframe.read_result(tmp_path / "b").steps, whole.steps[4:], strict=True):
        for name in ("slip_path", "total_slip", "traction", "region"):
            np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name))
    assert rest.steps[-1].slip_path.max() > np.linalg.norm(rest.steps[-1].total_slip, axis=1).max()
