"""Test reading and writing meshes, and rejected files."""

import gzip
import os
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import h5py
import meshio
import numpy as np
import pytest

from meeframe.common import files
from meeframe.common.errors import MeshError
from meeframe.elements import ELEMENTS, Quad4, Quad9
from meeframe.elements.base import SurfaceElement
from meeframe.mesh import area, block_mesh, box_mesh, read_mesh, reader, volume
from meeframe.mesh.surface import SurfaceMesh

EVERY = pytest.mark.parametrize("element", ELEMENTS.values(), ids=lambda e: e.name)
BOX_AREAS = {"x-": 6.0, "x+": 6.0, "y-": 3.0, "y+": 3.0, "z-": 2.0, "z+": 2.0}


def box(element: SurfaceElement | None = None) -> SurfaceMesh:
    return box_mesh((1.0, 2.0, 3.0), (2, 3, 2), element or Quad4())


def cells_of(mesh: SurfaceMesh) -> list[tuple[str, np.ndarray]]:
    return [(block.element.meshio_type, block.connectivity) for block in mesh.blocks]


def write_gmsh(mesh: SurfaceMesh, path: Path, file_format: str = "gmsh22", extra: bool = False) -> None:
    """Write the mesh with physical groups; `extra` adds lines, points, volume cells and an unused point."""
    tags = [block.groups.astype(np.int32) + 1 for block in mesh.blocks]
    cells, points = cells_of(mesh), mesh.points
    if extra:
        points = np.vstack([points, [9.0, 9.0, 9.0]])
        cells = [
            ("line", np.array([[0, 1]])),
            ("vertex", np.array([[0]])),
            *cells,
            ("tetra", np.array([[0, 1, 2, len(points) - 1]])),
        ]
        tags = [np.array([77], np.int32), np.array([0], np.int32), *tags, np.array([50], np.int32)]
    data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    fields = {name: np.array([k + 1, 2]) for k, name in enumerate(mesh.group_names)}
    meshio.write(
        path, meshio.Mesh(points, cells, cell_data=data, field_data=fields), file_format=file_format, binary=False
    )


def read(path: Path, **options: object) -> SurfaceMesh:
    return read_mesh(path, ELEMENTS.values(), **options)


@EVERY
def test_gmsh_round_trip(element: SurfaceElement, tmp_path: Path) -> None:
    original = box(element)
    write_gmsh(original, tmp_path / "box.msh")
    mesh = read(tmp_path / "box.msh")
    np.testing.assert_array_equal(mesh.points, original.points)
    (block,) = mesh.blocks
    assert block.element == element
    np.testing.assert_array_equal(block.connectivity, original.blocks[0].connectivity)
    assert {name: pytest.approx(area(mesh, name)) for name in mesh.group_names} == BOX_AREAS
    assert volume(mesh) == pytest.approx(6.0)


def test_block_of_the_paper_from_a_file(tmp_path: Path) -> None:
    original = block_mesh(50.0, 120.0, 5.0, 16, 6, 3, Quad4())
    write_gmsh(original, tmp_path / "block.msh")
    mesh = read(tmp_path / "block.msh", length_unit=1e-3)
    assert (mesh.n_elements, len(mesh.points)) == (1088, 1090)
    assert area(mesh, "contact") == pytest.approx(25e-6, rel=1e-12)
    assert sorted(mesh.group_names) == sorted(original.group_names)


@pytest.mark.parametrize("named", [6, 4])
def test_cell_sets(named: int, tmp_path: Path) -> None:
    original = box()
    groups = original.blocks[0].groups
    names = ["xm", "xp", "ym", "yp", "zm", "zp"][:named]
    sets = {name: [np.flatnonzero(groups == k)] for k, name in enumerate(names)}
    meshio.write(tmp_path / "box.inp", meshio.Mesh(original.points, cells_of(original), cell_sets=sets))
    mesh = read(tmp_path / "box.inp")
    assert set(mesh.group_names) == set(names) | ({"surface"} if named < 6 else set())
    assert [area(mesh, name) for name in names] == pytest.approx([6.0, 6.0, 3.0, 3.0, 2.0, 2.0][:named])


@EVERY
def test_vtu_with_a_cell_array_as_groups(element: SurfaceElement, tmp_path: Path) -> None:
    original = box(element)
    path = tmp_path / "box.vtu"
    meshio.write(
        path, meshio.Mesh(original.points, cells_of(original), cell_data={"face": [original.blocks[0].groups]})
    )
    mesh = read(path)
    assert mesh.group_names == ("surface",)
    np.testing.assert_array_equal(mesh.points, original.points)
    named = read(path, group_data="face")
    assert named.group_names == tuple(f"face_{k}" for k in range(6))
    assert area(named, "face_1") == pytest.approx(6.0)
    with pytest.raises(
        MeshError, match=r"box\.vtu: group_data = 'faces': no such cell array in the file; it has: face"
    ):
        read(path, group_data="faces")


