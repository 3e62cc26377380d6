"""The point response and its integrals over cells agree with closed forms and quadrature."""

from itertools import pairwise

import numpy as np
import pytest
from meeframe_halfspace import PointResponse
from meeframe_halfspace.cells import _product_rules, cell_table, density_pieces, far_table, near_size
from meeframe_halfspace.entries import entries_to_matrix
from meeframe_halfspace.kernels import _near, tabulate
from meeframe_halfspace.kernels import cell_response as one_cell
from meeframe_halfspace.response import mirror_parity

from meeframe.common.errors import MaterialError
from meeframe.material import Material, library_material, rotation_about
from meeframe.material.half_space import axisymmetric_compliance
from meeframe.testing.elastic_half_space import cell_response

YOUNG, POISSON = 2e11, 0.27
H = 1e-3


@pytest.mark.parametrize("missing", [1e-4, 1e-8])
def test_nearly_incompressible_response_matches_boussinesq(missing):
    """Near a Poisson ratio of 0.5, digits of the compliance cancel."""
    poisson = 0.5 - missing
    answer = PointResponse.of(Material.isotropic(1e6, poisson).stiffness, np.eye(3)).evaluate(np.array([[3.0, 4.0]]))
    np.testing.assert_allclose(answer[0, 2, 2], (1 - poisson**2) / (np.pi * 1e6 * 5.0), rtol=1e-13 / missing)


def rotated_orthotropic():
    return library_material("orthotropic-mee").rotated(rotation_about((1.0, 2.0, 0.5), 0.8)).stiffness


def table(response, spacing, shape, size):
    values = np.moveaxis(cell_table(response, spacing, shape, size), 0, -1)
    return entries_to_matrix(values) * np.outer(response.factors, response.factors)


def test_constant_cells_match_boussinesq_and_cerruti():
    response = PointResponse.of(Material.isotropic(YOUNG, POISSON).stiffness, np.eye(3))
    n = 16  # farther away, the closed form loses digits, because it is a difference of four large numbers
    x, y = np.meshgrid(np.arange(n) * H, np.arange(1 - n, n) * H, indexing="ij")
    exact = cell_response(YOUNG, POISSON, x, y, H / 2)[..., :3, :3]
    computed = table(response, (H, H), "constant", (n, n))[..., :3, :3]
    size = np.abs(exact).max(axis=(2, 3), keepdims=True)
    assert (np.abs(computed - exact) / size).max() < 1e-12
    assert np.abs(exact[..., 2, :2] / size[..., 0]).max() > 0.1  # the odd coupling is not zero


def test_axisymmetric_response_matches_closed_form():
    stiffness = library_material("batio3-cofe2o4").stiffness
    xi = axisymmetric_compliance(stiffness)
    offset = np.array([[0.3, 0.4], [-2.0, 0.1]])
    response = PointResponse.of(stiffness, np.eye(3)).evaluate(offset)[:, 2:, 2:]
    exact = xi / np.linalg.norm(offset, axis=1)[:, None, None]
    np.testing.assert_allclose(response, exact, rtol=1e-10)


def test_response_rotates_with_the_body():
    material = library_material("orthotropic-mee").rotated(rotation_about((1.0, 2.0, 0.5), 0.8))
    angle = 0.7
    about = rotation_about((0.0, 0.0, 1.0), angle)
    offset = np.array([[0.3, 0.4], [-2.0, 0.1], [0.1, -0.9]])
    first = PointResponse.of(material.stiffness, np.eye(3)).evaluate(offset)
    second = PointResponse.of(material.rotated(about).stiffness, np.eye(3)).evaluate(offset @ about[:2, :2].T)
    turn = np.eye(5)
    turn[:3, :3] = about
    scale = np.sqrt(np.abs(np.einsum("naa,nbb->nab", first, first)))
    assert (np.abs(second - turn @ first @ turn.T) / scale).max() < 1e-11
    # rotating the frame of the zone is equivalent
    third = PointResponse.of(material.stiffness, about.T).evaluate(offset @ about[:2, :2])
    assert (np.abs(third - turn.T @ first @ turn) / scale).max() < 1e-11


