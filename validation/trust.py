"""Write docs/validation/trust.md and checks.md from the numbers of a full validation.

    uv run meeframe validate
    uv run python validation/trust.py

`--numbers` names other files; several files, from runs with --only, count as one run. `--out` names another folder.
Interrupted cases are rejected; cases that were not run are listed on the page.
"""

import argparse
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from meeframe.study.reports.validation import CaseReport, Check, Claim, Row, Skip, Validation, Verdict
from meeframe.study.reports.validation_table import reason_of, table_cells
from meeframe.study.validate import known_cases

HERE = Path(__file__).parent
ROOT = HERE.parent
SUMMARY = "<!-- summary -->"
"""Line of trust_head.md that the summary replaces."""

CHECKS_HEAD = """# All checks

Every check of [`meeframe validate`](trust.md), with its computed value, reference, difference and tolerance."""
KINDS = {"check": Check, "claim": Claim, "skip": Skip}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    default = [ROOT / "validated" / "validation.json"]
    parser.add_argument("--numbers", type=Path, nargs="+", default=default, help="files of full runs")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "validation", help="folder of the pages")
    arguments = parser.parse_args()
    try:
        result = joined([read(json.loads(file.read_text(encoding="utf-8"))) for file in arguments.numbers])
    except ValueError as error:
        parser.error(str(error))
    for name, text in pages(result).items():
        (arguments.out / name).write_text(text, encoding="utf-8")


def pages(result: Validation) -> dict[str, str]:
    """Return the text of both pages by file name: the summary with its explanation, and all checks."""
    head = (HERE / "trust_head.md").read_text(encoding="utf-8")
    checks = "\n".join([CHECKS_HEAD, *(line for case in result.cases for line in _section(case))])
    summary = head.replace(SUMMARY, "\n".join(_summary(result)))
    return {"trust.md": summary.rstrip() + "\n", "checks.md": checks.rstrip() + "\n"}


def read(data: dict[str, Any]) -> Validation:
    """Return a validation without its figures."""
    reports = (
        CaseReport(
            case["name"],
            case["title"],
            case["source"],
            tuple(_row(check) for check in case["checks"]),
            seconds=case["seconds"],
            error=case["error"],
            finished=case.get("finished", False),
        )
        for case in data["cases"]
    )
    return Validation(data["quick"], data["versions"], tuple(reports), planned=data["planned_cases"])


def joined(parts: Sequence[Validation]) -> Validation:
    """Join several validations to one that is to have all cases of this folder; the last report of a case counts.

    Raises ValueError for quick validations and unfinished cases.
    """
    if any(part.quick for part in parts):
        raise ValueError("the page requires full validations, not quick ones")
    cases = {case.name: case for part in parts for case in part.cases}
    versions = {name: version for part in parts for name, version in part.versions.items()}
    unfinished = sorted(name for name, case in cases.items() if not case.finished)
    if unfinished:
        raise ValueError(f"{', '.join(unfinished)}: not run to the end; run it again with --only")
    planned = len(known_cases(HERE).keys() | cases.keys())
    return Validation(False, versions, tuple(cases[name] for name in sorted(cases)), planned=planned)


def _row(check: dict[str, Any]) -> Row:
    kind = KINDS[check["kind"]]
    given = {key: value for key, value in check.items() if key in kind.__dataclass_fields__}
    if kind is Check:
        given |= {key: float("nan") for key in ("computed", "reference") if given[key] is None}
    return Row(kind(**given), check["seconds"])


def _summary(result: Validation) -> Iterator[str]:
    """Yield the outcome and one line for each case."""
    yield f"{result.headline[0].upper()}{result.headline[1:]}. Times are on two cores shared with other work.\n"
    missing = sorted(known_cases(HERE).keys() - {case.name for case in result.cases})
    if missing:
        yield f"Not run: {', '.join(missing)}.\n"
    yield "| case | checks | passed | explained differences | time [s] |\n| --- | --- | --- | --- | --- |"
    for case in result.cases:
        counts = [sum(v is verdict for v in case.verdicts) for verdict in (Verdict.PASS, Verdict.DIFFERS)]
        link = f"[{case.title}](checks.md#{_anchor(case.title)})"
        yield f"| {link} | {len(case.verdicts)} | {counts[0]} | {counts[1] or ''} | {case.seconds:.0f} |"


def _anchor(title: str) -> str:
    retained = "".join(letter for letter in title.lower() if letter.isalnum() or letter in " -_")
    return retained.replace(" ", "-")


def _section(case: CaseReport) -> Iterator[str]:
    yield f"\n## {case.title}\n\n{case.source}\n\n`meeframe validate --only {case.name}`\n"
    if case.error:
        yield f"```text\n{case.error.strip()}\n```\n"
    yield "| check | computed | reference | difference | tolerance | |\n| --- | --- | --- | --- | --- | --- |"
    for row in case.rows:
        verdict = row.item.verdict
        reason = f": {reason_of(row.item)}" if reason_of(row.item) else ""
        cells = (word.replace("|", "\\|") for word in table_cells(row)[:-1])
        yield f"| {' | '.join(cells)} | {verdict if verdict is Verdict.PASS else f'**{verdict}**'}{reason} |"


if __name__ == "__main__":
    main()
