"""Test rough surfaces: statistics, spectra, files."""

import h5py
import numpy as np
import pytest
from meeframe_halfspace import MeasuredHeights, Scales, SelfAffine, read_height_map

import meeframe
from meeframe import topography
from meeframe.common.errors import CaseError
from meeframe.plugin.registry import Kind, load
from meeframe.testing import check_indenter

PERIOD = 2e-3
SELF_AFFINE = SelfAffine(
    PERIOD, shortest=PERIOD / 24, hurst=0.8, rms_height=1e-6, roll_off=PERIOD / 3, seed=3, samples=128
)


def spectral(surface, power):
    """Return the mean square of the gradient to a power, from the discrete transform."""
    heights = surface.surface()
    n = len(heights)
    q = 2.0 * np.pi * np.fft.fftfreq(n, surface.period / n)
    size = np.abs(np.fft.fft2(heights) / n**2) ** 2
    return float((size * np.hypot(q[:, None], q) ** power).sum()), size, np.hypot(q[:, None], q)


def test_root_mean_squares_are_exact():
    assert np.std(SELF_AFFINE.surface()) == pytest.approx(1e-6, rel=1e-12)
    steep = SelfAffine(PERIOD, PERIOD / 24, 0.8, rms_slope=0.02, seed=3, samples=128)
    assert np.sqrt(spectral(steep, 2)[0]) == pytest.approx(0.02, rel=1e-12)


def test_root_mean_squares_with_fewest_samples():
    """Round-off of the quotient 3 must not remove one of the three waves."""
    period, shortest = 0.3, 0.1  # the quotient is 2.9999999999999996
    assert int(period / shortest) == 2
    with pytest.raises(CaseError, match="at least 7"):
        SelfAffine(period, shortest, 0.8, 1e-6, samples=6)
    assert np.std(SelfAffine(period, shortest, 0.8, 1e-6, samples=7).surface()) == pytest.approx(1e-6, rel=1e-12)


def test_topography_of_the_generator_is_exact():
    """Statistics of the samples, by Parseval, are those of the waves; the spectrum is flat down to the roll-off."""
    surface = SELF_AFFINE.topography()
    np.testing.assert_array_equal(surface.heights, -SELF_AFFINE.surface())
    statistics = topography.SurfaceStatistics.of(surface)
    numbers = np.indices((49, 49)).reshape(2, -1).T - 24
    size = np.hypot(*numbers.T)
    q = 2.0 * np.pi / PERIOD * size[(size > 0) & (size <= 24 * (1 + 1e-12))]
    density = np.maximum(q / (2.0 * np.pi * 3 / PERIOD), 1.0) ** -3.6
    scale = 1e-12 / density.sum()
    assert statistics.rms_height == pytest.approx(1e-6, rel=1e-12)
    assert statistics.rms_slope_spectrum == pytest.approx(np.sqrt(scale * (q**2 * density).sum()), rel=1e-10)
    assert statistics.rms_curvature_spectrum == pytest.approx(np.sqrt(scale * (q**4 * density).sum()) / 2, rel=1e-10)
    qx, qy, spectrum = topography.power_spectrum(surface)
    long_waves = (np.hypot(qx[:, None], qy) < 2.0 * np.pi * 3.01 / PERIOD) & (spectrum > 0.0)
    np.testing.assert_allclose(spectrum[long_waves], scale * PERIOD**2, rtol=1e-9)
    steep = SelfAffine(PERIOD, PERIOD / 24, 0.8, rms_slope=0.02, seed=3, samples=128).topography()
    assert topography.SurfaceStatistics.of(steep).rms_slope_spectrum == pytest.approx(0.02, rel=1e-11)


