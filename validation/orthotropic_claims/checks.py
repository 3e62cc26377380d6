"""Figures 3 to 14 of the reference paper: what it says of them, judged by the numbers of the reproduced ones."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from claims import claims
from figures import read_figure
from judging import Claim as Judged
from judging import Verdict
from studies import study_plots

from meeframe.study.reports.study import study_json
from meeframe.study.reproduce import known_studies
from meeframe.study.solve import solve_study
from meeframe.study.validate import Claim, Item

TITLE = "Figures 3 to 14 of the reference paper"
SOURCE = (
    "Reference paper, sections 7.1 to 7.4: finite blocks by boundary elements, on its own meshes (quick: figures 5, 7 "
    "and 9 on a coarser one). Pictures and reasons: docs/validation/orthotropic.md."
)
STUDIES = Path(__file__).parents[1]
QUICK = ("fig-05", "fig-07", "fig-09")
COARSER = (("divisions = 16", "divisions = 12"), ("rings = 7", "rings = 4"))


def run(quick: bool) -> Iterator[Item]:
    """All figures on the paper's meshes; quick: a few on a coarser mesh."""
    files = {name: file for name, file in known_studies(STUDIES).items() if not quick or name in QUICK}
    with TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for name, file in files.items():
            study = solve_study(_coarser(file, folder) if quick else file, folder / "cache")
            numbers = folder / f"{name}.json"
            numbers.write_text(study_json(study), encoding="utf-8")
            for judged in claims(read_figure(numbers)):
                yield _claim(judged)
            yield from study_plots(study)


def _coarser(file: Path, folder: Path) -> Path:
    """A copy of a study and of the case files beside it on a coarser mesh."""
    place = folder / file.parent.name
    if not place.exists():
        shutil.copytree(file.parent, place, ignore=shutil.ignore_patterns("*.py", "__pycache__"))
        for copy in place.glob("*.toml"):
            text = copy.read_text(encoding="utf-8")
            for fine, coarse in COARSER:
                text = text.replace(fine, coarse)
            copy.write_text(text, encoding="utf-8")
    return place / file.name


def _claim(judged: Judged) -> Claim:
    holds = None if judged.verdict is Verdict.NOT_RESOLVED else judged.verdict is Verdict.HOLDS
    words = f"{judged.figure}: {judged.paper}"
    return Claim(words, judged.found, judged.judged, holds, judged.explained, judged.as_explained)
