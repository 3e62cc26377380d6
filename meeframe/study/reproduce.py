"""Figures of the paper by name: the studies of a folder, solved and drawn."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from meeframe.common.errors import CaseError
from meeframe.plugin.validation import choices
from meeframe.results.figures import check_format
from meeframe.results.output import open_output, replacing
from meeframe.results.sweep_files import POINTS
from meeframe.study.reports.study import Study, study_figure, study_json
from meeframe.study.solve import solve_study
from meeframe.study.sweep.pool import Pool
from meeframe.system.reduced import Progress, silent

ALL: Final = "all"
CACHE: Final = "cache"
DPI: Final = 100


def known_studies(folder: Path) -> dict[str, Path]:
    """Return the study files of a folder.

    Parameters
    ----------
    folder : Path
        The folder, whose subfolders hold the files.

    Returns
    -------
    dict of str to Path
        Files by name; fig-05 is FOLDER/*/fig-05.toml.

    Raises
    ------
    CaseError
        If there are none.
    """
    if not folder.is_dir():
        raise CaseError(f"folder of studies {folder} does not exist; name another folder with --validation")
    studies = {file.stem: file for file in sorted(folder.glob("*/fig-*.toml"))}
    if not studies:
        raise CaseError(f"folder of studies {folder} contains no */fig-*.toml; name another folder with --validation")
    return dict(sorted(studies.items()))


def choose(names: Sequence[str], known: dict[str, Path]) -> list[Path]:
    """Return the files of the named studies, each once.

    Parameters
    ----------
    names : sequence of str
        Names; 'all' selects all.
    known : dict of str to Path
        Files by name, as of `known_studies`.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    CaseError
        For an unknown name.
    """
    for name in names:
        if name not in known and name != ALL:
            raise CaseError(f"unknown figure {name!r}; {choices(name, (*known, ALL))}")
    return [file for name, file in known.items() if name in names or ALL in names]


def reproduce(
    names: Sequence[str],
    folder: Path,
    out: Path,
    progress: Progress = silent,
    pool: Pool | None = None,
    suffix: str = "png",
) -> Iterator[Study]:
    """Solve and draw studies of a folder one after the other; write a figure and NAME.json each.

    Finished runs are stored in `out`/points and reduced systems in `out`/cache, from which later calls reuse them. Each
    file is written atomically.

    Parameters
    ----------
    names : sequence of str
        Names of figures, or `all`.
    folder : Path
        Folder of the studies.
    out : Path
        Output folder; created if it does not exist and locked until the last study is drawn.
    progress : callable, optional
        Called with the stage and the fraction of it that is done.
    pool : Pool, optional
        Pool that solves the runs; by default this process.
    suffix : str, optional
        Format of the figure, of meeframe.results.figures.FORMATS.

    Yields
    ------
    Study
        Each study when it has been solved and drawn.

    Raises
    ------
    CaseError
        For unknown names and for invalid studies or cases.
    ResultError
        For an unknown format, if `out` cannot be written, or if another process writes there.
    """
    check_format(suffix)
    files = choose(names, known_studies(folder))
    with open_output(out, overwrite=True):
        for file in files:
            study = solve_study(file, out / CACHE, progress, pool=pool, store=out / POINTS)
            with replacing(out / f"{study.name}.json") as path:
                path.write_text(study_json(study), encoding="utf-8")
            with replacing(out / f"{study.name}.{suffix}") as path:
                study_figure(study).savefig(path, dpi=DPI)
            yield study
