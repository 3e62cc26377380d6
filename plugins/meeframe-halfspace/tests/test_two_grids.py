"""Rough responses by two grids against the convolution in double precision, and what solvers find by them."""

import pickle
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace
from meeframe_halfspace.cells import Shape, far_table
from meeframe_halfspace.convolution import Convolution
from meeframe_halfspace.cutoff import MIN_CUTOFF, cutoff_radius
from meeframe_halfspace.grid_response import FreeGrid, PeriodicGrid
from meeframe_halfspace.response import PointResponse
from meeframe_halfspace.system import HalfSpaceSystem, convolution_of, potential_signs
from meeframe_halfspace.transfer import N_BEFORE, RATIO, WEIGHTS, add_interpolated, add_restricted, coarse_count
from meeframe_halfspace.two_grids import _add_interpolated, _restrict

from meeframe.contact.problem import Status
from meeframe.elements import Quad4
from meeframe.fields import N_FIELDS, Array
from meeframe.laws import IsotropicCoulomb
from meeframe.material import Material, library_material, material_from_components, rotation_about
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.solvers import SemismoothNewton, StoppingCriteria, solve
from meeframe.system.capabilities import APPROXIMATE_TOLERANCE, ApproximateApply, apply_fields
from meeframe.system.edge_correction import correct_edge
from meeframe.system.reduced import ReducedSystem
from meeframe.system.rotated import rotate_frames
from meeframe.system.two_body import combine_bodies
from meeframe.testing.half_space import indentation_problem
from meeframe.testing.matrix_free import MatrixFree
from meeframe.testing.operation_counter import OperationCounter

ALL = (0, 1, 2, 3, 4)
STRAIGHT = library_material("orthotropic-mee").stiffness
TURNED = library_material("orthotropic-mee").rotated(rotation_about((1.0, 2.0, 0.5), 0.8)).stiffness
CERAMIC = library_material("pzt-4").rotated(rotation_about((1.0, 0.0, 0.3), 0.9)).stiffness
_PERMITTIVITIES = {f"{kind}_{axis}{axis}": 1e-10 for kind in ("eps", "mu") for axis in (1, 2, 3)}
_FIBRES = {"c_1111": 141e9, "c_1122": 5.6e9, "c_1133": 5.6e9, "c_2222": 12.7e9, "c_2233": 5.8e9, "c_3333": 12.7e9}
_SHEAR = {"c_2323": 3.5e9, "c_1313": 5e9, "c_1212": 5e9}
FIBRES = material_from_components(
    "carbon fibres along x1 in epoxy", {**_FIBRES, **_SHEAR, **_PERMITTIVITIES}, "orthotropic"
).stiffness
MEDIA = {"turned": TURNED, "straight": STRAIGHT, "ceramic": CERAMIC, "fibres": FIBRES}
GRIDS: list[tuple[tuple[int, int], tuple[float, float], Shape]] = [
    ((160, 160), (1.0, 1.0), "bilinear"),
    ((131, 257), (1.0, 1.0), "constant"),
    ((180, 163), (0.8, 1.0), "bilinear"),
    ((70, 400), (1.0, 1.0), "bilinear"),
    ((400, 70), (1.0, 1.0), "constant"),
    ((1000, 80), (1.0, 1.0), "bilinear"),
]
OBLONG: list[tuple[tuple[int, int], tuple[float, float], Shape]] = [
    ((200, 400), (3.0, 1.0), "bilinear"),
    ((400, 200), (1.0, 3.0), "constant"),
]
CHOICES = [((2,), (2,)), ((0,), ALL), ((4, 2), (0, 2, 3)), ((3, 4), (4, 3, 2))]
SINGLE = {np.dtype(np.float32)}
WIDTH = 1e-2


@lru_cache(maxsize=1)
def made(medium: str, size: tuple[int, int], spacing: tuple[float, float], shape: Shape) -> Convolution:
    return convolution_of(FreeGrid(PointResponse.of(MEDIA[medium], np.eye(3)), spacing, size, shape))


