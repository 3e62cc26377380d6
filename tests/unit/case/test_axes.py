"""Test friction axes of cases: keys, and results on independent springs."""

import dataclasses

import numpy as np
import pytest

import meeframe
from meeframe.common.errors import CaseError
from meeframe.laws import OrthotropicCoulomb
from meeframe.mesh import FrictionAxes
from meeframe.model.cache import cached_reduce
from meeframe.model.load import load_case
from meeframe.model.solve import reduce
from meeframe.model.step import Step
from meeframe.results.records import RunStatus

CONTACT = '\n[contact]\nlaw = {{name = "orthotropic-coulomb", mu1 = 0.1, mu2 = 0.4}}\naxes = {}\n'


@pytest.fixture
def case(write_case, registry):
    return load_case(write_case(), registry)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("{direction = [1, 1, 0]}", FrictionAxes(direction=(1.0, 1.0, 0.0))),
        ("{around = [0, 0, 1]}", FrictionAxes(around=(0.0, 0.0, 1.0))),
        ('{around = [0, 0, 2], centre = ["1 mm", 0, 0]}', FrictionAxes((None), (0.0, 0.0, 2.0), (1e-3, 0.0, 0.0))),
    ],
)
def test_axes_of_a_file(write_case, registry, text, expected):
    assert load_case(write_case(more=CONTACT.format(text)), registry).axes == expected


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{}", "contact.axes.*neither of direction and around"),
        ("{direction = [1, 0, 0], around = [0, 0, 1]}", "contact.axes.*both of direction and around"),
        ("{direction = [0, 0, 0]}", "contact.axes.*not all zero"),
        ('{around = [0, 0, 1], centre = ["1 kg", 0, 0]}', "contact.axes.centre.*wrong unit"),
        ("{around = [0, 1]}", "contact.axes.around"),
        ("{along = [0, 1, 0]}", "contact.axes.along.*unknown key"),
        ("[1, 0, 0]", "contact.axes"),
    ],
)
def test_invalid_axes_are_rejected(write_case, registry, text, message):
    with pytest.raises(CaseError, match=message):
        load_case(write_case(more=CONTACT.format(text)), registry)


def solve_tangential(case, law, axes=None, **step):
    """Return points, pressures (n,), and tangential tractions (n, 2) along global x1, x2, of the last step."""
    steps = (dataclasses.replace(case.steps[0], **step),)
    result = meeframe.solve_case(dataclasses.replace(case, contact_law=law, axes=axes, steps=steps))
    assert result.status is RunStatus.CONVERGED
    traction = result.steps[-1].traction
    tangential = np.einsum("na,nai->ni", traction[:, :2], result.zone.frames[:, :2, :2])
    return result.zone.points, -traction[:, 2], tangential


def test_direction_equals_angle_on_flat_zone(case):
    angle, drag = 0.7, (2e-4, -1e-4)
    _, _, expected = solve_tangential(case, OrthotropicCoulomb(0.1, 0.4, angle), translation=drag)
    axes = FrictionAxes(direction=(np.cos(angle), np.sin(angle), 3.0))
    _, _, solution = solve_tangential(case, OrthotropicCoulomb(0.1, 0.4), axes, translation=drag)
    np.testing.assert_allclose(solution, expected, atol=1e-7 * np.abs(expected).max())
    _, _, other = solve_tangential(case, OrthotropicCoulomb(0.1, 0.4), translation=drag)
    assert np.abs(other - expected).max() > 0.1 * np.abs(expected).max()


@pytest.mark.parametrize(("axes", "coefficient"), [((0.0, 0.0, 1.0), 0.4), (None, None)])
def test_twist_about_an_axis_has_the_second_coefficient(case, axes, coefficient):
    """Far above the limit, each spring carries mu2 p in the circumferential direction."""
    field = None if axes is None else FrictionAxes(around=axes)
    points, pressure, traction = solve_tangential(case, OrthotropicCoulomb(0.1, 0.4), field, twist=50.0)
    firm = (pressure > 0.0) & (np.linalg.norm(points, axis=1) > 1e-9)
    arms = points[firm, :2] / np.linalg.norm(points[firm], axis=1, keepdims=True)
    across = np.column_stack([-arms[:, 1], arms[:, 0]])
    along = np.einsum("ni,ni->n", traction[firm], across) / pressure[firm]
    if coefficient is None:
        assert np.ptp(along) > 0.1, "without axes the coefficient depends on the direction"
    else:
        np.testing.assert_allclose(along, coefficient, rtol=1e-6)
        np.testing.assert_allclose(np.einsum("ni,ni->n", traction[firm], arms) / pressure[firm], 0.0, atol=1e-6)


def test_reduced_systems_from_the_cache_are_rotated(case, tmp_path):
    rotated = dataclasses.replace(case, axes=FrictionAxes(around=(0.0, 0.0, 1.0)))
    for again in (rotated, case, rotated):
        expected, cached = reduce(again), cached_reduce(again, tmp_path)
        np.testing.assert_array_equal(cached.frames, expected.frames)
        np.testing.assert_array_equal(cached.dense(), expected.dense())
    assert len(list(tmp_path.glob("*.h5"))) == 1


@pytest.mark.parametrize(("axes", "held"), [(None, 1), (FrictionAxes(direction=(0.0, 1.0, 0.0)), 0)])
def test_forces_along_a_frictionless_axis_are_rejected(case, axes, held):
    """A force along the other axis is accepted, whatever its global direction."""
    law, (along, across) = OrthotropicCoulomb(0.0, 0.4), np.eye(2)[[held, 1 - held]]
    first, force = dataclasses.replace(case.steps[0], increments=4), 0.1 * np.pi * 1e14 * 0.1 * 1e-5**2
    rotated = dataclasses.replace(case, contact_law=law, axes=axes)
    solved = dataclasses.replace(rotated, steps=(first, Step(tangential_force=tuple(force * along))))
    result = meeframe.solve_case(solved)
    assert result.status is RunStatus.CONVERGED
    totals = meeframe.resultants(result.zone, result.steps[-1])
    np.testing.assert_allclose(totals.force[:2], force * along, atol=1e-9 * force)
    with pytest.raises(CaseError, match=r"tangential_force = .*the laws of the contact admit no traction that resists"):
        dataclasses.replace(rotated, steps=(first, Step(tangential_force=tuple(force * across))))
