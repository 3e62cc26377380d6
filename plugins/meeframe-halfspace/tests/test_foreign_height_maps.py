"""Height maps in HDF5, of instruments too, that refer to other files, or declare more than they hold."""

import h5py
import numpy as np
import pytest
from meeframe_halfspace.height_files import Scales, read_height_map

from meeframe.plugin import CaseError

SCALES = Scales(unit=1e-9, spacing=(1e-6, 1e-6), dataset="heights")


def link(file, private):
    file["heights"] = h5py.ExternalLink(str(private), "data")


def stored(file, private):
    file.create_dataset("heights", (4, 4), float, external=[(str(private), 0, h5py.h5f.UNLIMITED)])


def virtual(file, private):
    layout = h5py.VirtualLayout(shape=(4, 4), dtype=float)
    layout[:] = h5py.VirtualSource(str(private), "data", shape=(4, 4))
    file.create_virtual_dataset("heights", layout)


@pytest.mark.parametrize("put", [link, stored, virtual])
def test_data_of_other_files_are_not_read(tmp_path, put):
    private, path = tmp_path / "private.h5", tmp_path / "map.h5"
    with h5py.File(private, "w") as file:
        file["data"] = np.full((4, 4), 42.0)
    with h5py.File(path, "w") as file:
        put(file, private)
    with pytest.raises(CaseError, match=r"map\.h5: .*allowed: data in the file itself"):
        read_height_map(path, SCALES)


def test_maps_larger_than_their_file_are_not_read(tmp_path):
    path = tmp_path / "map.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("heights", (316_000, 316_000), float, chunks=(1000, 1000))
    with pytest.raises(CaseError, match=r"map\.h5: .*takes 744 GiB"):
        read_height_map(path, SCALES)


def test_maps_that_are_hardly_stored_are_not_read(tmp_path):
    path = tmp_path / "map.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("heights", (11_000, 11_000), float, chunks=(1000, 1000))
    with pytest.raises(CaseError, match=r"map\.h5: .*takes 0\.9015 GiB, of which the file stores 0 bytes; allowed: "):
        read_height_map(path, SCALES)


def test_texts_are_not_read(tmp_path):
    path = tmp_path / "map.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("heights", (4, 4), h5py.string_dtype())
    with pytest.raises(CaseError, match=r"map\.h5: object \(4, 4\) in it; allowed: .* real numbers"):
        read_height_map(path, SCALES)


def describe_datx(file):
    """Add what a file of a Zygo interferometer has beside its heights, which are in 'heights'."""
    texts = np.dtype([("a", "S40"), ("b", "S40"), ("c", "S60")])
    entries = [(b"Root", b"Measurement", b"{m}"), (b"{m}", b"Surface", b"{s}"), (b"{s}", b"Path", b"/heights")]
    file["MetaData"] = np.array(entries, texts)
    converter = np.dtype([("category", "S20"), ("unit", "S20"), ("values", "f8", (4,))])
    attributes = file["heights"].attrs
    attributes["Unit"] = ["m"]
    for name, category, unit, scale in (
        ("X", b"LateralCat", b"Pixels", 2e-6),
        ("Y", b"LateralCat", b"Pixels", 3e-6),
        ("Z", b"HeightCat", b"m", 1.0),
    ):
        attributes[f"{name} Converter"] = np.array([(category, unit, [0.0, scale, 0.0, 0.0])], converter)


def test_datx_is_read(tmp_path):
    pytest.importorskip("SurfaceTopography")
    path, heights = tmp_path / "map.datx", 1e-9 * np.arange(20.0).reshape(4, 5)
    with h5py.File(path, "w") as file:
        file["heights"] = heights
        describe_datx(file)
    surface = read_height_map(path)
    np.testing.assert_allclose(surface.heights, heights.T)
    np.testing.assert_allclose(surface.spacing, (2e-6, 3e-6))


def unwritten(file, _):
    file.create_dataset("heights", (11_000, 11_000), float, chunks=(1000, 1000))


@pytest.mark.parametrize("name", ["map.datx", "map.mat", "map.dat", "map"])
@pytest.mark.parametrize("put", [link, stored, virtual, unwritten])
def test_instrument_files_are_checked_whatever_their_suffix(tmp_path, put, name):
    """Files of MATLAB have a block of 512 bytes before HDF5 begins, as any such file may have."""
    private, path = tmp_path / "private.h5", tmp_path / name
    with h5py.File(private, "w") as file:
        file["data"] = np.full((4, 4), 42.0)
    with h5py.File(path, "w", userblock_size=512 if name == "map.mat" else 0) as file:
        put(file, private)
        if put is not link:
            describe_datx(file)
    message = "of which the file stores 0 bytes" if put is unwritten else "allowed: data in the file itself"
    with pytest.raises(CaseError, match=message):
        read_height_map(path, SCALES)