@pytest.mark.parametrize("odd", [1.5, np.nan, np.inf])
def test_group_numbers_are_integers(odd: float, tmp_path: Path) -> None:
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    path = tmp_path / "odd.vtu"
    meshio.Mesh(corners, [("triangle", faces)], cell_data={"face": [np.array([1.0, 2.0, odd, 2.0])]}).write(path)
    with pytest.raises(MeshError, match=f"group_data = 'face': it contains {odd:g}; allowed: integers"):
        read(path, group_data="face")


def test_mixed_elements(tmp_path: Path) -> None:
    original = box()
    quads = original.blocks[0].connectivity
    cells = [("quad", quads[6:]), ("triangle", quads[:6][:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3))]
    meshio.write(tmp_path / "mixed.vtk", meshio.Mesh(original.points, cells))
    mesh = read(tmp_path / "mixed.vtk")
    assert sorted(block.element.name for block in mesh.blocks) == ["quad4", "tri3"]
    assert mesh.n_elements == 26 + 12
    assert volume(mesh) == pytest.approx(6.0)


def test_points_lines_and_volume_cells_are_ignored(tmp_path: Path) -> None:
    original = box()
    write_gmsh(original, tmp_path / "extra.msh", extra=True)
    mesh = read(tmp_path / "extra.msh")
    np.testing.assert_array_equal(mesh.points, original.points)
    assert {name: pytest.approx(area(mesh, name)) for name in mesh.group_names} == BOX_AREAS


GMSH_41 = """$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
3
2 7 "contact"
2 8 "held"
3 9 "body"
$EndPhysicalNames
$Entities
0 0 4 1
1 0 0 0 1 1 0 1 7 0
2 0 0 0 1 0 1 1 8 0
3 0 0 0 1 1 1 1 8 0
4 0 0 0 0 1 1 1 10 0
1 0 0 0 1 1 1 1 9 4 1 2 3 4
$EndEntities
$Nodes
1 4 1 4
2 1 0 4
1
2
3
4
0 0 0
1 0 0
0 1 0
0 0 1
$EndNodes
$Elements
5 5 1 5
2 1 2 1
1 1 3 2
2 2 2 1
2 1 2 4
2 3 2 1
3 2 3 4
2 4 2 1
4 1 4 3
3 1 4 1
5 1 2 3 4
$EndElements
"""


def test_physical_groups_of_gmsh_4(tmp_path: Path) -> None:
    # written manually: two named groups, one without a name, and the volume
    (tmp_path / "tetra.msh").write_text(GMSH_41)
    mesh = read(tmp_path / "tetra.msh")
    assert mesh.group_names == ("contact", "held", "surface")
    assert [area(mesh, name) for name in mesh.group_names] == pytest.approx([0.5, 0.5 + np.sqrt(0.75), 0.5])
    assert volume(mesh) == pytest.approx(1 / 6)


def test_elements_in_no_physical_group(tmp_path: Path) -> None:
    original = box()
    tags = np.where(original.blocks[0].groups == 5, 0, np.where(original.blocks[0].groups == 4, 9, 1)).astype(np.int32)
    data = {"gmsh:physical": [tags], "gmsh:geometrical": [tags]}
    fields = {"held": np.array([1, 2]), "a line": np.array([9, 1])}
    written = meshio.Mesh(original.points, cells_of(original), cell_data=data, field_data=fields)
    meshio.write(tmp_path / "box.msh", written, file_format="gmsh22", binary=False)
    mesh = read(tmp_path / "box.msh")
    assert mesh.group_names == ("held", "physical_9", "surface")
    assert area(mesh, "surface") == pytest.approx(2.0)


def test_duplicate_nodes_are_rejected_or_merged(tmp_path: Path) -> None:
    original = box()
    split = original.points[original.blocks[0].connectivity].reshape(-1, 3)
    path = tmp_path / "split.vtk"
    meshio.write(path, meshio.Mesh(1e3 * split, [("quad", np.arange(len(split)).reshape(-1, 4))]))
    with pytest.raises(MeshError, match=r"split\.vtk: the surface has points that coincide .*: \d+ pairs, at \("):
        read(path, length_unit=1e-3)
    merged = read(path, length_unit=1e-3, merge_tolerance=1e-6)
    assert len(merged.points) == len(original.points)
    assert volume(merged) == pytest.approx(6.0)


