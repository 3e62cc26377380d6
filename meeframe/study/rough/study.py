"""The study of a rough surface from a file or options to files in a folder."""

from collections.abc import Mapping
from pathlib import Path
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
from meeframe.study.rough.files import FILES, write_rough
from meeframe.study.rough.run import RoughResult, solve_rough
from meeframe.system.reduced import Progress, silent

HEIGHT_MAP: Final = "height-map"
"""Indenter of files of heights."""


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
                f"{source}: pressures: is no range, whose {', '.join(chosen)} could be replaced; allowed: a range with "
                "from, to and count, or pressures in place of those of the file"
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
        After Ctrl-C; the finished pressures are written, and a note says so.
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
        try:
            result = solve_rough(study, progress)
        except Interrupted as error:
            finished, count = len(error.result.status), len(study.pressures)
            if finished:
                remove_files(out, FILES)
                write_rough(out, error.result, suffix)
            where = f"and in {out}" if finished else f"; nothing was written to {out}"
            error.add_note(f"{finished} of {count} pressures are finished {where}".replace(" ;", ";"))
            raise
        progress("writing", 0.0)
        remove_files(out, FILES)
        write_rough(out, result, suffix)
        return result
