"""Non-associated and superelliptic friction have the correct limit and slip direction."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from meeframe_laws.directional import NonAssociatedCoulomb, SuperellipticCoulomb

from meeframe.contact.problem import Status, contact_gap
from meeframe.laws import Insulating
from meeframe.material import library_material
from meeframe.solvers import SemismoothNewton, solve
from meeframe.testing.contact_cases import SphereCase
from meeframe.testing.force_control import TIGHT_CRITERIA

ANGLE = st.floats(-3.2, 3.2)
COEFFICIENT = st.floats(0.05, 2.0)
STEP = st.floats(-6.0, 6.0)


def point_and_normal(half_axes, angle, exponent, parameter):
    """Return a point of a rotated superellipse and its outward normal, from a parametrisation of the curve."""
    c, s = np.cos(parameter), np.sin(parameter)
    local = np.array([np.copysign(abs(c) ** (2.0 / exponent), c), np.copysign(abs(s) ** (2.0 / exponent), s)])
    point = half_axes * local
    normal = np.copysign(abs(local) ** (exponent - 1.0), local) / half_axes
    axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return point @ axes, normal @ axes / np.linalg.norm(normal)


def slipping_nodes(law):
    """Return traction over pressure and slip, (m, 2) each, of the nodes that slip under a dragged sphere."""
    insulating = Insulating()
    problem = SphereCase(library_material("orthotropic-mee"), law, insulating, insulating, 12).problem()
    solution = solve(problem, SemismoothNewton(), TIGHT_CRITERIA)
    assert solution.status is Status.CONVERGED, solution.message
    slip = contact_gap(problem, solution.state.displacement)[:, :2]
    slips = (solution.state.load[:, 2] < 0.0) & (np.linalg.norm(slip, axis=1) > 1e-8)
    assert slips.sum() > 20
    return solution.state.load[slips, :2] / -solution.state.load[slips, 2:3], slip[slips]


def lame_norm(points, exponent):
    """Return (|x|^n + |y|^n)^(1/n), (m,), of points (m, 2)."""
    largest = np.abs(points).max(axis=1)
    return largest * ((np.abs(points) / largest[:, None]) ** exponent).sum(axis=1) ** (1.0 / exponent)


def parallel(one, other, atol):
    """Return True for rows that have the same direction."""
    units = [rows / np.linalg.norm(rows, axis=1)[:, None] for rows in (one, other)]
    np.testing.assert_allclose(units[0], units[1], atol=atol)


@settings(deadline=None, max_examples=200)
@given(COEFFICIENT, COEFFICIENT, COEFFICIENT, ANGLE, ANGLE, ANGLE, STEP, STEP)
def test_non_associated_slip_is_normal_to_the_slip_ellipse(
    mu1, mu2, ratio, angle, slip_angle, parameter, step, pressure
):
    law = NonAssociatedCoulomb(mu1, mu2, ratio, angle, slip_angle)
    p = 10.0**pressure
    traction = p * point_and_normal(np.array([mu1, mu2]), angle, 2.0, parameter)[0]
    # the normal of the slip ellipse at the direction of the traction: the gradient of x1^2 + x2^2/ratio^2
    first = np.array([np.cos(slip_angle), np.sin(slip_angle)])
    second = np.array([-first[1], first[0]])
    normal = (traction @ first) * first + (traction @ second) * second / ratio**2
    trial = traction + p * 10.0**step * law.tangential_scaling() @ (normal / np.linalg.norm(normal))
    computed = law.resolve(np.append(trial, -p)[None], np.zeros((1, 3)), (1.0, 1.0))[0]
    assert np.abs(computed - np.append(traction, -p)).max() <= 1e-12 * max(p, np.abs(trial).max())


def test_non_associated_computed_values():
    """With a circle as slip ellipse, slip along (1, 1) has a traction along (1, 1), whatever the
    normal of the limit."""
    law = NonAssociatedCoulomb(0.6, 0.2)
    scaling = law.tangential_scaling()
    np.testing.assert_allclose(scaling, np.diag([1.0, 1.0 / 9.0]))
    radius = 1.0 / np.sqrt(1.0 / 0.36 + 1.0 / 0.04)
    traction = np.array([radius, radius])
    trial = np.append(traction + 7.0 * scaling @ [1.0, 1.0], -1.0)[None]
    np.testing.assert_allclose(law.resolve(trial, 0.0 * trial, (1.0, 7.0)), [[radius, radius, -1.0]], rtol=1e-13)
    inside = np.array([[0.1, 0.1, -1.0], [9.0, 9.0, 0.0], [9.0, 9.0, np.inf]])
    expected = [[0.1, 0.1, -1.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    np.testing.assert_allclose(law.resolve(inside, np.zeros((3, 3)), (1.0, 1.0)), expected, rtol=1e-13)


def test_non_associated_under_a_sphere():
    law = NonAssociatedCoulomb(0.4, 0.15, 0.5, 0.3, -0.6)
    traction, slip = slipping_nodes(law)
    axes = np.array([[np.cos(0.3), np.sin(0.3)], [-np.sin(0.3), np.cos(0.3)]])
    np.testing.assert_allclose(np.linalg.norm(traction @ axes.T / [0.4, 0.15], axis=1), 1.0, rtol=1e-9)
    axes = np.array([[np.cos(0.6), -np.sin(0.6)], [np.sin(0.6), np.cos(0.6)]])
    normal = ((traction @ axes.T) / [1.0, 0.25]) @ axes
    parallel(slip, normal, 1e-6)


@settings(deadline=None, max_examples=300)
@given(COEFFICIENT, COEFFICIENT, st.floats(1.05, 20.0), ANGLE, ANGLE, STEP, STEP)
def test_superelliptic_slip_is_normal_to_the_limit(mu1, mu2, exponent, angle, parameter, step, pressure):
    law = SuperellipticCoulomb(mu1, mu2, exponent, angle)
    p = 10.0**pressure
    point, normal = point_and_normal(np.array([mu1, mu2]), angle, exponent, parameter)
    trial = p * (point + 10.0**step * law.tangential_scaling() @ normal)
    computed = law.project(np.append(trial, -p)[None])[0]
    assert np.abs(computed - np.append(p * point, -p)).max() <= 1e-10 * max(p, np.abs(trial).max())


@pytest.mark.full(except_for=3)
@pytest.mark.parametrize("exponent", [1.0, 1.0001, 1.5, 2.0, 4.0, 100.0, 1e6])
def test_superelliptic_projection_is_the_nearest_point(exponent):
    """None of 20 000 points of the curve is nearer in y = M^-1 t."""
    random = np.random.default_rng(0)
    mu = np.array([0.6, 0.2])
    trial = np.column_stack([random.normal(size=(100, 2)), np.full(100, -0.5)])
    computed = SuperellipticCoulomb(*mu, exponent).project(trial)[:, :2]
    parameter = np.linspace(0.0, 2.0 * np.pi, 20_001)
    c, s = np.cos(parameter), np.sin(parameter)
    size = (
        (abs(c) ** exponent + abs(s) ** exponent) ** (1.0 / exponent) if exponent < 100 else np.maximum(abs(c), abs(s))
    )
    curve = 0.5 * np.column_stack([c, s]) / size[:, None]
    outside = lame_norm(trial[:, :2] / mu, exponent) > 0.5
    assert outside.sum() > 50
    distance = np.linalg.norm((trial[:, :2] - computed) / mu, axis=1)
    nearest = np.linalg.norm((trial[:, None, :2] / mu) - curve, axis=2).min(axis=1)
    np.testing.assert_allclose(distance[outside], nearest[outside], atol=1e-2 if exponent == 100 else 1e-5)
    np.testing.assert_array_equal(computed[~outside], trial[~outside, :2])
    np.testing.assert_allclose(lame_norm(computed[outside] / mu, exponent), 0.5, rtol=1e-9)


def test_rhombus_and_box():
    trial = np.array([[0.9, 0.3, -1.0], [3.0, 0.3, -1.0], [0.3, 0.1, -1.0], [1.0, 0.1, 2.0]])
    rhombus = SuperellipticCoulomb(0.5, 0.5, 1.0).project(trial)
    # on the side x + y = 0.5 to the foot of the perpendicular, or to the corner if that lies beyond it
    np.testing.assert_allclose(rhombus, [[0.5, 0.0, -1.0], [0.5, 0.0, -1.0], [0.3, 0.1, -1.0], [0, 0, 0]], atol=1e-12)
    foot = SuperellipticCoulomb(0.5, 0.5, 1.0).project(np.array([[0.8, 0.6, -1.0]]))
    np.testing.assert_allclose(foot, [[0.35, 0.15, -1.0]], rtol=1e-12)
    box = SuperellipticCoulomb(0.5, 0.2, 1e12).project(trial)
    np.testing.assert_allclose(box, [[0.5, 0.2, -1.0], [0.5, 0.2, -1.0], [0.3, 0.1, -1.0], [0, 0, 0]], rtol=1e-9)


@pytest.mark.parametrize("exponent", [1.2, 5.0])
def test_superelliptic_under_a_sphere(exponent):
    traction, slip = slipping_nodes(SuperellipticCoulomb(0.4, 0.15, exponent))
    share = np.abs(traction) / [0.4, 0.15]
    np.testing.assert_allclose((share**exponent).sum(axis=1), 1.0, rtol=1e-8)
    parallel(slip, np.copysign(share ** (exponent - 1.0), traction) / [0.4, 0.15], 1e-5)
