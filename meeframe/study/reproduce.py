"""Figures by name: the studies of a folder, solved and drawn."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from meeframe.common.errors import CaseError
from meeframe.plugin.validation import choices
from meeframe.results.output import check_output, replacing
from meeframe.results.sweep_files import POINTS
from meeframe.study.reports.study import Study, study_figure, study_json
from meeframe.study.solve import solve_study
from meeframe.study.sweep.engine import Pool
from meeframe.system.reduced import Progress, silent

ALL: Final = "all"
CACHE: Final = "cache"
DPI: Final = 100


def known_studies(folder: Path) -> dict[str, Path]:
    """Return the study files by name, fig-05 being FOLDER/*/fig-05.toml. Raises CaseError if there are none."""
    if not folder.is_dir():
        raise CaseError(f"folder of studies {folder} does not exist; name the one that holds them with --validation")
    found = {file.stem: file for file in sorted(folder.glob("*/fig-*.toml"))}
    if not found:
        raise CaseError(f"folder of studies {folder} holds no */fig-*.toml; name another one with --validation")
    return dict(sorted(found.items()))


def choose(names: Sequence[str], known: dict[str, Path]) -> list[Path]:
    """Return the files of the named studies, each once; `all` stands for all of them. Raises CaseError for an unknown
    name."""
    for name in names:
        if name not in known and name != ALL:
            raise CaseError(f"unknown figure {name!r}; {choices(name, (*known, ALL))}")
    return [file for name, file in known.items() if name in names or ALL in names]


def reproduce(
    names: Sequence[str], folder: Path, out: Path, progress: Progress = silent, pool: Pool | None = None
) -> Iterator[Study]:
    """Solve and draw the named studies of a folder one after the other: NAME.png and NAME.json in `out`.

    pool: where runs are solved, by default in this process. Finished runs are kept in the folder `points` there and
    found again, reduced systems in `cache`. Each file is whole or as it was before. Raises CaseError for names, studies
    and cases with problems, ResultError if `out` cannot be written.
    """
    files = choose(names, known_studies(folder))
    check_output(out, overwrite=True)
    for file in files:
        study = solve_study(file, out / CACHE, progress, pool=pool, store=out / POINTS)
        out.mkdir(parents=True, exist_ok=True)
        with replacing(out / f"{study.name}.json") as path:
            path.write_text(study_json(study), encoding="utf-8")
        with replacing(out / f"{study.name}.png") as path:
            study_figure(study).savefig(path, dpi=DPI, format="png")
        yield study