def test_node_numbers_beyond_64_bits(tmp_path: Path) -> None:
    path = tmp_path / "large.obj"
    path.write_text(f"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 {10**25}\n")
    with pytest.raises(MeshError, match=r"large\.obj: it contains an integer of more than 64 bits"):
        read(path)


def test_reorient(tmp_path: Path) -> None:
    original = box(Quad9())
    flipped = original.blocks[0].connectivity[:, [3, 2, 1, 0, 6, 5, 4, 7, 8]]
    path = tmp_path / "flipped.vtu"
    meshio.write(path, meshio.Mesh(original.points, [("quad9", flipped)]))
    with pytest.raises(MeshError, match=r"flipped\.vtu: the surface is inside out"):
        read(path)
    assert volume(read(path, reorient=True)) == pytest.approx(6.0)


def _mesh_file(points: object, cells: list[tuple[str, object]]) -> Callable[[Path], None]:
    return lambda path: meshio.write(path, meshio.Mesh(np.asarray(points, float), cells))


TETRA = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
CLOSED = [("triangle", [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])]


@pytest.mark.parametrize(
    ("name", "make", "text"),
    [
        ("absent.msh", lambda path: None, "no such file"),
        ("folder.msh", lambda path: path.mkdir(), "no such file"),
        ("empty.msh", lambda path: path.write_text(""), "meshio cannot read it"),
        ("noise.vtu", lambda path: path.write_bytes(bytes(range(256))), "meshio cannot read it"),
        (
            "noise.msh",
            lambda path: path.write_text("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\nx\n"),
            "meshio cannot read it",
        ),
        ("mesh.unknown", lambda path: path.write_text("1 2 3"), "meshio cannot read it.*unknown"),
        (
            "solid.vtk",
            _mesh_file(TETRA, [("tetra", [[0, 1, 2, 3]])]),
            "no surface elements; cells in the file: tetra; allowed: quad,",
        ),
        ("lines.vtk", _mesh_file(TETRA, [("line", [[0, 1]])]), "no surface elements; cells in the file: line"),
        (
            "open.vtk",
            _mesh_file(TETRA, [("triangle", CLOSED[0][1][:3])]),
            "not closed: an edge belongs to only one element: 3 edges",
        ),
        ("nan.vtk", _mesh_file([*TETRA[:3], [0, 0, np.nan]], CLOSED), "not finite or beyond 1e\\+60 m: 1 point"),
        ("range.vtk", _mesh_file(TETRA[:3], CLOSED), "tri3 elements use point 3, but"),
        ("flat.xdmf", _mesh_file([p[:2] for p in TETRA], [("triangle", [[0, 1, 2]])]), "not three-dimensional"),
        (
            "high.vtu",
            _mesh_file(np.zeros((10, 3)), [("VTK_LAGRANGE_TRIANGLE", [list(range(10))])]),
            "cells of type '.*' are not supported; allowed: quad",
        ),
    ],
)
def test_invalid_files_are_rejected(
    name: str, make: Callable[[Path], None], text: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    make(path)
    capfd.readouterr()
    with pytest.raises(MeshError, match=f"{name}: .*{text}"):
        read(path)
    out, err = capfd.readouterr()
    assert (out, err) == ("", "")


@pytest.mark.parametrize(
    ("suffix", "kind", "end"),
    [("ply", "ply", b"end_header"), ("off", "off", b"\n"), ("dat", "tecplot", b"1.0"), ("msh", "ansys", b" Binary")],
)
def test_truncated_files(suffix: str, kind: str, end: bytes, tmp_path: Path) -> None:
    """Some readers of meshio would wait for the missing end forever."""
    path = tmp_path / f"cut.{suffix}"
    meshio.write(path, meshio.Mesh(np.array(TETRA, float), CLOSED), file_format=kind)
    whole = path.read_bytes()
    assert volume(read(path)) == pytest.approx(1 / 6)
    path.write_bytes(whole[: whole.index(end)])
    with pytest.raises(MeshError, match=rf"cut\.{suffix}: meshio cannot read it: the file ends too early"):
        read(path)


def test_threads_read_one_after_another(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The reader changes process-wide state (how files are opened, standard output), so reading is serialised."""
    path, before, read_one = tmp_path / "good.vtk", sys.stdout, meshio.read
    _mesh_file(TETRA, CLOSED)(path)

    def slowly(file: Path) -> meshio.Mesh:
        time.sleep(0.02)
        return read_one(file)

    monkeypatch.setattr(meshio, "read", slowly)
    with ThreadPoolExecutor(4) as threads:
        assert list(threads.map(lambda file: volume(read(file)), [path] * 4)) == pytest.approx([1 / 6] * 4)
    assert sys.stdout is before
    assert not hasattr(meshio._files, "open")


def test_valid_tetrahedron_and_unit(tmp_path: Path) -> None:
    path = tmp_path / "good.vtk"
    _mesh_file(TETRA, CLOSED)(path)
    assert volume(read(path)) == pytest.approx(1 / 6)
    assert volume(read(path, length_unit=1e-3)) == pytest.approx(1e-9 / 6)
    with pytest.raises(MeshError, match=r"good\.vtk: length_unit = 0: must be"):
        read(path, length_unit=0)
    with pytest.raises(MeshError, match="merge_tolerance = nan"):
        read(path, merge_tolerance=float("nan"))


def test_element_in_two_groups_is_rejected(tmp_path: Path) -> None:
    sets = {"one": [np.array([0, 1])], "two": [np.array([1, 2, 3])]}
    meshio.write(tmp_path / "two.inp", meshio.Mesh(np.array(TETRA, float), CLOSED, cell_sets=sets))
    with pytest.raises(MeshError, match=r"two\.inp: an element is in two face groups, 'one' and 'two'"):
        read(tmp_path / "two.inp")


def _xdmf(folder: Path, **formats: str) -> Path:
    """Write a tetrahedron in XDMF, and beside it the HDF5 file that it names."""
    path = folder / "mesh.xdmf"
    meshio.write(path, meshio.Mesh(np.array(TETRA, float), CLOSED), **formats)
    return path


def _renamed(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def test_xdmf_takes_data_from_its_folder_only(tmp_path: Path) -> None:
    """A file from somebody else must not bring other readable files into a mesh."""
    (tmp_path / "inside").mkdir()
    path = _xdmf(tmp_path / "inside")
    assert volume(read(path)) == pytest.approx(1 / 6)
    (tmp_path / "inside" / "mesh.h5").rename(tmp_path / "private.h5")
    for name in ("../private.h5", str(tmp_path / "private.h5")):
        other = _xdmf(tmp_path / "inside")
        _renamed(other, "mesh.h5", name)
        with pytest.raises(MeshError, match=rf"mesh\.xdmf: refers to '{name}'; allowed: names of files in its folder"):
            read(other)


def test_xdmf_names_hdf5_without_links(tmp_path: Path) -> None:
    path = _xdmf(tmp_path)
    with h5py.File(tmp_path / "mesh.h5", "a") as file:
        (first, *_) = file
        file.move(first, "moved")
        file[first] = h5py.ExternalLink("other.h5", first)
    with pytest.raises(MeshError, match=r"mesh\.h5 cannot be read as HDF5: .* is a link to another file"):
        read(path)


def test_xdmf_with_raw_files_is_rejected(tmp_path: Path) -> None:
    path = _xdmf(tmp_path, data_format="Binary")
    with pytest.raises(MeshError, match=r"takes data from the raw file .*; allowed: data in HDF5 files or in XML"):
        read(path)


def test_abaqus_includes_from_its_folder_only(tmp_path: Path) -> None:
    """Includes are followed at any depth, and one that includes itself ends with an error."""
    meshio.write(tmp_path / "part.inp", meshio.Mesh(np.array(TETRA, float), CLOSED))
    path = tmp_path / "mesh.inp"
    path.write_text("*HEADING\n*INCLUDE, INPUT=part.inp\n")
    assert volume(read(path)) == pytest.approx(1 / 6)
    part = tmp_path / "part.inp"
    for name, message in (("/etc/passwd", "refers to '/etc/passwd'"), ("part.inp", "meshio cannot read it")):
        part.write_text(f"*HEADING\n*include, input={name}\n")
        with pytest.raises(MeshError, match=message):
            read(path)


@pytest.mark.parametrize(
    "lines",
    [
        "*INC*LUDE, INPUT={}\n",
        "  **include , input={}\n",
        "include\v, x={}\n",
        "*HEADING\r*INCLUDE, INPUT={}\r*END\r",
        "*\u0131nclude, input={}\n",  # a dotless i, whose capital is I
    ],
)
@pytest.mark.parametrize("name", ["mesh.inp", "MESH.INP", "part.txt"])
def test_abaqus_includes_are_found_as_by_the_reader(lines: str, name: str, tmp_path: Path) -> None:
    """The reader ignores stars within keywords, spaces around them, their case, and the suffix of included files."""
    (tmp_path / "inside").mkdir()
    private = tmp_path / "private.inp"
    meshio.write(private, meshio.Mesh(np.array(TETRA, float), CLOSED))
    path = tmp_path / "inside" / (name if name.lower().endswith(".inp") else "mesh.inp")
    path.write_text("*INCLUDE, INPUT=part.txt\n")
    (path.parent / name).write_text(lines.format(private), newline="")
    assert len(meshio.abaqus.read(path).points) == 4  # without the check
    with pytest.raises(MeshError, match=f"refers to '{private}'; allowed: names of files in its folder"):
        read(path)


def test_abaqus_comments_include_nothing(tmp_path: Path) -> None:
    path = tmp_path / "mesh.inp"
    meshio.write(path, meshio.Mesh(np.array(TETRA, float), CLOSED))
    path.write_text("**INCLUDE, INPUT=/etc/passwd\n" + path.read_text())
    assert volume(read(path)) == pytest.approx(1 / 6)


def test_abaqus_includes_no_files_of_the_current_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The reader prefers them to those beside the mesh."""
    (tmp_path / "inside").mkdir()
    path = tmp_path / "inside" / "mesh.inp"
    path.write_text("*INCLUDE, INPUT=part.inp\n")
    for folder in (tmp_path, path.parent):
        meshio.write(folder / "part.inp", meshio.Mesh(np.array(TETRA, float), CLOSED))
    monkeypatch.chdir(tmp_path)
    with pytest.raises(MeshError, match=r"refers to 'part\.inp', which is in the current folder too; allowed: "):
        read(path)
    monkeypatch.chdir(path.parent)
    assert volume(read(Path("mesh.inp"))) == pytest.approx(1 / 6)


def test_meshes_refer_to_no_pipes(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "part.inp")
    (tmp_path / "mesh.inp").write_text("*INCLUDE, INPUT=part.inp\n")
    with pytest.raises(MeshError, match=r"part\.inp cannot be read: is a device or a pipe"):
        read(tmp_path / "mesh.inp")


def test_xdmf_names_files_in_any_element(tmp_path: Path) -> None:
    """The reader does not look at the names of elements with data."""
    (tmp_path / "inside").mkdir()
    path = _xdmf(tmp_path / "inside")
    (tmp_path / "inside" / "mesh.h5").rename(tmp_path / "private.h5")
    _renamed(path, "mesh.h5", str(tmp_path / "private.h5"))
    _renamed(path, "DataItem", "Other")
    assert len(meshio.read(path).points) == 4  # without the check
    with pytest.raises(MeshError, match=r"private\.h5'; allowed: names of files in its folder"):
        read(path)


def test_links_to_xdmf_are_followed(tmp_path: Path) -> None:
    """HDF5 files are beside the XDMF file, not beside the link to it."""
    (tmp_path / "other").mkdir()
    path = tmp_path / "mesh.xdmf"
    path.symlink_to(_xdmf(tmp_path / "other"))
    assert volume(read(path)) == pytest.approx(1 / 6)
    with h5py.File(tmp_path / "other" / "mesh.h5", "a") as file:
        (first, *_) = file
        file.move(first, "moved")
        file[first] = h5py.ExternalLink("other.h5", first)
    with pytest.raises(MeshError, match=r"mesh\.h5 cannot be read as HDF5: .* is a link to another file"):
        read(path)


@pytest.mark.parametrize("compression", ["zlib", "lzma"])
def test_compressed_meshes_that_expand_too_far(
    compression: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Readers expand each block whatever it holds: 2 MB may become 2 GB."""
    path = tmp_path / "box.vtu"
    mesh = box()
    meshio.vtu.write(path, meshio.Mesh(mesh.points, cells_of(mesh)), compression=compression)
    assert len(read_mesh(path, ELEMENTS.values()).points) == len(mesh.points)
    monkeypatch.setattr(files, "MAX_EXPANDED_BYTES", 500)
    with pytest.raises(MeshError, match=r"box\.vtu: .*compressed data expand to more than 500 bytes"):
        read_mesh(path, ELEMENTS.values())


def test_files_of_gzip_that_expand_too_far(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "mesh.vol.gz"
    path.write_bytes(gzip.compress(bytes(2**20)))
    monkeypatch.setattr(reader, "MAX_EXPANDED_BYTES", 2**19)
    with pytest.raises(MeshError, match=r"mesh\.vol\.gz: it expands to more than 524288 bytes"):
        read_mesh(path, ELEMENTS.values())
