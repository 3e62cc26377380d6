"""Test load histories: ramps, motions and resultants, energy, slip and stick."""

from dataclasses import replace

import numpy as np
import pytest

from meeframe.laws import IsotropicCoulomb, OrthotropicCoulomb
from meeframe.model.step import Step
from meeframe.results.records import Region
from meeframe.testing.closed_forms_friction import HertzContact, PartialSlip

EVERYTHING = {
    "approach": 3e-5,
    "translation": (4e-6, -2e-6),
    "tilt": (2e-4, -1e-4),
    "twist": 1e-3,
}
"""A single step in which the contact sticks, slips, turns and tilts."""


def test_increments_are_linear_from_the_start_of_the_step(bed, frictional, system):
    path = bed.follow(
        frictional,
        system,
        Step(approach=2e-5, increments=2),
        Step(approach=4e-5, translation=(3e-6, 0.0), increments=3),
        Step(twist=1e-3),
    )
    assert [(step.step, step.increment) for step in path.steps] == [(1, 1), (1, 2), (2, 1), (2, 2), (2, 3), (3, 1)]
    assert path.motion[:, 0] == pytest.approx([1e-5, 2e-5, 8e-5 / 3, 1e-4 / 3, 4e-5, 4e-5], rel=1e-14)
    assert path.motion[:, 1] == pytest.approx([0.0, 0.0, 1e-6, 2e-6, 3e-6, 3e-6], rel=1e-14)
    assert path.motion[:, 5].tolist() == [0.0] * 5 + [1e-3]


def test_ramps_start_at_current_values(bed, frictional, system):
    """A motion, then its force, then a motion again: each ramp starts at the end of the previous one."""
    path = bed.follow(
        frictional,
        system,
        Step(approach=3e-5, translation=(2e-6, 0.0)),
        Step(normal_force=2e3, tangential_force=(100.0, 50.0), increments=2),
        Step(approach=1e-5, translation=(0.0, 0.0), increments=2),
        Step(force_ratio=(0.1, 0.0), increments=2),
    )
    force, tangential = path.resultants[:, 0], path.resultants[:, 1:3]
    assert force[1:3] == pytest.approx([(force[0] + 2e3) / 2, 2e3], rel=1e-8)
    assert tangential[1] == pytest.approx((tangential[0] + [100.0, 50.0]) / 2, rel=1e-7)
    assert tangential[2] == pytest.approx([100.0, 50.0], rel=1e-7)
    assert path.motion[3, :3] == pytest.approx((path.motion[2, :3] + [1e-5, 0.0, 0.0]) / 2, rel=1e-12)
    assert path.motion[4, :3] == pytest.approx([1e-5, 0.0, 0.0], abs=1e-18)
    ratio = tangential / force[:, None]
    assert ratio[5] == pytest.approx((ratio[4] + [0.1, 0.0]) / 2, abs=1e-8)
    assert ratio[6] == pytest.approx([0.1, 0.0], abs=1e-8)
    assert path.motion[4:, 0] == pytest.approx([1e-5] * 3, rel=1e-12), "the approach stays prescribed"


def test_unnamed_forces_keep_their_values(bed, frictional, system):
    path = bed.follow(frictional, system, Step(normal_force=1e3, tangential_force=(50.0, 0.0)), Step(twist=2e-3))
    assert path.resultants[1, :3] == pytest.approx([1e3, 50.0, 0.0], rel=1e-8, abs=1e-6)
    assert path.motion[1, 1] > path.motion[0, 1], "it creeps while it is twisted"
    assert set(path.steps[1].loading.prescribed) == {"normal_force", "tangential_force"}


PAIRS = {
    "P": {"normal_force": "approach"},
    "F": {"tangential_force": "translation"},
    "F/P": {"force_ratio": "translation"},
    "M": {"moment": "tilt"},
    "T": {"torque": "twist"},
    "P, F": {"normal_force": "approach", "tangential_force": "translation"},
    "P, F/P": {"normal_force": "approach", "force_ratio": "translation"},
    "all": {"normal_force": "approach", "tangential_force": "translation", "moment": "tilt", "torque": "twist"},
}


