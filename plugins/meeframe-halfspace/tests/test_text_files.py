"""Text files of heights with decimal commas, byte order marks, missing points and headers are read, or refused."""

import sys

import numpy as np
import pytest
from meeframe_halfspace import Scales, read_height_map

from meeframe.plugin import CaseError

STEPS = Scales(spacing=(1.0, 1.0))
ROWS = [[0.12, 1.5, -2.0, 3e-3], [4.0, 5.25, 6.0, 7.0], [8.0, 9.0, 10.5, 11.0]]


def written(path, rows, separator, comma=False, head="", encoding="utf-8"):
    lines = [separator.join(f"{value:g}" if isinstance(value, float) else value for value in row) for row in rows]
    text = "\n".join(lines)
    path.write_bytes((head + (text.replace(".", ",") if comma else text) + "\n").encode(encoding))
    return path


@pytest.mark.parametrize("separator", [" ", "\t", ";", "; ", "   "])
@pytest.mark.parametrize("comma", [False, True])
def test_decimal_commas(tmp_path, separator, comma):
    surface = read_height_map(written(tmp_path / "map.txt", ROWS, separator, comma), STEPS)
    np.testing.assert_array_equal(surface.heights, np.transpose(ROWS))


@pytest.mark.parametrize("separator", [",", ", ", " , "])
def test_commas_that_separate_numbers(tmp_path, separator):
    path = written(tmp_path / "map.txt", ROWS, separator, head="A, B, C, D\n")
    np.testing.assert_array_equal(read_height_map(path, STEPS).heights, np.transpose(ROWS))


@pytest.mark.parametrize("content", ["1,5, 2,5\n3,5, 4,5\n", "1.5,2.5 3.5\n4.5,5.5 6.5\n", "1,2,3 4\n5,6,7 8\n"])
def test_uncertain_commas_are_refused(tmp_path, content):
    (tmp_path / "map.txt").write_text(content)
    with pytest.raises(CaseError, match=r"map\.txt: commas in '1.*write decimal points"):
        read_height_map(tmp_path / "map.txt", STEPS)


@pytest.mark.parametrize("head", ["10,5 um x 10,5 um\n", "3 x 3 pixels, 10,5 um\n", "0.5 um, 10,5 x 10,5\n"])
@pytest.mark.parametrize(("separator", "comma"), [(",", False), (", ", False), ("\t", True), (";", True)])
def test_headers_do_not_decide_on_commas(tmp_path, head, separator, comma):
    path = written(tmp_path / "map.txt", ROWS, separator, comma, head)
    surface = read_height_map(path, Scales(unit=1.0, spacing=(1.0, 1.0)))
    np.testing.assert_array_equal(surface.heights, np.transpose(ROWS))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1"])
def test_encodings(tmp_path, encoding):
    head = "# Width: 8 µm\n# Height: 6 µm\n# Value units: nm\n"
    surface = read_height_map(written(tmp_path / "map.txt", ROWS, " ", head=head, encoding=encoding))
    np.testing.assert_allclose(surface.heights, 1e-9 * np.transpose(ROWS))
    assert surface.spacing == pytest.approx((2e-6, 2e-6))
    plain = read_height_map(written(tmp_path / "plain.txt", ROWS, " ", encoding=encoding), STEPS)
    assert plain.shape == (4, 3)
    grid = "ncols 4\nnrows 3\ncellsize 1\n"
    esri = read_height_map(written(tmp_path / "map.asc", ROWS, " ", head=grid, encoding=encoding))
    np.testing.assert_array_equal(esri.heights, np.transpose(ROWS[::-1]))


def test_columns_with_a_spacing_are_refused(tmp_path):
    rows = [[float(i), float(j), 1.0] for i in range(4) for j in range(3)]
    with pytest.raises(CaseError, match="three columns are x, y and height, which need no spacing"):
        read_height_map(written(tmp_path / "rows.txt", rows, " "), STEPS)
    matrix = [[0.3, 0.1, 0.2], [0.5, 0.2, 0.4], [0.1, 0.7, 0.6], [0.2, 0.9, 0.8]]
    assert read_height_map(written(tmp_path / "map.txt", matrix, " "), STEPS).shape == (3, 4)
    constant = [[float(i), 0.0, 1.0] for i in range(4)]
    assert read_height_map(written(tmp_path / "constant.txt", constant, " "), STEPS).shape == (3, 4)


HEADER = "Pixel width: 0.5 um\nWavelength 632.8\n"


def test_headers_with_numbers_are_refused_by_line(tmp_path):
    path = written(tmp_path / "map.txt", ROWS, " ", head="Height map\n" + HEADER)
    for scales in (STEPS, Scales(unit=1e-9), Scales()):
        with pytest.raises(CaseError, match=r"line 2, 'Pixel width: 0\.5 um': neither a comment nor heights"):
            read_height_map(path, scales)
    known = read_height_map(path, Scales(unit=1e-9, spacing=(1.0, 1.0)))
    np.testing.assert_allclose(known.heights, 1e-9 * np.transpose(ROWS))


