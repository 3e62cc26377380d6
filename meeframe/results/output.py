"""Output folder: checked before anything is computed, locked for one run at a time, with complete files only."""

import errno
import fcntl
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import get_native_id
from typing import Final

from meeframe.common.errors import ResultError
from meeframe.results import schema

RESULT_FILE: Final = "result.h5"
SUMMARY_FILE: Final = "summary.json"
FIELDS_FILE: Final = "fields.vtu"
SERIES_FILE: Final = "fields.pvd"
SERIES: Final = "fields.series"
"""Folder of the files of fields.pvd, one for each load step."""
INTERIOR_FILE: Final = "interior.vtu"
"""Fields inside the body, which `meeframe show DIR --interior` writes."""
INTERIOR_PICTURE: Final = "interior"
"""Section of them, which it writes as well: name without suffix."""
FORMATS: Final = ("png", "pdf", "svg")
"""Formats of figure files."""
INCREMENTS: Final = "result.increments"
"""Folder of the increments of an unfinished run, one file each."""
LOCK_FILE: Final = ".lock"
_MAX_REMOVALS: Final = 100
"""Number of times that a folder is created again while other processes remove it."""
_DRAWN: Final = ("sections.png", "stick_slip.png", "history.png")


def output_files() -> tuple[str, ...]:
    """Return the names of all files that a run may write."""
    maps = (f"{name}.png" for name in schema.nodal(schema.View.MAP))
    return (RESULT_FILE, SUMMARY_FILE, FIELDS_FILE, SERIES_FILE, *maps, *_DRAWN)


def in_all_formats(name: str) -> tuple[str, ...]:
    """Return the file names of a figure in all formats."""
    return tuple(f"{name}.{suffix}" for suffix in FORMATS)


@contextmanager
def open_output(folder: Path, overwrite: bool) -> Iterator[None]:
    """Lock an output folder for one run, from before anything is computed until it ends.

    Nothing in the folder is changed. A folder that is created for it is removed again if it is still empty at the end.

    Raises
    ------
    ResultError
        If another process holds the folder, if the folder cannot be written, or if it holds anything and overwrite is
        false.
    """
    with locked(folder):
        check_output(folder, overwrite)
        yield


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Lock a folder for this process alone, by a lock on a file in it; create the folder if there is none.

    The operating system releases the lock when the process ends, however it ends: a file that a killed process left
    behind locks nothing. The lock has no effect on file systems without locks. Raises ResultError if another process
    holds the folder, or if it cannot be written.
    """
    absent: list[Path] = []
    try:
        absent = _absent_folders(folder)
        file = _lock(folder)
    except OSError as error:
        _remove_empty(absent)
        raise _unwritable(folder, error) from None
    try:
        yield
    finally:
        with suppress(OSError):
            (folder / LOCK_FILE).unlink()  # before the lock is released: nobody else holds this file
        os.close(file)
        _remove_empty(absent)


def _absent_folders(folder: Path) -> list[Path]:
    """Return a folder and its parents as far as they do not exist; raise NotADirectoryError if it is a file."""
    if folder.is_file():
        raise NotADirectoryError("it is a file")
    return [path for path in (folder, *folder.parents) if not path.exists()]


def _lock(folder: Path) -> int:
    """Create a folder and return the descriptor of its locked lock file.

    Raises ResultError if another process holds it.
    """
    removed = 0
    while True:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            file = os.open(folder / LOCK_FILE, os.O_RDWR | os.O_CREAT, 0o666)
        except (FileNotFoundError, FileExistsError):
            removed += 1  # its last holder removed the folder in between, or it cannot be created at all
            if removed < _MAX_REMOVALS:
                continue
            raise
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(file)
            raise ResultError(
                f"folder {folder} is in use: another process writes there; wait until it ends or name another folder"
            ) from None
        except OSError:  # a file system without locks
            return file
        try:
            if os.path.samestat(os.fstat(file), os.stat(folder / LOCK_FILE)):
                return file
        except FileNotFoundError:  # its last holder removed it in between
            pass
        os.close(file)


def _remove_empty(folders: list[Path]) -> None:
    for folder in folders:
        with suppress(OSError):
            folder.rmdir()


def check_output(folder: Path, overwrite: bool) -> None:
    """Check that the output folder can be created and files written there, without leaving any change.

    Raises ResultError if it cannot be written, or if it holds anything and overwrite is false.
    """
    absent: list[Path] = []
    try:
        absent = _absent_folders(folder)
        folder.mkdir(parents=True, exist_ok=True)
        occupied = sorted(entry.name for entry in folder.iterdir() if entry.name != LOCK_FILE)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise _unwritable(folder, error) from None
    finally:
        _remove_empty(absent)  # the first result creates it permanently
    if occupied and not overwrite:
        listed = ", ".join(occupied[:4]) + (", ..." if len(occupied) > 4 else "")
        otherwise = "name another one or pass --overwrite (from Python overwrite=True)"
        raise ResultError(f"output folder {folder} is not empty ({listed}); {otherwise}")


def check_writable(file: Path) -> None:
    """Check that a file can be written in its folder, which must exist, without any change. Raises ResultError."""
    try:
        if file.is_dir():
            raise IsADirectoryError("is a folder")
        with tempfile.TemporaryFile(dir=file.parent):
            pass
    except OSError as error:
        raise ResultError(f"{file} cannot be written: {error.strerror or error}") from None


def make_folder(folder: Path, parents: bool = False) -> None:
    """Create a folder, with its parents if wanted, unless it exists. Raises ResultError."""
    try:
        folder.mkdir(parents=parents, exist_ok=True)
    except OSError as error:
        raise ResultError(f"folder {folder} cannot be written: {error.strerror or error}") from None


def clear_output(folder: Path) -> None:
    """Create the output folder or remove the files that an earlier run left in it, and only those.

    Raises ResultError.
    """
    remove_files(folder, (*output_files(), INTERIOR_FILE, *in_all_formats(INTERIOR_PICTURE)))
    try:
        for inner in (INCREMENTS, SERIES):
            if (folder / inner).is_dir():
                shutil.rmtree(folder / inner)
    except OSError as error:
        raise _unwritable(folder, error) from None


def remove_files(folder: Path, names: Iterable[str]) -> None:
    """Create a folder, or remove files of these names from it, with what is left of those that were not completed.

    Raises ResultError.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name in map(Path, names):
            (folder / name).unlink(missing_ok=True)
            for leftover in folder.glob(f".{name.stem}.*{name.suffix}"):  # of a run that was killed while it wrote
                leftover.unlink()
    except OSError as error:
        raise _unwritable(folder, error) from None