@pytest.mark.full(except_for=4)
@pytest.mark.parametrize("chosen", PAIRS)
def test_force_of_a_motion_recovers_the_motion(bed, frictional, system, chosen):
    first = bed.follow(frictional, system, Step(**EVERYTHING))
    regions = first.steps[0].region
    assert all((regions == region).sum() > 4 for region in Region)
    prescribed = dict(EVERYTHING)
    for resultant, motion in PAIRS[chosen].items():
        del prescribed[motion]
        if resultant == "force_ratio":
            prescribed[resultant] = tuple(np.array(first.total("tangential_force")) / first.total("normal_force"))
        else:
            prescribed[resultant] = first.total(resultant)
    second = bed.follow(frictional, system, Step(**prescribed))
    largest = np.abs(first.steps[0].traction).max()
    np.testing.assert_allclose(second.steps[0].traction, first.steps[0].traction, atol=1e-8 * largest)
    np.testing.assert_allclose(second.motion, first.motion, rtol=1e-7, atol=1e-13)
    np.testing.assert_array_equal(second.steps[0].region, regions)


@pytest.mark.parametrize(
    "law", [IsotropicCoulomb(0.3), OrthotropicCoulomb(0.5, 0.2, 0.4)], ids=["isotropic", "orthotropic"]
)
def test_work_of_the_indenter_is_stored_or_dissipated(bed, frictional, system, law):
    """The balance is exact in every increment of a path with all six motions.

    The compliance is symmetric, so the stored energy is half of load times displacement. With the mean of the
    tractions at both ends the balance of an increment is exact; the contact gap also does work where the contact
    opens or closes.
    """
    path = bed.follow(
        frictional,
        system,
        Step(approach=2e-5, increments=2),
        Step(tilt=(2e-4, -1e-4), translation=(5e-6, 1e-6), increments=2),
        Step(twist=2e-3, approach=3e-5, increments=2),
        Step(normal_force=0.5e3, translation=(0.0, 0.0), twist=0.0, increments=3),
        contact_law=law,
    )
    zone, n = path.zone, len(path.zone.points)
    stored = [zone.weights @ (step.traction * step.displacement).sum(axis=1) / 2 for step in path.steps]
    traction = np.array([np.zeros((n, 3)), *(step.traction for step in path.steps)])
    slip = np.array([step.slip for step in path.steps])
    gap = np.array([step.gap for step in path.steps])
    mean = (traction[1:] + traction[:-1]) / 2
    begin = np.concatenate([[replace(frictional, steps=(Step(0.0),)).indenter.height(*zone.points[:, :2].T)], gap[:-1]])
    lost = np.einsum("n,kn->k", zone.weights, (mean[:, :, :2] * slip).sum(axis=2) + mean[:, :, 2] * (gap - begin))
    forces = np.concatenate([np.zeros((1, 8)), path.resultants])
    motions = np.concatenate([np.zeros((1, 8)), path.motion])
    work = ((forces[1:] + forces[:-1]) / 2 * np.diff(motions, axis=0)).sum(axis=1)
    balance = np.diff([0.0, *stored]) + lost
    np.testing.assert_allclose(work, balance, atol=1e-9 * np.abs(work).max())
    assert np.abs(lost).max() > 0.02 * np.abs(work).max()


