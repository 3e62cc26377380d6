"""Test products on a grid against sums over its nodes, for all sizes, fields, precisions and numbers of threads."""

import pickle
from dataclasses import replace

import numba
import numpy as np
import pytest
from meeframe_halfspace.cells import cell_table
from meeframe_halfspace.convolution import Convolution, Symbol
from meeframe_halfspace.entries import entries_to_matrix
from meeframe_halfspace.grid_response import FreeGrid, GridResponse, PeriodicGrid, full_entry, mean_length
from meeframe_halfspace.inverse import wave_inverse
from meeframe_halfspace.response import PointResponse, scaled_compliance

from meeframe.fields import N_FIELDS, Array
from meeframe.material import Material, library_material, rotation_about
from meeframe.testing.elastic_half_space import cell_response

TURNED = library_material("orthotropic-mee").rotated(rotation_about((1.0, 2.0, 0.5), 0.8)).stiffness
RESPONSE = PointResponse.of(TURNED, np.eye(3))
STRAIGHT = PointResponse.of(library_material("orthotropic-mee").stiffness, np.eye(3))
SPACING = (1.0, 0.8)
SIZES = [(9, 14), (16, 7), (5, 5), (12, 6)]
ALL = (0, 1, 2, 3, 4)
CHOICES = [((2,), (2,)), (ALL, ALL), ((4, 2), (0, 2, 3)), ((1,), (4, 0, 1, 2)), ((3, 4), (4, 3))]


def convolution_of(grid: GridResponse) -> Convolution:
    return Convolution(
        Symbol(grid.symbol, grid.response.numbers, grid.response.parities),
        grid.size,
        grid.padded,
        np.ones((N_FIELDS, N_FIELDS)),
    )


def free(size: tuple[int, int], response: PointResponse = RESPONSE) -> tuple[Convolution, Array]:
    """Return a convolution on a free grid, and the response (2 nx - 1, 2 ny - 1, 5, 5) to a load by offset, most
    negative first."""
    ahead = entries_to_matrix(np.moveaxis(cell_table(response, SPACING, "bilinear", size), 0, -1))
    behind = ahead[:0:-1, ::-1].swapaxes(2, 3)  # reciprocity
    return convolution_of(FreeGrid(response, SPACING, size, "bilinear")), np.concatenate([behind, ahead])


def mirrored(size: tuple[int, int]) -> tuple[Convolution, Array]:
    """Return the same for a medium whose symmetry planes are aligned with the grid: entries are even or odd."""
    return free(size, STRAIGHT)