def test_headers_without_surface_topography_name_the_file_once(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "SurfaceTopography", None)
    with pytest.raises(CaseError, match=r"line 1, .*pip install") as caught:
        read_height_map(written(tmp_path / "map.txt", ROWS, " ", head=HEADER), STEPS)
    assert str(caught.value).count("map.txt") == 1


def test_headers_that_surface_topography_knows(tmp_path):
    pytest.importorskip("SurfaceTopography")
    head = "x-pixels = 4\ny-pixels = 3\nx-length = 8\ny-length = 9\nx-unit = um\ny-unit = um\nz-unit = nm\n"
    surface = read_height_map(written(tmp_path / "map.txt", ROWS, " ", head=head))
    np.testing.assert_allclose(surface.heights, 1e-9 * np.transpose(ROWS))
    assert surface.spacing == pytest.approx((2e-6, 3e-6))


@pytest.mark.parametrize("mark", ["BAD", "***", "n/a", "--", "NaN", "void", "no data", "NoData"])
@pytest.mark.parametrize("separator", [" ", ";", ",", "\t"])
def test_missing_points_of_a_matrix(tmp_path, mark, separator):
    rows = [[mark, *ROWS[0][1:]], ROWS[1], [*ROWS[2][:3], mark], [mark] * 4]
    surface = read_height_map(written(tmp_path / "map.txt", rows, separator, head="a b c d\n"), STEPS)
    expected = np.array([*ROWS, [0.0] * 4])
    expected[0, 0] = expected[2, 3] = np.nan
    expected[3] = np.nan
    np.testing.assert_array_equal(surface.heights, expected.T)


@pytest.mark.parametrize("separator", [",", ";", "\t", " \t "])
@pytest.mark.parametrize("end", ["", "{0}"])
@pytest.mark.parametrize("start", ["", "{0}"])
def test_empty_entries_are_missing(tmp_path, separator, start, end):
    """Separators that begin or end all lines are no entries."""
    rows = "1{0}{0}3", "4{0}5{0}6", "{0}8{0}9", "10{0}11{0}"
    lines = [(start + row + end).format(separator) for row in rows]
    (tmp_path / "map.csv").write_text("\n".join([*lines, "\t\t", ""]))
    surface = read_height_map(tmp_path / "map.csv", Scales(unit=1.0, spacing=(1.0, 1.0)))
    nan = np.nan
    np.testing.assert_array_equal(surface.heights, [[1.0, 4.0, nan, 10.0], [nan, 5.0, 8.0, 11.0], [3.0, 6.0, 9.0, nan]])


def test_missing_points_of_columns(tmp_path):
    """Points without a row, and rows without a height, are missing."""
    rows = [[float(i), float(j), 10.0 * i + j] for i in range(3) for j in range(4) if (i, j) != (1, 2)]
    rows[0][2] = "x"
    rows[0], rows[1] = rows[1], rows[0]
    surface = read_height_map(written(tmp_path / "rows.txt", rows, " "))
    expected = 10.0 * np.arange(3.0)[:, None] + np.arange(4.0)
    expected[1, 2] = expected[0, 0] = np.nan
    np.testing.assert_array_equal(surface.heights, expected)


def test_lines_of_text_between_heights_are_refused(tmp_path):
    (tmp_path / "map.txt").write_text("1 2\n3 4\nend here\n")
    with pytest.raises(CaseError, match="line 3, 'end here': no number in it"):
        read_height_map(tmp_path / "map.txt", STEPS)


@pytest.mark.parametrize("empty", ["\t\t", ";;"])
def test_empty_rows_between_heights_are_refused(tmp_path, empty):
    (tmp_path / "map.txt").write_text(f"1 2 3\n{empty}\n4 5 6\n")
    with pytest.raises(CaseError, match=r"line 2, .*no number in it"):
        read_height_map(tmp_path / "map.txt", STEPS)


@pytest.mark.parametrize("text", ["1;2;3\n1;2\n4;5;6\n", "3 3\n1 2 3\n4 5 6\n"])
def test_lines_of_another_length_are_named(tmp_path, text):
    (tmp_path / "map.txt").write_text(text)
    number = 2 if ";" in text else 1
    with pytest.raises(CaseError, match=f"line {number}, '.*': 2 entries, where most lines have 3"):
        read_height_map(tmp_path / "map.txt", STEPS)


@pytest.mark.parametrize(("name", "size"), [("map.txt", "1 x 64"), ("map.npy", "64 x 1")])
def test_lines_are_no_maps(tmp_path, name, size):
    line = np.arange(64.0)
    if name.endswith(".npy"):
        np.save(tmp_path / name, line[:, None])
    else:
        np.savetxt(tmp_path / name, line[None])
    with pytest.raises(CaseError, match=f"{size} numbers in it; a map has at least 2 x 2"):
        read_height_map(tmp_path / name, STEPS)