def test_preparation_of_measured_maps(tmp_path):
    """Trends, outliers and missing heights of a file are treated before the surface becomes an indenter."""
    x = y = 1e-6 * (np.arange(24) - 11.5)
    waves = 1e-8 * np.sin(4e5 * x)[:, None] * np.cos(5e5 * y)
    bent = waves + 2e3 * x[:, None] ** 2 - 0.01 * y
    bent[5, 6] = 1e-3
    bent[12, 3] = np.nan
    np.save(tmp_path / "map.npy", bent.T)
    keys = {"spacing": (1e-6, 1e-6), "outliers": 30.0}
    with pytest.raises(CaseError, match=r"map.npy: 2 of 576 heights are missing"):
        MeasuredHeights(tmp_path / "map.npy", **keys).topography()
    indenter = MeasuredHeights(tmp_path / "map.npy", **keys, missing="harmonic", levelled="quadratic")
    surface = indenter.topography()
    expected = topography.detrend(topography.HeightMap(x, y, waves), "quadratic").heights
    np.testing.assert_allclose(surface.heights, expected, atol=2e-9)
    gap = indenter.height(*(grid.ravel() for grid in np.meshgrid(x, y, indexing="ij")))
    np.testing.assert_allclose(gap, surface.heights.max() - surface.heights.ravel(), atol=1e-20)
    down = MeasuredHeights(tmp_path / "map.npy", **keys, missing="nearest", levelled=True, facing="down")
    assert np.isfinite(down.topography().heights).all()


def test_spectrum_with_roll_off_and_cut_off():
    _, size, q = spectral(SELF_AFFINE, 0)
    knee, end = 2.0 * np.pi * 3 / PERIOD, 2.0 * np.pi * 24 / PERIOD
    flat, falling = size[(q > 0) & (q <= knee)], (q > knee * 1.0001) & (q < end * 0.9999)
    np.testing.assert_allclose(flat, flat[0], rtol=1e-9)
    slope = np.polyfit(np.log(q[falling]), np.log(size[falling]), 1)[0]
    assert slope == pytest.approx(-2.0 * (1.0 + 0.8), abs=1e-9)
    assert size[q > end * 1.0001].max() < 1e-25 * flat[0]


def test_surface_does_not_depend_on_samples():
    fine = SelfAffine(PERIOD, PERIOD / 24, 0.8, 1e-6, roll_off=PERIOD / 3, seed=3, samples=384)
    # with three times as many samples, each coarse sample is the middle of three
    np.testing.assert_allclose(fine.surface()[1::3, 1::3], SELF_AFFINE.surface(), atol=1e-18)


def test_shorter_cut_off_preserves_long_waves():
    other = SelfAffine(PERIOD, PERIOD / 40, 0.8, 1e-6, roll_off=PERIOD / 3, seed=3, samples=128)
    first, second = (np.fft.fft2(s.surface()) for s in (SELF_AFFINE, other))
    np.testing.assert_allclose(np.angle(second * np.conj(first))[1:6, 1:6], 0.0, atol=1e-9)


def test_height_is_exact_at_samples_and_periodic_between():
    i = (np.arange(128) + 0.5) * PERIOD / 128 - PERIOD / 2
    x, y = (grid.ravel() for grid in np.meshgrid(i, i, indexing="ij"))
    heights = SELF_AFFINE.surface() - SELF_AFFINE.surface().min()
    np.testing.assert_allclose(SELF_AFFINE.height(x, y), heights.ravel(), atol=1e-17)
    random = np.random.default_rng(0).uniform(-PERIOD, PERIOD, (2, 50))
    np.testing.assert_allclose(
        SELF_AFFINE.height(*random), SELF_AFFINE.height(random[0] + PERIOD, random[1] - PERIOD), atol=1e-16
    )


def test_seeds_differ_and_repeat():
    again, other = (SelfAffine(PERIOD, PERIOD / 24, 0.8, 1e-6, seed=seed, samples=128) for seed in (0, 1))
    assert np.corrcoef(again.surface().ravel(), other.surface().ravel())[0, 1] < 0.9
    np.testing.assert_array_equal(again.surface(), SelfAffine(PERIOD, PERIOD / 24, 0.8, 1e-6, samples=128).surface())


