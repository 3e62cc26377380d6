"""The output folder: refused before anything is computed, made with the first result; files in it are whole."""

import os
import re
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import get_native_id
from typing import Final

from meeframe.common.errors import ResultError
from meeframe.fields import MEE, OPTIONAL_FIELDS

RESULT_FILE: Final = "result.h5"
SUMMARY_FILE: Final = "summary.json"
FIELDS_FILE: Final = "fields.vtu"
FIGURE_FILES: Final = (
    "pressure.png",
    *(f"{scalar.value_name}.png" for scalar in (*MEE.scalars, *OPTIONAL_FIELDS)),
    "sections.png",
    "stick_slip.png",
    "history.png",
)
OUTPUT_FILES: Final = (RESULT_FILE, SUMMARY_FILE, FIELDS_FILE, *FIGURE_FILES)


def check_output(folder: Path, overwrite: bool) -> None:
    """See that the output folder can be made and files written there; nothing is changed or left behind.

    Raises ResultError if it cannot be written, or if it holds anything and overwrite is false.
    """
    absent: list[Path] = []
    try:
        if folder.is_file():
            raise NotADirectoryError("it is a file")
        absent = [path for path in (folder, *folder.parents) if not path.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        occupied = sorted(entry.name for entry in folder.iterdir())
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise _unwritable(folder, error) from None
    finally:
        for made in absent:  # the first result makes it for good
            with suppress(OSError):
                made.rmdir()
    if occupied and not overwrite:
        listed = ", ".join(occupied[:4]) + (", ..." if len(occupied) > 4 else "")
        otherwise = "name another one or pass --overwrite (from Python overwrite=True)"
        raise ResultError(f"output folder {folder} is not empty ({listed}); {otherwise}")


def check_place(file: Path) -> None:
    """See that a file can be written in its folder, which has to be there; nothing is left. Raises ResultError."""
    try:
        if file.is_dir():
            raise IsADirectoryError("is a folder")
        with tempfile.TemporaryFile(dir=file.parent):
            pass
    except OSError as error:
        raise ResultError(f"{file} cannot be written: {error.strerror or error}") from None


def clear_output(folder: Path) -> None:
    """Make the output folder or remove the files that an earlier run left in it, and only those. Raises ResultError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name in map(Path, OUTPUT_FILES):
            (folder / name).unlink(missing_ok=True)
            for leftover in folder.glob(f".{name.stem}.*{name.suffix}"):  # of a run that was killed while it wrote
                leftover.unlink()
    except OSError as error:
        raise _unwritable(folder, error) from None


def _unwritable(folder: Path, error: OSError) -> ResultError:
    return ResultError(f"output folder {folder} cannot be written: {error.strerror or error}")


@contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """Path of a temporary file that takes the target's place at the end, unless an exception passes.

    Whatever happens, the target holds either its old content or its new one. Raises ResultError if writing fails.
    """
    temporary = target.with_name(f".{target.stem}.{get_native_id()}{target.suffix}")
    try:
        yield temporary
        os.replace(temporary, target)
    except (OSError, RuntimeError) as error:
        told = _of_files(error)
        if told is None:
            raise
        raise ResultError(f"{target} cannot be written: {told}") from None
    finally:
        temporary.unlink(missing_ok=True)


def _of_files(error: OSError | RuntimeError) -> str | None:
    """What an error of a file says, in words; None if it is not one. HDF5 writes the number of what the system said
    into its text, and what it meets on closing h5py raises as a RuntimeError."""
    number = re.search(r"errno = (\d+)", str(error))
    if number:
        return os.strerror(int(number[1]))
    return (error.strerror or str(error)) if isinstance(error, OSError) else None


@contextmanager
def rewriting(target: Path) -> Iterator[Callable[[str], None]]:
    """Writes texts into a file, each in place of the one before; an interruption is told where the last of them is."""
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
            error.add_note(f"what was found so far is in {target}")
        raise
