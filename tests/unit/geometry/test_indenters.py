"""Shapes of indenters agree with their formulas; heights can be given as numbers."""

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.special import elliprd, elliprf

from meeframe.common.errors import CaseError
from meeframe.indenters import Cone, Cylinder, FlatPunch, Heights, Paraboloid, RectangularPunch, SampledHeights, Sphere
from meeframe.plugin.validation import build
from meeframe.solvers import SemismoothNewton, solve
from meeframe.testing.half_space import half_space_system, indentation_problem

RANDOM = np.random.default_rng(5)
X, Y = np.random.default_rng(4).uniform(-2e-3, 2e-3, (2, 400))
R = np.hypot(X, Y)


def test_sphere() -> None:
    np.testing.assert_allclose(Sphere(0.1).height(X, Y), R**2 / 0.2, rtol=1e-15)
    exact = Sphere(2e-3, "exact").height(X, Y)
    inside = R <= 2e-3
    # every point lies on the sphere about (0, 0, radius)
    np.testing.assert_allclose(np.hypot(R[inside], exact[inside] - 2e-3), 2e-3, rtol=1e-12)
    assert (exact[inside] <= 2e-3).all()
    assert np.isinf(exact[~inside]).all()
    assert 0 < inside.sum() < len(R)


def test_exact_sphere_is_accurate_near_its_lowest_point() -> None:
    r = np.array([0.0, 1e-9, 1e-6])
    expected = r**2 / 0.2 * (1 + (r / 0.1) ** 2 / 4)
    np.testing.assert_allclose(Sphere(0.1, "exact").height(r, 0 * r), expected, rtol=1e-14)


def test_exact_profiles_reach_their_equator() -> None:
    edge = np.array([2e-3 * (1 + 1e-12)])
    assert Sphere(2e-3, "exact").height(edge, 0 * edge) == pytest.approx(2e-3)
    assert Cylinder(2e-3, np.pi / 2, "exact").height(edge, edge) == pytest.approx(2e-3)


def test_paraboloid() -> None:
    shape = Paraboloid(0.1, 0.02)
    line = np.linspace(-2e-3, 2e-3, 11)
    np.testing.assert_allclose(shape.height(line, 0 * line), Cylinder(0.1, np.pi / 2).height(line, line), rtol=1e-14)
    np.testing.assert_allclose(shape.height(0 * line, line), Cylinder(0.02).height(line, line), rtol=1e-14)
    np.testing.assert_allclose(Paraboloid(0.1, 0.1).height(X, Y), Sphere(0.1).height(X, Y), rtol=1e-14)


@pytest.mark.full
@pytest.mark.parametrize(("a", "b"), [(1.0e-3, 0.5e-3), (0.35e-3, 1.0e-3)])
def test_paraboloids_cause_elliptic_hertz_contact(a: float, b: float) -> None:
    """p_0 sqrt(1 - x^2/a^2 - y^2/b^2) displaces the surface by p_0 a b/(2 E*) times the integral from w = 0 to
    infinity of (1 - x^2/(a^2 + w) - y^2/(b^2 + w))/sqrt(w (a^2 + w)(b^2 + w)): Johnson, Contact Mechanics (1985),
    section 3.5."""
    modulus, peak = 1e11, 2e9
    across_x, across_y = elliprd(0, b**2, a**2), elliprd(0, a**2, b**2)
    shape = Paraboloid(*(3 * modulus / (2 * peak * a * b) / np.array([across_x, across_y])))
    approach = peak * a * b / modulus * elliprf(0, a**2, b**2)
    system = half_space_system(np.diag([1 / (np.pi * modulus), -1e9, -1e4]), 2.2e-3, 32)
    x, y = system.points[:, :2].T
    solution = solve(indentation_problem(system, shape.height(x, y), approach), SemismoothNewton())
    forces = -system.weights * solution.state.load[:, 2]
    assert solution.status == "converged"
    assert forces.sum() == pytest.approx(2 / 3 * np.pi * a * b * peak, rel=5e-3)
    assert np.sqrt(5 * forces @ x**2 / forces.sum()) == pytest.approx(a, rel=5e-3)
    assert np.sqrt(5 * forces @ y**2 / forces.sum()) == pytest.approx(b, rel=5e-3)