def _unwritable(folder: Path, error: OSError) -> ResultError:
    return ResultError(f"output folder {folder} cannot be written: {error.strerror or error}")


@contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """Provide the path of a temporary file that replaces the target at the end, unless an exception passes.

    In any case, also after a power failure, the target holds either its old content or its new one. Raises ResultError
    if writing fails.
    """
    temporary = target.with_name(f".{target.stem}.{get_native_id()}{target.suffix}")
    try:
        yield temporary
        _flush(temporary)
        os.replace(temporary, target)
        _flush(target.parent)
    except (OSError, RuntimeError) as error:
        message = _of_files(error)
        if message is None:
            raise
        raise ResultError(f"{target} cannot be written: {message}") from None
    finally:
        with suppress(OSError):  # the folder itself may be gone
            temporary.unlink(missing_ok=True)


def _flush(path: Path) -> None:
    """Write a file, or the names of the files in a folder, from the memory of the system to the disk."""
    file = os.open(path, os.O_RDONLY)
    try:
        os.fsync(file)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # file systems without it
            raise
    finally:
        os.close(file)


def _of_files(error: OSError | RuntimeError) -> str | None:
    """Return the message of an error of a file, None if it is not one.

    HDF5 writes the system's error number into its text, and h5py raises errors on closing as a RuntimeError.
    """
    number = re.search(r"errno = (\d+)", str(error))
    if number:
        return os.strerror(int(number[1]))
    return (error.strerror or str(error)) if isinstance(error, OSError) else None


@contextmanager
def rewriting(target: Path) -> Iterator[Callable[[str], None]]:
    """Write texts into a file, each in place of the one before; an interruption reports where the last of them is."""
    written = False

    def write(text: str) -> None:
        nonlocal written
        with replacing(target) as path:
            path.write_text(text, encoding="utf-8")
        written = True

    try:
        yield write
    except KeyboardInterrupt as error:
        if written:
            error.add_note(f"results so far are in {target}")
        raise