def test_conformance():
    check_indenter(SELF_AFFINE)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({}, "either"),
        ({"rms_height": 1e-6, "rms_slope": 0.1}, "either"),
        ({"rms_height": -1e-6}, "rms_height"),
        ({"rms_height": 1e-6, "roll_off": 5e-3}, "roll_off"),
        ({"rms_height": 1e-6, "samples": 40}, "at least"),
        ({"rms_height": 1e-6, "shortest": 1e-60}, "at most 12500 shortest waves"),
    ],
)
def test_keys_of_random_surfaces(keys, message):
    with pytest.raises(CaseError, match=message):
        SelfAffine(**{"period": PERIOD, "shortest": PERIOD / 24, "hurst": 0.8, **keys})


def test_numbers_of_samples_beyond_any_memory():
    table = {"name": "self-affine", "period": PERIOD, "shortest": PERIOD / 24, "hurst": 0.8, "rms_height": 1e-6}
    with pytest.raises(CaseError, match="samples"):
        load().create(Kind.INDENTER, {**table, "samples": 10**30})


NX, NY, DX, DY = 7, 5, 2e-6, 3e-6
HEIGHTS = np.random.default_rng(5).normal(size=(NX, NY)) * 1e-7


def test_files_without_scales_are_in_metres(tmp_path):
    np.savetxt(tmp_path / "rows.txt", [[x, y, x + y] for x in (0.0, 1.0) for y in (0.0, 2.0)])
    height_map = read_height_map(tmp_path / "rows.txt")
    np.testing.assert_array_equal(height_map.heights, [[0.0, 2.0], [1.0, 3.0]])


def test_keys_override_the_header(tmp_path):
    gwyddion(tmp_path / "map.txt")
    height_map = read_height_map(tmp_path / "map.txt", Scales(unit=2e-9, spacing=(1e-6, 4e-6)))
    np.testing.assert_allclose(height_map.heights, 2.0 * HEIGHTS, rtol=1e-9)
    np.testing.assert_allclose(np.diff(height_map.x), 1e-6)
    np.testing.assert_allclose(np.diff(height_map.y), 4e-6)
    indenter = MeasuredHeights(tmp_path / "map.txt", unit=2e-9, facing="down")
    highest = np.unravel_index(HEIGHTS.argmax(), HEIGHTS.shape)
    x, y = (highest[0] - (NX - 1) / 2) * DX, (highest[1] - (NY - 1) / 2) * DY
    assert indenter.height(np.array([x]), np.array([y])) == pytest.approx(2.0 * np.ptp(HEIGHTS), rel=1e-9)


def surfer(path):
    rows = "\n".join(" ".join(f"{1e9 * h:.12g}" for h in row) for row in HEIGHTS.T)
    path.write_text(f"DSAA\n{NX} {NY}\n0 {1e6 * DX * (NX - 1)}\n0 {1e6 * DY * (NY - 1)}\n-1 1\n{rows}\n")


def columns(path):
    rows = [f"{1e6 * DX * i}, {1e6 * DY * j}, {1e9 * HEIGHTS[i, j]:.12g}" for j in range(NY) for i in range(NX)]
    path.write_text("X, Y, Z\n# by a profilometer\n" + "\n".join(rows[::-1]))


def gwyddion(path):
    rows = "\n".join("\t".join(f"{1e9 * h:.12g}" for h in row) for row in HEIGHTS.T)
    sizes = f"# Width: {1e6 * DX * NX:g} µm\n# Height: {1e6 * DY * NY:g} µm\n# Value units: nm\n"
    path.write_text("# Channel: Height\n" + sizes + rows, encoding="utf-8")


def numpy_rows(path):
    x, y = np.meshgrid(1e6 * DX * np.arange(NX), 1e6 * DY * np.arange(NY), indexing="ij")
    np.save(path, np.column_stack([x.ravel(), y.ravel(), 1e9 * HEIGHTS.ravel()]))


def hdf5(path):
    with h5py.File(path, "w") as file:
        file["a/heights"] = 1e9 * HEIGHTS.T
        file["noise"] = np.zeros((2, 2))


IN_NM = Scales(unit=1e-9, lateral_unit=1e-6)
MATRIX = Scales(unit=1e-9, spacing=(DX, DY))


