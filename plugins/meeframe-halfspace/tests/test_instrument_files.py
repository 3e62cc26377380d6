"""Binary files of instruments are read by SurfaceTopography, with units, sizes and channels; or clearly refused."""

import struct
import sys
import zipfile
import zlib

import numpy as np
import pytest
from meeframe_halfspace import MeasuredHeights, Scales, read_height_map

from meeframe.common import files
from meeframe.plugin import CaseError, bounded_decompression

HEIGHTS = 1e-9 * np.random.default_rng(2).uniform(0.0, 30.0, (5, 4))
"""Heights at x[i] and in line j of a file [m]."""


def item(name, kind, payload):
    return name.encode() + b"\0" + kind.encode() + payload


def container(name, *items):
    body = b"".join(items)
    return name.encode() + b"\0" + struct.pack("<I", len(body)) + body


def gwyddion(path, unit=b"m"):
    """Write a file in the native format of Gwyddion, as its manual describes it: 5 x 4 points on 10 um x 4 um."""
    si_unit = container("GwySIUnit", item("unitstr", "s", unit + b"\0"))
    numbers = (("xres", "i", 5), ("yres", "i", 4), ("xreal", "d", 10e-6), ("yreal", "d", 4e-6))
    field = container(
        "GwyDataField",
        *(item(name, kind, struct.pack(f"<{kind}", value)) for name, kind, value in numbers),
        *(item(name, "o", si_unit) for name in ("si_unit_xy", "si_unit_z")),
        item("data", "D", struct.pack("<I", HEIGHTS.size) + HEIGHTS.T.astype("<f8").tobytes()),
    )
    path.write_bytes(
        b"GWYP" + container("GwyContainer", item("/0/data", "o", field), item("/0/data/title", "s", b"Height\0"))
    )
    return path


def test_file_of_gwyddion(tmp_path):
    pytest.importorskip("SurfaceTopography")
    path = gwyddion(tmp_path / "map.gwy")
    for dataset in (None, "Height"):
        surface = read_height_map(path, Scales(dataset=dataset))
        np.testing.assert_allclose(surface.heights, HEIGHTS, rtol=1e-12)
        np.testing.assert_allclose(surface.x, 2e-6 * np.arange(5))
        np.testing.assert_allclose(surface.y, 1e-6 * np.arange(4))
        assert not surface.is_periodic
    scaled = read_height_map(path, Scales(unit=2.0, spacing=(1e-6, 3e-6)))
    np.testing.assert_allclose(scaled.heights, 2.0 * HEIGHTS, rtol=1e-12)
    assert scaled.spacing == pytest.approx((1e-6, 3e-6))
    peak = np.unravel_index(HEIGHTS.argmax(), HEIGHTS.shape)
    x, y = 2e-6 * (peak[0] - 2.0), 1e-6 * (peak[1] - 1.5)
    assert MeasuredHeights(path).height(np.array([x]), np.array([y])) == pytest.approx(0.0, abs=1e-20)


def test_file_without_size_and_unit(tmp_path):
    """A tile of the Shuttle Radar Topography Mission holds nothing but heights, line by line."""
    pytest.importorskip("SurfaceTopography")
    path, heights = tmp_path / "map.hgt", 256 + np.arange(256).reshape(16, 16)
    path.write_bytes(heights.astype(">i2").tobytes())
    surface = read_height_map(path, Scales(unit=1e-9, spacing=(1e-6, 3e-6)))
    np.testing.assert_allclose(surface.heights, 1e-9 * heights.T)
    assert surface.spacing == pytest.approx((1e-6, 3e-6))
    for scales, key in ((Scales(unit=1e-9), "spacing"), (Scales(spacing=(1e-6, 1e-6)), "unit")):
        with pytest.raises(CaseError, match=rf"map\.hgt: .*needs a key such as {key} = "):
            read_height_map(path, scales)


def test_unknown_channels_and_damaged_files(tmp_path):
    pytest.importorskip("SurfaceTopography")
    path = gwyddion(tmp_path / "map.gwy")
    with pytest.raises(CaseError, match=r"map\.gwy: dataset = 'Phase'; the channels in the file are Height"):
        read_height_map(path, Scales(dataset="Phase"))
    (tmp_path / "cut.gwy").write_bytes(path.read_bytes()[:200])
    with pytest.raises(CaseError, match=r"cut\.gwy: .*allowed: a file of an instrument"):
        read_height_map(tmp_path / "cut.gwy")
    (tmp_path / "other.bin").write_bytes(bytes(range(256)))
    with pytest.raises(CaseError, match=r"other\.bin: SurfaceTopography cannot read it"):
        read_height_map(tmp_path / "other.bin")


def test_message_without_the_package(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "SurfaceTopography", None)
    with pytest.raises(
        CaseError, match=r"map\.gwy: SurfaceTopography reads .*pip install 'meeframe-halfspace\[instruments\]'"
    ):
        read_height_map(gwyddion(tmp_path / "map.gwy"))


def test_archives_that_expand_too_far(tmp_path):
    """A file of .x3p is a zip archive, here of 64 kB in place of 1 GiB."""
    path = tmp_path / "map.x3p"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("main.xml", bytes(2**16))
        archive.infolist()[0].file_size = 2**30  # as its directory then states
    with pytest.raises(CaseError, match=r"map\.x3p: .*the files in it expand to 1073741824 bytes; allowed: 536870912"):
        read_height_map(path)


def test_compressed_parts_that_expand_too_far(monkeypatch):
    """Readers of .mnt files, among others, expand all that a file holds."""
    reader = pytest.importorskip("SurfaceTopography.IO.MNT")
    original, data = reader.zlib, zlib.compress(bytes(2**16))
    monkeypatch.setattr(files, "MAX_EXPANDED_BYTES", 2**17)
    with bounded_decompression("SurfaceTopography"):
        for _ in range(2):
            assert reader.zlib.decompress(data) == bytes(2**16)
        with pytest.raises(reader.zlib.error, match="expand to more than 131072 bytes"):
            reader.zlib.decompress(data)
        with pytest.raises(reader.zlib.error):
            reader.zlib.decompress(b"")
    assert reader.zlib is original
