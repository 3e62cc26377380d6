"""Compare the statements of the reference paper about its figures 3 to 14 with the reproduced figures."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from claims import claims
from criteria import Claim as PaperClaim
from criteria import Verdict
from figures import read_figure
from studies import study_plots

from meeframe.study.reports.study import study_json
from meeframe.study.reproduce import known_studies
from meeframe.study.solve import solve_study
from meeframe.study.validate import Claim, Item

TITLE = "Figures 3 to 14 of the reference paper"
SOURCE = (
    "Reference paper, sections 7.1 to 7.4: finite blocks by boundary elements, on its meshes (quick: figures 5, 7 "
    "and 9 on a coarser one). Figures and reasons: docs/validation/orthotropic.md."
)
STUDIES = Path(__file__).parents[1]
QUICK = ("fig-05", "fig-07", "fig-09")
COARSER = (("divisions = 16", "divisions = 12"), ("rings = 7", "rings = 4"))


def run(quick: bool) -> Iterator[Item]:
    """Check all figures on the paper's meshes, or a few on a coarser mesh if `quick`."""
    files = {name: file for name, file in known_studies(STUDIES).items() if not quick or name in QUICK}
    with TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for name, file in files.items():
            study = solve_study(_coarser(file, folder) if quick else file, folder / "cache")
            numbers = folder / f"{name}.json"
            numbers.write_text(study_json(study), encoding="utf-8")
            for claim in claims(read_figure(numbers)):
                yield _claim(claim)
            yield from study_plots(study)


def _coarser(file: Path, folder: Path) -> Path:
    """Copy a study and its case files with a coarser mesh."""
    place = folder / file.parent.name
    if not place.exists():
        shutil.copytree(file.parent, place, ignore=shutil.ignore_patterns("*.py", "__pycache__"))
        for copy in place.glob("*.toml"):
            text = copy.read_text(encoding="utf-8")
            for fine, coarse in COARSER:
                text = text.replace(fine, coarse)
            copy.write_text(text, encoding="utf-8")
    return place / file.name


def _claim(claim: PaperClaim) -> Claim:
    holds = None if claim.verdict is Verdict.NOT_RESOLVED else claim.verdict is Verdict.HOLDS
    words = f"{claim.figure}: {claim.paper}"
    return Claim(words, claim.observed, claim.criterion, holds, claim.explained, claim.as_explained)
