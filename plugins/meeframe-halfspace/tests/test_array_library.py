"""Test products by other libraries of arrays against those of numpy: with numpy itself in their place, and on a GPU."""

import pickle
import sys
from dataclasses import replace

import numpy as np
import pytest
from meeframe_halfspace import HalfSpace
from meeframe_halfspace.array_library import MIN_PADDED_NODES, ArrayLibrary, gpu_library
from meeframe_halfspace.convolution import Convolution
from meeframe_halfspace.grid_response import FreeGrid, GridResponse, PeriodicGrid
from meeframe_halfspace.inverse import wave_inverse
from meeframe_halfspace.response import PointResponse
from meeframe_halfspace.system import HalfSpaceSystem, convolution_of

from meeframe.elements import Quad4
from meeframe.laws import IsotropicCoulomb
from meeframe.material import library_material, rotation_about
from meeframe.mesh import half_space_mesh
from meeframe.mesh.body import Body
from meeframe.plugin import Array, CaseError
from meeframe.solvers import SemismoothNewton, StoppingCriteria, solve
from meeframe.testing.half_space import indentation_problem

MATERIAL = library_material("orthotropic-mee")
STIFFNESSES = {
    "turned": MATERIAL.rotated(rotation_about((1.0, 2.0, 0.5), 0.8)).stiffness,
    "mirrored": MATERIAL.stiffness,
}
SPACING = (1.0, 0.8)
ALL = (0, 1, 2, 3, 4)


@pytest.fixture(params=["numpy", "cupy"])
def library(request: pytest.FixtureRequest) -> ArrayLibrary:
    if request.param == "numpy":
        return ArrayLibrary("numpy", "scipy.fft")
    try:
        return gpu_library()
    except CaseError as error:
        pytest.skip(str(error))


def convolution(medium: str, kind: str, odd: bool = False) -> Convolution:
    """Return a convolution on a grid of more padded nodes than a library needs."""
    response = PointResponse.of(STIFFNESSES[medium], np.eye(3))
    if kind == "periodic":
        size = (375, 385) if odd else (384, 360)
        grid: GridResponse = PeriodicGrid(response, SPACING, size, "constant")
    else:
        grid = FreeGrid(response, SPACING, (179, 185) if odd else (180, 200), "bilinear")
    made = convolution_of(grid)
    assert np.prod(made.padded) >= MIN_PADDED_NODES
    return made


def compare(
    made: Convolution, library: ArrayLibrary, load: Array, loaded: tuple[int, ...], fields: tuple[int, ...]
) -> None:
    expected = made.response(load, loaded, fields)
    check_close(replace(made, library=library).response(load, loaded, fields), expected)


def check_close(computed: Array, expected: Array) -> None:
    assert computed.dtype == expected.dtype
    size = np.abs(expected).max(axis=(1, 2), keepdims=True)
    assert np.all(np.abs(computed - expected) <= 30.0 * np.finfo(expected.dtype).eps * size)


@pytest.mark.full(except_for=4)
@pytest.mark.parametrize("precision", [np.float64, np.float32])
@pytest.mark.parametrize("medium", STIFFNESSES)
@pytest.mark.parametrize(("kind", "odd"), [("free", False), ("periodic", False), ("periodic", True)])
def test_products_match_those_of_numpy(library, kind, odd, medium, precision) -> None:
    made = convolution(medium, kind, odd)
    load = np.random.default_rng(1).normal(size=(5, *made.size)).astype(precision)
    compare(made, library, load, ALL, ALL)
    compare(made, library, load[[2]], (2,), (2,))
    compare(made, library, load[[4, 2]], (4, 2), (0, 2, 3))


@pytest.mark.parametrize("kind", ["free", "periodic"])
def test_inverses_match_those_of_numpy(library, kind) -> None:
    made = convolution("mirrored", kind)
    load = np.random.default_rng(2).normal(size=(3, *made.size)).astype(np.float32)
    compare(wave_inverse(made, (0, 1, 2)), library, load, (0, 1, 2), (0, 1, 2))


def test_entries_computed_later_reach_the_library(library) -> None:
    made = replace(convolution("mirrored", "free"), library=library)
    load = np.random.default_rng(3).normal(size=(5, *made.size))
    alone = made.response(load[[2]], [2], [2])
    check_close(made.response(load, ALL, ALL), convolution("mirrored", "free").response(load, ALL, ALL))
    np.testing.assert_array_equal(made.response(load[[2]], [2], [2]), alone)


def test_convolutions_can_be_pickled(library) -> None:
    made = replace(convolution("mirrored", "free"), library=library)
    load = np.random.default_rng(4).normal(size=(1, *made.size))
    expected = made.response(load, [2], [2])
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(made)).response(load, [2], [2]), expected)


@pytest.mark.full
def test_solutions_match_those_of_numpy(library) -> None:
    """A conducting sphere with friction, solved on nested grids, subgrids and with approximate inverses."""
    n, period = 200, 7e-3
    mesh = half_space_mesh(10.0 * period, period, n - 1, 1, Quad4())
    system = HalfSpace(matrix_up_to=0).reduce(Body(MATERIAL.stiffness, mesh, (), "contact"))
    assert isinstance(system, HalfSpaceSystem)
    height = (system.points[:, :2] ** 2).sum(axis=1) / 0.2
    loads = []
    for each in (system, replace(system, convolution=replace(system.convolution, library=library))):
        problem = indentation_problem(each, height, 2e-5, IsotropicCoulomb(0.3), (1e-3, 1e-3), (5.0, 1.0))
        solution = solve(problem, SemismoothNewton(), StoppingCriteria(tolerance=1e-10))
        assert solution.status == "converged"
        loads.append(solution.state.load)
    assert np.all(np.abs(loads[1] - loads[0]).max(axis=0) <= 1e-8 * np.abs(loads[0]).max(axis=0))


def test_a_device_that_is_not_there_is_refused(monkeypatch) -> None:
    gpu_library.cache_clear()
    monkeypatch.setitem(sys.modules, "cupy", None)
    body = Body(MATERIAL.stiffness, half_space_mesh(1.0, 0.1, 4, 1, Quad4()), (), "contact")
    with pytest.raises(CaseError, match=r"device = 'gpu' needs CuPy.*allowed: 'cpu'"):
        HalfSpace(device="gpu").check(body)
    gpu_library.cache_clear()