@pytest.mark.parametrize(
    ("name", "write", "scales"),
    [
        ("map.grd", surfer, IN_NM),
        ("map.csv", columns, IN_NM),
        ("map.txt", gwyddion, Scales()),
        ("rows.npy", numpy_rows, IN_NM),
        ("matrix.npy", lambda path: np.save(path, 1e9 * HEIGHTS.T), MATRIX),
        ("plain.txt", lambda path: np.savetxt(path, 1e9 * HEIGHTS.T), MATRIX),
        ("map.h5", hdf5, Scales(unit=1e-9, spacing=(DX, DY), dataset="a/heights")),
    ],
)
def test_formats(tmp_path, name, write, scales):
    write(tmp_path / name)
    height_map = read_height_map(tmp_path / name, scales)
    np.testing.assert_allclose(height_map.heights, HEIGHTS, rtol=1e-9)
    np.testing.assert_allclose(np.diff(height_map.x), DX, rtol=1e-9)
    np.testing.assert_allclose(np.diff(height_map.y), DY, rtol=1e-9)


def test_esri_grid_with_missing_heights(tmp_path):
    path = tmp_path / "map.asc"
    path.write_text("ncols 3\nnrows 2\nxllcorner 10\nyllcorner 20\ncellsize 2\nNODATA_value -1\n4 5 6\n1 2 -1\n")
    height_map = read_height_map(path)
    np.testing.assert_array_equal(height_map.x, [11.0, 13.0, 15.0])
    np.testing.assert_array_equal(height_map.y, [21.0, 23.0])
    np.testing.assert_array_equal(height_map.heights, [[1.0, 4.0], [2.0, 5.0], [np.nan, 6.0]])
    with pytest.raises(CaseError, match="1 of 6 heights are missing"):
        MeasuredHeights(path).height(np.zeros(1), np.zeros(1))
    filled = MeasuredHeights(path, missing="nearest", facing="down", centred=False)
    np.testing.assert_allclose(filled.height(np.array([11.0, 15.0]), np.array([21.0, 23.0])), [0.0, 5.0])