def loads_on(size: tuple[int, int]) -> dict[str, Array]:
    """Loads (5, nx, ny) of size one."""
    x, y = np.meshgrid(*(np.linspace(-1.0, 1.0, n) for n in size), indexing="ij")
    rows, columns = np.indices(size)
    ring = (np.minimum(rows, columns) < 2) | (np.minimum(size[0] - 1 - rows, size[1] - 1 - columns) < 2)
    node, corners, noise = np.zeros(size), np.zeros(size), np.random.default_rng(0)
    node[size[0] // 3, size[1] // 2] = 1.0
    corners[0, 0], corners[-1, -1] = 1.0, -1.0
    same = {
        "Hertz": np.sqrt(np.maximum(1.0 - (x**2 + y**2) / 0.5, 0.0)),
        "node": node,
        "corners": corners,
        "ring": ring.astype(float),
        "checkered": (-1.0) ** (rows + columns),
        "waves": np.cos(np.pi * rows / 4.0) * np.cos(np.pi * columns / 5.0),
    }
    found = {name: np.tile(load, (N_FIELDS, 1, 1)) for name, load in same.items()}
    return {**found, "noise": noise.standard_normal((N_FIELDS, *size)), "pressures": noise.random((N_FIELDS, *size))}


def scaled(whole: Convolution, load: Array) -> Array:
    """The load (5, nx, ny) in units that cause responses of the same size in all fields."""
    return load / np.sqrt(np.abs(np.diag(whole.scale)))[:, None, None]


def error(whole: Convolution, load: Array, loaded: Sequence[int] = ALL, fields: Sequence[int] = ALL) -> float:
    """The worst rough response in parts of the largest in its field. Fields that do not answer must not."""
    assert whole.approximate is not None
    load = scaled(whole, load)[list(loaded)]
    exact, rough = whole.response(load, loaded, fields), whole.approximate.response(load, loaded, fields)
    assert rough.dtype == np.float32
    assert rough.shape == exact.shape
    largest, off = np.abs(exact).max(axis=(1, 2)), np.abs(rough - exact).max(axis=(1, 2))
    assert not off[largest == 0.0].any()
    return float((off[largest > 0.0] / largest[largest > 0.0]).max())


def worst(whole: Convolution, size: tuple[int, int]) -> float:
    """The largest error of all loads."""
    return max(error(whole, load) for load in loads_on(size).values())


@pytest.mark.full(except_for=2)
@pytest.mark.parametrize("grid", GRIDS, ids=str)
@pytest.mark.parametrize("medium", ["turned", "straight", "ceramic"])
def test_responses_to_all_fields_at_once(medium, grid) -> None:
    assert worst(made(medium, *grid), grid[0]) < APPROXIMATE_TOLERANCE


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize("grid", OBLONG, ids=str)
@pytest.mark.parametrize("medium", ["turned", "straight"])
def test_responses_on_oblong_cells(medium, grid) -> None:
    whole = made(medium, *grid)
    for load in loads_on(grid[0]).values():
        assert error(whole, load) < APPROXIMATE_TOLERANCE
        assert error(whole, load, (0,), ALL) < APPROXIMATE_TOLERANCE


@pytest.mark.full
def test_responses_of_a_medium_much_stiffer_along_one_axis() -> None:
    """They are sharp, so that what is near reaches farther: on small grids there is no room for it."""
    assert made("fibres", *GRIDS[0]).approximate is None
    whole = made("fibres", (500, 540), (1.0, 1.0), "bilinear")
    assert worst(whole, (500, 540)) < APPROXIMATE_TOLERANCE


@pytest.mark.parametrize("spacing", [(1.0, 1.0), (1e-6, 3e-6), (2.0, 1.0)])
@pytest.mark.parametrize("medium", ["turned", "straight", "ceramic"])
def test_smooth_responses_are_near_within_some_of_the_wider_spacings(medium, spacing) -> None:
    response = PointResponse.of(MEDIA[medium], np.eye(3))
    assert MIN_CUTOFF <= cutoff_radius(response, spacing, np.inf) / max(spacing) < 1.2 * MIN_CUTOFF


@pytest.mark.full(except_for=1)
@pytest.mark.parametrize(("along", "across"), [(1.0, 1.0), (1.0, 2.0), (3.0, 1.0)])
def test_sharp_responses_are_near_farther_out(along, across) -> None:
    """By as much whichever axis they are sharp across, and the less, the closer nodes are there."""
    response, turned_by = (
        PointResponse.of(FIBRES, np.eye(3)),
        np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    )
    found = cutoff_radius(response, (along, across), np.inf)
    assert found > 1.5 * MIN_CUTOFF * across
    assert cutoff_radius(PointResponse.of(FIBRES, turned_by), (across, along), np.inf) == pytest.approx(found, rel=1e-6)
    assert cutoff_radius(response, (along, 0.5 * across), np.inf) < found
    assert cutoff_radius(response, (1e-6 * along, 1e-6 * across), np.inf) == pytest.approx(1e-6 * found, rel=1e-6)
    assert 70.0 * across < cutoff_radius(response, (along, across), 70.0 * across) < found  # there is no room for it


@pytest.mark.parametrize(("loaded", "fields"), CHOICES)
@pytest.mark.parametrize("medium", ["turned", "straight"])
def test_responses_to_some_fields(medium, loaded, fields) -> None:
    """Weak couplings too are right to a few digits of themselves."""
    whole = made(medium, *GRIDS[0])
    for load in loads_on(GRIDS[0][0]).values():
        assert error(whole, load, loaded, fields) < APPROXIMATE_TOLERANCE


def test_fields_that_are_not_coupled_do_not_answer() -> None:
    isotropic = PointResponse.of(Material.isotropic(2e11, 0.3).stiffness, np.eye(3))
    whole = convolution_of(FreeGrid(isotropic, (1.0, 1.0), (160, 150), "constant"))
    load = loads_on((160, 150))["noise"]
    assert whole.approximate is not None
    rough = whole.approximate.response(scaled(whole, load)[3:4], (3,), ALL)
    assert not rough[[0, 1, 2, 4]].any()
    assert error(whole, load, (3,), (3,)) < APPROXIMATE_TOLERANCE


def test_responses_are_linear_and_reciprocal() -> None:
    """But for single precision: far more exactly than they are right."""
    whole = made("turned", *GRIDS[0])
    rough = whole.approximate
    assert rough is not None
    loads = loads_on(GRIDS[0][0])
    one, other = scaled(whole, loads["noise"]), scaled(whole, loads["pressures"][::-1] - 0.4)
    answers = [rough.response(load, ALL, ALL).astype(float) for load in (one, other, 3.0 * one - 0.5 * other)]
    expected = 3.0 * answers[0] - 0.5 * answers[1]
    largest = np.abs(expected).max(axis=(1, 2))
    assert (np.abs(answers[2] - expected).max(axis=(1, 2)) < 2e-6 * largest).all()
    signed = potential_signs(N_FIELDS)[:, None, None]  # with them the compliance is symmetric
    works = [float((signed * load * answer).sum()) for load, answer in ((other, answers[0]), (one, answers[1]))]
    most = sum(float(np.linalg.norm(other[k]) * np.linalg.norm(answers[0][k])) for k in range(N_FIELDS))
    assert abs(works[0] - works[1]) < 1e-6 * most
    exact = float((signed * other * whole.response(one, ALL, ALL)).sum())
    assert abs(works[0] - exact) < APPROXIMATE_TOLERANCE * most


def test_threads_that_share_a_convolution_find_the_same() -> None:
    grid = FreeGrid(PointResponse.of(TURNED, np.eye(3)), (1.0, 1.0), (160, 140), "bilinear")
    whole, fresh = convolution_of(grid), convolution_of(grid).approximate
    load = scaled(whole, loads_on((160, 140))["noise"])
    assert whole.approximate is not None
    assert fresh is not None
    expected = whole.approximate.response(load, ALL, ALL)
    with ThreadPoolExecutor(2) as pool:
        for found in pool.map(lambda _: fresh.response(load, ALL, ALL), range(2)):
            np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("size", [(40, 40), (120, 90), (1000, 20), (20, 1000)])
def test_small_and_narrow_grids_have_none(size) -> None:
    """Zeros around the near part would be as many as they are without it."""
    assert made("straight", size, (1.0, 1.0), "bilinear").approximate is None


def test_periodic_grids_have_none() -> None:
    response = PointResponse.of(STRAIGHT, np.eye(3))
    assert convolution_of(PeriodicGrid(response, (1.0, 1.0), (300, 300), "constant")).approximate is None


# Between the grids


@pytest.mark.full(except_for=4)
@pytest.mark.parametrize("count", [*range(1, 14), 40, 41, 42, 43])
def test_interpolation_is_exact_of_the_fifth_degree(count) -> None:
    nodes, places = np.arange(count), RATIO * (np.arange(coarse_count(count)) - N_BEFORE)
    middle, half = places.mean(), np.ptp(places) / 2.0
    for degree in range(7):
        found = np.zeros((count, 1))
        add_interpolated((((places - middle) / half) ** degree)[:, None], WEIGHTS, found)
        off = np.abs(found[:, 0] - ((nodes - middle) / half) ** degree).max()
        assert off < 3e-7 if degree < 6 or count == 1 else off > 3e-7


def test_as_many_coarse_nodes_count_on_either_side() -> None:
    """Mirrored about the middle between two of them; a node of the coarse grid is itself."""
    for step in range(1, RATIO):
        np.testing.assert_allclose(WEIGHTS[step], WEIGHTS[RATIO - step, ::-1], rtol=1e-6)
    np.testing.assert_array_equal(WEIGHTS[0], np.arange(WEIGHTS.shape[1]) == N_BEFORE)


def test_interpolation_along_both_axes() -> None:
    size = 33, 58
    x, y = (RATIO * (np.arange(coarse_count(n)) - N_BEFORE) / n for n in size)
    i, j = (np.arange(n) / n for n in size)
    fine = np.ones((2, *size))
    _add_interpolated(np.array([np.outer(x**5, y**4), np.outer(x, y**5 - y)]), fine)
    exact = 1.0 + np.array([np.outer(i**5, j**4), np.outer(i, j**5 - j)])
    assert np.abs(fine - exact).max() < 1e-6


@pytest.mark.parametrize("size", [(33, 58), (48, 31)])
def test_gathering_is_the_transpose_of_interpolation(size) -> None:
    random = np.random.default_rng(0)
    coarse = random.standard_normal((2, *(coarse_count(n) for n in size)))
    fine, between = random.standard_normal((2, *size)), np.zeros((2, *size))
    _add_interpolated(coarse, between)
    gathered = _restrict(fine)
    assert gathered.shape == coarse.shape
    assert (gathered * coarse).sum() == pytest.approx((fine * between).sum(), rel=1e-12)


def test_gathering_adds() -> None:
    fine, coarse = np.ones((9, 3)), np.full((coarse_count(9), 3), 2.0)
    add_restricted(fine, WEIGHTS, coarse)
    assert (coarse - 2.0).sum() == pytest.approx(fine.sum(), rel=1e-6)  # weights of a node add up to one


@pytest.mark.full(except_for=3)
@pytest.mark.parametrize("shape", ["bilinear", "constant"])
@pytest.mark.parametrize("spacing", [(1.0, 1.0), (0.4, 1.0)])
def test_far_responses_at_every_fourth_offset(shape, spacing) -> None:
    """To fourth order in one over the distance, of all entries."""
    response = PointResponse.of(TURNED, np.eye(3))
    size = tuple(int(160.0 / (RATIO * h)) for h in spacing)
    places = [RATIO * h * np.arange(n) for h, n in zip(spacing, size, strict=True)]
    distance = np.hypot(*np.meshgrid(*places, indexing="ij"))
    errors = []
    for low, high in ((60.0, 75.0), (120.0, 150.0)):
        ring = (distance > low) & (distance < high)
        off = []
        for number in range(25):
            fine = far_table(response, spacing, shape, tuple(RATIO * n for n in size), number)  # type: ignore[arg-type]
            hopped = far_table(response, spacing, shape, size, number, RATIO)
            exact = fine[::RATIO, RATIO * size[1] - 1 :: RATIO]
            off.append(np.abs(hopped[:, size[1] - 1 :] - exact)[ring].max() / np.abs(exact[ring]).max())
        errors.append(max(off))
    assert errors[0] < 1e-5
    assert 12.0 < errors[0] / errors[1] < 20.0


# Of systems


def system_of(nodes: tuple[int, int], stiffness: Array = TURNED, **options) -> HalfSpaceSystem:
    width = WIDTH, WIDTH * (nodes[1] - 1) / (nodes[0] - 1)
    mesh = half_space_mesh(10.0 * max(width), width, (nodes[0] - 1, nodes[1] - 1), 1, Quad4())
    system = HalfSpace(matrix_up_to=0, **options).reduce(Body(stiffness, mesh, (), "contact"))
    assert isinstance(system, HalfSpaceSystem)
    return system


def random_load(system: ReducedSystem) -> Array:
    own = np.abs(system.diagonal_blocks()[len(system.points) // 2])
    return np.random.default_rng(3).normal(size=system.offset.shape) / np.sqrt(np.diag(own))


def check_rough(system: ReducedSystem) -> None:
    """Approximate products against exact ones, of loads in both precisions."""
    capability, load = system.capability(ApproximateApply), random_load(system)
    assert capability is not None
    rough = capability.approximate_apply
    for loaded, fields in ((ALL, ALL), *CHOICES):
        part = load[:, list(loaded)]
        expected = apply_fields(system, part, loaded, fields)
        for given in (part, part.astype(np.float32)):
            found = rough(given, loaded, fields)
            assert found.shape == expected.shape
            assert (np.abs(found - expected).max(axis=0) < APPROXIMATE_TOLERANCE * np.abs(expected).max(axis=0)).all()


@pytest.fixture(scope="module")
def body() -> HalfSpaceSystem:
    return system_of((150, 143))


def test_of_a_half_space(body) -> None:
    """With shares of nodes on the border, in whatever order nodes are."""
    check_rough(body)


@pytest.mark.parametrize("options", [{"periodic": True}, {"periodic": True, "density": "trigonometric"}])
def test_of_a_periodic_half_space(options) -> None:
    assert system_of((150, 150), **options).capability(ApproximateApply) is None


def test_rotated_frames(body) -> None:
    angle = np.arctan2(*body.points[:, :2].T) + 0.3
    check_rough(rotate_frames(body, np.array([np.cos(angle), np.sin(angle), 0.0 * angle]).T))
    assert (
        rotate_frames(MatrixFree.of(body), np.tile([1.0, 1.0, 0.0], (len(angle), 1))).capability(ApproximateApply)
        is None
    )


def test_of_edges_between_nodes(body) -> None:
    some = np.random.default_rng(0).random(len(body.points)) < 0.05
    own = 20.0 * some[:, None, None] * body.diagonal_blocks() * (1.0 + np.eye(N_FIELDS))
    check_rough(correct_edge(body, own))
    assert correct_edge(MatrixFree.of(body), own).capability(ApproximateApply) is None


def test_of_two_bodies(body) -> None:
    other = system_of((150, 143), STRAIGHT)
    check_rough(combine_bodies(body, other))
    check_rough(combine_bodies(MatrixFree.of(other), body))
    check_rough(combine_bodies(other, MatrixFree.of(body)))
    check_rough(
        correct_edge(
            rotate_frames(combine_bodies(body, other), np.tile([1.0, 2.0, 0.0], (len(body.points), 1))),
            body.diagonal_blocks(),
        )
    )
    assert combine_bodies(MatrixFree.of(body), MatrixFree.of(other)).capability(ApproximateApply) is None
    askew = rotate_frames(other, np.tile([1.0, 1.0, 0.0], (len(body.points), 1)))
    check_rough(combine_bodies(body, askew))


def test_counted(body) -> None:
    counted = OperationCounter.of(body)
    rough = counted.capability(ApproximateApply).approximate_apply
    before = len(counted.products)
    load = random_load(body)
    np.testing.assert_array_equal(rough(load, ALL, (2,)), body.approximate_apply(load, ALL, (2,)))
    assert len(counted.products) == before + 1
    assert replace(counted, accelerated=False).capability(ApproximateApply) is None


def test_a_pickled_system_answers_as_before() -> None:
    system = system_of((150, 143))
    load = random_load(system)
    answer = system.approximate_apply(load, ALL, ALL)
    for again in (pickle.loads(pickle.dumps(system)), pickle.loads(pickle.dumps(system_of((150, 143))))):
        np.testing.assert_array_equal(again.approximate_apply(load, ALL, ALL), answer)


def test_newton_finds_the_same_with_and_without() -> None:
    """Friction under a drag, contact over much of the zone. The residual is in double precision either way."""
    loads = []
    for accelerated in (True, False):
        whole = system_of((160, 160), Material.isotropic(200e9, 0.3).stiffness)
        assert whole.capability(ApproximateApply) is whole
        system = OperationCounter.of(whole, accelerated)
        x, y, _ = (system.points - system.points.mean(axis=0)).T
        radius = 0.1
        approach = (0.4 * WIDTH) ** 2 / radius
        problem = indentation_problem(
            system, (x**2 + y**2) / (2.0 * radius), approach, IsotropicCoulomb(0.3), translation=(0.15 * approach, 0.0)
        )
        solution = solve(problem, SemismoothNewton(), StoppingCriteria(tolerance=1e-10))
        assert solution.status is Status.CONVERGED
        loads.append(solution.state.load)
    assert np.abs(loads[0] - loads[1]).max() < 1e-7 * np.abs(loads[1]).max(axis=0)[[0, 2]].min()