@pytest.mark.full
def test_loop_area_equals_dissipated_energy(bed, frictional):
    """Under constant normal force and without coupling, both agree with the closed form of Mindlin and Deresiewicz."""
    system, force, swing = bed.half_space(12, 0.5), 1.5e3, 0.24
    hertz = HertzContact(bed.young, 0.5, bed.radius, (force * 3 / (4 * bed.young / 0.75 * bed.radius**0.5)) ** (2 / 3))
    exact = PartialSlip(hertz, 0.3).loop_dissipation(swing * force)
    for parts, tolerance in ((6, 0.05), (24, 0.005)):
        path = bed.follow(
            frictional,
            system,
            Step(normal_force=force),
            Step(force_ratio=(swing, 0.0), increments=parts // 2),
            Step(force_ratio=(-swing, 0.0), increments=parts),
            Step(force_ratio=(swing, 0.0), increments=parts),
        )
        turn = parts // 2  # number of the increment in which the loop begins
        x, f = path.motion[turn:, 1], path.resultants[turn:, 1]
        assert (x[0], f[0]) == (pytest.approx(x[-1], rel=2e-3), pytest.approx(f[-1], rel=1e-8))
        area = ((f[1:] + f[:-1]) / 2 * np.diff(x)).sum()
        dissipated = sum(total.dissipated_energy for total in path.totals[turn + 1 :])
        assert dissipated == pytest.approx(area, rel=tolerance)
    assert dissipated == pytest.approx(exact, rel=0.05)


@pytest.mark.full
def test_work_around_a_loop_is_stored_or_dissipated_to_second_order(bed, frictional, system):
    """The balance also holds in each stroke under varying pressure."""
    corners, off = [(3e-5, 4e-6), (1.5e-5, 2e-6), (1.5e-5, -4e-6), (3e-5, 0.0)], []
    for parts in (6, 12, 24):
        around = [Step(approach=a, translation=(x, 0.0), increments=parts) for a, x in corners]
        path = bed.follow(frictional, system, Step(approach=3e-5, increments=parts), *around)
        stored = [path.zone.weights @ (step.traction * step.displacement).sum(axis=1) / 2 for step in path.steps]
        works = (path.resultants[1:] + path.resultants[:-1]) / 2 * np.diff(path.motion, axis=0)
        lost = (works.sum(axis=1) - np.diff(stored))[-4 * parts :].reshape(4, parts).sum(axis=1)
        energies = np.array([total.dissipated_energy for total in path.totals[-4 * parts :]])
        off.append(np.abs(energies.reshape(4, parts).sum(axis=1) - lost).max() / lost.sum())
    assert off[2] < 4e-3
    assert np.log2(off[0] / off[2]) / 2 > 1.6


def test_dissipation_of_a_stroke_does_not_depend_on_increments(bed, frictional):
    """Under constant pressure, a reversal of full slip dissipates friction times distance, less the elastic part."""
    system = bed.half_space(8, 0.5)
    computed = []
    for parts in (1, 16):
        strokes = [Step(translation=(x, 0.0), increments=parts) for x in (2e-5, -2e-5)]
        path = bed.follow(frictional, system, Step(normal_force=1.5e3), *strokes)
        computed.append(sum(total.dissipated_energy for total in path.totals[-parts:]))
    elastic = 2.0 * path.zone.weights @ (path.steps[-1].traction * path.steps[-1].displacement)[:, 0]
    assert computed == pytest.approx([0.3 * 1.5e3 * 4e-5 - elastic] * 2, rel=3e-4)


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("seed", range(4))
def test_dissipation_is_never_negative(bed, frictional, system, seed):
    """The indenter moves along random paths, by motions and by forces, always with some contact."""
    random = np.random.default_rng(seed)

    def pair(size):
        return tuple((size * random.uniform(-1, 1, 2)).tolist())

    steps = [Step(approach=2e-5, increments=2)]
    for _ in range(3):
        pressing = (
            {"approach": random.uniform(1e-5, 3e-5)}
            if random.random() < 0.5
            else {"normal_force": random.uniform(5e2, 3e3)}
        )
        dragging = {"translation": pair(6e-6)} if random.random() < 0.5 else {"force_ratio": pair(0.15)}
        steps.append(Step(**pressing, **dragging, tilt=pair(2e-4), twist=random.uniform(-2e-3, 2e-3), increments=2))
    path = bed.follow(frictional, system, *steps, contact_law=OrthotropicCoulomb(0.5, 0.25, random.uniform(0, 3)))
    dissipated = np.array([total.dissipated_energy for total in path.totals])
    assert (dissipated >= 0.0).all()
    assert (dissipated[2:] > 0.0).any()
    for step, total in zip(path.steps, path.totals, strict=True):
        assert total.stick_area + total.slip_area == pytest.approx(total.contact_area)
        assert ((step.region == Region.OPEN) == (step.traction[:, 2] == 0.0)).all()


def test_slips_add_up_to_the_relative_motion(bed, frictional, system):
    path = bed.follow(
        frictional, system, Step(approach=3e-5), Step(translation=(8e-6, 0.0), increments=2), Step(twist=1e-3)
    )
    slips = np.cumsum([step.slip for step in path.steps], axis=0)
    for step, slip in zip(path.steps, slips, strict=True):
        x, y = path.zone.points[:, :2].T
        moved = step.loading.translation + step.loading.twist * np.column_stack([-y, x])
        np.testing.assert_allclose(slip, moved - step.displacement[:, :2], atol=1e-18)
        np.testing.assert_allclose(step.total_slip, slip, atol=1e-18)
