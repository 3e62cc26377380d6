"""Height maps from binary files of instruments, read by the optional package SurfaceTopography."""

import warnings
import zipfile
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np

from meeframe.plugin import MAX_EXPANDED_BYTES, CaseError, HeightMap, Quantity, bounded_decompression, open_hdf5

_SAMPLE: Final = 2**16
"""Number of bytes at the beginning of a file that show whether it is text."""
_NO_SIZE: Final = 'no physical size in it: needs a key such as spacing = ["1 um", "1 um"]'
_METRE: Final = Quantity("m", gt=0, lt=float("inf"))


def is_binary(path: Path) -> bool:
    """Return whether a file holds anything but text. Raises OSError if it cannot be read."""
    with path.open("rb") as file:
        return b"\0" in file.read(_SAMPLE)


def read_instrument(
    path: Path,
    unit: float | None = None,
    spacing: tuple[float, float] | None = None,
    channel: str | None = None,
) -> HeightMap:
    """Read a height map in any format that SurfaceTopography detects.

    Parameters
    ----------
    path
        The file.
    unit
        Metres per unit of heights, overriding that of the file.
    spacing
        Spacing along x and y [m], overriding that of the file.
    channel
        Name of the channel; by default that with heights.

    Returns
    -------
    HeightMap
        The map, NaN where heights are missing.

    Raises
    ------
    CaseError
        Without SurfaceTopography.
    OSError
        If the file is a damaged one of HDF5.
    ValueError
        If it cannot read the file, if `open_hdf5` refuses it, or if the file does not define unit or size and neither
        do the arguments.
    """
    if h5py.is_hdf5(path):  # whatever its suffix: .datx, .mat, ...
        with open_hdf5(path):
            pass  # the readers below follow references to other files
    if zipfile.is_zipfile(path):
        _check_archive(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            from SurfaceTopography import open_topography

            with bounded_decompression("SurfaceTopography"), open_topography(str(path)) as reader:
                return _height_map(_channel(reader, channel), unit, spacing)
    except ImportError as error:
        raise CaseError(
            f"height map {path}: SurfaceTopography reads files of many instruments, binary files among them ({error}): "
            "pip install 'meeframe-halfspace[instruments]'"
        ) from None
    except ValueError:
        raise
    except Exception as error:  # its readers raise any kind of exception for damaged files
        lines = [line for line in str(error).splitlines() if line.strip()] or [type(error).__name__]
        raise ValueError(f"SurfaceTopography cannot read it: {lines[0][:200]}") from None


def _check_archive(path: Path) -> None:
    """Raise ValueError if the files in a zip archive, such as .x3p, expand too far: it states their sizes."""
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
    except zipfile.BadZipFile as error:
        raise ValueError(f"is damaged: {error}") from None
    if size > MAX_EXPANDED_BYTES:
        raise ValueError(f"the files in it expand to {size} bytes; allowed: {MAX_EXPANDED_BYTES}")


def _channel(reader: Any, name: str | None) -> Any:
    """Return a channel. Raises ValueError if there is none of this name."""
    if name is None:
        return reader.default_channel
    names = [str(channel.name) for channel in reader.channels]
    if name not in names:
        raise ValueError(f"dataset = {name!r}; the channels in the file are {', '.join(names)}")
    return reader.channels[names.index(name)]


def _height_map(channel: Any, unit: float | None, spacing: tuple[float, float] | None) -> HeightMap:
    if len(channel.nb_grid_pts) != 2:
        raise ValueError("a line scan, not a map")
    sizes = channel.physical_sizes
    if sizes is None and spacing is not None:  # its readers want a size, and take none beside that of a file
        given = tuple(step * count for step, count in zip(spacing, channel.nb_grid_pts, strict=True))
        topography = channel.topography(physical_sizes=given)
    elif sizes is None:
        raise ValueError(_NO_SIZE)
    else:
        topography = channel.topography()
    heights = np.ma.filled(np.ma.asarray(topography.heights(), float), np.nan)
    metres = _metres(topography.unit)
    if unit is None and metres is None:
        raise ValueError('no unit of heights in it: needs a key such as unit = "1 nm"')
    if spacing is None:
        if metres is None:
            raise ValueError(_NO_SIZE)
        spacing = tuple(metres * float(size) / count for size, count in zip(sizes, heights.shape, strict=True))
    x, y = (step * np.arange(count) for step, count in zip(spacing, heights.shape, strict=True))
    height_unit = metres if unit is None else unit
    return HeightMap(x, y, np.ascontiguousarray(heights) * height_unit, bool(topography.is_periodic))


def _metres(unit: str | None) -> float | None:
    """Return the metres of a unit of length, None if it is not one."""
    try:
        return None if unit is None else _METRE.check(f"1 {unit}")
    except ValueError:
        return None
