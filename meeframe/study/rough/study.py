"""The study of a rough surface from a file or options to files in a folder."""

from collections.abc import Callable, Mapping
from pathlib import Path
from time import monotonic
from typing import Any, Final

from meeframe.common.errors import CaseError
from meeframe.common.toml import read_toml
from meeframe.plugin import registry as plugins
from meeframe.plugin.registry import Registry
from meeframe.results.figures import check_format
from meeframe.results.output import open_output, remove_files
from meeframe.results.result import Interrupted
from meeframe.results.sweep_files import check_installed
from meeframe.study.rough.declare import RoughStudy, declare
from meeframe.study.rough.files import FILES, write_rough, write_tables
from meeframe.study.rough.run import RoughResult, solve_rough
from meeframe.system.reduced import Progress, silent

HEIGHT_MAP: Final = "height-map"
"""Indenter of files of heights."""
INTERVAL: Final = 2.0
"""Time after which finished pressures are written again [s]; for small surfaces this takes a third of a second."""


def load_study(source: Path, options: Mapping[str, Any], registry: Registry | None = None) -> RoughStudy:
    """Return the checked study of a study file or of a height map.

    Parameters
    ----------
    source : Path
        A study file (.toml), or a file of heights that the indenter height-map reads.
    options : mapping
        Keys that replace those of the study file; those of `surface`, and of a range of pressures, are merged into it.
    registry : Registry, optional
        Registry in which names are looked up; by default everything that is installed.

    Returns
    -------
    RoughStudy
        The study.

    Raises
    ------
    CaseError
        With a line for each problem.
    """
    registry = registry or plugins.load()
    is_study = source.suffix.lower() == ".toml"
    tables: dict[str, Any] = (
        read_toml(source)[1] if is_study else {"surface": {"name": HEIGHT_MAP, "file": source.name}}
    )
    if not is_study and not source.exists():
        raise CaseError(f"{source}: does not exist; allowed: a study file (.toml) or a file of heights")
    if is_study and "mesh" in tables:
        raise CaseError(f"{source}: is a case file; allowed: a study of a rough surface, see docs/howto/rough.md")
    added = dict(options)
    chosen = added.get("pressures")
    if "pressures" in tables and isinstance(chosen, Mapping):
        if not isinstance(tables["pressures"], Mapping):
            raise CaseError(
                f"{source}: pressures: is not a range, of which {', '.join(chosen)} could be replaced; allowed: a "
                "range with from, to and count, or pressures in place of those of the file"
            )
        added["pressures"] = {**tables["pressures"], **chosen}
    extra = added.pop("surface", {})
    if extra:
        surface = tables.get("surface")
        tables["surface"] = {**(surface if isinstance(surface, Mapping) else {"name": surface}), **extra}
    return declare({**tables, **added}, registry, source.parent, f"{source}: ")


def rough(
    study: RoughStudy,
    out: Path | None = None,
    overwrite: bool = False,
    progress: Progress = silent,
    suffix: str = "png",
) -> RoughResult:
    """Solve a study and write its files into a folder.

    Parameters
    ----------
    study : RoughStudy
        The study.
    out : Path, optional
        Folder for the files; without it nothing is written.
    overwrite : bool, optional
        Whether files of an earlier study in it are replaced.
    progress : callable, optional
        Function that is called with the name of a stage and the fraction of it that is done.
    suffix : {'png', 'pdf', 'svg'}, optional
        Format of the pictures.

    Returns
    -------
    RoughResult
        Quantities of all pressures.

    Raises
    ------
    Interrupted
        After Ctrl-C; the finished pressures are written, and a note says so. A process that is killed, or that an error
        ends, leaves their dataset and table, but for pressures of the last `INTERVAL` seconds.
    ResultError
        Before anything is computed, for an unknown format, or if the folder cannot be written or holds anything and
        overwrite is false.
    CaseError
        Without xarray, which writes the dataset.
    """
    if out is None:
        return solve_rough(study, progress)
    check_installed()
    check_format(suffix)
    with open_output(out, overwrite):
        writer = _Writer(out)
        try:
            result = solve_rough(study, progress, writer.update)
        except BaseException as error:
            if isinstance(error, Interrupted) and error.result.status:
                writer.write(write_rough, error.result, suffix)
            if writer.written or isinstance(error, Interrupted):
                where = f" and in {out}" if writer.written else f"; nothing was written to {out}"
                error.add_note(f"{writer.written} of {len(study.pressures)} pressures are finished{where}")
            raise
        progress("writing", 0.0)
        writer.write(write_rough, result, suffix)
        return result


class _Writer:
    """Writer of finished pressures into a folder, from which it removes the files of an earlier study first."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._time = folder, monotonic()
        self.written = 0

    def update(self, result: RoughResult) -> None:
        """Write the dataset and the table of a result so far, unless they were written a short time ago."""
        if monotonic() >= self._time + INTERVAL:
            self.write(write_tables, result)

    def write(self, function: Callable[..., None], result: RoughResult, *arguments: str) -> None:
        """Write a result by a function of the folder, the result and further arguments."""
        if not self.written:
            remove_files(self._folder, FILES)
        function(self._folder, result, *arguments)
        self.written, self._time = len(result.status), monotonic()