def test_peaks_touch_first(tmp_path):
    path = tmp_path / "map.npy"
    np.save(path, HEIGHTS.T)
    x, y = (g.ravel() for g in np.meshgrid(DX * np.arange(NX), DY * np.arange(NY), indexing="ij"))
    x, y = x - x.max() / 2, y - y.max() / 2
    up = MeasuredHeights(path, spacing=(DX, DY))
    np.testing.assert_allclose(up.height(x, y), HEIGHTS.max() - HEIGHTS.ravel(), atol=1e-16)
    down = MeasuredHeights(path, spacing=(DX, DY), facing="down")
    np.testing.assert_allclose(down.height(x, y), HEIGHTS.ravel() - HEIGHTS.min(), atol=1e-16)
    assert np.isinf(up.height(np.array([DX * NX]), np.zeros(1)))
    lowest = np.unravel_index(HEIGHTS.argmin(), HEIGHTS.shape)
    moved = HEIGHTS - HEIGHTS[lowest]
    moved[NX // 2, NY // 2] = -1e-8  # under the axis, where the kit evaluates it
    np.save(path, moved.T)
    check_indenter(MeasuredHeights(path, spacing=(DX, DY), facing="down", interpolation="cubic"), size=DX / 2)


def test_levelled_subtracts_the_plane(tmp_path):
    x, y = np.meshgrid(DX * np.arange(NX), DY * np.arange(NY), indexing="ij")
    wave = np.where((np.indices((NX, NY)).sum(axis=0) % 2) == 0, 1e-7, -1e-7)
    paths = [tmp_path / "tilted.npy", tmp_path / "level.npy"]
    for path, tilt in zip(paths, (1e-2, 0.0), strict=True):
        np.save(path, (wave + tilt * x - tilt / 2 * y).T)
    tilted, level = (MeasuredHeights(path, spacing=(DX, DY), levelled=True) for path in paths)
    at = np.random.default_rng(0).uniform(-DX, DX, (2, 20))
    np.testing.assert_allclose(tilted.height(*at), level.height(*at), atol=1e-15)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("1 2 3 4\n5 6 7 8\n", r'heights needs a key such as spacing = \["10 um", "10 um"\]'),
        ("1 2 3\n4 5\n6 7 8\n", "line 2, '4 5': 2 entries, where most lines have 3; .* equally many"),
        ("nothing\n", "equally many"),
        ("0 0 1\n1 0 1\n0 1 1\n1 1 1\n0 0 2\n", "form no grid: 1 of them repeat the point of another one"),
        ("0 0 1\n1 2 1\n3 1 1\n4 3 1\n", "different y form no grid: half of its points or more have no row"),
        ("0 0 1\n1 0 1\n", "2 different x and 1 different y form no grid of at least 2 x 2 points"),
        ("# Width: -20 um\n# Height: 20 um\n1 2\n3 4\n", "# width: -20 um: must be > 0"),
        ("# Width: 20 s\n# Height: 20 um\n1 2\n3 4\n", "# width: 20 s: has the wrong unit"),
        ("# Value units: V\n0 0 1\n1 0 1\n0 1 1\n1 1 1\n", "# value units: V: has the wrong unit"),
        ("DSAA\n3 3\n0 1\n0 1\n0 1\n1 2 3\n", "do not make"),
        ("DSAA", "header is incomplete; allowed: DSAA, nx ny, x0 x1"),
        (
            "DSAA\n2 2\n1 0\n0 1\n0 1\n1 2 3 4\n",
            "2 coordinates along x do not increase from 1 to 0 m; allowed: .*x0 < x1",
        ),
        ("DSAA\n2 2\n0 1\n1 1\n0 1\n1 2 3 4\n", "2 coordinates along y do not increase"),
        ("DSAA\n2 2\n0 inf\n0 1\n0 1\n1 2 3 4\n", "2 coordinates along x do not increase"),
        ("ncols 2\nnrows 2\ncellsize inf\n1 2 3 4\n", "coordinates along x do not increase"),
        ("DSAA\n4 1\n0 1\n0 1\n0 1\n1 2 3 4\n", "1 coordinates along y do not increase"),
        ("DSAA\nmany 2\n0 1\n0 1\n0 1\n1 2 3 4\n", "'many'; allowed: DSAA"),
        ("ncols 3\nnrows 1\n1 2 3\n", "lacks cellsize"),
        ("ncols inf\nnrows 1\ncellsize 1\n1 2 3\n", "infinity.*allowed: ncols, nrows and cellsize > 0"),
        ("ncols 2\nnrows 2\ncellsize -1\n1 2 3 4\n", "coordinates along x do not increase.*cellsize > 0"),
        ("ncols 2\nnrows 2\ncellsize 1\n", "0 heights do not make 2 rows of 2; allowed: ncols"),
        ("ncols\n", "lacks ncols, nrows, cellsize"),
        ("ncols 2\nncols 2\nnrows\n", "lacks nrows, cellsize"),
        ("ncols two\nnrows 2\ncellsize 1\n1 2 3 4", "'two'; allowed: ncols"),
    ],
)
def test_invalid_files_are_rejected(tmp_path, content, message):
    path = tmp_path / "map.txt"
    path.write_text(content)
    with pytest.raises(CaseError, match=rf"map\.txt.*{message}"):
        read_height_map(path)


def archive(path):
    with path.open("wb") as file:
        np.savez(file, HEIGHTS)


def soft_link(path):
    with h5py.File(path, "w") as file:
        file["heights"] = h5py.SoftLink("/nowhere")


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("archive.npy", archive),
        ("empty.npy", lambda path: path.write_bytes(b"")),
        ("complex.npy", lambda path: np.save(path, HEIGHTS * 1j)),
        ("objects.npy", lambda path: np.save(path, np.array([None, {}]), allow_pickle=True)),
        ("link.h5", soft_link),
        ("group.h5", lambda path: h5py.File(path, "w").create_group("heights").file.close()),
        ("text.h5", lambda path: path.write_text("1 2 3")),
    ],
)
def test_invalid_binary_files_are_rejected(tmp_path, name, write):
    write(tmp_path / name)
    dataset = "heights" if name.endswith(".h5") else None
    with pytest.raises(CaseError, match=rf"{name}: .*; allowed: .*real numbers"):
        read_height_map(tmp_path / name, Scales(spacing=(DX, DY), dataset=dataset))