def test_cone() -> None:
    angle = np.arctan2(Cone(0.3).height(X, Y), R)
    np.testing.assert_allclose(angle, 0.3, rtol=1e-14)


def test_flat_punches() -> None:
    round_end = FlatPunch(1.5e-3).height(X, Y)
    np.testing.assert_array_equal(round_end, np.where(R < 1.5e-3, 0, np.inf))
    rectangle = RectangularPunch(1e-3, 0.5e-3).height(X, Y)
    np.testing.assert_array_equal(rectangle, np.where((abs(X) < 1e-3) & (abs(Y) < 0.5e-3), 0, np.inf))
    # nodes on the edge belong to the punch, despite round-off
    edge = 1e-3 * (1 + np.array([-1e-14, 0, 1e-14]))
    assert (FlatPunch(1e-3).height(edge, 0 * edge) == 0).all()
    assert (RectangularPunch(1e-3, 1e-3).height(edge, edge) == 0).all()


@pytest.mark.parametrize("direction", [0.0, 0.7, np.pi / 2, -2.0])
def test_cylinder(direction: float) -> None:
    along = X * np.cos(direction) + Y * np.sin(direction)
    across = np.sqrt(np.maximum(R**2 - along**2, 0))
    np.testing.assert_allclose(Cylinder(0.1, direction).height(X, Y), across**2 / 0.2, rtol=1e-9, atol=1e-18)
    exact = Cylinder(5e-3, direction, "exact", 1e-3).height(X, Y)
    within = np.abs(along) <= 1e-3
    np.testing.assert_allclose(np.hypot(across, exact - 5e-3)[within], 5e-3, rtol=1e-12)
    assert np.isinf(exact[~within]).all()


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: Sphere(-1.0), r"Sphere: radius = -1\.0: must be > 0"),
        (lambda: Sphere(float("nan")), "Sphere: radius = nan"),
        (lambda: Sphere(float("inf")), "Sphere: radius = inf: must be .*finite"),
        (lambda: Sphere("3 V"), "Sphere: radius = '3 V': has the wrong unit"),
        (lambda: Sphere(0.1, "conic"), "Sphere: profile = 'conic': allowed: parabolic, exact"),
        (lambda: Paraboloid(0.1, 0.0), r"Paraboloid: radius_y = 0\.0: must be > 0"),
        (lambda: FlatPunch(0.0), r"FlatPunch: radius = 0\.0"),
        (lambda: RectangularPunch(1.0, -1.0), r"half_width_y = -1\.0"),
        (lambda: Cone(1.6), r"Cone: angle = 1\.6: must be > 0 and < 1\.57"),
        (lambda: Cylinder(0.1, float("inf")), "Cylinder: direction = inf"),
        (lambda: Cylinder(0.1, half_length=0.0), r"half_length = 0\.0"),
        (lambda: Heights(Path("a.csv"), "quintic"), "interpolation = 'quintic': allowed: linear, cubic, nodes"),
        (lambda: Heights(Path("a.csv"), unit=0.0), r"Heights: unit = 0\.0"),
        (lambda: SampledHeights(np.zeros((3, 2))), r"heights: numbers in rows .*\(3, 2\)"),
        (lambda: SampledHeights(np.full((4, 3), np.nan)), "heights: row 1 is not finite"),
        (lambda: SampledHeights([[0.0, 0.0], [1.0]]), "heights: "),
        (lambda: SampledHeights.on_grid(np.zeros(3), np.zeros(2), np.zeros((2, 3))), r"\(3,\), \(2,\) and \(2, 3\)"),
        (lambda: SampledHeights.on_grid([0.0, 1.0], [0.0, 1.0], [["a", "b"]] * 2), "heights: numbers in rows"),
    ],
)
def test_invalid_values_are_rejected(make: object, text: str) -> None:
    with pytest.raises(CaseError, match=text):
        make()


