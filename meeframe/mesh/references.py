"""Check of the other files that a mesh file refers to: readers follow them wherever they lead."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final
from xml.etree import ElementTree

from meeframe.common.errors import MeshError
from meeframe.common.files import check_file


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
        If it refers to a file in another folder, to a raw file, a device or a pipe, or is one of HDF5 that refers to
        others.
    """
    named = _NAMED.get(file.suffix.lower(), _no_names)
    pending, seen = [file], {file}
    while pending:
        current = pending.pop()
        try:
            check_file(current)
            _check_hdf5(current)
            for other in named(current):
                if other not in seen and other.exists():
                    seen.add(other)
                    pending.append(other)
        except OSError as error:
            raise MeshError(f"{current.name} cannot be read: {error.strerror}") from None


def _no_names(_: Path) -> Iterator[Path]:
    return iter(())


def _named_in_xdmf(file: Path) -> Iterator[Path]:
    """Yield the HDF5 files that an XDMF file names, in elements of any name: so does the reader. Raises MeshError."""
    try:
        items = [(item.get("Format"), item.text or "") for item in ElementTree.parse(file).iter()]
    except (ElementTree.ParseError, ValueError, LookupError):
        return  # the reader describes what is wrong; HDF5 files are no XML
    folder = file.resolve().parent
    for kind, text in items:
        if kind == "Binary":
            raise MeshError(f"takes data from the raw file {text.strip()!r}; allowed: data in HDF5 files or in XML")
        if kind == "HDF":
            yield folder / _checked(text.strip().partition(":")[0])


def _included_in_abaqus(file: Path) -> Iterator[Path]:
    """Yield the files that an Abaqus file includes. Raises MeshError.

    The lines, their encoding and their keywords are those of the reader, which ignores stars within a keyword.
    """
    with file.open(errors="replace") as lines:
        for line in lines:
            if line.startswith("**"):  # a comment
                continue
            if line.partition(",")[0].replace("*", "").strip().upper() == "INCLUDE":
                name = _checked(line.rpartition("=")[2].strip())
                beside, here = file.parent / name, Path(name)
                if here.exists() and not (beside.exists() and here.samefile(beside)):  # the reader prefers it
                    raise MeshError(
                        f"refers to {name!r}, which is in the current folder too; allowed: files in its folder"
                    )
                yield beside


_NAMED: Final[dict[str, Callable[[Path], Iterator[Path]]]] = {
    ".xdmf": _named_in_xdmf,
    ".xmf": _named_in_xdmf,
    ".inp": _included_in_abaqus,
}
"""Functions that yield the files that a mesh file names, by its suffix; included files are of the same format."""


def _checked(name: str) -> str:
    if not name or Path(name).name != name:
        raise MeshError(f"refers to {name!r}; allowed: names of files in its folder")
    return name


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