def test_plane_is_fitted_to_measured_heights_only(tmp_path):
    """The corner of a steep plane is missing; heights filled from neighbours do not affect the fit."""
    x, y = np.meshgrid(DX * np.arange(NX), DY * np.arange(NY), indexing="ij")
    plane = 0.3 * x - 0.2 * y
    plane[:3, :2] = np.nan
    np.save(tmp_path / "plane.npy", plane.T)
    flat = MeasuredHeights(tmp_path / "plane.npy", spacing=(DX, DY), levelled=True, missing="nearest")
    at = np.random.default_rng(0).uniform(-2.0 * DX, 2.0 * DX, (2, 20))
    np.testing.assert_allclose(flat.height(*at), 0.0, atol=1e-15)


@pytest.mark.parametrize("name", ["none.npy", "with\0nul.npy"])
def test_missing_file(tmp_path, name):
    with pytest.raises(CaseError, match="cannot be read"):
        MeasuredHeights(tmp_path / name).height(np.zeros(1), np.zeros(1))


def test_statistics_of_a_map(tmp_path):
    x = np.linspace(0.0, 1.0, 401)
    np.save(tmp_path / "wave.npy", np.tile(1e-2 * np.sin(2.0 * np.pi * x), (3, 1)))
    height_map = read_height_map(tmp_path / "wave.npy", Scales(spacing=(x[1], 1.0)))
    assert height_map.rms_height == pytest.approx(1e-2 / np.sqrt(2.0), rel=5e-3)
    assert height_map.rms_slope == pytest.approx(2e-2 * np.pi / np.sqrt(2.0), rel=5e-3)


def periodic_case(indenter, width, **placement):
    """Return a case with a periodic zone of 16 x 16 nodes, a width [m] between the outermost ones."""
    return meeframe.Case(
        material="steel",
        mesh=meeframe.mesh.half_space(width, divisions=15),
        formulation=meeframe.formulation("half-space", periodic=True),
        indenter=indenter,
        placement=meeframe.Placement(**placement),
        steps=[meeframe.Step(normal_force=1.0)],
    )


@pytest.mark.parametrize("factor", [0.99, 1.01])
def test_period_of_a_surface_other_than_that_of_the_zone(factor):
    surface, width = SelfAffine(1e-3, 2.5e-4, 0.8, rms_slope=0.1, samples=16), 1e-3 * 15 / 16
    assert periodic_case(surface, width).warnings == ()
    along_x, along_y = periodic_case(surface, factor * width).warnings
    other = f"but the period of the contact zone 'contact' is {factor / 1e3:g} m"
    assert f"the period of the surface along x is 0.001 m, {other}" in along_x
    assert f"the period of the surface along y is 0.001 m, {other}" in along_y
    assert periodic_case(surface, 2.0 * width).warnings == (), "the zone holds the period twice"
    # along other axes the periods do not compare
    assert periodic_case(surface, factor * width, rotation=0.3).warnings == ()


@pytest.mark.parametrize(("nodes", "differs"), [(15, True), (16, False), (17, False), (18, True)])
def test_size_of_a_height_map_other_than_the_period(tmp_path, nodes, differs):
    """A map of one period may end with it, or one spacing before; others are too small or too large."""
    file, spacing = tmp_path / "map.npy", 1e-3 / 16
    np.save(file, 1e-6 * np.random.default_rng(1).random((nodes, nodes)))
    warnings = periodic_case(MeasuredHeights(file, spacing=(spacing, spacing)), 1e-3 * 15 / 16).warnings
    assert [text.partition(" along")[0] for text in warnings] == 2 * differs * ["the size of the height map"]
