"""Check of the other files that a mesh file refers to: readers follow them wherever they lead."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final
from xml.etree import ElementTree

from meeframe.common.errors import MeshError

_XDMF: Final = (".xdmf", ".xmf")
_ABAQUS: Final = (".inp",)
_INCLUDE: Final = re.compile(rb"^\s*\*\s*include\b[^=\n]*=\s*([^\n]*)", re.IGNORECASE | re.MULTILINE)


def check_references(file: Path) -> None:
    """Check that a mesh file takes data only from itself and from files beside it.

    XDMF files name HDF5 files, which may link to further ones, and Abaqus files include others. A file from somebody
    else could thus make any readable file part of a mesh or of a message.

    Parameters
    ----------
    file : Path
        The mesh file.

    Raises
    ------
    MeshError
        If it refers to a file in another folder, or to a raw file, or is one of HDF5 that refers to others.
    """
    pending, seen = [file], {file}
    while pending:
        current = pending.pop()
        _check_hdf5(current)
        for name in _names(current):
            if not name or Path(name).name != name:
                raise MeshError(f"refers to {name!r}; allowed: names of files in its folder")
            other = current.parent / name
            if other not in seen and other.is_file():
                seen.add(other)
                pending.append(other)


def _names(file: Path) -> Iterator[str]:
    """Yield the names of other files in a file of XDMF or Abaqus. Raises MeshError."""
    suffix = file.suffix.lower()
    if suffix in _XDMF:
        yield from _named_in_xdmf(file)
    elif suffix in _ABAQUS:
        yield from (name.decode(errors="replace").strip() for name in _INCLUDE.findall(file.read_bytes()))


def _named_in_xdmf(file: Path) -> Iterator[str]:
    try:
        items = [(item.get("Format"), item.text or "") for item in ElementTree.parse(file).iter("DataItem")]
    except (ElementTree.ParseError, ValueError, LookupError):
        return  # the reader describes what is wrong
    for kind, text in items:
        if kind == "Binary":
            raise MeshError(f"takes data from the raw file {text.strip()!r}; allowed: data in HDF5 files or in XML")
        if kind == "HDF":
            yield text.strip().partition(":")[0]


def _check_hdf5(file: Path) -> None:
    """Raise MeshError if a file is one of HDF5 that refers to other files."""
    import h5py

    from meeframe.common.hdf5 import open_hdf5

    try:
        if h5py.is_hdf5(file):
            with open_hdf5(file):
                pass
    except (OSError, ValueError, RuntimeError) as error:
        raise MeshError(f"{file.name} cannot be read as HDF5: {error}") from None
