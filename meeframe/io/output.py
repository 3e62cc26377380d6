"""The output folder: refused or cleared before anything is computed; files appear in it whole or not at all."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from meeframe.core.errors import ResultError

RESULT_FILE: Final = "result.h5"
SUMMARY_FILE: Final = "summary.json"
FIELDS_FILE: Final = "fields.vtu"
FIGURE_FILES: Final = (
    "pressure.png",
    "electric_potential.png",
    "magnetic_potential.png",
    "sections.png",
)
OUTPUT_FILES: Final = (RESULT_FILE, SUMMARY_FILE, FIELDS_FILE, *FIGURE_FILES)


def check_output(folder: Path, overwrite: bool) -> None:
    """Make the output folder and see that files can be written there; nothing existing is touched.

    Raises ResultError if it cannot be written, or if it holds anything and overwrite is false.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        occupied = sorted(entry.name for entry in folder.iterdir())
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise ResultError(f"output folder {folder} cannot be written: {error.strerror or error}") from None
    if occupied and not overwrite:
        listed = ", ".join(occupied[:4]) + (", ..." if len(occupied) > 4 else "")
        raise ResultError(f"output folder {folder} is not empty ({listed}); name another one or pass --overwrite")


def clear_output(folder: Path) -> None:
    """Remove the files that an earlier run left, and only those."""
    for name in map(Path, OUTPUT_FILES):
        (folder / name).unlink(missing_ok=True)
        for leftover in folder.glob(f".{name.stem}.*{name.suffix}"):  # of a run that was killed while it wrote
            leftover.unlink()


@contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """Path of a temporary file that takes the target's place at the end, unless an exception passes.

    Whatever happens, the target holds either its old content or its new one. Raises ResultError if writing fails.
    """
    temporary = target.with_name(f".{target.stem}.{os.getpid()}{target.suffix}")
    try:
        yield temporary
        os.replace(temporary, target)
    except OSError as error:
        raise ResultError(f"{target} cannot be written: {error.strerror or error}") from None
    finally:
        temporary.unlink(missing_ok=True)