def test_reciprocity_between_two_points():
    response = PointResponse.of(rotated_orthotropic(), np.eye(3))
    offset = np.array([[0.3, 0.4], [-2.0, 0.1]])
    there, back = response.evaluate(offset), response.evaluate(-offset)
    np.testing.assert_allclose(back, there.transpose(0, 2, 1), rtol=1e-12)
    scale = np.outer(response.factors, response.factors)
    assert np.abs((there - back) / scale).max() > 1e-2 * np.abs(there / scale).max()


@pytest.mark.full(except_for=7)
@pytest.mark.parametrize("shape", ["constant", "bilinear"])
@pytest.mark.parametrize("position", [(0, 0), (1, 0), (0, -2), (3, 2), (5, 4), (6, 1), (9, -13)])
def test_cells_match_integrals_of_the_response(shape, position):
    spacing = (1.0, 1.4)
    response = PointResponse.of(rotated_orthotropic(), np.eye(3))
    scale = np.outer(response.factors, response.factors)
    computed = table(response, spacing, shape, (10, 14))[position[0], 13 + position[1]] / scale
    exact = _integral(response, shape, spacing, position[0] * spacing[0], position[1] * spacing[1]) / scale
    assert np.abs(computed - exact).max() < 1e-11 * np.abs(computed).max()


def _integral(response, shape, spacing, x, y):
    """Integrate (5, 5) by 40 x 40 Gauss points on each rectangle without kinks, in polar coordinates about the point
    if it is a corner, so that the integrand is bounded."""

    def integrand(dx, dy):
        a, b = np.abs(x - dx) / spacing[0], np.abs(y - dy) / spacing[1]
        density = (1 - a) * (1 - b) if shape == "bilinear" else np.ones_like(a)
        return response.evaluate(np.column_stack([dx, dy])) * density[:, None, None]

    edges = np.array([-1.0, 0.0, 1.0] if shape == "bilinear" else [-0.5, 0.0, 0.5])
    total = np.zeros((5, 5))
    for xs in pairwise(x + spacing[0] * edges):
        for ys in pairwise(y + spacing[1] * edges):
            integrate = _corner if 0.0 in xs and 0.0 in ys else _away
            total += integrate(integrand, xs, ys)
    return total


def _gauss(low, high):
    points, weights = np.polynomial.legendre.leggauss(40)
    return low + (high - low) * (points + 1.0) / 2.0, (high - low) / 2.0 * weights


def _away(integrand, xs, ys):
    (x, x_weights), (y, y_weights) = _gauss(*xs), _gauss(*ys)
    values = integrand(np.repeat(x, len(y)), np.tile(y, len(x)))
    return np.einsum("n,nij->ij", np.outer(x_weights, y_weights).ravel(), values)


def _corner(integrand, xs, ys):
    """Integrate with the singular point at a corner of the rectangle: two triangles, collapsed there."""
    a, b = (xs[0] or xs[1]), (ys[0] or ys[1])
    points, weights = _gauss(0.0, 1.0)
    u, v = np.repeat(points, len(points)), np.tile(points, len(points))
    values = integrand(u * a, u * v * b) + integrand(u * v * a, u * b)
    return np.einsum("n,nij->ij", np.outer(weights, weights).ravel() * u * abs(a * b), values)


@pytest.mark.parametrize("shape", ["constant", "bilinear"])
def test_near_and_far_rules_agree_at_transitions(shape):
    """Both integration methods agree at the distance where one replaces the other, and where the order of the rules
    changes."""
    response = PointResponse.of(rotated_orthotropic(), np.eye(3))
    spacing, rule = np.array([1.0, 0.8]), np.array(np.polynomial.legendre.leggauss(60))
    pieces = [density_pieces(shape, h) for h in spacing]
    series = response.even, response.odd
    around = tabulate(*series, 8192)
    worst = 0.0
    for distance in (6.05, 7.0, 9.0, 12.0, 20.0, 30.0):
        for angle in (0.1, 1.2, 2.9):
            x, y = distance * np.cos(angle), distance * np.sin(angle)
            near, far = np.zeros(25), np.zeros(25)
            _near(x, y, *pieces, *series, rule, near)
            one_cell(x, y, spacing, *pieces, *series, around, rule, *_product_rules(shape), far)
            # near the axes, terms cancel that are larger by a factor of the distance squared
            worst = max(worst, np.abs(near - far).max() / np.abs(near).max() / distance**2)
    assert worst < 1e-13