def periodic(size: tuple[int, int]) -> tuple[Convolution, Array]:
    """Return the same for a periodic surface, wave by wave; the highest wave of an even count is
    split in two halves."""
    kernel = np.zeros((2 * size[0] - 1, 2 * size[1] - 1, N_FIELDS, N_FIELDS))
    waves, shares = [], []
    for n in size:
        number = np.arange(-(n // 2), n // 2 + 1)
        waves.append(2.0 * np.pi * number / n)
        shares.append(np.where(2 * np.abs(number) == n, 0.5, 1.0))
    offsets = [np.arange(1 - n, n) for n in size]
    for p, share_p in zip(waves[0], shares[0], strict=True):
        for q, share_q in zip(waves[1], shares[1], strict=True):
            if p == q == 0.0:
                circle = np.linspace(0.0, 2.0 * np.pi, 128, endpoint=False)
                kernel += mean_length(size, SPACING) * scaled_compliance(TURNED, np.eye(3), circle).mean(axis=0).real
                continue
            k = p / SPACING[0], q / SPACING[1]
            y = scaled_compliance(TURNED, np.eye(3), np.array([np.arctan2(k[1], k[0])]))[0] / np.hypot(*k)
            window = share_p * share_q * np.sinc(p / (2.0 * np.pi)) * np.sinc(q / (2.0 * np.pi))
            wave = np.exp(1j * np.add.outer(p * offsets[0], q * offsets[1]))
            kernel += window * (wave[:, :, None, None] * y).real
    return convolution_of(PeriodicGrid(RESPONSE, SPACING, size, "constant")), kernel / (size[0] * size[1])


def sum_over_loads(kernel: Array, load: Array, loaded: tuple[int, ...], fields: tuple[int, ...]) -> Array:
    """Return the response (k, nx, ny) as a sum over loaded nodes."""
    _, nx, ny = load.shape
    chosen = kernel[:, :, fields][:, :, :, loaded]
    computed = np.zeros((len(fields), nx, ny))
    for i in range(nx):
        for j in range(ny):
            near = chosen[nx - 1 - i : 2 * nx - 1 - i, ny - 1 - j : 2 * ny - 1 - j]
            computed += np.moveaxis(near @ load[:, i, j], -1, 0)
    return computed


@pytest.mark.full(except_for=6)
@pytest.mark.parametrize("kind", [free, mirrored, periodic])
@pytest.mark.parametrize("size", SIZES)
def test_products_are_sums_over_nodes(kind, size) -> None:
    """A convolution computes entries when they are first needed; odd and even sizes are tested."""
    made, kernel = kind(size)
    for loaded, fields in (*CHOICES, CHOICES[0]):
        load = np.random.default_rng(1).normal(size=(len(loaded), *size))
        expected = sum_over_loads(kernel, load, loaded, fields)
        scale = np.abs(expected).max()  # in scaled fields, where couplings may be small
        computed = made.response(load, loaded, fields)
        assert np.abs(computed - expected).max() < 1e-13 * scale
        single = made.response(load.astype(np.float32), loaded, fields)
        assert single.dtype == np.float32
        assert 1e-9 * scale < np.abs(single - expected).max() < 1e-6 * scale


def test_single_precision_before_double() -> None:
    """Data cached for one precision do not affect the other."""
    made, kernel = free((9, 14))
    load = np.random.default_rng(2).normal(size=(5, 9, 14))
    made.response(load.astype(np.float32), ALL, ALL)
    expected = sum_over_loads(kernel, load, ALL, ALL)
    assert np.abs(made.response(load, ALL, ALL) - expected).max() < 1e-12 * np.abs(expected).max()


def test_reused_memory_does_not_change_results() -> None:
    """Results stay valid after products of other sizes and precisions."""
    made, kernel = free((9, 14))
    load = np.random.default_rng(7).normal(size=(5, 9, 14))
    expected = sum_over_loads(kernel, load, ALL, ALL)
    first = made.response(load, ALL, ALL)
    larger, _ = free((16, 15))
    larger.response(np.ones((5, 16, 15)), ALL, ALL)
    made.response(load[:2].astype(np.float32), (0, 1), ALL)
    for computed in (first, made.response(load, ALL, ALL)):
        assert np.abs(computed - expected).max() < 1e-12 * np.abs(expected).max()


def test_uncoupled_fields_have_no_response() -> None:
    """Charges on an isotropic medium cause no displacement, in products of several fields and of one."""
    response = PointResponse.of(Material.isotropic(2e11, 0.3).stiffness, np.eye(3))
    made = convolution_of(FreeGrid(response, SPACING, (8, 6), "constant"))
    load = np.random.default_rng(3).normal(size=(1, 8, 6))
    computed = made.response(load, (3,), (0, 3, 2))
    assert not computed[[0, 2]].any()
    np.testing.assert_array_equal(computed[1:2], made.response(load, (3,), (3,)))
    assert computed[1].all()
    assert made.response(load, (3,), (1, 4)).shape == (2, 8, 6)
    assert not made.response(load, (3,), (1, 4)).any()


@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_products_without_loaded_fields(precision) -> None:
    """The first product of a convolution has no loaded field, before any entry has been computed."""
    made, _ = free((8, 6))
    computed = made.response(np.empty((0, 8, 6), precision), (), (2, 0))
    assert (computed.shape, computed.dtype) == ((2, 8, 6), precision)
    assert not computed.any()
    assert not made.response(np.zeros((1, 8, 6), precision), (1,), (2, 0)).any()


def test_wrong_number_of_loads_is_rejected() -> None:
    made, _ = free((5, 5))
    for count in (0, 1, 3):
        with pytest.raises(ValueError, match=rf"loads of {count} fields are given for the 2 fields \[2, 4\]"):
            made.response(np.ones((count, 5, 5)), [2, 4], [0])


def test_repeated_fields() -> None:
    """Loads of a repeated field add up; a repeated field is returned as often as it is requested."""
    made, kernel = free((9, 14))
    load = np.random.default_rng(4).normal(size=(3, 9, 14))
    expected = sum_over_loads(kernel, load, (1, 4, 1), (2, 0, 2))
    assert np.abs(made.response(load, (1, 4, 1), (2, 0, 2)) - expected).max() < 1e-12 * np.abs(expected).max()


def test_change_of_scale_after_products() -> None:
    made, _ = free((9, 14))
    load = np.random.default_rng(5).normal(size=(5, 9, 14))
    before = made.response(load, ALL, ALL)
    scale = np.arange(1.0, 6.0)[:, None] * np.ones(5)
    after = replace(made, scale=scale).response(load, ALL, ALL)
    np.testing.assert_allclose(after, before * np.arange(1.0, 6.0)[:, None, None], rtol=1e-12)


def test_pickled_convolution_recomputes_entries() -> None:
    made, _ = free((9, 14))
    load = np.random.default_rng(6).normal(size=(5, 9, 14))
    expected = made.response(load, ALL, ALL)
    again = pickle.loads(pickle.dumps(made))
    assert not again.symbol.entries(())[1]
    np.testing.assert_array_equal(again.response(load, ALL, ALL), expected)


def without_symmetry(made: Convolution) -> Convolution:
    """Return the same convolution, with all entries of its symbol stored explicitly."""
    symbol, parities = made.symbol, made.symbol.parities
    assert parities is not None
    halves, positions = symbol.entries(symbol.numbers)
    assert halves.shape[2] == made.padded[1] // 2 + 1
    entries = [full_entry(halves[positions[number]], parities[number], made.padded[1]) for number in symbol.numbers]
    return replace(made, symbol=Symbol.of(np.array(entries), symbol.numbers, None))


@pytest.mark.full(except_for=4)
@pytest.mark.parametrize("precision", [np.float64, np.float32])
@pytest.mark.parametrize(("loaded", "fields"), CHOICES)
@pytest.mark.parametrize("size", SIZES)
def test_half_symbol_matches_full_symbol(size, loaded, fields, precision) -> None:
    load = np.random.default_rng(7).normal(size=(len(loaded), *size)).astype(precision)
    for made in (mirrored(size)[0], convolution_of(PeriodicGrid(STRAIGHT, SPACING, size, "bilinear"))):
        expected = without_symmetry(made).response(load, loaded, fields)
        computed = made.response(load, loaded, fields)
        assert np.abs(computed - expected).max() < 8.0 * np.finfo(precision).eps * np.abs(expected).max()


@pytest.mark.full(except_for=5)
@pytest.mark.parametrize("fields", [(2,), (4, 2), ALL])
@pytest.mark.parametrize("size", [*SIZES, (9, 15)])
def test_half_symbol_matches_full_inverse(size, fields) -> None:
    load = np.random.default_rng(9).normal(size=(len(fields), *size)).astype(np.float32)
    for made in (mirrored(size)[0], convolution_of(PeriodicGrid(STRAIGHT, SPACING, size, "bilinear"))):
        computed, expected = (
            wave_inverse(each, fields).response(load, fields, fields) for each in (made, without_symmetry(made))
        )
        assert np.abs(computed - expected).max() < 1e-6 * np.abs(expected).max()


@pytest.mark.parametrize("response", [RESPONSE, STRAIGHT], ids=["turned", "mirrored"])
def test_entries_are_computed_one_by_one(response) -> None:
    """Products that were created earlier keep their entries."""
    size = 9, 14
    made, at_once = (free(size, response)[0] for _ in range(2))
    load = np.random.default_rng(8).normal(size=(5, *size))
    for fields in ([2], [0, 2], list(ALL), [2]):
        before = [made.response(load[[field]], [field], [field]) for field in fields]
        computed, expected = (each.response(load[fields], fields, ALL) for each in (made, at_once))
        np.testing.assert_allclose(computed, expected, rtol=0, atol=1e-14 * np.abs(expected).max())
        for field, alone in zip(fields, before, strict=True):
            np.testing.assert_array_equal(made.response(load[[field]], [field], [field]), alone)
    entries, positions = made.symbol.entries(())
    assert sorted(positions) == response.numbers
    assert sorted(positions.values()) == list(range(len(entries)))


LONG = [(40, 3), (3, 70)]


@pytest.mark.parametrize("size", LONG)
def test_long_grids_against_boussinesq_and_cerruti(size) -> None:
    """Loads act on cells in a corner, in the middle and elsewhere, also beyond the range of near-field integration."""
    young, poisson, h = 2e11, 0.27, 1e-3
    response = PointResponse.of(Material.isotropic(young, poisson).stiffness, np.eye(3))
    made = replace(
        convolution_of(FreeGrid(response, (h, h), size, "constant")), scale=np.outer(response.factors, response.factors)
    )
    i, j = np.indices(size)
    for position in ((0, 0), (size[0] - 1, 0), (size[0] // 2, 1)):
        exact = cell_response(young, poisson, (i - position[0]) * h, (j - position[1]) * h, h / 2)
        for loaded in range(3):
            load = np.zeros((1, *size))
            load[0, *position] = 1.0
            computed = made.response(load, [loaded], [0, 1, 2])
            expected = np.moveaxis(exact[..., :3, loaded], -1, 0)
            # the closed form is a difference of numbers that grow with the distance
            assert np.abs(computed - expected).max() < 1e-13 * np.abs(expected).max()


@pytest.mark.parametrize("size", LONG)
def test_long_grids_against_integration(size) -> None:
    """Gauss rules on the quarters of the loaded cell give the response of an anisotropic medium, near and far."""
    made, (nx, ny) = convolution_of(FreeGrid(RESPONSE, SPACING, size, "bilinear")), size
    points, weights = np.polynomial.legendre.leggauss(16)
    points, weights = (1.0 + points) / 2.0, weights / 2.0
    s = np.concatenate([points - 1.0, points])  # the density is 1 - |s|, with s in spacings
    w = np.concatenate([weights, weights]) * (1.0 - np.abs(s))
    across = np.outer(w, w).ravel() * SPACING[0] * SPACING[1]
    for position in ((0, 0), (nx - 1, ny - 1)):
        load = np.zeros((1, *size))
        load[0, *position] = 1.0
        computed = np.stack([made.response(load, [field], ALL) for field in ALL], axis=-1)  # (5, nx, ny, 5)
        for node in {(nx // 5, ny // 5), (nx // 2, ny // 2), (nx - 1 - position[0], ny - 1 - position[1]), (0, ny - 1)}:
            steps = np.subtract(node, position)
            if np.abs(steps).max() < 3:
                continue
            x, y = ((step - s) * h for step, h in zip(steps, SPACING, strict=True))
            offsets = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
            scaled = RESPONSE.evaluate(offsets) / np.outer(RESPONSE.factors, RESPONSE.factors)
            expected = np.einsum("p,pij->ij", across, scaled)
            assert np.abs(computed[:, *node] - expected).max() < 1e-12 * np.abs(expected).max()


def test_results_do_not_depend_on_threads() -> None:
    """The grid is large enough for its products to be shared among threads."""
    if numba.config.NUMBA_NUM_THREADS < 2:
        pytest.skip("one thread")
    made = convolution_of(FreeGrid(RESPONSE, SPACING, (300, 250), "bilinear"))
    load = np.random.default_rng(10).normal(size=(5, 300, 250))
    before = numba.get_num_threads()
    answers = []
    for threads in (1, 2):
        numba.set_num_threads(threads)
        answers.append(made.response(load, ALL, ALL))
    numba.set_num_threads(before)
    np.testing.assert_array_equal(answers[1], answers[0])
