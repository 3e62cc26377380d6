"""Reproduce figures 3 to 14, compare them with the statements of the paper, and write the page.

    uv run python validation/orthotropic_claims/regenerate.py

Writes docs/validation/orthotropic.md with its figures, and the claims as JSON. `--work` names the folder of the
reproduced figures and of the cache of reduced systems, `--out` the folder of the page.
"""

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from claims import claims
from criteria import Claim, Verdict
from figures import Figure, read_figure
from PIL import Image

from meeframe.study.reproduce import ALL, reproduce

HERE = Path(__file__).parent
STUDIES = HERE.parent
PAGE = "orthotropic"
COLOURS = 128
ROOT = HERE.parents[1]
COUNTED = {Verdict.HOLDS: "hold", Verdict.DIFFERS: "do not", Verdict.NOT_RESOLVED: "are not resolved"}
LISTED = {Verdict.DIFFERS: "These do not hold:", Verdict.NOT_RESOLVED: "This mesh does not resolve:"}


def main() -> None:
    """Run the studies and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--work", type=Path, default=ROOT / "reproduced", help="folder of the figures and the cache")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "validation", help="folder of the page")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    figures = []
    for study in reproduce([ALL], STUDIES, arguments.work):
        print(study.name, flush=True)
        figures.append(read_figure(arguments.work / f"{study.name}.json"))
        with Image.open(arguments.work / f"{study.name}.png") as picture:  # fewer colours, a fraction of the size
            picture.convert("RGB").quantize(COLOURS).save(arguments.out / f"{PAGE}_{study.name}.png", optimize=True)
    result = {figure.name: claims(figure) for figure in figures}
    (arguments.out / f"{PAGE}.md").write_text(page(figures, result), encoding="utf-8")
    numbers = [asdict(claim) for group in result.values() for claim in group]
    text = json.dumps(numbers, indent=1, ensure_ascii=False) + "\n"
    (arguments.out / f"{PAGE}.json").write_text(text, encoding="utf-8")


def page(figures: list[Figure], result: dict[str, list[Claim]]) -> str:
    """Return the page: the written text and the computed sections."""
    every = [claim for group in result.values() for claim in group]
    counts = ", ".join(f"{sum(c.verdict is v for c in every)} {words}" for v, words in COUNTED.items())
    summary = ["## Summary", "", f"Of {len(every)} claims, {counts}.", ""]
    for verdict, heading in LISTED.items():
        named = (claim for claim in every if claim.verdict is verdict)
        lines = [f"- {_name(claim.figure)}: {claim.paper}. Here: {claim.observed}." for claim in named]
        summary += [heading, "", *lines, ""] if lines else []
    head = (HERE / "head.md").read_text(encoding="utf-8")
    tail = (HERE / "differences.md").read_text(encoding="utf-8")
    sections = [line for figure in figures for line in _section(figure, result[figure.name])]
    return "\n".join([head, *summary, tail, *sections]).rstrip() + "\n"


def _name(name: str) -> str:
    number, _, variant = name.removeprefix("fig-").partition("-")
    return f"Fig. {int(number)}" + (f", {variant}" if variant else "")


def _section(figure: Figure, result: list[Claim]) -> list[str]:
    """Return the section of a figure: the figure, the statements of the paper, and the computed values."""
    lines = [
        f"## {_name(figure.name)}",
        "",
        f"{figure.title}. `meeframe reproduce {figure.name}`",
        "",
        f"![{figure.title}]({PAGE}_{figure.name}.png)",
        "",
        f"The paper: {figure.paper}",
        "",
        "| the paper says | computed | criterion | |",
        "| --- | --- | --- | --- |",
    ]
    for claim in result:
        verdict = claim.verdict if claim.verdict is Verdict.HOLDS else f"**{claim.verdict}**"
        lines.append(f"| {claim.paper} | {claim.observed} | {claim.criterion} | {verdict} |")
    messages = [f"- {message}." for message in figure.messages]
    return [*lines, "", *(["Messages of the runs:", "", *messages, ""] if messages else [])]


if __name__ == "__main__":
    main()