def test_quantities_with_units() -> None:
    assert Sphere("100 mm") == Sphere(0.1)
    assert Cone("10 deg").angle == pytest.approx(np.pi / 18)


def test_creation_from_tables() -> None:
    assert build(Cylinder, {"radius": "5 mm", "direction": "90 deg"}) == Cylinder(0.005, np.pi / 2)
    assert build(Heights, {"file": "a.csv", "unit": "1 um"}) == Heights(Path("a.csv"), unit=1e-6)
    assert build(FlatPunch, {"radius": 0.001}) == FlatPunch(1e-3)
    assert build(Paraboloid, {"radius_x": "2 cm", "radius_y": "5 mm"}) == Paraboloid(0.02, 0.005)


def grid(f: object, nx: int = 9, ny: int = 7) -> np.ndarray:
    x, y = np.meshgrid(np.linspace(-2e-3, 2e-3, nx), np.linspace(-3e-3, 3e-3, ny), indexing="ij")
    return np.stack([x, y, f(x, y)], axis=-1).reshape(-1, 3)


def bilinear(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 2e-6 + 1e-3 * x - 2e-3 * y + 0.3 * x * y


def test_linear_interpolation_is_exact_for_bilinear_heights() -> None:
    rows = grid(bilinear)
    height = SampledHeights(RANDOM.permutation(rows)).height(X, Y)
    np.testing.assert_allclose(height, bilinear(X, Y) - rows[:, 2].min(), atol=1e-19)


def test_positions_of_heights_on_a_grid() -> None:
    x, y = np.linspace(-2e-3, 2e-3, 9), np.linspace(-3e-3, 3e-3, 7)
    shape = SampledHeights.on_grid(x, y[::-1], bilinear(x[:, None], y[None, ::-1]))
    np.testing.assert_array_equal(shape.height(X, Y), SampledHeights(grid(bilinear)).height(X, Y))


def test_cubic_interpolation_is_exact_for_cubics() -> None:
    def cubic(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return 5.0 * x**2 + 3e2 * y**3 + 1e6 * x**3 * y**2 + 1e-3 * x

    rows = grid(cubic)
    height = SampledHeights(rows, "cubic").height(X, Y)
    np.testing.assert_allclose(height, cubic(X, Y) - rows[:, 2].min(), atol=1e-12 * np.ptp(rows[:, 2]))


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_heights_at_grid_nodes_match_the_samples(interpolation: str) -> None:
    x, y = np.linspace(-2e-3, 2e-3, 9), np.linspace(-3e-3, 3e-3, 7)
    samples = RANDOM.uniform(size=(9, 7))
    shape = SampledHeights.on_grid(x, y, samples, interpolation)
    across, along = (nodes.ravel() for nodes in np.meshgrid(x, y, indexing="ij"))
    order = RANDOM.permutation(across.size)
    np.testing.assert_array_equal(shape.height(across[order], along[order]), (samples.ravel() - samples.min())[order])
    between = shape.height(across[:-1] + 1e-9, along[:-1])
    np.testing.assert_allclose(between[:-7], (samples.ravel() - samples.min())[:-8], atol=1e-4)
    assert shape.height(np.empty(0), np.empty(0)).shape == (0,)


def test_sampled_heights_differ_and_copy_their_samples() -> None:
    rows = grid(bilinear)
    first, second = SampledHeights(rows), SampledHeights(2.0 * rows)
    assert first != second
    rows[:, 2] = 0.0
    assert first.height(X, Y).max() > 0.0


def test_interpolation_of_a_sphere_converges() -> None:
    inner = (np.abs(X) < 1.9e-3) & (np.abs(Y) < 1.9e-3)
    for kind, order in (("linear", 2), ("cubic", 4)):
        errors = []
        for n in (16, 32):
            shape = SampledHeights(grid(lambda x, y: 1e-5 * np.cos(900 * x) * np.cos(600 * y), n + 1, n + 1), kind)
            lowest = 1e-5 * np.cos(900 * X) * np.cos(600 * Y) - shape.height(X, Y)
            errors.append(np.ptp(lowest[inner]))  # the lowest point of the grid only adds a constant
        assert np.log2(errors[0] / errors[1]) > order - 0.3, (kind, errors)


def test_no_surface_outside_the_grid() -> None:
    shape = SampledHeights(grid(bilinear))
    outside = shape.height(np.array([2.1e-3, 0.0, -2e-3 * (1 + 1e-12)]), np.array([0.0, -3.1e-3, 3e-3]))
    assert np.isinf(outside).tolist() == [True, True, False]


def test_one_height_for_each_node() -> None:
    rows = np.stack([X, Y, 1e-6 * RANDOM.uniform(size=len(X))], axis=1)
    shape = SampledHeights(RANDOM.permutation(rows), "nodes")
    np.testing.assert_array_equal(shape.height(X, Y), rows[:, 2] - rows[:, 2].min())
    assert np.isinf(shape.height(np.array([5e-3]), np.array([0.0]))).all()
    assert SampledHeights(rows[:1], "nodes").height(X[:1], Y[:1]) == 0.0


def test_heights_from_files(tmp_path: Path) -> None:
    rows = grid(bilinear)
    expected = SampledHeights(rows).height(X, Y)
    np.save(tmp_path / "heights.npy", 1e3 * rows)
    np.testing.assert_allclose(Heights(tmp_path / "heights.npy", unit=1e-3).height(X, Y), expected, atol=1e-18)
    np.savetxt(tmp_path / "comma.csv", rows, delimiter=",", header="x, y, height", fmt="%.17g")
    np.testing.assert_array_equal(Heights(tmp_path / "comma.csv").height(X, Y), expected)
    np.savetxt(tmp_path / "blank.txt", rows, fmt="%.17g")
    np.testing.assert_array_equal(Heights(tmp_path / "blank.txt").height(X, Y), expected)


def test_changed_file_is_read_again(tmp_path: Path) -> None:
    path = tmp_path / "heights.npy"
    np.save(path, grid(bilinear))
    shape = Heights(path)
    before = shape.height(X, Y)
    np.save(path, 2 * grid(bilinear))
    os.utime(path, ns=(0, path.stat().st_mtime_ns + 10**9))  # the modification time of the file may not have changed
    np.testing.assert_allclose(shape.height(2 * X, 2 * Y), 2 * before)


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("absent.csv", None, "cannot be read: No such file"),
        ("empty.csv", "", r"numbers in rows \(x, y, height\)"),
        ("words.csv", "x,y,height\n0,0,0\n", "could not convert string 'x'"),
        ("two.csv", "0,0\n1,1\n", r"not an array of shape \(2, 2\)"),
        ("nan.csv", "0,0,0\n0,1,nan\n1,0,0\n1,1,0\n", "row 2 is not finite"),
        (
            "hole.csv",
            "0,0,0\n0,1,0\n1,0,0\n",
            "3 rows with 2 distinct x and 2 distinct y do not form a full rectangular grid",
        ),
        ("twice.csv", "0,0,0\n0,1,0\n1,0,0\n1,0,0\n", "do not form a full rectangular grid"),
        ("line.csv", "0,0,0\n0,1,0\n", "do not form a full rectangular grid"),
        ("noise.npy", "not numpy", "noise.npy: "),
        ("empty.npy", "", "EOF"),
        ("archive.npy", "PK\x03\x04 an archive", "magic string is not correct"),
    ],
)
def test_invalid_files_are_rejected(name: str, content: str | None, text: str, tmp_path: Path) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_text(content)
    with pytest.raises(CaseError, match=rf"heights: .*{name}: .*{text}" if content != "not numpy" else text):
        Heights(path).height(X, Y)


def test_cubic_interpolation_needs_four_points_per_axis(tmp_path: Path) -> None:
    with pytest.raises(
        CaseError, match=r"cubic interpolation needs 4 points along each side of the grid; it has \(3, 7\)"
    ):
        SampledHeights(grid(bilinear, 3, 7), "cubic").height(X, Y)