@pytest.mark.parametrize("rotated", [False, True])
@pytest.mark.parametrize("shape", ["constant", "bilinear"])
def test_far_cells_from_the_response_at_nodes(shape, rotated):
    """Each entry agrees with integration, relative to the largest at that place; without rotation half of the grid is
    mirrored."""
    stiffness = rotated_orthotropic() if rotated else library_material("orthotropic-mee").stiffness
    response = PointResponse.of(stiffness, np.eye(3))
    spacing, size = (1.0, 0.8), (44, 50)
    near = near_size(spacing, size)
    assert near == (31, 39)
    whole = cell_table(response, spacing, shape, size)
    assert [mirror_parity(response.entry(entry)[0]) for entry in (0, 1, 16, 19)] == (
        [0] * 4 if rotated else [1, -1, 1, -1]
    )
    computed_entry = np.stack([far_table(response, spacing, shape, size, entry) for entry in range(25)])
    far = np.ones(whole.shape[1:], bool)
    far[: near[0], size[1] - near[1] : size[1] + near[1] - 1] = False
    error = np.abs(computed_entry - whole).max(axis=0) / np.abs(whole).max(axis=0)
    assert far.any()
    assert error[far].max() < 1e-12


def test_entries_that_symmetry_forbids_are_zero():
    """Isotropic media have 8 of 25 entries to compute, rotated orthotropic media all."""
    isotropic = PointResponse.of(Material.isotropic(YOUNG, POISSON).stiffness, np.eye(3))
    made = [entry for entry in range(25) if len(isotropic.entry(entry)[0])]
    assert made == [0, 1, 5, 9, 12, 14, 16, 19]
    rotated = PointResponse.of(rotated_orthotropic(), np.eye(3))
    assert all(len(rotated.entry(entry)[0]) for entry in range(25))


@pytest.mark.parametrize("quarter_turns", [0, 1, 2])
def test_responses_mirrored_about_the_first_axis(quarter_turns):
    """For media with symmetry planes, each entry is even or odd."""
    medium = library_material("orthotropic-mee").rotated(rotation_about((0.0, 0.0, 1.0), 0.5 * np.pi * quarter_turns))
    around = np.random.default_rng(0).normal(size=(20, 2))
    for stiffness in (medium.stiffness, Material.isotropic(YOUNG, POISSON).stiffness):
        response = PointResponse.of(stiffness, np.eye(3))
        there, beyond = (response.evaluate(around * [1.0, sign]) for sign in (1.0, -1.0))
        parities = np.abs(entries_to_matrix(response.parities.astype(float)))
        np.testing.assert_array_equal(parities[~np.eye(5, dtype=bool)] % 2, 0)  # both kinds of entries occur
        signs = np.sign(entries_to_matrix(np.concatenate([response.parities[:15], np.zeros(10)])))
        assert np.abs(beyond - signs * there).max() < 1e-12 * np.abs(there).max()


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (1.0, 2.0, 0.5), (0.0, 1.0, 0.0)])
def test_responses_without_mirror_symmetry(axis):
    medium = library_material("orthotropic-mee").rotated(rotation_about(axis, 0.5))
    response = PointResponse.of(medium.stiffness, np.eye(3))
    mirrors = axis == (0.0, 1.0, 0.0)  # a rotation about the second axis preserves the symmetry plane across it
    assert (response.parities is not None) == mirrors


def test_inadmissible_stiffness_is_rejected():
    with pytest.raises(MaterialError, match="converge"):
        PointResponse.of(np.full((3, 5, 5, 3), np.nan), np.eye(3))
